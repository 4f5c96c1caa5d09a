// Undo of slow drags; the preview, offered while it shows the light on show.
import { open, relit } from "./visit.mjs";

const PAUSE = 1000; // ms, longer than what joins the steps of a key

export async function visitSteps(browser, url, seen, { photo, other }) {
  const page = await open(browser, url, seen, { width: 1000, height: 900 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", photo));
  seen.preview = [await preview(page)];
  await dragSlider(page, seen);
  seen.preview.push(await preview(page));
  await relit(page, () => page.click("#reset"));
  seen.preview.push(await preview(page));
  await dragDome(page, seen);
  await page.setInputFiles("#file", [photo, other]);
  await page.waitForSelector("#photos:not([hidden])");
  seen.preview.push(await preview(page));
  await page.context().close();
}

/** A drag from one point to others, with a pause at each. */
export async function drag(page, points) {
  const [start, ...rest] = points;
  await page.mouse.move(...start);
  await page.mouse.down();
  for (const point of rest) {
    await page.mouse.move(...point, { steps: 3 });
    await page.waitForTimeout(PAUSE);
  }
  await page.mouse.up();
}

const values = (page) =>
  page.evaluate(() => ["sun_azimuth", "sun_elevation"].map((name) => document.getElementById(name).value));

const preview = async (page) => [
  await page.isEnabled("#get-preview"),
  (await page.isVisible("#preview-note")) ? await page.textContent("#preview-note") : "",
];

/** Two slow drags of one slider, taken back one by one. */
async function dragSlider(page, seen) {
  const slider = page.locator("#sun_azimuth");
  await slider.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await slider.boundingBox();
  const at = (share) => [x + share * width, y + height / 2];
  seen.slider = [await values(page)];
  for (const points of [[at(0.5), at(0.6), at(0.7)], [at(0.7), at(0.8), at(0.9)]]) {
    await drag(page, points);
    seen.slider.push(await values(page));
  }
  for (let i = 0; i < 2; i++) {
    await page.click("#undo");
    seen.slider.push(await values(page));
  }
  await page.click("#redo");
}

async function dragDome(page, seen) {
  const dome = page.locator("#dome svg");
  await dome.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await dome.boundingBox();
  const at = (right, down) => [x + right * width, y + down * height];
  seen.dome = [await values(page)];
  await drag(page, [at(0.45, 0.45), at(0.4, 0.4), at(0.6, 0.4)]);
  seen.dome.push(await values(page));
  await page.click("#undo");
  seen.dome.push(await values(page));
}

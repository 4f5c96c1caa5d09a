// Undo: keys, slow drags of a slider and of the dome, and keys pressed at a file chooser.
import { drag, open, relit } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { photo }) {
  const page = await open(browser, url, seen, { width: 1000, height: 900 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", photo));
  await pressKeys(page, seen);
  await dragSlider(page, seen);
  await relit(page, () => page.click("#reset"));
  await dragDome(page, seen);
  await undoFromTheChooser(page, seen);
  await page.context().close();
}

/** Sixty steps of a slider, how many requests they made, and one undo of them all. */
async function pressKeys(page, seen) {
  page.requests = [];
  await page.focus("#sun_elevation");
  await relit(page, async () => {
    for (let i = 0; i < 60; i++) await page.keyboard.press(i % 2 ? "ArrowRight" : "ArrowUp");
  });
  await page.waitForTimeout(300);
  seen.requests = page.requests.filter((address) => address.includes("/v1/"));
  const elevation = () => page.inputValue("#sun_elevation");
  seen.keys = [await elevation()];
  await page.keyboard.press("Control+z");
  seen.keys.push(await elevation());
  await page.click("#redo");
  seen.keys.push(await elevation());
  await relit(page, () => page.click("#reset"));
}

const sunSliders = (page) =>
  page.evaluate(() => ["sun_azimuth", "sun_elevation"].map((name) => document.getElementById(name).value));

/** Two slow drags of one slider, taken back one by one. */
async function dragSlider(page, seen) {
  const slider = page.locator("#sun_azimuth");
  await slider.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await slider.boundingBox();
  const at = (share) => [x + share * width, y + height / 2];
  seen.slider = [await sunSliders(page)];
  for (const points of [[at(0.5), at(0.6), at(0.7)], [at(0.7), at(0.8), at(0.9)]]) {
    await drag(page, points);
    seen.slider.push(await sunSliders(page));
  }
  for (let i = 0; i < 2; i++) {
    await page.click("#undo");
    seen.slider.push(await sunSliders(page));
  }
  await page.click("#redo");
}

async function dragDome(page, seen) {
  const dome = page.locator("#dome svg");
  await dome.scrollIntoViewIfNeeded();
  const { x, y, width, height } = await dome.boundingBox();
  const at = (right, down) => [x + right * width, y + down * height];
  seen.dome = [await sunSliders(page)];
  await drag(page, [at(0.45, 0.45), at(0.4, 0.4), at(0.6, 0.4)]);
  seen.dome.push(await sunSliders(page));
  await page.click("#undo");
  seen.dome.push(await sunSliders(page));
}

async function undoFromTheChooser(page, seen) {
  const turbidity = () => page.inputValue("#turbidity");
  seen.chooser = [await turbidity()];
  await relit(page, () => page.locator("#turbidity").press("ArrowRight"));
  seen.chooser.push(await turbidity());
  await page.focus("#model-file");
  await page.keyboard.press("Control+z");
  seen.chooser.push(await turbidity());
}

// Undo: keys, slow drags of a slider, of the dome and of the object, and keys pressed at a file chooser.
import { drag, open, relit } from "./visit.mjs";

export async function visit(browser, url, seen, { photo, small }) {
  const page = await open(browser, url, seen, { width: 1000, height: 900 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", photo));
  await pressKeys(page, seen);
  await dragSlider(page, seen);
  await relit(page, () => page.click("#reset"));
  await dragDome(page, seen);
  await undoFromTheChooser(page, seen);
  await page.context().close();
  await dragObject(browser, url, seen, small);
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

async function dragObject(browser, url, seen, small) {
  const page = await open(browser, url, seen, { width: 360, height: 900 });
  await relit(page, () => page.setInputFiles("#file", small));
  await page.click("#unfold");
  await page.waitForSelector("#stage:not([hidden])");
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const { x, y, width, height } = await page.locator("#stage").boundingBox();
  const at = (right) => [x + right * width, y + 0.6 * height];
  const rotation = () => page.inputValue("#object-turn");
  seen.object = [await rotation()];
  await drag(page, [at(0.3), at(0.4), at(0.6)]);
  seen.object.push(await rotation());
  await page.keyboard.press("Control+z");
  seen.object.push(await rotation(), await page.isEnabled("#undo"));
  await page.context().close();
}

// Narrow screens and fingers: an example by keyboard, the camera's tilt, a phone.
import { faults, open, relit } from "./visit.mjs";

export async function visit(browser, url, seen, { small, tilted }) {
  await chooseByKeyboard(browser, url, seen);
  await showTilt(browser, url, seen, tilted);
  await touch(browser, url, seen, small);
}

async function chooseByKeyboard(browser, url, seen) {
  const page = await open(browser, url, seen, { width: 360, height: 720 }, { flat: true });
  const overflow = () => document.documentElement.scrollWidth - document.documentElement.clientWidth;
  seen.overflow = [await page.evaluate(overflow)];
  seen.examples = await page.locator("#examples button").allTextContents();
  await page.locator("#examples button").first().focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#result:not([hidden])");
  await page.click("#correct summary");
  await page.click("#copy-curl");
  seen.title = await page.textContent("#title");
  seen.overflow.push(await page.evaluate(overflow));
  seen.faults = await faults(page);
  await page.context().close();
}

/** The row on how the camera was held, for each photo. */
async function showTilt(browser, url, seen, photos) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  seen.tilt = [];
  for (const photo of photos) {
    await relit(page, () => page.setInputFiles("#file", photo));
    const row = page.locator("#metadata div", { hasText: "Tilt" }).locator("dd");
    const { x, width } = await row.boundingBox();
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    const warnings = await page.locator("#warnings li").allTextContents();
    seen.tilt.push([await row.textContent(), warnings, [x, x + width, overflow]]);
  }
  await page.context().close();
}

async function touch(browser, url, seen, small) {
  const page = await open(browser, url, seen, { width: 390, height: 844 }, { touch: true });
  seen.touch = [await page.innerText(".drop-title")];
  await relit(page, () => page.setInputFiles("#file", small));
  seen.folded = [await page.isVisible("#title"), await page.isVisible("#studio"), await page.isVisible(".rest")];
  await page.tap("#unfold");
  await page.waitForSelector("#stage:not([hidden])");
  seen.touch.push(await page.textContent("#scene-note"), await page.textContent("#readout"));
  await page.context().close();
}

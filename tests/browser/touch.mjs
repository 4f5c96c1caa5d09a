// The page on a phone, which is worked by fingers.
import { open, relit } from "./visit.mjs";

export async function visitTouch(browser, url, seen, { small }) {
  const page = await open(browser, url, seen, { width: 390, height: 844 }, { touch: true });
  seen.touch = [await page.innerText(".drop-title")];
  await relit(page, () => page.setInputFiles("#file", small));
  await page.waitForSelector("#stage:not([hidden])");
  seen.touch.push(await page.textContent("#scene-note"), await page.textContent("#readout"));
  await page.context().close();
}

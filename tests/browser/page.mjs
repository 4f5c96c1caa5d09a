// Drives the page in Chromium: node page.mjs PAGE_URL CHROMIUM FILES_AS_JSON. Prints what it saw as JSON.
import { visitLight } from "./light.mjs";
import { visitObject } from "./object.mjs";
import { visitSaid } from "./said.mjs";
import { faults, open, report } from "./visit.mjs";

await report([visitLight, visitObject, visitSaid, visitNarrow]);

/** An example, chosen by keyboard on a narrow screen. */
async function visitNarrow(browser, url, seen) {
  const page = await open(browser, url, seen, { width: 360, height: 720 }, { flat: true });
  const overflow = () => document.documentElement.scrollWidth - document.documentElement.clientWidth;
  seen.overflow = [await page.evaluate(overflow)];
  seen.examples = await page.locator("#examples button").allTextContents();
  await page.locator("#examples button").first().focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#result:not([hidden])");
  await page.click("summary");
  await page.click("#copy-curl");
  seen.example = await page.textContent("#title");
  seen.overflow.push(await page.evaluate(overflow));
  seen.narrowFaults = await faults(page);
  await page.context().close();
}

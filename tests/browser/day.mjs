// The light of another day: a slider of its hours at a place that the file states, and a sentence where no place is known.
import { open, relit } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { other, street }) {
  const page = await open(browser, url, seen, { width: 1000, height: 900 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", other));
  await page.click(".day summary");
  await page.fill("#day-date", "2024-12-21");
  await page.waitForSelector("#day-hours:not([hidden])");
  seen.note = await page.textContent("#day-note");
  seen.hours = [];
  for (const key of ["Home", "End", "PageDown"]) {
    await page.focus("#day-hour");
    await relit(page, () => page.keyboard.press(key));
    seen.hours.push([await page.textContent("#day-clock"), Number(await page.inputValue("#sun_elevation"))]);
  }
  await relit(page, () => page.click("#undo"));
  await relit(page, () => page.setInputFiles("#file", street));
  await page.fill("#day-date", "2024-12-21");
  await page.waitForFunction(() => !/^$|^Choose/.test(document.getElementById("day-note").textContent));
  seen.withoutPlace = [await page.textContent("#day-note"), await page.isVisible("#day-hours")];
  seen.complaints = seen.complaints.filter((text) => !/422/.test(text));
  await page.context().close();
}

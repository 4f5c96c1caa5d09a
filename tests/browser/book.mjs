// The book: search by keyboard, copying, contents on a phone, axe in both schemes.
import { faults, open } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen) {
  await searchByKeyboard(browser, url, seen);
  await readOnPhone(browser, url, seen);
}

async function searchByKeyboard(browser, url, seen) {
  const page = await open(browser, `${url}book/`, seen, { width: 1440, height: 900 }, { flat: true });
  seen.titles = [await page.textContent("h1")];
  await page.keyboard.press("/");
  await page.keyboard.type("camera height");
  await page.waitForSelector("#found li");
  seen.count = await page.textContent("#count");
  seen.searchFaults = await faults(page);
  await page.keyboard.press("Escape");
  seen.closed = await page.isHidden("#found");
  await page.fill("#search", "lighting envmap --height");
  await page.waitForSelector("#found li");
  await page.keyboard.press("ArrowDown");
  seen.focused = await page.evaluate(() => document.activeElement.textContent);
  await page.keyboard.press("ArrowUp");
  await page.keyboard.press("Enter");
  await page.waitForURL("**/reference/command-line#lighting-envmap");
  await page.click("#lighting-envmap ~ .code button");
  seen.copied = await page.evaluate(() => navigator.clipboard.readText());
  seen.requests = page.requests.filter((address) => !address.startsWith(url));
  await page.context().close();
}

async function readOnPhone(browser, url, seen) {
  const options = { touch: true, colorScheme: "dark" };
  const page = await open(browser, `${url}book/`, seen, { width: 390, height: 844 }, options);
  await page.tap(".contents summary");
  await page.tap('.contents a[href$="command-line"]');
  await page.waitForURL("**/command-line");
  seen.titles.push(await page.textContent("h1"));
  seen.folded = await page.evaluate(() => !document.querySelector(".contents").open);
  seen.overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  seen.phoneFaults = await faults(page);
  await page.context().close();
}

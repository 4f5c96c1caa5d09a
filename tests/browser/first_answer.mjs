// How long a visitor waits for the first answer, on a page that has just been loaded: an example, and a photo of one's own.
import { open } from "./visit.mjs";

export async function visit(browser, url, seen, { rounds, photo }) {
  const ways = {
    "an example": (page) => page.locator("#examples button").first().click(),
    "a photo of 12 megapixels": (page) => page.setInputFiles("#file", photo),
  };
  seen.waits = [];
  seen.firstView = await measureFirstView(browser, url, seen);
  for (let round = 0; round <= rounds; round++) {
    for (const [name, act] of Object.entries(ways)) {
      seen.waits.push({ name, ...(await measureWait(browser, url, seen, act)) });
    }
  }
}

/** Bytes of the page, its styles and its scripts, as they are sent before there is a photo. */
async function measureFirstView(browser, url, seen) {
  const page = await open(browser, url, seen, { width: 390, height: 844 }, { touch: true });
  const bytes = await page.evaluate(() =>
    performance
      .getEntries()
      .filter(({ entryType, name }) => entryType === "navigation" || /\.(js|css)$/.test(name))
      .reduce((sum, { encodedBodySize }) => sum + encodedBodySize, 0),
  );
  await page.context().close();
  return bytes;
}

/** Seconds until the headline is there, of these until the service's answer was; and of the browser's processors. */
async function measureWait(browser, url, seen, act) {
  const page = await open(browser, url, seen, { width: 1440, height: 900 }, { motion: true });
  const processors = await browser.newBrowserCDPSession();
  const spent = async () => {
    const { processInfo } = await processors.send("SystemInfo.getProcessInfo");
    return processInfo.filter(({ type }) => type !== "GPU").reduce((sum, { cpuTime }) => sum + cpuTime, 0);
  };
  await page.evaluate(() => {
    const noteBegin = () => {
      globalThis.begun ??= performance.now();
    };
    for (const kind of ["click", "change"]) document.addEventListener(kind, noteBegin, { capture: true });
    new MutationObserver(() => {
      requestAnimationFrame(() => {
        globalThis.shown ??= performance.now();
      });
    }).observe(document.getElementById("result"), { attributeFilter: ["hidden"] });
  });
  const before = await spent();
  await act(page);
  await page.waitForFunction(() => globalThis.shown);
  const processor = (await spent()) - before;
  const [clock, answer] = await page.evaluate(() => {
    const entries = performance.getEntriesByType("resource");
    const { duration } = entries.find((entry) => entry.name.includes("v1/lighting?"));
    return [globalThis.shown - globalThis.begun, duration];
  });
  await page.context().close();
  return { clock: clock / 1000, answer: answer / 1000, processor };
}

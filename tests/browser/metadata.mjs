// The photo's metadata, stated and corrected by the user; how sure the headline is.
import { answerWith, expectFailures, faults, metadataRows, open, relit } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { dated, photo }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", dated));
  seen.rows = await metadataRows(page);
  seen.evidence = [await page.textContent("#evidence")];
  await correct(page, seen);
  seen.faults = await faults(page);
  await doubt(page, url, seen, photo);
  await page.context().close();
}

async function correct(page, seen) {
  await page.click("#correct summary");
  seen.time = await page.inputValue("#input-time");
  await choosePlace(page, seen);
  await page.fill("#input-latitude", "41.91");
  await page.fill("#input-longitude", "12.48");
  await page.fill("#input-utc_offset", "+02:00");
  page.requests = [];
  await relit(page, () => page.click("#user-input button[type=submit]"));
  seen.requests = page.requests.filter((address) => address.includes("v1/lighting"));
  seen.evidence.push(await page.textContent("#evidence"));
  await page.fill("#input-time", "2024-08-10T02:00:00");
  await page.click("#user-input button[type=submit]");
  await page.waitForSelector("#error:not([hidden])");
  seen.night = await page.textContent("#error");
  seen.nightInSight = await page.evaluate(() => {
    const boxes = ["#error", "#user-input button"].map((name) => document.querySelector(name).getBoundingClientRect());
    return scrollY > 0 && boxes.every(({ top, bottom }) => top >= 0 && bottom < innerHeight + 1); // it scrolls by whole pixels
  });
  expectFailures(seen, /status of 422/);
  await relit(page, () => page.click("#forget"));
  seen.evidence.push(await page.textContent("#evidence"));
}

/** A place by the small map: clicked, then moved by keys. */
async function choosePlace(page, seen) {
  const place = async () => [await page.inputValue("#input-latitude"), await page.inputValue("#input-longitude")];
  const map = page.locator("#world");
  const { width, height } = await map.boundingBox();
  seen.marked = [await page.isVisible("#world-mark")];
  await map.click({ position: { x: 0.534 * width, y: 0.267 * height } });
  seen.marked.push(await page.isVisible("#world-mark"));
  seen.places = [await place()];
  await map.press("ArrowUp");
  await map.press("Shift+ArrowLeft");
  seen.places.push(await place());
  seen.placeSaid = await map.getAttribute("aria-valuetext");
}

/** Records of newer networks, and of an answer that is none. */
async function doubt(page, url, seen, photo) {
  const parts = [
    { sun: { visibility: 0.1 }, warnings: ["The clock and the pixels disagree."] },
    { sun: { visibility: 0.9, radius_50: 30, radius_90: 80, azimuth: 92 }, sky: { cover: 0.4, irradiance: [1, 1.1, 1.4] } },
    { suitable: 0.1, ground: { color: [0.2, 0.1, 0.05] }, sun: { irradiance: [2, 1.8, 1.5] } },
  ];
  await answerWith(page, url, photo, (record) => {
    const { sun = {}, sky = {}, ...rest } = parts[0];
    return { ...record, ...rest, sun: { ...record.sun, ...sun }, sky: { ...record.sky, ...sky } };
  });
  seen.titles = [];
  while (parts.length) {
    await relit(page, () => page.setInputFiles("#file", photo));
    seen.titles.push(await page.textContent("#title"));
    seen.pale ??= await page.evaluate(paleColors);
    seen.warnings ??= await page.locator("#warnings li").allTextContents();
    parts.shift();
  }
}

/** The colours on the dome of a region's line and share, and of grey text. */
function paleColors() {
  const style = (name) => getComputedStyle(document.querySelector(name));
  return [style(".dome .region").stroke, style(".dome .share").fill, style("#readout").color];
}

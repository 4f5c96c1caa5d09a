// What the photo says, given and corrected; several photos; HEIC; soft words for a poor answer.
import { answering, copied, faults, open, relit, saved } from "./visit.mjs";

export async function visitSaid(browser, url, seen, { dated, photo, heic, folder }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  seen.faultsBefore = await faults(page);
  await relit(page, () => page.setInputFiles("#file", dated));
  seen.facts = await page.locator("#metadata dd").allTextContents();
  seen.evidence = [await page.textContent("#evidence")];
  await correct(page, seen);
  seen.faults = await faults(page);
  await several(page, seen, [photo, dated], folder);
  if (heic) await showHeic(page, seen, heic);
  await soften(page, url, seen, photo);
  await page.context().close();
}

async function correct(page, seen) {
  await page.click("summary");
  seen.form = await page.inputValue("#input-time");
  await page.fill("#input-lat", "41.91");
  await page.fill("#input-lon", "12.48");
  await page.fill("#input-utc_offset", "+02:00");
  page.asked = [];
  await relit(page, () => page.click("#user-input button[type=submit]"));
  seen.corrected = page.asked.filter((address) => address.includes("v1/lighting"));
  seen.evidence.push(await page.textContent("#evidence"));
  await page.fill("#input-time", "2024-08-10T02:00:00");
  await page.click("#user-input button[type=submit]");
  await page.waitForSelector("#error:not([hidden])");
  seen.night = await page.textContent("#error");
  seen.nightInSight = await page.evaluate(() => {
    const sights = ["#error", "#user-input button"].map((name) => document.querySelector(name).getBoundingClientRect());
    return scrollY > 0 && sights.every(({ top, bottom }) => top >= 0 && bottom < innerHeight + 1); // it scrolls by whole pixels
  });
  seen.complaints = seen.complaints.filter((words) => !/status of 422/.test(words)); // that refusal, in the console
  await relit(page, () => page.click("#forget"));
  seen.evidence.push(await page.textContent("#evidence"));
}

async function several(page, seen, photos, folder) {
  await relit(page, () => page.setInputFiles("#file", photos));
  seen.together = await page.locator("#photos button").allTextContents();
  seen.togetherEvidence = await page.textContent("#evidence");
  await relit(page, () => page.locator("#photos button").nth(1).click());
  seen.second = [
    await page.getAttribute("#photo", "alt"),
    await page.getAttribute("#photos li:nth-child(2) button", "aria-pressed"),
  ];
  await saved(page, "#get-json", folder, "together.json");
  await saved(page, "#get-exr", folder, "together.exr");
  seen.togetherCopies = [await copied(page, "curl"), await copied(page, "python")];
  seen.copyShown = [await page.isVisible("#snippet")];
  await relit(page, () => page.locator("#photos button").first().click());
  seen.copyShown.push(await page.isVisible("#snippet"));
}

async function showHeic(page, seen, heic) {
  await relit(page, () => page.setInputFiles("#file", heic));
  seen.heic = await page.evaluate(() => {
    const image = document.getElementById("photo");
    return [image.naturalWidth, image.naturalHeight, document.getElementById("status").textContent];
  });
}

/** Records with what newer networks say, and with an answer that is none. */
async function soften(page, url, seen, photo) {
  const parts = [
    { sun: { visibility: 0.1 }, warnings: ["The clock and the pixels disagree."] },
    { sun: { visibility: 0.9, radius_50: 30, radius_90: 80, azimuth: 92 }, sky: { cover: 0.4, irradiance: [1, 1.1, 1.4] } },
    { suitable: 0.1, ground: { color: [0.2, 0.1, 0.05] }, sun: { irradiance: [2, 1.8, 1.5] } },
  ];
  await answering(page, url, photo, (record) => {
    const { sun = {}, sky = {}, ...rest } = parts[0];
    return { ...record, ...rest, sun: { ...record.sun, ...sun }, sky: { ...record.sky, ...sky } };
  });
  seen.titles = [];
  while (parts.length) {
    await relit(page, () => page.setInputFiles("#file", photo));
    seen.titles.push(await page.textContent("#title"));
    seen.pale ??= await page.evaluate(palenessOfRegions);
    seen.warnings ??= await page.locator("#warnings li").allTextContents();
    parts.shift();
  }
}

/** The colours on the dome of a region's line and share, and of what is said in grey. */
function palenessOfRegions() {
  const style = (name) => getComputedStyle(document.querySelector(name));
  return [style(".dome .region").stroke, style(".dome .share").fill, style("#readout").color];
}

// Files and copied texts of the light on show, of the estimate and of a light that was changed.
import { readFileSync } from "node:fs";
import { copied, downloaded, expectFailures, open, relit, saved } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, files) {
  const { photo, other, folder } = files;
  const page = await open(browser, url, seen, { width: 620, height: 700 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", photo));
  seen.title = await page.textContent("#title");
  seen.numbers = await page.locator("#numbers dt").allTextContents();
  seen.note = await page.textContent("#numbers-note");
  await saved(page, "#get-json", folder, "estimate.json");
  await readDome(page, seen);
  seen.preview = [await preview(page)];
  await moveSun(page, seen, folder);
  seen.preview.push(await preview(page));
  await copy(page, seen);
  seen.preview.push(await preview(page));
  seen.targets = await page.locator("#download-for option").evaluateAll((options) => options.map(({ value }) => value));
  for (const tool of seen.targets.slice(0, -3)) await downloaded(page, tool, folder, `${tool}.zip`);
  seen.saved = await page.textContent("#saved");
  await saved(page, "#get-preview", folder, "preview.png");
  await page.setInputFiles("#file", [photo, other]);
  await page.click("#together");
  await page.waitForSelector("#photos:not([hidden])");
  seen.preview.push(await preview(page));
  await page.context().close();
  await loseTheTable(browser, url, seen, photo);
  await offerByService(browser, url, seen, photo);
}

/** The dome by keyboard: arrows read it, Enter moves the sun there. */
async function readDome(page, seen) {
  await page.focus("#dome svg");
  await page.keyboard.press("ArrowUp");
  seen.readout = await page.textContent("#readout");
  await relit(page, () => page.keyboard.press("Enter"));
  seen.changed = await page.isEnabled("#reset");
  await relit(page, () => page.click("#reset"));
}

/** Whether the preview is offered, and the note beside it. */
const preview = async (page) => [
  await page.isEnabled("#get-preview"),
  (await page.isVisible("#preview-note")) ? await page.textContent("#preview-note") : "",
];

async function moveSun(page, seen, folder) {
  seen.sceneNote = await page.textContent("#scene-note");
  await page.focus("#sun_azimuth");
  await relit(page, () => page.keyboard.press("Home"));
  seen.slider = await page.getAttribute("#sun_azimuth", "aria-valuetext");
  seen.exr = await downloaded(page, "exr", folder, "map.exr");
  await page.selectOption("#size", "256");
  for (const format of ["hdr", "png"]) await downloaded(page, format, folder, `map.${format}`);
  await saved(page, "#get-json", folder, "edited.json");
  page.requests = [];
  await saved(page, "#get-preview", folder, "edited-preview.png");
  seen.previewOfChange = page.requests.filter((address) => address.includes("v1/preview"));
  await relit(page, () => page.locator("#warmth").press("ArrowRight"));
  seen.preview.push(await preview(page));
  await page.click("#undo");
}

/** The copied texts, of the changed light and of the estimate. */
async function copy(page, seen) {
  seen.changedCurl = await copied(page, "curl");
  seen.changedPython = await copied(page, "python");
  await relit(page, () => page.click("#reset"));
  seen.curl = await copied(page, "curl");
  seen.python = await copied(page, "python");
}

/** A page without the sky's table, until it fetches it once more. */
async function loseTheTable(browser, url, seen, photo) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  const error = () => page.waitForSelector("#error:not([hidden])").then((box) => box.textContent());
  await page.route("**/*.f{16,32}", (route) => route.abort());
  await page.setInputFiles("#file", photo);
  seen.errorWithoutTable = await error();
  await page.locator("#turbidity").press("ArrowRight");
  await error();
  await page.unroute("**/*.f{16,32}");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#get-json")]);
  seen.irradianceAfterAll = JSON.parse(readFileSync(await download.path(), "utf8")).sun.irradiance;
  seen.errorAfterAll = await page.isVisible("#error");
  expectFailures(seen);
  await page.context().close();
}

/** Choices of what a service states that it makes, known here or not. */
async function offerByService(browser, url, seen, photo) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  const json = { accuracy: {}, matching: false, scene_labels: { usd: "USD", toy: "A toy" }, map_formats: ["exr", "jxl"] };
  await page.route("**/v1/model", (route) => route.fulfill({ json }));
  await page.reload({ waitUntil: "networkidle" });
  await relit(page, () => page.setInputFiles("#file", photo));
  seen.offered = await page.locator("#download-for option").allTextContents();
  await page.context().close();
}

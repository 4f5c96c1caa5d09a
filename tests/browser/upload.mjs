// How photos come in: formats, examples, drops, pastes, refusals, and what comes late or changes on its disk.
import { appendFileSync, copyFileSync } from "node:fs";
import { expectFailures, faults, metadataRows, open, PATIENCE, refused, relit } from "./visit.mjs";

const LONG_NAME = `${"a_photo_with_a_long_name_".repeat(6)}.jpg`;

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, files) {
  await openFormats(browser, url, seen, files);
  await bringOtherThings(browser, url, seen, files);
  await changeUnderway(browser, url, seen, files);
  expectFailures(seen);
}

/** One photo in every format: its metadata, and which way up it is shown. */
async function openFormats(browser, url, seen, { formats, upright, letterbox, small, heic }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true, motion: true });
  seen.firstRequests = page.requests.filter((address) => address.startsWith(url)).map((address) => address.slice(url.length));
  seen.faults = await faults(page);
  seen.metadata = {};
  for (const [name, file] of Object.entries(formats)) {
    await relit(page, () => page.setInputFiles("#file", file));
    seen.metadata[name] = await metadataRows(page);
  }
  seen.upright = {};
  for (const [name, file] of Object.entries(upright)) {
    await relit(page, () => page.setInputFiles("#file", file));
    seen.upright[name] = await page.evaluate(() => {
      const { naturalWidth, naturalHeight } = document.getElementById("photo");
      return [naturalWidth, naturalHeight, document.getElementById("frame").style.getPropertyValue("--aspect")];
    });
  }
  await relit(page, () => page.setInputFiles("#file", letterbox));
  seen.letterbox = await page.evaluate(() => {
    const photo = document.getElementById("photo");
    const [width, height] = [photo.naturalWidth, photo.naturalHeight];
    const context = Object.assign(document.createElement("canvas"), { width, height }).getContext("2d");
    context.drawImage(photo, 0, 0);
    const edges = [0, height - 1].map((row) => {
      const { data } = context.getImageData(0, row, width, 1);
      return data.reduce((sum, value, i) => sum + (i % 4 < 3 ? value : 0), 0) / (3 * width);
    });
    const aspect = document.getElementById("frame").style.getPropertyValue("--aspect");
    return { size: [width, height], aspect, edges };
  });
  if (heic) {
    await relit(page, () => page.setInputFiles("#file", heic));
    seen.heic = await page.evaluate(() => {
      const { naturalWidth, naturalHeight } = document.getElementById("photo");
      return [naturalWidth, naturalHeight, document.getElementById("status").textContent];
    });
  }
  await relit(page, () => page.setInputFiles("#file", small));
  seen.metadataOfNone = [await metadataRows(page), await page.isVisible("#metadata")];
  await page.context().close();
}

async function bringOtherThings(browser, url, seen, { photo, textFile, model }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", photo));
  await refuseText(page, seen, photo, textFile);
  await missExamples(page, seen);
  await estimateAgain(page, seen, textFile);
  await refused(page, () => page.setInputFiles("#file", textFile));
  await page.setInputFiles("#model-file", model);
  await page.waitForSelector('#shapes input[value="own"]:checked');
  seen.errorAfterModel = await page.isVisible("#error");
  await bringNoFile(page, seen);
  await page.context().close();
}

/** A text file: alone, beside a photo; and more photos than the service takes. */
async function refuseText(page, seen, photo, textFile) {
  seen.error = await refused(page, () => page.setInputFiles("#file", textFile));
  const texts = ["#title", "#previous-answer", "#status"].map((id) => page.textContent(id));
  seen.previousAnswer = await Promise.all(texts);
  seen.title = await page.textContent("#title");
  await page.locator("#turbidity").press("ArrowRight");
  seen.errorAfterChange = [await page.isVisible("#error"), await page.isVisible("#previous-answer")];
  await page.route("**/v1/lighting*", async (route) => {
    await new Promise((resolve) => setTimeout(resolve, 300)); // the service's word on the picture comes first
    await route.continue();
  });
  const together = (files) => page.setInputFiles("#file", files).then(() => page.click("#together"));
  seen.errorOfOne = await refused(page, () => together([photo, textFile]));
  await together(Array(9).fill(photo));
  await page.waitForFunction(() => !/notes\.txt/.test(document.getElementById("error").textContent));
  seen.errorOfMany = await page.textContent("#error");
  await page.unrouteAll({ behavior: "ignoreErrors" });
}

/** Examples that the service does not give. */
async function missExamples(page, seen) {
  const answers = [(route) => route.abort(), (route) => route.fulfill({ status: 503, body: "<p>busy</p>" })];
  seen.missingExamples = [];
  for (const answer of answers) {
    await page.evaluate(() => document.getElementById("error").replaceChildren());
    await page.route("**/assets/*.jpg", answer);
    await page.locator("#examples button").first().click();
    await page.waitForFunction(() => document.getElementById("error").textContent, null, { timeout: PATIENCE });
    seen.missingExamples.push(await page.textContent("#error"));
    await page.unroute("**/assets/*.jpg");
  }
}

/** Both buttons that estimate again, each after a file that was refused. */
async function estimateAgain(page, seen, textFile) {
  seen.again = [];
  await page.click("#correct summary");
  await page.fill("#input-vertical_fov", "50");
  for (const button of ["#user-input button[type=submit]", "#forget"]) {
    await refused(page, () => page.setInputFiles("#file", textFile));
    await page.click(button);
    await page.waitForSelector("#error[hidden]", { state: "attached" });
    await page.waitForFunction(() => !document.body.hasAttribute("data-busy"));
    seen.again.push([await page.getAttribute("#photo", "alt"), await page.isVisible("#error")]);
  }
}

/** Text that is dropped on the page, on a field for text, and pasted. */
async function bringNoFile(page, seen) {
  const drop = (target) => page.evaluate(dropText, target);
  seen.noFile = [await refused(page, () => drop("body"))];
  await relit(page, () => page.locator("#turbidity").press("ArrowRight"));
  seen.textInField = [await drop("#input-latitude"), await page.isVisible("#error")];
  seen.noFile.push(await refused(page, () => page.evaluate(pasteText)));
  await interrupt(page, seen);
}

/** An example that is dragged to where photos go, and text that is pasted before it is answered. */
async function interrupt(page, seen) {
  let answer;
  const late = new Promise((resolve) => {
    answer = resolve;
  });
  await page.route("**/v1/lighting?*", (route) => late.then(() => route.continue()));
  await page.locator("#examples img").nth(1).dragTo(page.locator("#drop"));
  await page.waitForSelector("body[data-busy]");
  await refused(page, () => page.evaluate(pasteText));
  seen.meanwhile = [await page.textContent("#status"), await page.getAttribute("body", "data-busy")];
  await relit(page, answer);
  seen.dragged = [await page.getAttribute("#photo", "alt"), await page.isVisible("#error")];
  await page.unroute("**/v1/lighting?*");
}

/** Returns whether the browser is left to put the text there. */
function dropText(target) {
  const dataTransfer = new DataTransfer();
  dataTransfer.setData("text/plain", "48.1");
  const event = new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true });
  return document.querySelector(target).dispatchEvent(event);
}

function pasteText() {
  const clipboardData = new DataTransfer();
  clipboardData.setData("text/plain", "https://example.com/photo.jpg");
  document.body.dispatchEvent(new ClipboardEvent("paste", { clipboardData, bubbles: true }));
}

/** An example that another one overtakes, and a file with a long name that another program writes to. */
async function changeUnderway(browser, url, seen, { photo, folder }) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  await overtakeAnExample(page, seen);
  const file = `${folder}/${LONG_NAME}`;
  copyFileSync(photo, file);
  await relit(page, () => page.setInputFiles("#file", file));
  seen.overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  appendFileSync(file, "changed");
  const download = page.waitForEvent("download", { timeout: PATIENCE }).then(() => "saved");
  await page.click("#get-preview");
  const error = page.waitForSelector("#error:not([hidden])").then((box) => box.textContent());
  seen.changedFile = await Promise.race([download, error.catch(() => "")]);
  await page.context().close();
}

/** An example that comes late, and another one that is chosen meanwhile. */
async function overtakeAnExample(page, seen) {
  let give;
  const late = new Promise((resolve) => {
    give = resolve;
  });
  await page.route("**/assets/brick_street*.jpg", async (route) => {
    if (route.request().resourceType() === "fetch") await late;
    await route.continue().catch(() => {}); // the page gave up on it
  });
  await page.locator("#examples button").first().click();
  seen.underway = await page.textContent("#status");
  await relit(page, () => page.locator("#examples button", { hasText: "Dusk" }).click());
  give();
  await page.waitForTimeout(500);
  seen.overtaken = [await page.textContent("#status"), await page.getAttribute("#photo", "alt")];
}

// What goes missing while the page is open: an example on the way, a file, parts of the page, the canvas's memory.
import { appendFileSync, copyFileSync, readFileSync } from "node:fs";
import { lookOf, open, PATIENCE, relit } from "./visit.mjs";

const SIZE = { width: 360, height: 800 };
const LONG = `${"a_photo_with_a_long_name_".repeat(6)}.jpg`;

export async function visitLost(browser, url, seen, { photo, folder }) {
  const page = await open(browser, url, seen, SIZE, { flat: true });
  await overtakeAnExample(page, seen);
  await loseTheTable(page, seen, photo);
  await changeTheFile(page, seen, photo, folder);
  await undoFromTheChooser(page, seen);
  await page.context().close();
  await loseTheStage(browser, url, seen, photo);
  await loseTheCanvas(browser, url, seen, photo, folder);
  seen.complaints = seen.complaints.filter((words) => !/Failed to load resource/.test(words)); // what was taken away
}

const told = (page) => page.waitForSelector("#error:not([hidden])").then((box) => box.textContent());

/** An example that comes late, and another one that is chosen meanwhile. */
async function overtakeAnExample(page, seen) {
  let give;
  const late = new Promise((resolve) => {
    give = resolve;
  });
  await page.route("**/assets/golden_hour*.jpg", async (route) => {
    if (route.request().resourceType() === "fetch") await late;
    await route.continue().catch(() => {}); // it is not asked for any more
  });
  await page.locator("#examples button").first().click();
  seen.onTheWay = await page.textContent("#status");
  await relit(page, () => page.locator("#examples button", { hasText: "Snow" }).click());
  give();
  await page.waitForTimeout(500);
  seen.overtaken = [await page.textContent("#status"), await page.getAttribute("#photo", "alt")];
}

/** A page that has not got the sky's table, until it is asked for once more. */
async function loseTheTable(page, seen, photo) {
  await page.reload({ waitUntil: "networkidle" });
  await page.route("**/*.f32", (route) => route.abort());
  await page.setInputFiles("#file", photo);
  seen.noTable = await told(page);
  await page.locator("#turbidity").press("ArrowRight");
  await told(page);
  await page.unroute("**/*.f32");
  const [download] = await Promise.all([page.waitForEvent("download"), page.click("#get-json")]);
  seen.powerAfterAll = JSON.parse(readFileSync(await download.path(), "utf8")).sun.irradiance;
  seen.errorAfterAll = await page.isVisible("#error");
}

/** A file with a long name that another program writes to while it is on show. */
async function changeTheFile(page, seen, photo, folder) {
  const file = `${folder}/${LONG}`;
  copyFileSync(photo, file);
  await relit(page, () => page.setInputFiles("#file", file));
  seen.overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
  appendFileSync(file, "changed");
  const download = page.waitForEvent("download", { timeout: PATIENCE }).then(() => "saved");
  await page.click("#get-preview");
  seen.changedFile = await Promise.race([download, told(page).catch(() => "")]);
}

async function undoFromTheChooser(page, seen) {
  const turbidity = () => page.inputValue("#turbidity");
  seen.undone = [await turbidity()];
  await relit(page, () => page.locator("#turbidity").press("ArrowRight"));
  seen.undone.push(await turbidity());
  await page.focus("#model-file");
  await page.keyboard.press("Control+z");
  seen.undone.push(await turbidity());
}

async function loseTheStage(browser, url, seen, photo) {
  const page = await open(browser, url, seen, SIZE);
  await page.route("**/assets/stage*.js", (route) => route.abort());
  await relit(page, () => page.setInputFiles("#file", photo));
  await page.waitForFunction(() => !/^Loading/.test(document.getElementById("scene-note").textContent));
  seen.noStage = await page.textContent("#scene-note");
  await page.context().close();
}

/** The browser takes the canvas's memory and gives it back. */
async function loseTheCanvas(browser, url, seen, photo, folder) {
  const page = await open(browser, url, seen, SIZE);
  await relit(page, () => page.setInputFiles("#file", photo));
  await page.waitForSelector("#stage:not([hidden])");
  await page.waitForTimeout(500);
  await lookOf(page, `${folder}/lit.png`);
  await page.evaluate(() => {
    globalThis.lost = document.getElementById("stage").getContext("webgl2").getExtension("WEBGL_lose_context");
    globalThis.lost.loseContext();
  });
  await page.waitForFunction(() => getComputedStyle(document.getElementById("stage")).visibility === "hidden", null, {
    timeout: 10_000,
  });
  const gone = await lookOf(page, `${folder}/gone.png`);
  await page.evaluate(() => globalThis.lost.restoreContext());
  await page.waitForFunction(() => getComputedStyle(document.getElementById("stage")).visibility === "visible");
  await lookOf(page, `${folder}/back.png`, gone);
  await page.context().close();
}

// A photo and its light: numbers, dome, sliders without requests, undo, downloads, copies.
import { copied, open, relit, saved } from "./visit.mjs";

const TOOLS = ["blender", "usd", "gltf", "threejs", "mitsuba"];

export async function visitLight(browser, url, seen, { photo, textFile, folder }) {
  const page = await open(browser, url, seen, { width: 620, height: 700 }, { flat: true });
  seen.first = page.asked.filter((address) => address.startsWith(url)).map((address) => address.slice(url.length));
  await relit(page, () => page.setInputFiles("#file", photo));
  seen.title = await page.textContent("#title");
  seen.numbers = await page.locator("#numbers dt").allTextContents();
  seen.note = await page.textContent("#numbers-note");
  await saved(page, "#get-json", folder, "estimate.json");
  await readDome(page, seen);
  await pressKeys(page, seen);
  await undo(page, seen);
  await moveSun(page, seen, folder);
  await copy(page, seen);
  for (const tool of TOOLS) await saved(page, `#get-${tool}`, folder, `${tool}.zip`);
  await saved(page, "#get-preview", folder, "preview.png");
  await refuseText(page, seen, photo, textFile);
  await page.context().close();
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

/** Sixty steps of a slider, and how many requests they made. */
async function pressKeys(page, seen) {
  page.asked = [];
  await page.focus("#sun_elevation");
  await relit(page, async () => {
    for (let i = 0; i < 60; i++) await page.keyboard.press(i % 2 ? "ArrowRight" : "ArrowUp");
  });
  await page.waitForTimeout(300);
  seen.pressed = [...page.asked];
}

async function undo(page, seen) {
  seen.slid = await page.inputValue("#sun_elevation");
  await page.keyboard.press("Control+z");
  seen.undone = await page.inputValue("#sun_elevation");
  await page.click("#redo");
  seen.redone = await page.inputValue("#sun_elevation");
  await relit(page, () => page.click("#reset"));
}

async function moveSun(page, seen, folder) {
  seen.flat = await page.textContent("#scene-note");
  await page.focus("#sun_azimuth");
  await relit(page, () => page.keyboard.press("Home"));
  seen.slider = await page.getAttribute("#sun_azimuth", "aria-valuetext");
  seen.exr = await saved(page, "#get-exr", folder, "map.exr");
  await page.selectOption("#size", "256");
  for (const format of ["hdr", "png"]) await saved(page, `#get-${format}`, folder, `map.${format}`);
  await saved(page, "#get-json", folder, "edited.json");
}

/** The copied texts, of the changed light and of the estimate. */
async function copy(page, seen) {
  seen.changedCurl = await copied(page, "curl");
  seen.changedPython = await copied(page, "python");
  await relit(page, () => page.click("#reset"));
  seen.curl = await copied(page, "curl");
  seen.python = await copied(page, "python");
}

async function refuseText(page, seen, photo, textFile) {
  await page.setInputFiles("#file", textFile);
  await page.waitForSelector("#error:not([hidden])");
  seen.error = await page.textContent("#error");
  seen.kept = [await page.textContent("#title"), await page.textContent("#previous-answer"), await page.textContent("#status")];
  await page.locator("#turbidity").press("ArrowRight");
  seen.forgiven = [await page.isVisible("#error"), await page.isVisible("#previous-answer")];
  await page.route("**/v1/lighting?*", async (route) => {
    await new Promise((resolve) => setTimeout(resolve, 300)); // the service's word on the picture comes first
    await route.continue();
  });
  await page.setInputFiles("#file", [photo, textFile]);
  await page.waitForSelector("#error:not([hidden])");
  seen.errorOfOne = await page.textContent("#error");
  await page.setInputFiles("#file", Array(9).fill(photo));
  await page.waitForFunction(() => !/notes\.txt/.test(document.getElementById("error").textContent));
  seen.errorOfMany = await page.textContent("#error");
  await page.unroute("**/v1/lighting?*");
  seen.complaints = seen.complaints.filter((words) => !/status of 4\d\d/.test(words)); // that refusal, in the console
}

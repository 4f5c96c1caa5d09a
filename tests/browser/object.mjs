// The object: moved, rotated, scaled, of other materials, of the user's file; its shadow on ground that is half in shade.
import { readFileSync } from "node:fs";
import { answerWith, drag, open, relit, saved, screenshotOf } from "./visit.mjs";

const CAMERA = { elevation: 0, roll: 0, vertical_fov: 60 };

export async function visit(browser, url, seen, { small, groundMask, model, wideModel, folder }) {
  const page = await open(browser, url, seen, { width: 360, height: 900 });
  await page.route("**/v1/ground?*", (route) => route.fulfill({ path: groundMask })); // as of the light below
  await answerWith(page, url, small, (record) => ({
    ...record,
    suitable: 0.99,
    sun: { ...record.sun, azimuth: -90, elevation: 30, direction: [-0.866, 0.5, 0], visibility: 0.97 },
    camera: CAMERA,
  }));
  await relit(page, () => page.setInputFiles("#file", small));
  await page.waitForSelector("#stage:not([hidden])");
  await press(page.locator("#show-marks"));
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  await wipe(page, seen, folder);
  await movePlacement(page, seen, folder);
  await changeMaterial(page, seen, folder);
  await press(page.locator('#shapes input[value="teapot"]'));
  seen.turntables = [await saved(page, "#get-turntable", folder, "turntable.webp")];
  await page.evaluate(() => {
    const { toBlob } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.toBlob = function (done) {
      toBlob.call(this, done, "image/png"); // as Safari, which writes no WebP
    };
  });
  seen.turntables.push(await saved(page, "#get-turntable", folder, "turntable.gif"));
  await useOwnModel(page, seen, model, folder);
  await moveSun(page, seen, folder);
  await page.context().close();
  await measure(browser, url, seen, small, wideModel);
}

/** The picture with the wipe at either end, and where the object stands in it. */
async function wipe(page, seen, folder) {
  await press(page.locator("#compare"));
  for (const value of ["0", "100"]) {
    await page.locator("#wipe").fill(value);
    await page.waitForTimeout(500);
    await screenshotOf(page, `${folder}/wipe-${value}.png`);
  }
  seen.wipe = await foot(page);
  await press(page.locator("#compare"));
}

/** The height that the page states of a sphere and of the user's own model; between them a slow drag. */
async function measure(browser, url, seen, small, model) {
  const page = await open(browser, url, seen, { width: 360, height: 900 });
  await relit(page, () => page.setInputFiles("#file", small));
  await page.click("#unfold");
  await page.waitForSelector("#stage:not([hidden])");
  seen.heights = [await statedHeight(page)];
  await dragSlowly(page, seen);
  await page.setInputFiles("#model-file", model);
  await page.waitForSelector('#shapes input[value="own"]:checked');
  seen.heights.push(await statedHeight(page));
  await page.context().close();
}

/** A drag with pauses, and its undo. */
async function dragSlowly(page, seen) {
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const { x, y, width, height } = await page.locator("#stage").boundingBox();
  const at = (right) => [x + right * width, y + 0.6 * height];
  seen.slowDrag = [await rotation(page)];
  await drag(page, [at(0.3), at(0.4), at(0.6)]);
  seen.slowDrag.push(await rotation(page));
  await page.keyboard.press("Control+z");
  seen.slowDrag.push(await rotation(page), await page.isEnabled("#undo"));
}

/** Centimetres that the page states, and those of the sphere of that radius. */
async function statedHeight(page) {
  const text = await page.textContent("#object-where");
  const [, value, unit] = /^([\d.]+)\s(cm|m) high/.exec(text);
  return [Number(value) * (unit === "m" ? 100 : 1), 200 * 2 ** Number(await page.inputValue("#object-size"))];
}

/** Where the stage is once it stands still: a focus may scroll it. */
async function boxOf(page) {
  let box = await page.locator("#stage").boundingBox();
  for (;;) {
    await page.waitForTimeout(300);
    const now = await page.locator("#stage").boundingBox();
    if (now.y === box.y && now.height === box.height) return now;
    box = now;
  }
}

/** A click that does not wait for the page to stand still: frames are rare where the CPU draws them. */
const press = (button) => button.dispatchEvent("click");

const foot = (page) => page.evaluate(() => JSON.parse(document.getElementById("stage").dataset.foot));
const rotation = (page) => page.inputValue("#object-turn");

async function movePlacement(page, seen, folder) {
  let { x, y, width, height } = await boxOf(page);
  await page.mouse.click(x + 0.44 * width, y + 0.85 * height);
  seen.clicked = await foot(page);
  seen.scene = await page.textContent("#object-where");
  await screenshotOf(page, `${folder}/shadow.png`);
  await page.mouse.move(x + 0.5 * width, y + 0.6 * height);
  await page.mouse.down();
  await page.mouse.move(x + 0.7 * width, y + 0.6 * height, { steps: 5 });
  await page.mouse.up();
  seen.dragged = [await rotation(page), await foot(page)];
  await page.focus("#stage");
  for (const key of ["ArrowUp", "ArrowRight", ">", "+"]) await page.keyboard.press(key);
  seen.keyed = [await rotation(page), await foot(page), await page.inputValue("#object-size")];
  ({ x, y, width, height } = await boxOf(page));
  await page.mouse.click(x + 0.15 * width, y + 0.4 * height); // beside the note about shade
  seen.sky = [await page.textContent("#scene-note"), await foot(page)];
  await page.mouse.click(x + 0.85 * width, y + 0.85 * height);
  seen.shade = [await page.isVisible("#shade"), (await foot(page))[0]];
  await press(page.locator("#put-in-sun"));
  await page.waitForFunction(() => !document.getElementById("put-in-sun").disabled); // until the service has answered
  seen.shade.push(await page.isVisible("#shade"), (await foot(page))[0]);
  await page.focus("#stage");
  for (let i = 0; i < 11; i++) await page.keyboard.press("Control+z");
  seen.back = [await page.isEnabled("#undo"), await foot(page)];
}

async function changeMaterial(page, seen, folder) {
  seen.materials = [];
  for (const finish of ["matte", "glossy", "mirror"]) {
    await press(page.locator(`#finishes input[value="${finish}"]`));
    seen.materials.push(await screenshotOf(page, `${folder}/${finish}.png`, seen.materials.at(-1)));
  }
  seen.ownOffered = await page.isEnabled('#shapes input[value="own"]');
}

/** A .glb dropped on the page, as from a folder. */
async function useOwnModel(page, seen, model, folder) {
  const before = await screenshotOf(page, `${folder}/before-own.png`);
  const transfer = await page.evaluateHandle((bytes) => {
    const data = new DataTransfer();
    data.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], "chair.glb"));
    return data;
  }, readFileSync(model).toString("base64"));
  await page.dispatchEvent("#frame", "drop", { dataTransfer: transfer });
  await page.waitForSelector('#finishes input[value="original"]:checked');
  seen.own = [await page.textContent("#own-name"), (await screenshotOf(page, `${folder}/own.png`, before)) !== before];
  await page.setInputFiles("#model-file", { name: "broken.glb", mimeType: "", buffer: Buffer.from("nothing") });
  await page.waitForSelector("#error:not([hidden])");
  seen.brokenModel = await page.textContent("#error");
}

async function moveSun(page, seen, folder) {
  seen.before = await screenshotOf(page, `${folder}/before.png`);
  await page.focus("#sun_azimuth");
  await relit(page, () => page.keyboard.press("Home"));
  seen.after = await screenshotOf(page, `${folder}/after.png`, seen.before);
}

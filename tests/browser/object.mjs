// The object: moved, turned, scaled, dressed, replaced by a file; its shadow on ground that is half in shade.
import { readFileSync } from "node:fs";
import { answering, lookOf, open, relit } from "./visit.mjs";

const CAMERA = { elevation: 0, roll: 0, vertical_fov: 60 };

export async function visitObject(browser, url, seen, { halves, model, folder }) {
  const page = await open(browser, url, seen, { width: 360, height: 900 });
  await answering(page, url, halves, (record) => ({
    ...record,
    sun: { ...record.sun, azimuth: -90, elevation: 30, direction: [-0.866, 0.5, 0], visibility: 0.97 },
    camera: CAMERA,
  }));
  await relit(page, () => page.setInputFiles("#file", halves));
  await page.waitForSelector("#stage:not([hidden])");
  await press(page.locator("#show-marks"));
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  seen.scene = await page.textContent("#object-where");
  await place(page, seen, folder);
  await dress(page, seen, folder);
  await own(page, seen, model, folder);
  await moveSun(page, seen, folder);
  await page.context().close();
}

/** A click that does not wait for the page to stand still: frames are rare where the CPU draws them. */
const press = (button) => button.dispatchEvent("click");

const foot = (page) => page.evaluate(() => JSON.parse(document.getElementById("stage").dataset.foot));
const turn = (page) => page.inputValue("#object-turn");

async function place(page, seen, folder) {
  const { x, y, width, height } = await page.locator("#stage").boundingBox();
  await page.mouse.click(x + 0.44 * width, y + 0.85 * height);
  seen.clicked = await foot(page);
  await lookOf(page, `${folder}/shadow.png`);
  await page.mouse.move(x + 0.5 * width, y + 0.6 * height);
  await page.mouse.down();
  await page.mouse.move(x + 0.7 * width, y + 0.6 * height, { steps: 5 });
  await page.mouse.up();
  seen.dragged = [await turn(page), await foot(page)];
  await page.focus("#stage");
  for (const key of ["ArrowUp", "ArrowRight", ">", "+"]) await page.keyboard.press(key);
  seen.keyed = [await turn(page), await foot(page), await page.inputValue("#object-size")];
  await page.mouse.click(x + 0.5 * width, y + 0.2 * height);
  seen.sky = [await page.textContent("#scene-note"), await foot(page)];
  for (let i = 0; i < 9; i++) await page.keyboard.press("Control+z");
  seen.back = [await page.isEnabled("#undo"), await foot(page)];
}

async function dress(page, seen, folder) {
  seen.looks = [];
  for (const finish of ["matte", "glossy", "mirror"]) {
    await press(page.locator(`#finishes input[value="${finish}"]`));
    seen.looks.push(await lookOf(page, `${folder}/${finish}.png`, seen.looks.at(-1)));
  }
  seen.ownOffered = await page.isEnabled('#shapes input[value="own"]');
}

/** A .glb dropped on the page, as from a folder. */
async function own(page, seen, model, folder) {
  const before = await lookOf(page, `${folder}/before-own.png`);
  const transfer = await page.evaluateHandle((bytes) => {
    const data = new DataTransfer();
    data.items.add(new File([Uint8Array.from(atob(bytes), (c) => c.charCodeAt(0))], "chair.glb"));
    return data;
  }, readFileSync(model).toString("base64"));
  await page.dispatchEvent("#frame", "drop", { dataTransfer: transfer });
  await page.waitForSelector('#finishes input[value="file\'s own"]:checked');
  seen.own = [await page.textContent("#own-name"), (await lookOf(page, `${folder}/own.png`, before)) !== before];
  await page.setInputFiles("#model-file", { name: "broken.glb", mimeType: "", buffer: Buffer.from("nothing") });
  await page.waitForSelector("#error:not([hidden])");
  seen.brokenModel = await page.textContent("#error");
}

async function moveSun(page, seen, folder) {
  seen.before = await lookOf(page, `${folder}/before.png`);
  await page.focus("#sun_azimuth");
  await relit(page, () => page.keyboard.press("Home"));
  seen.after = await lookOf(page, `${folder}/after.png`, seen.before);
}

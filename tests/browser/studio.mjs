// The page as a studio: the picture beside its controls at every width, the sun dragged, targets, the map, cities.
import { answerWith, faults, open, relit } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

const LIGHT_CONTROLS = ["sun", "sun_azimuth", "sun_elevation", "warmth", "softness", "turbidity", "exposure"];
const SIZES = [[390, 844, "light"], [768, 1024, "dark"], [1440, 900, "light"], [844, 390, "dark"]]; // biome-ignore format: a table
const LEAST_TARGET = 44; // pixels

export async function visit(browser, url, seen, { photo, folder }) {
  seen.views = [];
  for (const [width, height, colorScheme] of SIZES) {
    const options = { flat: true, touch: width < 1000, colorScheme };
    const page = await open(browser, url, seen, { width, height }, options);
    const targets = await smallTargets(page);
    const first = await faults(page);
    await relit(page, () => page.setInputFiles("#file", photo));
    await page.evaluate(() => document.querySelector("#correct summary").click());
    seen.views.push({
      size: `${width} ${colorScheme}`,
      targets: [...targets, ...(await smallTargets(page))],
      faults: [...first, ...(await faults(page))],
      hidden: await controlsWithoutPicture(page),
      overflow: await page.evaluate(() => document.documentElement.scrollWidth - innerWidth),
    });
    if (width === 390) await takeHold(page, seen, folder);
    await page.context().close();
  }
  await dragInPicture(browser, url, seen, photo);
}

/** What can be pressed and is smaller than a finger, as "name: width x height". Links within a sentence may be narrower. */
const smallTargets = (page) =>
  page.evaluate((least) => {
    const names = "button, select, summary, a, input, textarea, [tabindex='0']";
    return [...document.querySelectorAll(names)].flatMap((element) => {
      const label = element.matches("[type=radio], [type=checkbox], [type=file]") ? element.closest("label") : null;
      const { width, height } = (label ?? element).getBoundingClientRect();
      if (!element.checkVisibility({ visibilityProperty: true }) || width === 0) return [];
      const text = `${element.id || element.textContent}: ${width.toFixed(1)} x ${height.toFixed(1)}`;
      return Math.min(width, height) < least - 0.1 ? [text] : [];
    });
  }, LEAST_TARGET);

/** Controls of the light that have the focus without all of the picture in sight, or behind something. */
async function controlsWithoutPicture(page) {
  const hidden = [];
  for (const id of LIGHT_CONTROLS) {
    await page.focus(`#${id}`);
    await page.waitForTimeout(50);
    const inSight = await page.evaluate((id) => {
      const picture = document.getElementById("frame").getBoundingClientRect();
      const control = document.getElementById(id).getBoundingClientRect();
      const [x, y] = [control.left + control.width / 2, control.top + control.height / 2];
      const isOnTop = document.elementFromPoint(x, y)?.id === id || document.getElementById(id).disabled;
      return isOnTop && picture.top >= -1 && picture.bottom <= innerHeight + 1 && picture.width > 200;
    }, id);
    if (!inSight) hidden.push(id);
  }
  return hidden;
}

/** A finger on the compass, a city, the camera's height, and the map that is shown beside the one that is saved. */
async function takeHold(page, seen, folder) {
  const sun = async () => [Number(await page.inputValue("#sun_azimuth")), Number(await page.inputValue("#sun_elevation"))];
  await page.focus("#dome svg");
  const grip = await page.locator("#dome .grip").boundingBox();
  const dome = await page.locator("#dome svg").boundingBox();
  const touch = await page.context().newCDPSession(page);
  const at = (type, x, y) => touch.send("Input.dispatchTouchEvent", { type, touchPoints: type === "touchEnd" ? [] : [{ x, y }] });
  seen.scrolled = [await page.evaluate(() => scrollY)];
  await at("touchStart", grip.x + grip.width / 2, grip.y + grip.height / 2);
  const [x, y] = [dome.x + dome.width * 0.5, dome.y + dome.height * 0.3];
  for (const away of [8, 0]) {
    await at("touchMove", x + away, y - away);
    await page.waitForTimeout(300); // moves come with the frames
  }
  await at("touchEnd", x, y);
  seen.compass = await sun();
  seen.scrolled.push(await page.evaluate(() => scrollY));
  await page.evaluate(() => document.getElementById("reset").click());
  await page.locator("#envmap").scrollIntoViewIfNeeded();
  await page.waitForFunction(() => document.getElementById("envmap").getAttribute("aria-busy") === "false");
  seen.mapNote = await page.textContent("#map-note");
  const shown = await page.evaluate(() => document.getElementById("envmap").toDataURL("image/png").split(",")[1]);
  const { writeFileSync } = await import("node:fs");
  writeFileSync(`${folder}/shown-map.png`, Buffer.from(shown, "base64"));
  await page.selectOption("#size", "256");
  await page.selectOption("#download-for", "png");
  const [download] = await Promise.all([page.waitForEvent("download"), page.tap("#download")]);
  await download.saveAs(`${folder}/saved-map.png`);
  await page.fill("#input-city", "muench");
  await page.fill("#input-city", "münch");
  await page.waitForFunction(() => document.querySelector("#cities option"));
  seen.city = [await page.getAttribute("#cities option", "value")];
  await page.fill("#input-city", seen.city[0]);
  await page.waitForFunction(() => document.getElementById("input-latitude").value);
  seen.city.push(await page.inputValue("#input-latitude"), await page.inputValue("#input-longitude"));
  await page.fill("#input-camera_height", "3");
  page.requests = [];
  await relit(page, () => page.tap("#user-input button[type=submit]"));
  seen.corrected = page.requests.filter((address) => address.includes("v1/lighting"));
}

/** A sun in the picture and one outside of it, by mouse and by keys. */
async function dragInPicture(browser, url, seen, photo) {
  const page = await open(browser, url, seen, { width: 1440, height: 900 }, { flat: true });
  const sun = async () => [Number(await page.inputValue("#sun_azimuth")), Number(await page.inputValue("#sun_elevation"))];
  const frame = () => page.locator("#frame").boundingBox();
  const dragTo = async (right, down) => {
    const handle = await page.locator("#sun-handle").boundingBox();
    const { x, y, width, height } = await frame();
    await page.mouse.move(handle.x + handle.width / 2, handle.y + handle.height / 2);
    await page.mouse.down();
    await page.mouse.move(x + right * width, y + down * height, { steps: 4 });
    await page.mouse.up();
  };
  for (const [name, azimuth] of [["inside", 10], ["outside", 150]]) {
    await answerWith(page, url, photo, (record) => ({
      ...record,
      sun: { ...record.sun, azimuth, elevation: 20, visibility: 0.97 },
      camera: { elevation: 0, roll: 0, vertical_fov: 60 },
    }));
    await relit(page, () => page.setInputFiles("#file", photo));
    await dragTo(0.5, 0.25);
    seen[name] = [await sun()];
    await page.focus("#sun-handle");
    await page.keyboard.press("ArrowUp");
    await page.keyboard.press("Shift+ArrowRight");
    seen[name].push(await sun(), await page.getAttribute("#sun-handle", "aria-valuetext"));
    await page.unroute("**/v1/lighting?*");
  }
  await page.context().close();
}

// A photo whose sun is 60° wrong, put right by one gesture on a phone, a tablet and a desk: how long, and how soon each move shows.
// Without WebGL: what a CPU draws in its place takes seconds, and says nothing of a graphics card.
import { open, relit } from "./visit.mjs";

export const flat = true;

const SCREENS = { 390: 844, 768: 1024, 1440: 900 };
const WRONG = 60; // degrees
const FOOT = [0.82, 0.96]; // of the lamp, in shares of the picture
const TIP = [0.62, 0.83]; // of its shadow

export async function visit(browser, url, seen, { street }) {
  seen.ways = [];
  for (const [width, height] of Object.entries(SCREENS)) {
    const page = await open(browser, url, seen, { width: Number(width), height }, { flat: true, touch: Number(width) < 500 });
    const right = await turnAnswers(page, url, street);
    for (const [name, act] of Object.entries(WAYS)) {
      await relit(page, () => page.setInputFiles("#file", street));
      await watchLights(page);
      await page.waitForTimeout(1000);
      await page.evaluate(() => globalThis.waits.splice(0));
      const began = Date.now();
      await act(page);
      const seconds = (Date.now() - began) / 1000;
      const error = Math.abs(((Number(await page.inputValue("#sun_azimuth")) - right + 540) % 360) - 180);
      const moves = await page.evaluate(() => globalThis.waits.splice(0));
      seen.ways.push({ width, name, seconds, error, moves });
    }
    await page.context().close();
  }
}

/** Has the service answer wrongly as long as no shadow is drawn; the azimuth that it gives with the shadow is right. */
async function turnAnswers(page, url, street) {
  const { readFileSync } = await import("node:fs");
  const ask = (query) =>
    fetch(`${url}v1/lighting?${query}`, {
      method: "POST",
      headers: { "Content-Type": "image/jpeg" },
      body: readFileSync(street),
    }).then((answer) => answer.json());
  const wrong = await ask("probability=true&photo_metadata=true");
  const [width, height] = [1600, 1200];
  const pixels = [FOOT, TIP].flatMap(([x, y]) => [x * width, y * height]);
  const { sun } = await ask(`shadow=${pixels}`);
  const azimuth = ((sun.azimuth + WRONG + 540) % 360) - 180;
  const candidates = [azimuth, sun.azimuth].map((at) => ({ azimuth: at, elevation: sun.elevation, probability: 0.5 }));
  const turned = { ...wrong, trust: "unsure", sun: { ...wrong.sun, azimuth, elevation: sun.elevation, candidates } };
  await page.route(
    (address) => address.pathname.endsWith("/v1/lighting") && !address.searchParams.has("shadow"),
    (route) => route.fulfill({ json: turned }),
  );
  return sun.azimuth;
}

/** Notes for each move of the pointer, press or release how many milliseconds later another light is on the page. */
async function watchLights(page) {
  await page.evaluate(() => {
    globalThis.waits ??= [];
    if (globalThis.watched) return;
    globalThis.watched = true;
    let since = 0;
    for (const kind of ["pointerdown", "pointermove", "pointerup", "click"])
      document.addEventListener(kind, () => { since = performance.now(); }, { capture: true }); // biome-ignore format: one line
    new MutationObserver(() => {
      requestAnimationFrame(() => requestAnimationFrame(() => globalThis.waits.push(performance.now() - since)));
    }).observe(document.getElementById("envmap"), { attributeFilter: ["data-lights"] });
  });
}

const WAYS = {
  "a shadow drawn": async (page) => {
    await page.locator("#tools label", { hasText: "shadow" }).click();
    await dragOver(page, FOOT, TIP);
    await page.waitForFunction(() => document.querySelector("#drawn button"), null, { polling: 20 });
  },
  "a sun picked": (page) => relit(page, () => page.locator("#suns button").nth(1).click()),
  "the sun dragged": async (page) => {
    await page.locator("#tools label", { hasText: "sun" }).click();
    await dragOver(page, [0.7, 0.5], [0.7 - WRONG / 180, 0.5]);
  },
};

/** A drag of a second and a half, with a rest after each of its steps. */
async function dragOver(page, from, to) {
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const { x, y, width, height } = await page.locator("#frame").boundingBox();
  const steps = 5;
  await page.mouse.move(x + from[0] * width, y + from[1] * height);
  await page.mouse.down();
  for (let i = 1; i <= steps; i++) {
    const [right, down] = from.map((start, axis) => start + ((to[axis] - start) * i) / steps);
    await page.mouse.move(x + right * width, y + down * height);
    await page.waitForTimeout(300);
  }
  await page.mouse.up();
}

// A photo whose sun is 60° wrong, or whose horizon is 8° wrong, put right by one gesture on a phone, a tablet and a desk:
// how long, and how soon each move shows. Without WebGL: what a CPU draws in its place takes seconds, and says nothing of a
// graphics card.
import { readFileSync } from "node:fs";
import { open, relit } from "./visit.mjs";

export const flat = true;

const SCREENS = { 390: 844, 768: 1024, 1440: 900 };
const WRONG = 60; // degrees of the sun
const TILTED = 8; // degrees of the camera's elevation
const FOOT = [0.82, 0.96]; // of the lamp, in shares of the picture
const UPRIGHT = [
  [[0.823, 0.948], [0.746, 0.2]], // the lamp's post
  [[0.183, 0.97], [0.178, 0.05]], // a pillar
];
const TIP = [0.62, 0.83]; // of its shadow
const STEPS = 10; // of a drag
const PAUSE = 150; // ms between two of them, as long as the light may take

export async function visit(browser, url, seen, { street }) {
  seen.ways = [];
  const answers = await ask(url, street);
  for (const [width, height] of Object.entries(SCREENS)) {
    const page = await open(browser, url, seen, { width: Number(width), height }, { flat: true, touch: Number(width) < 1000 });
    await page.route(
      (address) => address.pathname.endsWith("/v1/lighting") && !/shadow|horizon|vertical/.test(address.search),
      (route) => route.fulfill({ json: answers.wrong }),
    );
    for (const [name, { act, error }] of Object.entries(WAYS)) {
      await relit(page, () => page.setInputFiles("#file", street));
      await watchMoves(page);
      await page.waitForTimeout(1000);
      await page.evaluate(() => globalThis.waits.splice(0));
      const began = Date.now();
      await act(page, answers);
      const seconds = (Date.now() - began) / 1000;
      await page.waitForTimeout(300);
      const moves = await page.evaluate(() => globalThis.waits.splice(0));
      seen.ways.push({ width, name, seconds, error: await error(page, answers), moves });
    }
    await page.context().close();
  }
}

/** The service's answer by the shadow, which is right, and one whose sun and horizon are wrong. */
async function ask(url, street) {
  const fetchRecord = (query) =>
    fetch(`${url}v1/lighting?${query}`, {
      method: "POST",
      headers: { "Content-Type": "image/jpeg" },
      body: readFileSync(street),
    }).then((answer) => answer.json());
  const [columns, rows] = [1600, 1200];
  const pixels = [FOOT, TIP].flatMap(([x, y]) => [x * columns, y * rows]);
  const right = await fetchRecord(`shadow=${pixels}`);
  const given = await fetchRecord("probability=true&photo_metadata=true");
  const { elevation } = right.sun;
  const azimuth = ((right.sun.azimuth + WRONG + 540) % 360) - 180;
  const candidates = [azimuth, right.sun.azimuth].map((at) => ({ azimuth: at, elevation, probability: 0.5 }));
  const wrong = {
    ...given,
    trust: "unsure",
    sun: { ...given.sun, azimuth, elevation, candidates },
    camera: { ...given.camera, elevation: given.camera.elevation + TILTED },
  };
  return { right, given, wrong };
}

/** Notes for each press and move of the pointer how many milliseconds later the page shows what follows from it. */
async function watchMoves(page) {
  await page.evaluate(() => {
    globalThis.waits ??= [];
    if (globalThis.watched) return;
    globalThis.watched = true;
    let since;
    for (const kind of ["pointerdown", "pointermove", "pointerup", "click"])
      document.addEventListener(kind, () => { since = kind === "pointerup" ? undefined : performance.now(); }, { capture: true });
    const note = () => {
      const began = since;
      since = undefined; // so that each move counts once
      if (began !== undefined)
        requestAnimationFrame(() => requestAnimationFrame(() => globalThis.waits.push(performance.now() - began)));
    };
    const [lights, marks] = ["envmap", "marks"].map((id) => document.getElementById(id));
    new MutationObserver(note).observe(lights, { attributeFilter: ["data-lights"] });
    new MutationObserver(() => {
      if (document.getElementById("frame").dataset.tool === "horizon") note(); // else the light is still to come
    }).observe(marks, { childList: true });
  });
}

const sunError = async (page, { right }) =>
  Math.abs(((Number(await page.inputValue("#sun_azimuth")) - right.sun.azimuth + 540) % 360) - 180);

/** How wrong the camera's elevation is. */
async function tiltError(page, { given }) {
  const shown = await page.locator("#numbers > div", { hasText: "Camera elevation" }).textContent();
  const [, size, side] = /([\d.]+)° (up|down)/.exec(shown);
  return Math.abs(Number(size) * (side === "up" ? 1 : -1) - given.camera.elevation);
}

const WAYS = {
  "a shadow drawn": {
    error: sunError,
    act: async (page) => {
      await choose(page, "shadow");
      await dragOver(page, FOOT, TIP);
      await page.waitForSelector("#drawn button");
    },
  },
  "a sun picked": {
    error: sunError,
    act: (page) => relit(page, () => page.locator("#suns button").nth(1).click()),
  },
  "the sun on the photo": {
    error: sunError,
    act: async (page) => {
      await choose(page, "sun");
      await dragOver(page, [0.7, 0.5], [0.7 - WRONG / 180, 0.5]);
    },
  },
  "the sun on the map": {
    error: sunError,
    act: (page, answers) => dragSun(page, "#latlong", (azimuth, elevation) => [azimuth / 360 + 0.5, 0.5 - elevation / 180], answers),
  },
  "the sun on the compass": {
    error: sunError,
    act: (page, answers) => dragSun(page, "#dome svg", onCompass, answers),
  },
  "the horizon": {
    error: tiltError,
    act: async (page, { given, wrong }) => {
      await choose(page, "horizon");
      const row = ({ camera: { elevation, vertical_fov: fov } }) =>
        0.5 + Math.tan((elevation * Math.PI) / 180) / Math.tan((fov * Math.PI) / 360) / 2;
      await dragOver(page, [0.5, row(wrong)], [0.5, row(given)]);
      await page.waitForSelector("#drawn button");
    },
  },
  "two upright edges": {
    error: tiltError,
    act: async (page) => {
      await choose(page, "horizon");
      await page.selectOption("#kinds", { label: "Upright edges" });
      for (const [from, to] of UPRIGHT) {
        await dragOver(page, from, to);
        await page.waitForSelector("#drawn button");
        await page.waitForSelector("#result[aria-busy=false]");
      }
    },
  },
};

const choose = (page, tool) => page.locator("#tools label", { hasText: tool }).click();

/** Where the compass has a direction, in shares of its drawing. */
function onCompass(azimuth, elevation) {
  const out = ((90 - elevation) / 90) * (100 / 244);
  const angle = (azimuth * Math.PI) / 180;
  return [0.5 + out * Math.sin(angle), 0.5 - out * Math.cos(angle)];
}

/** The sun dragged from where it is to where it should be, on one of the drawings of the sky. */
async function dragSun(page, selector, place, { right, wrong }) {
  const at = ({ sun: { azimuth, elevation } }) => place(azimuth, elevation);
  await dragOver(page, at(wrong), at(right), selector);
}

/** A drag of a second and a half. */
async function dragOver(page, from, to, selector = "#frame") {
  await page.evaluate((name) => document.querySelector(name).scrollIntoView({ block: "center" }), selector);
  const { x, y, width, height } = await page.locator(selector).boundingBox();
  await page.mouse.move(x + from[0] * width, y + from[1] * height);
  await page.mouse.down();
  for (let i = 1; i <= STEPS; i++) {
    const [right, down] = from.map((start, axis) => start + ((to[axis] - start) * i) / STEPS);
    await page.mouse.move(x + right * width, y + down * height);
    await page.waitForTimeout(PAUSE);
  }
  await page.mouse.up();
}

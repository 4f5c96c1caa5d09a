// What the visits share: a browser, pages that record errors, downloads.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(new URL("../../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");

export const PATIENCE = 120_000; // ms; WebGL is drawn by the CPU here
export const axePath = require.resolve("axe-core/axe.min.js");

const WITH_WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-gpu-compositing"];

/** A browser; a `flat` one has no WebGL, and draws pages without it, which takes much less of a CPU. */
export const launch = (executablePath, flat = false) =>
  chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--disable-background-networking", ...(flat ? ["--disable-gpu"] : WITH_WEBGL)],
  });

/**
 * A page at `url` whose faults go to `seen.complaints` and whose requests go to `page.requests`. `flat` takes WebGL away,
 * which is slow where the CPU draws; `touch` is a phone; with `motion` the first view's example moves all the time.
 */
export async function open(
  browser,
  url,
  seen,
  viewport,
  { flat = false, touch = false, motion = false, colorScheme = "light" } = {},
) {
  const permissions = ["clipboard-read", "clipboard-write"];
  const reducedMotion = motion ? "no-preference" : "reduce";
  const options = { viewport, permissions, isMobile: touch, hasTouch: touch, colorScheme, reducedMotion };
  const context = await browser.newContext(options);
  if (flat) await context.addInitScript(withoutWebgl);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  page.requests = [];
  page.on("request", (request) => page.requests.push(request.url()));
  page.on("pageerror", (error) => seen.complaints.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error" && !(flat && /WebGL/.test(message.text()))) seen.complaints.push(message.text());
  });
  page.on("requestfinished", (request) => {
    if (!request.url().startsWith(new URL("/", url).href) && !request.url().startsWith("blob:")) seen.complaints.push(request.url());
  });
  await page.goto(url, { waitUntil: "networkidle" });
  return page;
}

function withoutWebgl() {
  const original = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : original.call(this, kind, ...rest);
  };
}

/** Does something and waits until the page shows the light that follows from it. */
export async function relit(page, act) {
  const lights = () => Number(document.getElementById("envmap").dataset.lights ?? 0);
  const before = await page.evaluate(lights);
  await act();
  const isLit = (count) => Number(document.getElementById("envmap").dataset.lights) > count;
  await page.waitForFunction(isLit, before, { polling: 50 }); // else it asks the CPU for a frame each time
}

export async function saved(page, button, folder, name) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
  await download.saveAs(`${folder}/${name}`);
  return download.suggestedFilename();
}

/** What the primary button saves for a tool, or as a map of a format. */
export async function downloaded(page, target, folder, name) {
  await page.selectOption("#download-for", target);
  return saved(page, "#download", folder, name);
}

/** Waits until the service's map lights the object. */
export const rested = (page) =>
  page.waitForResponse((answer) => /v1\/envmap.*format=hdr/.test(answer.url()), { timeout: PATIENCE });

/** The curl command or the Python program that the page copies. */
export async function copied(page, kind) {
  await page.click(`#copy-${kind}`);
  const name = kind === "curl" ? "curl" : "Python";
  await page.waitForFunction((text) => document.getElementById("copied").textContent.includes(text), name);
  return page.evaluate(() => navigator.clipboard.readText());
}

/** The photo with its object, as a file and as a digest; waits until it differs from another digest. */
export async function screenshotOf(page, file, other) {
  const began = Date.now();
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const clip = await page.locator("#frame").boundingBox();
  for (;;) {
    const picture = await page.screenshot({ path: file, clip });
    const digest = createHash("sha256").update(picture).digest("hex");
    if (digest !== other || Date.now() - began > PATIENCE) return digest;
    await page.waitForTimeout(100); // a picture takes the CPU from what is waited for
  }
}

const WCAG = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"]; // 2.2, level AA

/** What axe-core finds against WCAG 2.2 AA, or that is serious, as "rule: element". */
export async function faults(page) {
  await page.evaluate(readFileSync(axePath, "utf8"));
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  return violations
    .filter(({ impact, tags }) => impact === "serious" || impact === "critical" || tags.some((tag) => WCAG.includes(tag)))
    .flatMap(({ id, nodes }) => nodes.map(({ target }) => `${id}: ${target.join(" ")}`));
}

/** Answers every question for a photo's light with the record of `photo`, changed by the test. */
export async function answerWith(page, url, photo, change) {
  const type = photo.endsWith(".png") ? "image/png" : "image/jpeg";
  const answer = await fetch(`${url}v1/lighting?probability=true&photo_metadata=true`, {
    method: "POST",
    headers: { "Content-Type": type },
    body: readFileSync(photo),
  });
  const record = await answer.json();
  await page.route("**/v1/lighting?*", (route) => route.fulfill({ json: change(record) }));
}

/** Does what the page refuses, and returns its error. */
export async function refused(page, act) {
  await act();
  await page.waitForSelector("#error:not([hidden])");
  return page.textContent("#error");
}

/** A drag from one point to others, with a pause at each, longer than what joins the steps of a key. */
export async function drag(page, points) {
  const [start, ...rest] = points;
  await page.mouse.move(...start);
  await page.mouse.down();
  for (const point of rest) {
    await page.mouse.move(...point, { steps: 3 });
    await page.waitForTimeout(1000);
  }
  await page.mouse.up();
}

/** Leaves out of the complaints what the browser says of answers that the visit provoked. */
export function expectFailures(seen, pattern = /Failed to load resource/) {
  seen.complaints = seen.complaints.filter((text) => !pattern.test(text));
}

/** The rows of the photo's metadata. */
export const metadataRows = (page) => page.locator("#metadata dd").allTextContents();

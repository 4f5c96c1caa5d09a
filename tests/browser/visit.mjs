// What the visits share: a browser, pages that note what goes wrong, downloads.
import { createHash } from "node:crypto";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";

const require = createRequire(new URL("../../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");

export const PATIENCE = 120_000; // ms; WebGL is drawn by the CPU here
export const axePath = require.resolve("axe-core/axe.min.js");

const launch = (executablePath) =>
  chromium.launch({
    executablePath,
    args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"],
  });

/** Makes the visits with a script's arguments PAGE_URL CHROMIUM FILES_AS_JSON, and prints what they saw as JSON. */
export async function report(visits) {
  const [url, executablePath, files] = process.argv.slice(2);
  const seen = { complaints: [], seconds: {} };
  const browser = await launch(executablePath);
  try {
    for (const visit of visits) {
      const began = Date.now();
      await visit(browser, url, seen, JSON.parse(files));
      seen.seconds[visit.name] = (Date.now() - began) / 1000;
    }
  } finally {
    await browser.close();
  }
  console.log(JSON.stringify(seen));
}

/**
 * A page at `url` whose faults go to `seen.complaints` and whose requests go to `page.asked`. `flat` takes WebGL away,
 * which is slow where the CPU draws; `touch` is a phone.
 */
export async function open(browser, url, seen, viewport, { flat = false, touch = false } = {}) {
  const permissions = ["clipboard-read", "clipboard-write"];
  const context = await browser.newContext({ viewport, permissions, isMobile: touch, hasTouch: touch });
  if (flat) await context.addInitScript(withoutWebgl);
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE);
  page.asked = [];
  page.on("request", (request) => page.asked.push(request.url()));
  page.on("pageerror", (error) => seen.complaints.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error" && !(flat && /WebGL/.test(message.text()))) seen.complaints.push(message.text());
  });
  page.on("requestfinished", (request) => {
    if (!request.url().startsWith(url) && !request.url().startsWith("blob:")) seen.complaints.push(request.url());
  });
  await page.goto(url, { waitUntil: "networkidle" });
  return page;
}

function withoutWebgl() {
  const own = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
    return kind.startsWith("webgl") ? null : own.call(this, kind, ...rest);
  };
}

/** Does something and waits until the page shows the light that follows from it. */
export async function relit(page, act) {
  const lights = () => Number(document.getElementById("envmap").dataset.lights ?? 0);
  const before = await page.evaluate(lights);
  await act();
  await page.waitForFunction((count) => Number(document.getElementById("envmap").dataset.lights) > count, before);
}

export async function saved(page, button, folder, name) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(button)]);
  await download.saveAs(`${folder}/${name}`);
  return download.suggestedFilename();
}

/** The curl command or the Python program that the page copies. */
export async function copied(page, kind) {
  await page.click(`#copy-${kind}`);
  const word = kind === "curl" ? "curl" : "Python";
  await page.waitForFunction((name) => document.getElementById("copied").textContent.includes(name), word);
  return page.evaluate(() => navigator.clipboard.readText());
}

/** The photo with its object, as a file and as a digest; waits until it differs from another digest. */
export async function lookOf(page, file, other) {
  const began = Date.now();
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const clip = await page.locator("#frame").boundingBox();
  let look;
  do {
    const picture = await page.screenshot({ path: file, clip });
    look = createHash("sha256").update(picture).digest("hex");
  } while (look === other && Date.now() - began < PATIENCE);
  return look;
}

/** What axe-core finds that is serious or worse, as "rule: element". */
export async function faults(page) {
  await page.evaluate(readFileSync(axePath, "utf8"));
  const { violations } = await page.evaluate(() => globalThis.axe.run(document));
  return violations
    .filter(({ impact }) => impact === "serious" || impact === "critical")
    .flatMap(({ id, nodes }) => nodes.map(({ target }) => `${id}: ${target.join(" ")}`));
}

/** Answers every question for a photo's light with the record of `photo`, changed by the test. */
export async function answering(page, url, photo, change) {
  const type = photo.endsWith(".png") ? "image/png" : "image/jpeg";
  const answer = await fetch(`${url}v1/lighting?probability=true`, {
    method: "POST",
    headers: { "Content-Type": type },
    body: readFileSync(photo),
  });
  const record = await answer.json();
  await page.route("**/v1/lighting?*", (route) => route.fulfill({ json: change(record) }));
}

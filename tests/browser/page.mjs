// Drives the page in Chromium: node page.mjs PAGE_URL CHROMIUM PHOTO TEXT_FILE FOLDER. Prints what it saw as JSON.
import { createRequire } from "node:module";

const require = createRequire(new URL("../../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");
const [url, executablePath, photo, textFile, folder] = process.argv.slice(2);

const PATIENCE = 120_000; // ms; WebGL is drawn by the CPU here
const seen = { complaints: [] };

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking"],
});
try {
  await tryWide(await open({ width: 1000, height: 800 }));
  await tryNarrow(await open({ width: 360, height: 720 }));
} finally {
  await browser.close();
}
console.log(JSON.stringify(seen));

async function open(viewport) {
  const page = await (await browser.newContext({ viewport })).newPage();
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => seen.complaints.push(error.message));
  page.on("console", (message) => message.type() === "error" && seen.complaints.push(message.text()));
  page.on("requestfinished", (request) => {
    if (!request.url().startsWith(url) && !request.url().startsWith("blob:")) seen.complaints.push(request.url());
  });
  await page.goto(url);
  return page;
}

async function tryWide(page) {
  await page.setInputFiles("#file", photo);
  await page.waitForSelector("#stage:not([hidden])");
  seen.title = await page.textContent("#title");
  seen.numbers = await page.locator("#numbers dt").allTextContents();
  seen.record = await saved(page, "#get-json", "estimate.json");
  await readDome(page);
  await moveSun(page);
  await refuseText(page);
}

/** The dome by keyboard: arrows read it, Enter moves the sun there. */
async function readDome(page) {
  await page.focus("#dome svg");
  await page.keyboard.press("ArrowUp");
  seen.readout = await page.textContent("#readout");
  await page.keyboard.press("Enter");
  seen.changed = await page.isEnabled("#reset");
  await page.click("#reset");
}

async function moveSun(page) {
  seen.before = await lookOf(page);
  const rendered = page.waitForResponse((answer) => answer.url().includes("sun_azimuth=-180") && answer.url().includes("hdr"));
  await page.focus("#sun_azimuth");
  await page.keyboard.press("Home");
  seen.slider = await page.getAttribute("#sun_azimuth", "aria-valuetext");
  await rendered;
  seen.after = await lookOf(page, seen.before);
  seen.exr = await saved(page, "#get-exr", "map.exr");
  seen.edited = await saved(page, "#get-json", "edited.json");
}

/** A digest of the photo with its object; waits until it differs from another. */
async function lookOf(page, other) {
  const began = Date.now();
  let look;
  do {
    look = require("node:crypto").createHash("sha256").update(await page.locator("#frame").screenshot()).digest("hex");
  } while (look === other && Date.now() - began < PATIENCE);
  return look;
}

async function refuseText(page) {
  await page.setInputFiles("#file", textFile);
  await page.waitForSelector("#error:not([hidden])");
  seen.error = await page.textContent("#error");
  seen.kept = await page.textContent("#title");
  seen.complaints = seen.complaints.filter((words) => !/status of 4\d\d/.test(words)); // that refusal, in the console
}

async function tryNarrow(page) {
  await page.locator("#examples button").first().focus();
  await page.keyboard.press("Enter");
  await page.waitForSelector("#result:not([hidden])");
  seen.example = await page.textContent("#title");
  seen.overflow = await page.evaluate(() => document.documentElement.scrollWidth - document.documentElement.clientWidth);
}

async function saved(page, link, name) {
  const [download] = await Promise.all([page.waitForEvent("download"), page.click(link)]);
  await download.saveAs(`${folder}/${name}`);
  return download.suggestedFilename();
}

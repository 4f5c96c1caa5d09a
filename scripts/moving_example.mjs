// Pictures of a teapot that turns in an example photo, taken in the page: node moving_example.mjs URL CHROMIUM FOLDER FRAMES.
import { createRequire } from "node:module";

const require = createRequire(new URL("../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");
const [url, executablePath, folder, frames] = process.argv.slice(2);

const args = [
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-background-networking",
];
const browser = await chromium.launch({ executablePath, args });
const page = await browser.newPage({ viewport: { width: 1600, height: 1000 }, deviceScaleFactor: 1.5, bypassCSP: true });
page.setDefaultTimeout(120_000);
await page.goto(url, { waitUntil: "networkidle" });
await page.addStyleTag({ content: ".result { --picture-height: 600px !important; } .frame { border-radius: 0; }" });
await page.locator("#examples button").first().click();
await page.waitForSelector("#stage:not([hidden])");
await page.locator("#envmap").scrollIntoViewIfNeeded(); // so that its map is fetched, after the object's
await page.waitForFunction(() => document.getElementById("envmap").getAttribute("aria-busy") === "false");
await page.evaluate(() => scrollTo(0, 0));
const set = (id, value) =>
  page.evaluate(
    ([id, value]) => {
      const input = document.getElementById(id);
      input.value = value;
      input.dispatchEvent(new Event("input"));
    },
    [id, String(value)],
  );
await page.locator("#show-marks").dispatchEvent("click");
await page.locator('#shapes input[value="teapot"]').dispatchEvent("click");
await page.locator('#finishes input[value="glossy"]').dispatchEvent("click");
await set("object-size", Math.log2(0.42));
await page.evaluate(() => document.getElementById("shade").remove());
const clip = await page.locator("#frame").boundingBox();
const take = async (name) => {
  await page.waitForTimeout(400); // for the frame that draws it
  await page.screenshot({ path: `${folder}/${name}.png`, clip, scale: "device" });
};
for (let number = 0; number < Number(frames); number++) {
  await set("object-turn", Math.round((360 * number) / Number(frames)) - 180);
  await take(number);
}
await set("object-size", Math.log2(0.02)); // as small as it gets, and behind the strip
await take("photo");
await browser.close();

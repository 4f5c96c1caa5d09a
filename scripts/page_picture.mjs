// The page with an example in it, as a picture: node page_picture.mjs URL CHROMIUM OUT.png, after npm ci in server/web.
import { createRequire } from "node:module";

const require = createRequire(new URL("../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");
const [url, executablePath, out] = process.argv.slice(2);

const browser = await chromium.launch({
  executablePath,
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({ viewport: { width: 1240, height: 900 } });
page.setDefaultTimeout(120_000);
await page.goto(url);
await page.locator("#examples button").first().click();
await page.locator("#shapes label", { hasText: "teapot" }).click();
await page.locator("#finishes label", { hasText: "glossy" }).click();
await page.waitForSelector("#stage:not([hidden])");
await page.mouse.move(0, 0);
await page.evaluate(() => (document.activeElement?.blur(), scrollTo(0, 0)));
await page.screenshot({ path: out });
await browser.close();

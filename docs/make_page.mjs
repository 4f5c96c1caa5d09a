// Takes docs/page.png of a running service: node docs/make_page.mjs [URL], after npm ci in server/web.
import { createRequire } from "node:module";
import { fileURLToPath } from "node:url";

const require = createRequire(new URL("../server/web/package.json", import.meta.url));
const { chromium } = require("playwright-core");

const browser = await chromium.launch({
  executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({ viewport: { width: 1240, height: 1120 } });
page.setDefaultTimeout(120_000);
await page.goto(process.argv[2] ?? "http://127.0.0.1:8000/");
await page.locator("#examples button", { hasText: "Golden hour" }).click();
await page.locator("#shapes label", { hasText: "teapot" }).click();
await page.locator("#finishes label", { hasText: "glossy" }).click();
await page.waitForSelector("#stage:not([hidden])");
await page.mouse.move(0, 0);
await page.evaluate(() => (document.activeElement?.blur(), scrollTo(0, 0)));
await page.screenshot({ path: fileURLToPath(new URL("page.png", import.meta.url)) });
await browser.close();

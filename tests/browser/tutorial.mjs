// The page of docs/learn/web-page.md: a visitor chooses a photo. `files` has the photo and where a picture of the page goes.
import { PATIENCE } from "./visit.mjs";

export async function visit(browser, url, seen, { photo, picture }) {
  const page = await browser.newPage({ viewport: { width: 640, height: 560 } });
  page.setDefaultTimeout(PATIENCE);
  page.on("pageerror", (error) => seen.complaints.push(error.message));
  await page.goto(url);
  await page.setInputFiles("#photo", photo);
  await page.waitForFunction(() => document.querySelector("canvas").style.backgroundImage);
  await page.locator("canvas").screenshot({ path: picture });
}

// How the camera was held, on a narrow screen.
import { open, relit } from "./visit.mjs";

export async function visitHeld(browser, url, seen, { held }) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  seen.held = [];
  for (const file of held) {
    await relit(page, () => page.setInputFiles("#file", file));
    const row = page.locator("#metadata div", { hasText: "Held" }).locator("dd");
    const { x, width } = await row.boundingBox();
    const overflow = await page.evaluate(() => document.documentElement.scrollWidth - innerWidth);
    seen.held.push([await row.textContent(), await page.locator("#warnings li").allTextContents(), [x, x + width, overflow]]);
  }
  await page.context().close();
}

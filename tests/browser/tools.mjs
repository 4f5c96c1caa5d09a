// What is drawn on a photo: a sun that is picked, a shadow whose light follows the finger, a size, and all of it undone.
import { open, relit } from "./visit.mjs";

export const flat = true; // the drawing alone is looked at

export async function visit(browser, url, seen, { street }) {
  const page = await open(browser, url, seen, { width: 900, height: 900 }, { flat: true });
  await relit(page, () => page.setInputFiles("#file", street));
  seen.trust = [await page.textContent("#trust")];
  seen.chips = await page.locator("#suns button").count();
  await page.locator("#suns button").nth(1).click();
  seen.picked = [await page.locator("#suns button").nth(1).getAttribute("aria-pressed"), await direction(page)];
  await page.click("#undo");
  seen.picked.push(await direction(page));

  await page.locator("#tools label", { hasText: "shadow" }).click();
  const at = await picture(page);
  seen.live = [await direction(page)];
  await page.mouse.move(...at(0.82, 0.96));
  await page.mouse.down();
  await page.mouse.move(...at(0.62, 0.83), { steps: 3 });
  seen.live.push(await direction(page));
  seen.loupe = await page.isVisible("#loupe");
  await stated(page, () => page.mouse.up(), 1);
  seen.drawn = await page.locator("#drawn button").allTextContents();
  seen.trust.push(await page.textContent("#trust"));
  seen.evidence = await page.textContent("#evidence");
  seen.asked = page.requests.filter((address) => address.includes("shadow=")).length;
  await stated(page, () => page.click("#undo"), 0);
  seen.trust.push(await page.textContent("#trust"));

  await page.locator("#tools label", { hasText: "size" }).click();
  const there = await picture(page); // which another answer may have moved
  await page.mouse.move(...there(0.82, 0.96));
  await page.mouse.down();
  await page.mouse.move(...there(0.76, 0.1), { steps: 3 });
  await page.mouse.up();
  await page.fill("#meters", "4.5");
  await stated(page, () => page.click("#size-form button"), 1);
  seen.size = [
    await page.locator("#drawn button").allTextContents(),
    page.requests.some((a) => /reference=[^&]*4\.5/.test(a)),
  ];
  await page.locator("#tools label", { hasText: "horizon" }).click();
  await page.selectOption("#kinds", { label: "Upright edges" });
  for (const right of [0.05, 0.77]) {
    const at = await picture(page);
    await page.mouse.move(...at(right, 0.95));
    await page.mouse.down();
    await page.mouse.move(...at(right, 0.2), { steps: 3 });
    await stated(page, () => page.mouse.up(), 2);
  }
  seen.upright = [
    await page.locator("#drawn button").allTextContents(),
    new URL(page.requests.findLast((address) => address.includes("v1/lighting"))).searchParams.get("vertical"),
    await page.textContent("#evidence"),
  ];
  await dragOnMap(page, seen);
  await page.context().close();
}

/** The sun dragged on the environment map, and one undo of that. */
async function dragOnMap(page, seen) {
  await page.locator("#latlong").scrollIntoViewIfNeeded();
  const { x, y, width, height } = await page.locator("#latlong").boundingBox();
  const sun = async () => [Number(await page.inputValue("#sun_azimuth")), Number(await page.inputValue("#sun_elevation"))];
  seen.map = [await sun()];
  await page.mouse.move(x + 0.3 * width, y + 0.4 * height);
  await page.mouse.down();
  await page.mouse.move(x + 0.75 * width, y + 0.25 * height, { steps: 3 });
  await page.mouse.up();
  seen.map.push(await sun());
  await page.click("#undo");
  seen.map.push(await sun());
}

const direction = (page) => page.textContent("output[for=sun_azimuth]");

/** A function from shares of the picture's width and height to points of the page. */
async function picture(page) {
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const { x, y, width, height } = await page.locator("#frame").boundingBox();
  return (right, down) => [x + right * width, y + down * height];
}

/** Does something and waits until the page lists so many things that were drawn, and their light. */
async function stated(page, act, count) {
  await relit(page, async () => {
    await act();
    await page.waitForFunction((n) => document.querySelectorAll("#drawn button").length === n, count, { polling: 100 });
  });
}

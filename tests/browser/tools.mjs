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

  seen.chipsElsewhere = [];
  for (const selector of ["#sun-chips button:nth-child(2)", "#dome .candidate:nth-of-type(2) text"]) {
    await page.locator(selector).scrollIntoViewIfNeeded();
    await page.locator(selector).click();
    seen.chipsElsewhere.push([await direction(page), await page.isHidden(selector)]);
    await page.click("#undo");
  }

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
  await doubtShadow(page, seen);
  await stated(page, () => page.click("#undo"), 0);
  seen.trust.push(await page.textContent("#trust"));

  await drawOtherShadows(page, seen);
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
  await dragHorizon(page, seen);
  await drawEdges(page, seen);
  await page.locator("#tools label", { hasText: "place" }).click();
  seen.gripsOfPlace = await page.locator("#grips > *").count();
  await dragOnMap(page, seen);
  await page.context().close();
}

/** A shadow that is drawn is said to be a guess, and that is undone. */
async function doubtShadow(page, seen) {
  const look = async () => [await page.isChecked("#guess"), await page.locator("#pad .guess").count()];
  seen.guess = [await look()];
  await restated(page, "shadow", () => page.check("#guess"));
  seen.guess.push(lastAsked(page, "shadow"), await look());
  await page.click("#undo");
  seen.guess.push(await look());
}

/** Each other kind of shadow once, and what the service is asked then; all of them taken away by one button. */
async function drawOtherShadows(page, seen) {
  const gestures = {
    "Shadow, and what throws its tip": [[[0.82, 0.96], [0.62, 0.83]], [[0.76, 0.1]]],
    "Shadow of my camera or hands": [[[0.3, 0.97]]],
    "Shadow of my head": [[[0.35, 0.95]]],
    "Shadow without a foot": [[[0.5, 0.9], [0.7, 0.98]]],
    "Shadow on a wall, post or trunk": [[[0.2, 0.5], [0.28, 0.5]]],
  };
  seen.otherShadows = [];
  for (const [label, strokes] of Object.entries(gestures)) {
    await page.selectOption("#kinds", { label });
    const at = await picture(page);
    await restated(page, "shadow", async () => {
      for (const [from, to = from] of strokes) {
        await page.mouse.move(...at(...from));
        await page.mouse.down();
        await page.mouse.move(...at(...to), { steps: 2 });
        await page.mouse.up();
      }
    });
    seen.otherShadows.push(lastAsked(page, "shadow"));
    if (label.includes("wall")) await drawBorder(page, seen);
    await stated(page, () => page.click("#drawn button"), 0);
  }
}

/** The border of the lit side that was drawn last, by one tap, and the sun that follows while an end of it is dragged. */
async function drawBorder(page, seen) {
  let at = await picture(page);
  await restated(page, "shadow", () => page.mouse.click(...at(0.25, 0.5)));
  at = await picture(page); // which another answer may have moved
  seen.border = [lastAsked(page, "shadow"), await direction(page), await page.isHidden("#guess-label")];
  await page.mouse.move(...at(0.25, 0.5));
  await page.mouse.down();
  await page.mouse.move(...at(0.21, 0.5), { steps: 3 });
  seen.border.push(await direction(page));
  await restated(page, "shadow", () => page.mouse.up());
  seen.border.push(lastAsked(page, "shadow"));
  await page.click("#undo");
  await page.click("#undo");
}

/** The estimated horizon dragged as a whole, by one end, and by keys: what the page shows meanwhile, and each undone at once. */
async function dragHorizon(page, seen) {
  await page.locator("#tools label", { hasText: "horizon" }).click();
  const grip = (i) => page.locator("#grips > *").nth(i);
  seen.grips = await page.locator("#grips > *").evaluateAll((grips) => grips.map(({ ariaLabel }) => ariaLabel));
  const line = () => page.locator("#marks path.line").getAttribute("d");
  const [before, at] = [await line(), await picture(page)];
  await page.mouse.move(...at(0.5, 0.3));
  await page.mouse.down();
  await page.mouse.move(...at(0.5, 0.4), { steps: 3 });
  await page.waitForFunction((d) => document.querySelector("#marks path.line").getAttribute("d") !== d, before);
  seen.dragged = [await page.isVisible("#loupe"), asked(page, "horizon").length];
  await stated(page, () => page.mouse.up(), 2);
  seen.horizons = [lastAsked(page, "horizon")];
  const { x, y, width, height } = await grip(2).boundingBox();
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  await page.mouse.move(x + width / 2, y + height / 2 - 40, { steps: 3 });
  await restated(page, "horizon", () => page.mouse.up());
  seen.horizons.push(lastAsked(page, "horizon"));
  await grip(0).focus();
  await restated(page, "horizon", async () => {
    for (let i = 0; i < 5; i++) await page.keyboard.press("Shift+ArrowDown");
  });
  seen.horizons.push(lastAsked(page, "horizon"));
  seen.focused = await page.evaluate(() => document.activeElement.ariaLabel);
  const drawn = () => page.locator("#drawn button").count();
  for (let i = 0; i < 3; i++) await page.click("#undo");
  seen.horizonUndone = [await drawn()];
  for (let i = 0; i < 3; i++) await page.click("#redo");
  seen.horizonUndone.push(await drawn());
}

/** Two upright edges, an end of one of them dragged, and two level edges. */
async function drawEdges(page, seen) {
  await page.selectOption("#kinds", { label: "Upright edges" });
  seen.cameras = [];
  const noteCamera = async () => seen.cameras.push(await page.locator("#marks path.line").getAttribute("d"));
  const drawTo = async (from, to) => {
    const at = await picture(page);
    await noteCamera();
    await page.mouse.move(...at(...from));
    await page.mouse.down();
    await page.mouse.move(...at(...to), { steps: 3 });
    await page.waitForTimeout(100);
    await noteCamera();
    await page.mouse.up();
  };
  for (const right of [0.05, 0.77]) await restated(page, "vertical", () => drawTo([right, 0.95], [right, 0.2]));
  await noteCamera();
  seen.upright = [
    await page.locator("#drawn button").allTextContents(),
    lastAsked(page, "vertical"),
    await page.textContent("#evidence"),
  ];
  await restated(page, "vertical", () => drawTo([0.77, 0.2], [0.74, 0.2]));
  seen.upright.push(lastAsked(page, "vertical"));
  await page.selectOption("#kinds", { label: "Level edges" });
  await drawTo([0.98, 0.28], [0.73, 0.42]);
  seen.level = [await page.textContent("#tool-help")];
  await restated(page, "vertical", () => drawTo([0.98, 0.38], [0.73, 0.46]));
  seen.level.push(lastAsked(page, "vertical"));
}

const asked = (page, name) => page.requests.filter((address) => new URL(address).searchParams.has(name));
const lastAsked = (page, name) => new URL(asked(page, name).at(-1)).searchParams.get(name);

/** Does something and waits until the service has answered what is said of `name` then. */
async function restated(page, name, act) {
  const [answer] = await Promise.all([
    page.waitForResponse((one) => one.url().includes("v1/lighting") && new URL(one.url()).searchParams.has(name)),
    act(),
  ]);
  await answer.finished();
  await page.waitForSelector("#result[aria-busy=false]");
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

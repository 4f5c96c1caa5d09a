// The object on the stage: a slow drag is one step; an own object is as high as it stands.
import { drag } from "./steps.mjs";
import { open, relit } from "./visit.mjs";

export async function visitStage(browser, url, seen, { small, model }) {
  const page = await open(browser, url, seen, { width: 360, height: 900 });
  await relit(page, () => page.setInputFiles("#file", small));
  await page.waitForSelector("#stage:not([hidden])");
  await page.evaluate(() => document.getElementById("frame").scrollIntoView({ block: "center" }));
  const { x, y, width, height } = await page.locator("#stage").boundingBox();
  const at = (right) => [x + right * width, y + 0.6 * height];
  const turn = () => page.inputValue("#object-turn");
  seen.turns = [await turn()];
  await drag(page, [at(0.3), at(0.4), at(0.6)]);
  seen.turns.push(await turn());
  await page.keyboard.press("Control+z");
  seen.turns.push(await turn(), await page.isEnabled("#undo"));
  seen.heights = [await high(page)];
  await page.setInputFiles("#model-file", model);
  await page.waitForSelector('#shapes input[value="own"]:checked');
  seen.heights.push(await high(page));
  await page.context().close();
}

/** Centimetres that the page states, and those of the sphere of that radius. */
async function high(page) {
  const words = await page.textContent("#object-where");
  const [, value, unit] = /^([\d.]+)\s(cm|m) high/.exec(words);
  return [Number(value) * (unit === "m" ? 100 : 1), 200 * 2 ** Number(await page.inputValue("#object-size"))];
}

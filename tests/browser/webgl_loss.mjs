// The object where its script is not loaded, and where the browser takes the canvas's memory and gives it back.
import { expectFailures, open, relit, rested, screenshotOf } from "./visit.mjs";

const SIZE = { width: 360, height: 800 };

export async function visit(browser, url, seen, { photo, folder }) {
  await loseTheScript(browser, url, seen, photo);
  await loseTheMemory(browser, url, seen, photo, folder);
  expectFailures(seen);
}

async function loseTheScript(browser, url, seen, photo) {
  const page = await open(browser, url, seen, SIZE);
  await page.route("**/assets/stage*.js", (route) => route.abort());
  await relit(page, () => page.setInputFiles("#file", photo));
  await page.waitForFunction(() => !/^Loading/.test(document.getElementById("scene-note").textContent));
  seen.sceneNote = await page.textContent("#scene-note");
  await page.context().close();
}

async function loseTheMemory(browser, url, seen, photo, folder) {
  const page = await open(browser, url, seen, SIZE);
  await Promise.all([rested(page), page.setInputFiles("#file", photo)]);
  await page.waitForSelector("#stage:not([hidden])");
  await page.waitForTimeout(500);
  await screenshotOf(page, `${folder}/lit.png`);
  await page.evaluate(() => {
    globalThis.loss = document.getElementById("stage").getContext("webgl2").getExtension("WEBGL_lose_context");
    globalThis.loss.loseContext();
  });
  await page.waitForFunction(() => getComputedStyle(document.getElementById("stage")).visibility === "hidden", null, {
    timeout: 10_000,
  });
  const gone = await screenshotOf(page, `${folder}/gone.png`);
  await page.evaluate(() => globalThis.loss.restoreContext());
  await page.waitForFunction(() => getComputedStyle(document.getElementById("stage")).visibility === "visible");
  await screenshotOf(page, `${folder}/back.png`, gone);
  await page.context().close();
}

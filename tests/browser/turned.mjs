// Several photos, of which the first two overlap: how they are turned, in words.
import { open, saved } from "./visit.mjs";

export async function visitTurned(browser, url, seen, { turned, folder }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await page.setInputFiles("#file", turned);
  await page.waitForSelector("#photos:not([hidden])");
  seen.turned = [];
  for (const [index] of turned.entries()) {
    const button = page.locator("#photos button").nth(index);
    await button.click();
    const numbers = Object.fromEntries(
      await page.locator("#numbers > div").evaluateAll((rows) =>
        rows.map((row) => [row.querySelector("dt").textContent, row.querySelector("dd").firstChild.textContent]),
      ),
    );
    seen.turned.push({
      button: await page.locator("#photos button").nth(index).textContent(),
      said: (await page.isVisible("#rotation")) ? await page.textContent("#rotation") : "",
      title: await page.textContent("#title"),
      numbers,
    });
  }
  await page.locator("#photos button").first().click();
  await saved(page, "#get-json", folder, "first.json");
  await saved(page, "#get-exr", folder, "first.exr");
  await saved(page, "#get-mitsuba", folder, "first.zip");
  await page.setInputFiles("#file", turned[0]);
  await page.waitForSelector("#photos", { state: "hidden" });
  seen.turnedAlone = await page.isVisible("#rotation");
  await page.context().close();
  seen.promises = [await promise(browser, url, seen, true), await promise(browser, url, seen, false)];
}

/** What the page promises of several photos where the service says whether it matches them. */
async function promise(browser, url, seen, matching) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  await page.route("**/v1/model", (route) => route.fulfill({ json: { accuracy: {}, matching, scene_tools: [], map_formats: [] } }));
  await page.reload({ waitUntil: "networkidle" });
  const words = await page.textContent("#drop");
  await page.context().close();
  return words.replaceAll(/\s+/g, " ");
}

// Several photos: answered together, rotated by what they show in common, with files of the common light.
import { copied, downloaded, open, relit, saved } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { photo, dated, overlapping, folder }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await estimateTogether(page, seen, [photo, dated], folder);
  await rotate(page, seen, overlapping, folder);
  await page.context().close();
  seen.promises = [await promise(browser, url, seen, true), await promise(browser, url, seen, false)];
}

async function estimateTogether(page, seen, photos, folder) {
  await relit(page, () => page.setInputFiles("#file", photos));
  seen.together = await page.locator("#photos button").allTextContents();
  seen.evidence = await page.textContent("#evidence");
  await relit(page, () => page.locator("#photos button").nth(1).click());
  seen.second = [
    await page.getAttribute("#photo", "alt"),
    await page.getAttribute("#photos li:nth-child(2) button", "aria-pressed"),
  ];
  await saved(page, "#get-json", folder, "together.json");
  await downloaded(page, "exr", folder, "together.exr");
  seen.copies = [await copied(page, "curl"), await copied(page, "python")];
  seen.copyShown = [await page.isVisible("#snippet")];
  await relit(page, () => page.locator("#photos button").first().click());
  seen.copyShown.push(await page.isVisible("#snippet"));
}

/** Photos of which the first two overlap: how they are rotated against each other. */
async function rotate(page, seen, photos, folder) {
  await page.setInputFiles("#file", photos);
  await page.waitForFunction((count) => document.querySelectorAll("#photos button").length === count, photos.length);
  seen.rotated = [];
  for (const [index] of photos.entries()) {
    const button = page.locator("#photos button").nth(index);
    await button.click();
    const numbers = Object.fromEntries(
      await page.locator("#numbers > div").evaluateAll((rows) =>
        rows.map((row) => [row.querySelector("dt").textContent, row.querySelector("dd").firstChild.textContent]),
      ),
    );
    seen.rotated.push({
      button: await page.locator("#photos button").nth(index).textContent(),
      sentence: (await page.isVisible("#rotation")) ? await page.textContent("#rotation") : "",
      numbers,
    });
  }
  await page.locator("#photos button").first().click();
  await saved(page, "#get-json", folder, "first.json");
  await downloaded(page, "exr", folder, "first.exr");
  await downloaded(page, "mitsuba", folder, "first.zip");
  await page.setInputFiles("#file", photos[0]);
  await page.waitForSelector("#photos", { state: "hidden" });
  seen.rotatedAlone = await page.isVisible("#rotation");
}

/** What the page promises of several photos where the service states whether it matches them. */
async function promise(browser, url, seen, matching) {
  const page = await open(browser, url, seen, { width: 360, height: 800 }, { flat: true });
  const json = { accuracy: {}, matching, scene_tools: [], map_formats: [] };
  await page.route("**/v1/model", (route) => route.fulfill({ json }));
  await page.reload({ waitUntil: "networkidle" });
  const text = await page.textContent(".several-help p");
  await page.context().close();
  return text.replaceAll(/\s+/g, " ");
}

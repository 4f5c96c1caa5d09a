// Several photos: a table in which each opens as one; answered together, rotated by what they show in common.
import { copied, downloaded, expectFailures, faults, open, relit, saved } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { photo, street, textFile, dated, overlapping, folder }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await listed(page, seen, [textFile, street, photo]);
  await estimateTogether(page, seen, [photo, dated], folder);
  await rotate(page, seen, overlapping, folder);
  await page.context().close();
  seen.promises = [await promise(browser, url, seen, true), await promise(browser, url, seen, false)];
}

/** Three files in the table; the edits of one outlive a look at another. */
async function listed(page, seen, files) {
  await relit(page, () => page.setInputFiles("#file", files));
  await page.waitForFunction(() => document.querySelector("#table-rows tr:last-child .trust"));
  const rows = () =>
    page.locator("#table-rows tr").evaluateAll((lines) => lines.map(({ cells }) => [...cells].slice(1).map((cell) => cell.textContent)));
  const open = (number) => page.locator("#table-rows button").nth(number).click();
  const shown = async () => [await page.getAttribute("#photo", "alt"), await page.inputValue("#sun_azimuth")];
  seen.table = await rows();
  seen.opened = [await shown()];
  await relit(page, () => page.focus("#sun_azimuth").then(() => page.keyboard.press("Home")));
  await relit(page, () => open(2));
  seen.opened.push(await shown());
  await relit(page, () => open(1));
  seen.opened.push(await shown());
  seen.asked = page.requests.filter((address) => address.includes("v1/lighting")).length;
  seen.faults = await faults(page);
  expectFailures(seen); // of what is no photo
}

/** Lists photos, then asks for them together. */
async function together(page, photos) {
  await page.setInputFiles("#file", photos);
  await page.click("#together");
  await page.waitForFunction((count) => document.querySelectorAll("#photos button").length === count, photos.length);
}

async function estimateTogether(page, seen, photos, folder) {
  await relit(page, () => together(page, photos));
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
  await together(page, photos);
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
  const json = { accuracy: {}, matching, scene_labels: {}, map_formats: [] };
  await page.route("**/v1/model", (route) => route.fulfill({ json }));
  await page.reload({ waitUntil: "networkidle" });
  const text = await page.textContent(".several-help p");
  await page.context().close();
  return text.replaceAll(/\s+/g, " ");
}

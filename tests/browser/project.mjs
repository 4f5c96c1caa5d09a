// A project: saved, opened on its photo and on another one; a link with the edits, which opens an example; undo and redo of answers.
import { open, refused, relit, saved } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { street, photo, folder }) {
  const page = await open(browser, url, seen, { width: 1000, height: 900 }, { flat: true });
  const azimuth = () => page.inputValue("#sun_azimuth");
  await relit(page, () => page.setInputFiles("#file", street));
  await page.click("#correct summary");
  await relit(page, () => page.fill("#input-camera_height", "3").then(() => submit(page)));
  seen.restated = [await page.inputValue("#input-camera_height")];
  await relit(page, () => page.focus("#sun_azimuth").then(() => page.keyboard.press("Home")));
  seen.name = await saved(page, "#save-project", folder, "street.project.json");
  await page.click("#copy-link");
  await page.waitForFunction(() => document.getElementById("copied").textContent);
  seen.copied = [await page.textContent("#copied"), await page.evaluate(() => navigator.clipboard.readText())];
  const before = page.requests.length;
  for (const button of ["#undo", "#undo", "#redo", "#redo"]) {
    await page.click(button);
    seen.restated.push(await page.inputValue("#input-camera_height"));
  }
  seen.asked = page.requests.slice(before).filter((address) => address.includes("v1/lighting"));
  seen.azimuths = [await azimuth()];

  await relit(page, () => page.click("#reset"));
  await relit(page, () => page.setInputFiles("#project-file", `${folder}/street.project.json`));
  await page.waitForFunction(() => document.getElementById("sun_azimuth").value === "-180");
  seen.azimuths.push(await azimuth());
  await relit(page, () => page.setInputFiles("#file", photo));
  await page.waitForFunction(() => /railway/.test(document.getElementById("photo").alt)); // the light before may come late
  seen.refused = [await refused(page, () => page.setInputFiles("#project-file", `${folder}/street.project.json`))];
  await relit(page, () => page.setInputFiles("#file", street));
  await page.waitForFunction(() => document.getElementById("sun_azimuth").value === "-180");
  seen.azimuths.push(await azimuth());
  const record = { name: "record.json", mimeType: "application/json", buffer: Buffer.from('{"sun":{}}') };
  seen.refused.push(await refused(page, () => page.setInputFiles("#project-file", record)));
  await page.context().close();
  await follow(browser, seen);
}

const submit = (page) => page.click("#user-input button[type=submit]");

/** The link in a browser that knows nothing yet: it is of an example. */
async function follow(browser, seen) {
  const page = await open(browser, seen.copied[1], seen, { width: 1000, height: 900 }, { flat: true });
  await page.waitForFunction(() => document.getElementById("sun_azimuth").value === "-180");
  seen.followed = [await page.getAttribute("#photo", "alt"), await page.inputValue("#input-camera_height")];
  seen.sent = page.requests.filter((address) => address.includes("edits"));
  await page.context().close();
}

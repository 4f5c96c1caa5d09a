// What follows a refusal: another try with the photo on show, another key, an example, an object of one's own.
import { open, PATIENCE, relit } from "./visit.mjs";

export async function visitAgain(browser, url, seen, { photo, textFile, model }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  await askForKey(page, seen, photo);
  await missExamples(page, seen);
  await estimateAgain(page, seen, textFile);
  await refused(page, () => page.setInputFiles("#file", textFile));
  await page.setInputFiles("#model-file", model);
  await page.waitForSelector('#shapes input[value="own"]:checked');
  seen.errorAfterModel = await page.isVisible("#error");
  await bringNoFile(page, seen);
  seen.complaints = seen.complaints.filter((words) => !/Failed to load resource/.test(words)); // the refusals
  await page.context().close();
}

async function refused(page, act) {
  await act();
  await page.waitForSelector("#error:not([hidden])");
  return page.textContent("#error");
}

/** A service that wants a key, as far as the page can tell. */
async function askForKey(page, seen, photo) {
  const sent = [];
  await page.route("**/v1/lighting?*", async (route) => {
    const key = await route.request().headerValue("authorization");
    sent.push(key);
    if (key) return route.continue();
    return route.fulfill({ status: 401, json: { title: "An API key is needed", detail: "Send one." } });
  });
  await refused(page, () => page.setInputFiles("#file", photo));
  await page.fill("#key", "“key”");
  await page.click("#key-form button");
  seen.badKey = {
    form: await page.isVisible("#key-form"),
    words: await page.textContent("#key-note:not([hidden])"),
    stored: await page.evaluate(() => sessionStorage.length),
  };
  await page.fill("#key", "key");
  await relit(page, () => page.click("#key-form button"));
  seen.sentKeys = sent;
  await page.unroute("**/v1/lighting?*");
}

/** Examples that the service does not give. */
async function missExamples(page, seen) {
  const answers = [(route) => route.abort(), (route) => route.fulfill({ status: 503, body: "<p>busy</p>" })];
  seen.missing = [];
  for (const answer of answers) {
    await page.evaluate(() => document.getElementById("error").replaceChildren());
    await page.route("**/assets/*.jpg", answer);
    await page.locator("#examples button").first().click();
    await page.waitForFunction(() => document.getElementById("error").textContent, null, { timeout: PATIENCE });
    seen.missing.push(await page.textContent("#error"));
    await page.unroute("**/assets/*.jpg");
  }
}

/** Both buttons that ask again, each after a file that was refused. */
async function estimateAgain(page, seen, textFile) {
  seen.again = [];
  await page.click("summary");
  await page.fill("#input-fov", "50");
  for (const button of ["#user-input button[type=submit]", "#forget"]) {
    await refused(page, () => page.setInputFiles("#file", textFile));
    await page.click(button);
    await page.waitForSelector("#error[hidden]", { state: "attached" });
    await page.waitForFunction(() => !document.body.hasAttribute("data-busy"));
    seen.again.push([await page.getAttribute("#photo", "alt"), await page.isVisible("#error")]);
  }
}

/** Text that is dropped on the page, on a field for text, and pasted; and an example that is dragged to where photos go. */
async function bringNoFile(page, seen) {
  const drop = (target) => page.evaluate(dropText, target);
  seen.noFile = [await refused(page, () => drop("body"))];
  await relit(page, () => page.locator("#turbidity").press("ArrowRight"));
  seen.textInField = [await drop("#input-lat"), await page.isVisible("#error")];
  seen.noFile.push(await refused(page, () => page.evaluate(pasteText)));
  await interrupt(page, seen);
}

/** An example that is dragged to where photos go, and text that is pasted while it is being looked at. */
async function interrupt(page, seen) {
  let answer;
  const late = new Promise((resolve) => {
    answer = resolve;
  });
  await page.route("**/v1/lighting?*", (route) => late.then(() => route.continue()));
  await page.locator("#examples img").nth(1).dragTo(page.locator("#drop"));
  await page.waitForSelector("body[data-busy]");
  await refused(page, () => page.evaluate(pasteText));
  seen.meanwhile = [await page.textContent("#status"), await page.getAttribute("body", "data-busy")];
  await relit(page, answer);
  seen.dragged = [await page.getAttribute("#photo", "alt"), await page.isVisible("#error")];
  await page.unroute("**/v1/lighting?*");
}

/** Returns whether the browser is left to put the text there. */
function dropText(target) {
  const dataTransfer = new DataTransfer();
  dataTransfer.setData("text/plain", "48.1");
  const event = new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true });
  return document.querySelector(target).dispatchEvent(event);
}

function pasteText() {
  const clipboardData = new DataTransfer();
  clipboardData.setData("text/plain", "https://example.com/photo.jpg");
  document.body.dispatchEvent(new ClipboardEvent("paste", { clipboardData, bubbles: true }));
}

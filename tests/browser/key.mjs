// A service that wants a key, as far as the page can tell.
import { expectFailures, open, refused, relit } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { photo }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  seen.sentKeys = [];
  await page.route("**/v1/lighting?*", async (route) => {
    const key = await route.request().headerValue("authorization");
    seen.sentKeys.push(key);
    if (key) return route.continue();
    return route.fulfill({ status: 401, json: { title: "An API key is needed", detail: "Send one." } });
  });
  await refused(page, () => page.setInputFiles("#file", photo));
  await page.fill("#key", "“key”");
  await page.click("#key-form button");
  seen.badKey = {
    form: await page.isVisible("#key-form"),
    note: await page.textContent("#key-note:not([hidden])"),
    stored: await page.evaluate(() => sessionStorage.length),
  };
  await page.fill("#key", "key");
  await relit(page, () => page.click("#key-form button"));
  expectFailures(seen);
  await page.context().close();
}

// One photo in every format: what it says, and which way up it is shown.
import { answering, open, relit } from "./visit.mjs";

export async function visitFormats(browser, url, seen, { formats, upright, small }) {
  const page = await open(browser, url, seen, { width: 1000, height: 800 }, { flat: true });
  seen.facts = {};
  for (const [name, file] of Object.entries(formats)) {
    await relit(page, () => page.setInputFiles("#file", file));
    seen.facts[name] = await facts(page);
  }
  seen.upright = {};
  for (const [name, file] of Object.entries(upright)) {
    await relit(page, () => page.setInputFiles("#file", file));
    seen.upright[name] = await page.evaluate(() => {
      const { naturalWidth, naturalHeight } = document.getElementById("photo");
      return [naturalWidth, naturalHeight, document.getElementById("frame").style.getPropertyValue("--aspect")];
    });
  }
  const evidence = ["pixels", "time+place", "focal length"];
  await answering(page, url, small, (record) => ({ ...record, evidence }));
  await relit(page, () => page.setInputFiles("#file", small));
  seen.unread = await facts(page);
  await page.context().close();
}

const facts = (page) => page.locator("#metadata dd").allTextContents();

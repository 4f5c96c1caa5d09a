// Drives the page through what can go otherwise: node details.mjs PAGE_URL CHROMIUM FILES_AS_JSON. Prints what it saw.
import { visitAgain } from "./again.mjs";
import { visitFormats } from "./formats.mjs";
import { visitStage } from "./stage.mjs";
import { visitSteps } from "./steps.mjs";
import { launch } from "./visit.mjs";

const [url, executablePath, files] = process.argv.slice(2);
const seen = { complaints: [], seconds: {} };
const browser = await launch(executablePath);
try {
  for (const visit of [visitFormats, visitAgain, visitSteps, visitStage]) {
    const began = Date.now();
    await visit(browser, url, seen, JSON.parse(files));
    seen.seconds[visit.name] = (Date.now() - began) / 1000;
  }
} finally {
  await browser.close();
}
console.log(JSON.stringify(seen));

// Visits one feature of the page in Chromium: node run.mjs PAGE_URL CHROMIUM FEATURE FILES_AS_JSON. Prints what it saw as JSON.
import { launch } from "./visit.mjs";

const [url, executablePath, feature, files] = process.argv.slice(2);
const { visit, flat = false } = await import(`./${feature}.mjs`);
const seen = { complaints: [] };
const browser = await launch(executablePath, flat);
try {
  await visit(browser, url, seen, JSON.parse(files));
} finally {
  await browser.close();
}
console.log(JSON.stringify(seen));

// The reference of the API at /docs: what axe-core finds, and a first answer without a line of code.
import { faults, open } from "./visit.mjs";

export const flat = true; // no page of it has WebGL

export async function visit(browser, url, seen, { small }) {
  const page = await open(browser, `${url}docs`, seen, { width: 390, height: 844 });
  const operation = page.locator("#operations-lighting-estimate_lighting");
  await operation.locator(".opblock-summary-control").waitFor();
  seen.faults = await faults(page);
  await operation.locator(".opblock-summary-control").click();
  await operation.locator("input[type=file]").setInputFiles(small);
  await operation.locator("button.execute").click();
  seen.status = await operation.locator(".live-responses-table tbody .response-col_status").first().textContent();
  await page.context().close();
}

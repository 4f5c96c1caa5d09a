/** Links to the light on show, as files. */

import { type Estimate, envmapUrl, type Format, file, type Parameters } from "../api";
import { byId, make } from "../dom";
import { recordOf } from "../parameters";

const FORMATS: Format[] = ["exr", "hdr", "png"];

export function linkDownloads(lighting: Estimate, parameters: Parameters, photoName: string): void {
  const stem = photoName.replace(/\.\w+$/, "") || "photo";
  const height = Number(byId<HTMLSelectElement>("size").value);
  for (const format of FORMATS) link(`get-${format}`, envmapUrl(parameters, format, height), `${stem}.${format}`);
  const record = JSON.stringify(recordOf(lighting, parameters), null, 1);
  const before = byId<HTMLAnchorElement>("get-json").href;
  link("get-json", URL.createObjectURL(new Blob([record], { type: "application/json" })), `${stem}.json`);
  if (before) URL.revokeObjectURL(before);
}

/** Fetches what a link leads to: links carry no API key, say no errors, and save under the service's own name. */
export function listenForDownloads(failed: (error: unknown) => void): void {
  for (const format of FORMATS) {
    byId(`get-${format}`).addEventListener("click", (event) => {
      event.preventDefault();
      const { href, download } = event.currentTarget as HTMLAnchorElement;
      file(href).then((blob) => save(blob, download), failed);
    });
  }
}

function save(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

function link(id: string, href: string, name: string): void {
  Object.assign(byId<HTMLAnchorElement>(id), { href, download: name });
}

/** Links to the light on show, as files. */

import { envmapUrl, type Format, type Lighting, type Parameters } from "../api";
import { byId } from "../dom";
import { recordOf } from "../parameters";

const FORMATS: Format[] = ["exr", "hdr", "png"];

export function linkDownloads(lighting: Lighting, parameters: Parameters, photoName: string): void {
  const stem = photoName.replace(/\.\w+$/, "") || "photo";
  const height = Number(byId<HTMLSelectElement>("size").value);
  for (const format of FORMATS) link(`get-${format}`, envmapUrl(parameters, format, height), `${stem}.${format}`);
  const record = JSON.stringify(recordOf(lighting, parameters), null, 1);
  const before = byId<HTMLAnchorElement>("get-json").href;
  link("get-json", URL.createObjectURL(new Blob([record], { type: "application/json" })), `${stem}.json`);
  if (before) URL.revokeObjectURL(before);
}

function link(id: string, href: string, name: string): void {
  Object.assign(byId<HTMLAnchorElement>(id), { href, download: name });
}

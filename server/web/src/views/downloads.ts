/** The light on show, as files. They are fetched: links carry no API key and say no errors. */

import { type Changed, envmapFile, type Format, previewFile, sceneFile, TOOLS, type Tool } from "../api";
import { byId, make } from "../dom";
import { commonCamera, isSame, parametersOf, recordOf, statedLight } from "../parameters";
import { lookOf, type Shown, type View } from "../studio";

type Get = (view: View, shown: Shown) => Promise<Blob>;

const FORMATS: Format[] = ["exr", "hdr", "png"];
const CHANGED = "The preview shows the estimate; the light was changed. Reset brings the estimate back.";
const TOGETHER = "The preview shows the estimate from one photo alone; these photos were estimated together.";

/** Listens to the buttons; `on` gives what is shown when one is pressed. */
export function listenForDownloads(on: () => Promise<Shown | undefined>, failed: (error: unknown) => void): void {
  const listen = (id: string, suffix: string, get: Get): void => {
    const button = byId<HTMLButtonElement>(id);
    button.addEventListener("click", async () => {
      const shown = await on();
      const view = shown?.views[shown.at];
      if (!shown || !view) return;
      button.setAttribute("aria-busy", "true");
      const stem = view.photo.file.name.replace(/\.\w+$/, "") || "photo";
      await get(view, shown).then((blob) => save(blob, `${stem}${suffix}`), failed);
      button.removeAttribute("aria-busy");
    });
  };
  for (const format of FORMATS) listen(`get-${format}`, `.${format}`, (view, shown) => mapOf(view, shown, format));
  for (const tool of TOOLS) listen(`get-${tool}`, `-${tool}.zip`, (view, shown) => sceneOf(view, shown, tool));
  listen("get-json", ".json", recordFile);
  listen("get-preview", "-preview.png", ({ photo }, { given }) => previewFile(photo.file, given));
}

export const mapHeight = (): number => Number(byId<HTMLSelectElement>("size").value);

/** Whether the light on show is another than the service gives for this photo alone. */
export const isChanged = (view: View): boolean => !isSame(lookOf(view).parameters, parametersOf(view.answer));

function mapOf(view: View, shown: Shown, format: Format): Promise<Blob> {
  return envmapFile(view.photo.file, shown.given, { format, height: mapHeight() }, changedLight(view, shown));
}

function sceneOf(view: View, shown: Shown, tool: Tool): Promise<Blob> {
  return sceneFile(view.photo.file, shown.given, tool, changedLight(view, shown));
}

/**
 * The light on show where the service would not give the same for this photo alone; of photos estimated together it
 * knows neither sun nor sky nor camera. Its power is that of a settled sky.
 */
export function changedLight(view: View, { views }: Shown): Changed | undefined {
  const { parameters } = lookOf(view);
  if (views.length > 1) return { ...statedLight(view.answer, parameters, view.power), ...commonCamera(view.answer) };
  return isChanged(view) ? parameters : undefined;
}

/** The preview is of the estimate from one photo alone: it is offered while that is the light on show. */
export function showPreview(view: View, shown: Shown): void {
  const refused = changedLight(view, shown) !== undefined;
  byId<HTMLButtonElement>("get-preview").disabled = refused;
  const note = byId("preview-note");
  note.hidden = !refused;
  note.textContent = refused ? (shown.views.length > 1 ? TOGETHER : CHANGED) : "";
}

async function recordFile(view: View): Promise<Blob> {
  const record = recordOf(view.answer, lookOf(view).parameters, view.power);
  return new Blob([JSON.stringify(record, null, 1)], { type: "application/json" });
}

function save(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  make("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

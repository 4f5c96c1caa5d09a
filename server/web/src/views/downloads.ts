/** The light on show, as files and as text. Files are fetched: links carry no API key and say no errors. */

import { type Adjustments, fetchEnvmap, fetchPreview, fetchScene, type LightOverrides, type ModelInfo } from "../api";
import { byId, createElement } from "../dom";
import {
  buildRecord,
  cameraOverrides,
  currentState,
  isToned,
  overridesFromParameters,
  type PhotoView,
  parametersFromRecord,
  type Session,
  sameParameters,
  statedOverrides,
} from "../state";
import { type SnippetInput, writeCurl, writePython } from "../text/snippets";

type FetchFile = (view: PhotoView, session: Session) => Promise<Blob>;

/** What the primary button downloads: a scene for a tool, or a map. */
interface Target {
  value: string;
  label: string;
  isMap: boolean;
  suffix: string;
  fetchFile: FetchFile;
}

const TOOL_LABELS: Record<string, string> = {
  ...{ blender: "Blender", unreal: "Unreal", unity: "Unity", godot: "Godot", houdini: "Houdini", nuke: "Nuke" },
  ...{ usd: "USD", gltf: "glTF", filament: "Filament", cubemap: "Cubemap", threejs: "three.js", mitsuba: "Mitsuba" },
};
const CHOSEN_TARGET = "lighting-download-for"; // under which the browser keeps the latest one
const TONED_NOTE = "The preview cannot show your sun's color or softness. Press Reset first.";
const TOGETHER_NOTE = "No preview: these photos were estimated together, and it shows one photo's estimate.";

/** The buttons that save files; `settle` gives what is on show when one is pressed. */
export class Downloads {
  private readonly select = byId<HTMLSelectElement>("download-for");
  private targets: Target[] = [];

  constructor(
    private readonly settle: () => Promise<Session | undefined>,
    private readonly onError: (error: unknown) => void,
  ) {
    this.listen(byId("get-json"), () => ({ suffix: ".json", fetchFile: createRecordFile }));
    this.listen(byId("get-preview"), () => ({
      suffix: "-preview.png",
      fetchFile: (view, { userInput }) => fetchPreview(view.photo.file, userInput, adjustmentsOf(view)),
    }));
    this.listen(byId("download"), () => this.targets.find(({ value }) => value === this.select.value));
    this.select.addEventListener("change", () => {
      localStorage.setItem(CHOSEN_TARGET, this.select.value);
      this.nameButton();
    });
  }

  /** Offers each tool of a scene and each format of a map that the service has. */
  offer({ map_formats, scene_tools }: Pick<ModelInfo, "map_formats" | "scene_tools">): void {
    if (this.targets.length) return;
    this.targets = [...scene_tools.map(sceneTarget), ...map_formats.map(mapTarget)];
    this.select.replaceChildren(
      ...this.targets.map(({ value, label }) => createElement("option", { value, textContent: label })),
    );
    const chosen = localStorage.getItem(CHOSEN_TARGET);
    if (this.targets.some(({ value }) => value === chosen)) this.select.value = chosen ?? "";
    this.nameButton();
  }

  /** The button says what it will do: "Download for Blender", "Download map (.exr)". */
  private nameButton(): void {
    const chosen = this.targets.find(({ value }) => value === this.select.value);
    byId("download").textContent = chosen ? `Download ${chosen.isMap ? "" : "for "}${chosen.label}` : "Download";
  }

  private listen(button: HTMLElement, target: () => Pick<Target, "suffix" | "fetchFile"> | undefined): void {
    button.addEventListener("click", async () => {
      const session = await this.settle();
      const view = session?.views[session.index];
      const wanted = target();
      if (!session || !view || !wanted) return;
      const name = `${view.photo.file.name.replace(/\.\w+$/, "") || "photo"}${wanted.suffix}`;
      button.setAttribute("aria-busy", "true");
      byId("saved").textContent = `Making ${name}…`;
      try {
        const blob = await wanted.fetchFile(view, session);
        saveFile(blob, name);
        byId("saved").textContent = `Saved ${name} (${formatSize(blob.size)}).`;
      } catch (error) {
        byId("saved").textContent = "";
        this.onError(error);
      }
      button.removeAttribute("aria-busy");
    });
  }
}

const sceneTarget = (tool: string): Target => ({
  value: tool,
  label: TOOL_LABELS[tool] ?? tool,
  isMap: false,
  suffix: `-${tool}.zip`,
  fetchFile: (view, session) => fetchSceneOf(view, session, tool),
});

const mapTarget = (format: string): Target => ({
  value: format,
  label: `map (.${format})`,
  isMap: true,
  suffix: `.${format}`,
  fetchFile: (view, session) => fetchMap(view, session, format),
});

const formatSize = (bytes: number): string =>
  bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))}\u00a0kB` : `${(bytes / 1e6).toFixed(1)}\u00a0MB`;

export const mapHeight = (): number => Number(byId<HTMLSelectElement>("size").value);

/** Whether the light on show is another than the service gives for this photo alone. */
export const isChanged = (view: PhotoView): boolean =>
  !sameParameters(currentState(view).parameters, parametersFromRecord(view.estimate));

function fetchMap(view: PhotoView, session: Session, format: string): Promise<Blob> {
  return fetchEnvmap(
    view.photo.file,
    session.userInput,
    { format, height: mapHeight() },
    lightOverrides(view, session),
  );
}

function fetchSceneOf(view: PhotoView, session: Session, tool: string): Promise<Blob> {
  return fetchScene(view.photo.file, session.userInput, tool, lightOverrides(view, session));
}

/**
 * The light on show where the service would not give the same for this photo alone; of photos estimated together it
 * knows neither sun nor sky nor camera. Its irradiances are those of a settled sky.
 */
export function lightOverrides(view: PhotoView, { views }: Session): LightOverrides | undefined {
  const { parameters } = currentState(view);
  if (views.length > 1)
    return { ...statedOverrides(view.estimate, parameters, view.irradiances), ...cameraOverrides(view.estimate) };
  if (isToned(parameters)) return statedOverrides(view.estimate, parameters, view.irradiances);
  return isChanged(view) ? overridesFromParameters(parameters) : undefined;
}

/** What the light on show changes of the estimate. */
function adjustmentsOf(view: PhotoView): Adjustments | undefined {
  if (!isChanged(view)) return undefined;
  const { sun, sun_azimuth, sun_elevation, exposure, turbidity } = currentState(view).parameters;
  return {
    sun: sun && [sun_azimuth, sun_elevation],
    exposure: Math.log2(exposure / view.estimate.sky.exposure),
    haze: turbidity,
  };
}

/** The preview is of one photo alone, whose sun has the estimate's color and softness. */
export function offerPreview(view: PhotoView, session: Session): void {
  const note = session.views.length > 1 ? TOGETHER_NOTE : isToned(currentState(view).parameters) ? TONED_NOTE : "";
  byId<HTMLButtonElement>("get-preview").disabled = note !== "";
  byId("preview-note").hidden = note === "";
  byId("preview-note").textContent = note;
}

async function createRecordFile(view: PhotoView): Promise<Blob> {
  const record = buildRecord(view.estimate, currentState(view).parameters, view.irradiances);
  return new Blob([JSON.stringify(record, null, 1)], { type: "application/json" });
}

function saveFile(blob: Blob, name: string): void {
  const url = URL.createObjectURL(blob);
  createElement("a", { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 10_000);
}

const SNIPPETS = { curl: writeCurl, python: writePython } as const;
type SnippetKind = keyof typeof SNIPPETS;

export function listenForCopies(createInput: () => Promise<SnippetInput | undefined>): void {
  byId("size").addEventListener("change", hideSnippet);
  for (const kind of Object.keys(SNIPPETS) as SnippetKind[]) {
    byId(`copy-${kind}`).addEventListener("click", async () => {
      const input = await createInput();
      if (input) copySnippet(SNIPPETS[kind](input), kind);
    });
  }
}

/** Takes a copied text away once another light, photo or size is on show. */
export function hideSnippet(): void {
  byId("snippet-box").hidden = true;
}

async function copySnippet(text: string, kind: SnippetKind): Promise<void> {
  const box = byId<HTMLTextAreaElement>("snippet");
  box.value = text;
  byId("snippet-box").hidden = false;
  const name = kind === "curl" ? "The curl command" : "The Python program";
  try {
    await navigator.clipboard.writeText(text);
    byId("copied").textContent = `${name} is copied.`;
  } catch {
    box.select();
    byId("copied").textContent = `${name} is selected: press Ctrl+C.`;
  }
}

/** The light on show, as files and as text. Files are fetched: links carry no API key and say no errors. */

import { type Adjustments, apiKey, fetchEnvmap, fetchPreview, fetchScene, type ModelInfo } from "../api";
import { byId, createElement } from "../dom";
import {
  buildRecord,
  currentState,
  isChanged,
  isToned,
  lightOverrides,
  type PhotoView,
  parametersFromRecord,
} from "../state";
import { buildProject, identifyPhoto, type Project, projectLink } from "../text/project";
import { type SnippetInput, writeCurl, writePython } from "../text/snippets";

type FetchFile = (view: PhotoView) => Promise<Blob>;

/** What a button saves. */
interface FileToSave {
  suffix: string; // of the photo's name
  fetchFile: FetchFile;
  hasManyTypes?: boolean; // whether the file's own type ends its name
}

/** What the primary button downloads: a scene for a tool, or a map. */
interface Target extends FileToSave {
  value: string;
  label: string;
  isMap: boolean;
}

const CHOSEN_TARGET = "lighting-download-for"; // under which the browser keeps the latest one
const TONED_NOTE = "The preview cannot show your sun's color or softness. Press Reset first.";
const TOGETHER_NOTE = "No preview: these photos were estimated together, and it shows one photo's estimate.";

/** The buttons that save files and copy text; `settle` gives what is on show when one is pressed. */
export class Downloads {
  private readonly select = byId<HTMLSelectElement>("download-for");
  private targets: Target[] = [];

  constructor(
    private readonly settle: () => Promise<PhotoView | undefined>,
    private readonly onError: (error: unknown) => void,
    drawTurntable: () => Promise<Blob>,
  ) {
    this.listen(byId("get-turntable"), () => ({ suffix: "-turntable", fetchFile: drawTurntable, hasManyTypes: true }));
    this.listen(byId("get-json"), () => ({ suffix: ".json", fetchFile: createRecordFile }));
    this.listen(byId("save-project"), () => ({ suffix: ".project.json", fetchFile: createProjectFile }));
    byId("copy-link").addEventListener("click", () => this.copyLink());
    this.listen(byId("get-preview"), () => ({
      suffix: "-preview.png",
      fetchFile: (view) => fetchPreview(view.photo.file, view.userInput, adjustmentsOf(view)),
    }));
    this.listen(byId("download"), () => this.targets.find(({ value }) => value === this.select.value));
    byId("size").addEventListener("change", hideSnippet);
    for (const kind of Object.keys(SNIPPETS) as SnippetKind[]) {
      byId(`copy-${kind}`).addEventListener("click", () => this.copy(kind));
    }
    this.select.addEventListener("change", () => {
      localStorage.setItem(CHOSEN_TARGET, this.select.value);
      this.nameButton();
    });
  }

  /** Offers each tool of a scene and each format of a map that the service has. */
  offer({ map_formats, scene_labels }: Pick<ModelInfo, "map_formats" | "scene_labels">): void {
    if (this.targets.length) return;
    this.targets = [...Object.entries(scene_labels).map(sceneTarget), ...map_formats.map(mapTarget)];
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

  private async copy(kind: SnippetKind): Promise<void> {
    const view = await this.settle();
    if (!view) return;
    const input = snippetInput(view);
    const reads = kind === "python" && input.adjustments === "record";
    copySnippet(SNIPPETS[kind](input), SNIPPET_NAMES[kind], reads ? "It reads the record: save that beside it." : "");
  }

  private async copyLink(): Promise<void> {
    const view = await this.settle();
    if (!view) return;
    const link = projectLink(await projectOf(view), location.href);
    copySnippet(
      link,
      "The link",
      `It holds your edits${view.userInput.latitude ? " and the place" : ""}, not the photo.`,
    );
  }

  private listen(button: HTMLElement, target: () => FileToSave | undefined): void {
    button.addEventListener("click", async () => {
      const view = await this.settle();
      const wanted = target();
      if (!view || !wanted) return;
      const made = `${view.photo.file.name.replace(/\.\w+$/, "") || "photo"}${wanted.suffix}`;
      button.setAttribute("aria-busy", "true");
      byId("saved").textContent = `Making ${made}…`;
      try {
        const blob = await wanted.fetchFile(view);
        const name = wanted.hasManyTypes ? `${made}.${blob.type.replace("image/", "")}` : made;
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

const sceneTarget = ([tool, label]: [string, string]): Target => ({
  value: tool,
  label,
  isMap: false,
  suffix: `-${tool}.zip`,
  fetchFile: (view) => fetchScene(view.photo.file, view.userInput, tool, lightOverrides(view)),
});

const mapTarget = (format: string): Target => ({
  value: format,
  label: `map (.${format})`,
  isMap: true,
  suffix: `.${format}`,
  fetchFile: (view) =>
    fetchEnvmap(view.photo.file, view.userInput, { format, height: mapHeight() }, lightOverrides(view)),
});

const formatSize = (bytes: number): string =>
  bytes < 1e6 ? `${Math.max(1, Math.round(bytes / 1e3))}\u00a0kB` : `${(bytes / 1e6).toFixed(1)}\u00a0MB`;

const mapHeight = (): number => Number(byId<HTMLSelectElement>("size").value);

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

/** The same without what stays as it was; "record" where more has changed. */
function changesOf(view: PhotoView): SnippetInput["adjustments"] {
  if (view.together || isToned(currentState(view).parameters)) return "record";
  const adjustments = adjustmentsOf(view);
  if (!adjustments) return undefined;
  const { sun, exposure, haze } = adjustments;
  const estimated = parametersFromRecord(view.estimate);
  const isMoved = sun && (sun[0] !== estimated.sun_azimuth || sun[1] !== estimated.sun_elevation || !estimated.sun);
  return { ...(isMoved ? { sun } : {}), exposure, ...(haze === estimated.turbidity ? {} : { haze }) };
}

/** What goes with one photo alone: the preview, and the project. The preview is of one whose sun has the estimate's color and softness. */
export function offerForOne(view: PhotoView): void {
  const note = view.together ? TOGETHER_NOTE : isToned(currentState(view).parameters) ? TONED_NOTE : "";
  byId<HTMLButtonElement>("get-preview").disabled = note !== "";
  byId("preview-note").hidden = note === "";
  byId("preview-note").textContent = note;
  for (const id of ["save-project", "copy-link"]) byId<HTMLButtonElement>(id).disabled = view.together;
}

const projectOf = async (view: PhotoView): Promise<Project> =>
  buildProject(await identifyPhoto(view.photo.file), view.userInput, currentState(view));

async function createProjectFile(view: PhotoView): Promise<Blob> {
  return new Blob([JSON.stringify(await projectOf(view), null, 1)], { type: "application/json" });
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
const SNIPPET_NAMES = { curl: "The curl command", python: "The Python program" } as const;
type SnippetKind = keyof typeof SNIPPETS;

const snippetInput = (view: PhotoView): SnippetInput => ({
  origin: new URL(".", location.href).href,
  photo: view.photo.file.name,
  userInput: view.userInput,
  overrides: lightOverrides(view),
  adjustments: changesOf(view),
  height: mapHeight(),
  keyed: apiKey() !== null,
});

/** Takes a copied text away once another light, photo or size is on show. */
export function hideSnippet(): void {
  byId("snippet-box").hidden = true;
}

/** Copies a text, and says so by its name, with what else is to be known. */
async function copySnippet(text: string, name: string, note = ""): Promise<void> {
  const box = byId<HTMLTextAreaElement>("snippet");
  box.value = text;
  byId("snippet-box").hidden = false;
  try {
    await navigator.clipboard.writeText(text);
    byId("copied").textContent = `${name} is copied. ${note}`.trim();
  } catch {
    box.select();
    byId("copied").textContent = `${name} is selected: press Ctrl+C. ${note}`.trim();
  }
}

/** The light on show, as files and as text. Files are fetched: links carry no API key and say no errors. */

import { fetchEnvmap, fetchPreview, fetchScene, type LightOverrides, type ModelInfo } from "../api";
import { byId, createElement } from "../dom";
import {
  buildRecord,
  cameraOverrides,
  currentState,
  type PhotoView,
  parametersFromRecord,
  type Session,
  sameParameters,
  statedOverrides,
} from "../state";
import { type SnippetInput, writeCurl, writePython } from "../text/snippets";

type FetchFile = (view: PhotoView, session: Session) => Promise<Blob>;

const TOOL_LABELS: Record<string, string> = {
  ...{ blender: "Blender", usd: "USD", gltf: "glTF", threejs: "three.js", mitsuba: "Mitsuba" },
  ...{ godot: "Godot", unreal: "Unreal", unity: "Unity" },
};
const CHANGED_NOTE = "The preview shows the estimate; the light was changed. Reset brings the estimate back.";
const TOGETHER_NOTE = "The preview shows the estimate from one photo alone; these photos were estimated together.";

/** The buttons that save files; `settle` gives what is on show when one is pressed. */
export class Downloads {
  constructor(
    private readonly settle: () => Promise<Session | undefined>,
    private readonly onError: (error: unknown) => void,
  ) {
    this.listen(byId("get-json"), ".json", createRecordFile);
    this.listen(byId("get-preview"), "-preview.png", ({ photo }, { userInput }) => fetchPreview(photo.file, userInput));
  }

  /** Adds a button for each format of a map and each tool of a scene that the service has. */
  offer({ map_formats, scene_tools }: Pick<ModelInfo, "map_formats" | "scene_tools">): void {
    for (const format of map_formats) {
      this.add("map-downloads", format, format.toUpperCase(), `.${format}`, (view, session) =>
        fetchMap(view, session, format),
      );
    }
    for (const tool of scene_tools) {
      this.add("scene-downloads", tool, TOOL_LABELS[tool] ?? tool, `-${tool}.zip`, (view, session) =>
        fetchSceneOf(view, session, tool),
      );
    }
  }

  /** A button behind those of its row, once. */
  private add(row: string, name: string, label: string, suffix: string, fetchFile: FetchFile): void {
    const id = `get-${name}`;
    if (document.getElementById(id)) return;
    const button = createElement("button", { type: "button", id, className: "button", textContent: label });
    this.listen(button, suffix, fetchFile);
    byId(row).append(button);
  }

  private listen(button: HTMLElement, suffix: string, fetchFile: FetchFile): void {
    button.addEventListener("click", async () => {
      const session = await this.settle();
      const view = session?.views[session.index];
      if (!session || !view) return;
      button.setAttribute("aria-busy", "true");
      const stem = view.photo.file.name.replace(/\.\w+$/, "") || "photo";
      await fetchFile(view, session).then((blob) => saveFile(blob, `${stem}${suffix}`), this.onError);
      button.removeAttribute("aria-busy");
    });
  }
}

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
  return isChanged(view) ? parameters : undefined;
}

/** The preview is of the estimate from one photo alone: it is offered while that is the light on show. */
export function offerPreview(view: PhotoView, session: Session): void {
  const unavailable = lightOverrides(view, session) !== undefined;
  byId<HTMLButtonElement>("get-preview").disabled = unavailable;
  const note = byId("preview-note");
  note.hidden = !unavailable;
  note.textContent = unavailable ? (session.views.length > 1 ? TOGETHER_NOTE : CHANGED_NOTE) : "";
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

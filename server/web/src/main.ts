/** The page: photos go to the service, its answers to the views, and the controls change light and object on show. */

import { estimate, type Parameters, Refusal } from "./api";
import { byId } from "./dom";
import { apiKey, keepKey } from "./key";
import { parametersOf } from "./parameters";
import { aspectOf, openPhoto, type Photo } from "./photo";
import { type Given, NOTHING } from "./pure/given";
import { headline } from "./pure/headline";
import { latest } from "./pure/latest";
import type { Subject } from "./pure/snippets";
import { SkyRenderer } from "./sky/renderer";
import { held, type Source } from "./source";
import { filesOf, type Look, lookOf, questionOf, type Shown, type View, viewOf } from "./studio";
import { Dome } from "./views/dome";
import { changedLight, isChanged, listenForDownloads, mapHeight, showPreview } from "./views/downloads";
import { FactsView } from "./views/facts";
import { gesture, listenForGestures } from "./views/gesture";
import { listenForUndo, showUndo } from "./views/history";
import { mapMarks, photoMarks } from "./views/marks";
import { showNumbers } from "./views/numbers";
import { ObjectView } from "./views/object";
import { showPhotos } from "./views/photos";
import { listenForPhotos, showMatching } from "./views/pick";
import { Sliders } from "./views/sliders";
import { forgetCopy, listenForCopies } from "./views/snippets";
import { fitted } from "./views/svg";

interface Wish {
  sources: Source[];
  given: Given;
}

let shown: Shown | undefined;
let asked: Wish | undefined;

const result = byId("result");
const status = byId("status");
const current = (): View | undefined => shown?.views[shown.at];
const light = (part: Partial<Parameters>, kind: string): void => {
  const view = current();
  if (view) change({ parameters: { ...lookOf(view).parameters, ...part } }, kind);
};

const dome = new Dome(byId("dome"), byId("readout"), ({ azimuth, elevation }) =>
  light({ sun_azimuth: azimuth, sun_elevation: elevation }, "dome"),
);
const sliders = new Sliders(light);
const object = new ObjectView(change, tell);
const facts = new FactsView((given) => shown && take(filesOf(shown).map(held), given));
const submit = latest<Wish>(run, 0, fail);
const sky = new SkyRenderer(({ light, picture }) => {
  const view = current();
  if (!view) return;
  const canvas = byId<HTMLCanvasElement>("envmap");
  canvas.getContext("2d")?.putImageData(new ImageData(picture.data, picture.width, picture.height), 0, 0);
  canvas.dataset.lights = String(Number(canvas.dataset.lights ?? 0) + 1); // how often the light has changed, for tests
  view.power = { sun: light.sun, sky: light.sky };
  object.light(light, view);
}, tell);

const drawPhotoMarks = fitted(byId<SVGSVGElement>("marks"), (width, height) => {
  const view = current();
  if (!view || !byId<HTMLInputElement>("show-marks").checked) return [];
  return photoMarks(view.answer.camera, lookOf(view).parameters, width, height);
});
const drawMapMarks = fitted(byId<SVGSVGElement>("map-marks"), (width, height) => {
  const view = current();
  return view ? mapMarks(view.answer, lookOf(view).parameters, aspectOf(view.photo), width, height) : [];
});

listenForPhotos((sources) => take(sources, NOTHING), withPhoto, tell);
listenForGestures();
listenForDownloads(settled, tell);
listenForUndo(() => current()?.history, refresh);
listenForCopies(subject);
void showMatching();
byId("key-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const kept = keepKey(byId<HTMLInputElement>("key").value);
  byId("key-note").hidden = kept;
  if (kept && asked) take(asked.sources, asked.given);
});
byId("reset").addEventListener("click", () => {
  const view = current();
  if (view) change({ parameters: parametersOf(view.answer) }, "reset");
});
byId("show-marks").addEventListener("change", drawPhotoMarks);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dome.paint());

function take(sources: Source[], given: Given): void {
  asked = { sources, given };
  status.textContent = `Looking at ${sources.map(({ name }) => name).join(", ")}…`;
  forgive();
  setBusy(true);
  submit(asked);
}

function withPhoto(model: File): void {
  forgive();
  if (current()) object.take(model);
  else tell(new Error("Choose a photo first, then drop your object on it."));
}

function setBusy(busy: boolean): void {
  result.setAttribute("aria-busy", String(busy));
  document.body.toggleAttribute("data-busy", busy);
}

async function run({ sources, given }: Wish, signal: AbortSignal): Promise<void> {
  const files = await Promise.all(sources.map(({ load }) => load(signal)));
  const began = performance.now();
  const pictures = opened(files, signal);
  pictures.catch(() => {}); // told below: what is said of the light comes first, for it says which photo is meant
  const answers = await estimate(files, given, signal).catch((error: unknown) => {
    const [file, ...others] = files; // of several, the service says which it means
    throw error instanceof Refusal && file && others.length === 0 ? error.of(file) : error;
  });
  const photos = await pictures;
  if (signal.aborted) return;
  for (const { photo } of shown?.views ?? []) URL.revokeObjectURL(photo.url);
  const views = photos.map((photo, i) => viewOf(photo, answers[i] as (typeof answers)[number]));
  shown = { views, at: 0, given };
  forgive();
  byId("intro").hidden = true;
  result.hidden = false;
  setBusy(false);
  void showMatching();
  open(0);
  const seconds = ((performance.now() - began) / 1000).toFixed(1);
  const decoded = photos.some(({ byService }) => byService) ? " The service decoded it for this browser." : "";
  status.textContent = `${files.map(({ name }) => name).join(", ")}: answered in ${seconds} s.${decoded}`;
}

const opened = (files: File[], signal: AbortSignal): Promise<Photo[]> =>
  Promise.all(files.map((file) => openPhoto(file, signal)));

/** Shows one of the photos. */
function open(index: number): void {
  if (!shown) return;
  shown.at = index;
  const view = shown.views[index];
  if (!view) return;
  const { answer, photo } = view;
  const { title, text, kind } = headline(answer);
  byId("title").textContent = title.replaceAll("° ", "°\u00a0"); // no line ends inside an angle
  byId("title").className = kind;
  byId("spread").textContent = text;
  byId("model").textContent = `Network ${answer.model.name} ${answer.model.version}`;
  Object.assign(byId("photo"), { src: photo.url, alt: photo.file.name });
  byId("frame").style.setProperty("--aspect", String(aspectOf(photo)));
  showPhotos(shown, open);
  showNumbers(answer);
  facts.show(shown, view);
  dome.show(answer, aspectOf(photo));
  object.open(view);
  sky.setPhoto(photo.pixels, answer.camera, answer.surroundings);
  refresh();
}

/** Changes the look of the photo on show; `kind` says which steps may be undone together. */
function change(part: Partial<Look>, kind: string): void {
  const view = current();
  if (!view) return;
  forgive();
  view.history.push({ ...lookOf(view), ...part }, kind, gesture());
  refresh();
}

/** Brings everything to the look that the history holds. */
function refresh(): void {
  const view = current();
  if (!view || !shown) return;
  const look = lookOf(view);
  forgetCopy();
  sliders.show(look.parameters, parametersOf(view.answer));
  byId<HTMLButtonElement>("reset").disabled = !isChanged(view);
  showUndo(view.history);
  showPreview(view, shown);
  dome.mark(look.parameters);
  drawPhotoMarks();
  drawMapMarks();
  object.show(look);
  sky.ask(questionOf(view));
}

/** What is shown, once its light is known; undefined where it cannot be, which is told. */
async function settled(): Promise<Shown | undefined> {
  forgive();
  return (await sky.settled()) ? shown : undefined;
}

async function subject(): Promise<Subject | undefined> {
  const shown = await settled();
  const view = shown?.views[shown.at];
  if (!view || !shown) return undefined;
  return {
    origin: new URL(".", location.href).href,
    photo: view.photo.file.name,
    given: shown.given,
    changed: changedLight(view, shown),
    height: mapHeight(),
    keyed: apiKey() !== null,
  };
}

/** Takes an error away, with what was said beside it, when something else is tried. */
function forgive(): void {
  for (const id of ["error", "kept", "key-form", "key-note"]) byId(id).hidden = true;
}

/** A question to the service that failed. */
function fail(error: unknown): void {
  setBusy(false);
  status.textContent = "";
  tell(error);
}

/** Says what is wrong; a photo that is being looked at goes on. */
function tell(error: unknown): void {
  const { title, message } =
    error instanceof Refusal
      ? error
      : { title: "That did not work", message: error instanceof Error ? error.message : String(error) };
  const box = byId("error");
  box.replaceChildren(Object.assign(document.createElement("strong"), { textContent: `${title}.` }), ` ${message}`);
  box.hidden = false;
  byId("key-form").hidden = !(error instanceof Refusal && [401, 403].includes(error.status));
  const names = shown && filesOf(shown).map(({ name }) => name);
  byId("kept").textContent = names ? `Below is still the answer for ${names.join(", ")}.` : ""; // not for what was refused
  byId("kept").hidden = !names || document.body.hasAttribute("data-busy");
}

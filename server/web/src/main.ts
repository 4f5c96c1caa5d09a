/** The page: photos go to the service, its answers to the views, and the controls change light and object on show. */

import { apiKey, debounceLatest, estimatePhotos, type LightParameters, modelInfo, ServiceError, storeKey } from "./api";
import { byId, fitDrawing } from "./dom";
import type { Angles } from "./geometry/angles";
import { currentGesture, listenForUndo, showUndo } from "./history";
import {
  aspectRatio,
  cropPhoto,
  type DecodedPhoto,
  decodePhoto,
  loadGroundMask,
  type PhotoSource,
  sourceInMemory,
  turnUpright,
} from "./photo";
import { SkyClient } from "./sky/client";
import {
  createView,
  currentState,
  type EditState,
  type PhotoView,
  parametersFromRecord,
  photoFiles,
  type Session,
  skyRequest,
} from "./state";
import { buildHeadline } from "./text/format";
import { NO_USER_INPUT, type UserInput } from "./text/metadata";
import type { SnippetInput } from "./text/snippets";
import { Dome } from "./views/dome";
import {
  Downloads,
  hideSnippet,
  isChanged,
  lightOverrides,
  listenForCopies,
  mapHeight,
  offerPreview,
} from "./views/downloads";
import { EnvmapView } from "./views/envmap";
import { listenForLocation } from "./views/location";
import { drawMapMarkers, drawPhotoMarkers, SunHandle } from "./views/markers";
import { MetadataView, showNumbers } from "./views/metadata";
import { ObjectView } from "./views/object";
import { Sliders } from "./views/sliders";
import { listenForUploads, showMatching, showPhotos } from "./views/upload";

interface EstimateRequest {
  sources: PhotoSource[];
  userInput: UserInput;
}

let session: Session | undefined;
let lastRequest: EstimateRequest | undefined;

const result = byId("result");
const status = byId("status");
const currentView = (): PhotoView | undefined => session?.views[session.index];
const editLight = (part: Partial<LightParameters>, kind: string): void => {
  const view = currentView();
  if (view) editState({ parameters: { ...currentState(view).parameters, ...part } }, kind);
};

const moveSun =
  (kind: string) =>
  ({ azimuth, elevation }: Angles): void =>
    editLight({ sun_azimuth: azimuth, sun_elevation: elevation }, kind);
const dome = new Dome(byId("dome"), byId("readout"), moveSun("dome"));
const sunHandle = new SunHandle(moveSun("sun in the picture"));
const sliders = new Sliders(editLight);
const downloads = new Downloads(settleLight, showError);
const object = new ObjectView(editState, showError, () => {
  const view = currentView();
  if (session && view) envmap.request(view, session); // its light may have come before it
});
const metadata = new MetadataView(
  (userInput) => session && submitPhotos(photoFiles(session).map(sourceInMemory), userInput),
);
const debouncedEstimate = debounceLatest<EstimateRequest>(runEstimate, 0, failRequest);
const sky = new SkyClient(({ light, picture }) => {
  const view = currentView();
  if (!view) return;
  view.irradiances = { sun: light.sun, sky: light.sky };
  showSliders(view);
  if (session && !envmap.request(view, session)) envmap.drawDraft(picture);
  countLight(view);
  object.light(light, view);
}, showError);
const envmap = new EnvmapView(
  () => object.isDrawn,
  (view) => {
    if (view !== currentView()) return;
    sky.setExported(view.exported?.light ?? null);
    sky.request(skyRequest(view));
  },
);

let lastLight = ""; // the photo and the light that were shown last

/** How often the light on show has changed, for tests. */
function countLight(view: PhotoView): void {
  const light = JSON.stringify([view.photo.url, currentState(view).parameters]);
  const { dataset } = byId("envmap");
  if (light !== lastLight) dataset.lights = String(Number(dataset.lights ?? 0) + 1);
  lastLight = light;
}

const drawPhotoMarks = fitDrawing(byId<SVGSVGElement>("marks"), (width, height) => {
  const view = currentView();
  if (!view || !byId<HTMLInputElement>("show-marks").checked) return [];
  return drawPhotoMarkers(view.estimate.camera, currentState(view).parameters, width, height);
});
const drawMapMarks = fitDrawing(byId<SVGSVGElement>("map-marks"), (width, height) => {
  const view = currentView();
  return view
    ? drawMapMarkers(view.estimate, currentState(view).parameters, aspectRatio(view.photo), width, height)
    : [];
});

listenForUploads((sources) => submitPhotos(sources, NO_USER_INPUT), takeModel, showError);
listenForLocation();
watchViewer();
byId("unfold").addEventListener("click", () => foldResult(false));
listenForUndo(() => currentView()?.history, refresh);
listenForCopies(snippetInput);
void offerByService();
byId("key-form").addEventListener("submit", (event) => {
  event.preventDefault();
  const stored = storeKey(byId<HTMLInputElement>("key").value);
  byId("key-note").hidden = stored;
  if (stored && lastRequest) submitPhotos(lastRequest.sources, lastRequest.userInput);
});
byId("reset").addEventListener("click", () => {
  const view = currentView();
  if (view) editState({ parameters: parametersFromRecord(view.estimate) }, "reset");
});
byId("show-marks").addEventListener("change", drawPhotoMarks);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dome.paint());

/** What the service can do, once it has answered that. */
async function offerByService(): Promise<void> {
  const info = await modelInfo();
  if (!info) return;
  showMatching(info.matching);
  byId("jobs-note").hidden = !info.jobs;
  downloads.offer(info);
}

function submitPhotos(sources: PhotoSource[], userInput: UserInput): void {
  lastRequest = { sources, userInput };
  status.textContent = `Looking at ${sources.map(({ name }) => name).join(", ")}…`;
  clearErrors();
  setBusy(true);
  sky.start();
  debouncedEstimate(lastRequest);
}

function takeModel(model: File): void {
  clearErrors();
  if (currentView()) object.takeModel(model);
  else showError(new Error("Choose a photo first, then drop your object on it."));
}

function setBusy(busy: boolean): void {
  result.setAttribute("aria-busy", String(busy));
  document.body.toggleAttribute("data-busy", busy);
}

async function runEstimate({ sources, userInput }: EstimateRequest, signal: AbortSignal): Promise<void> {
  const files = await Promise.all(sources.map(({ load }) => load(signal)));
  const startTime = performance.now();
  const decoding = decodePhotos(files, signal);
  decoding.catch(() => {}); // thrown below: the service's error comes first, for it names the photo
  const answers = await estimatePhotos(files, userInput, signal).catch((error: unknown) => {
    const [file, ...others] = files; // of several, the service names the one
    throw error instanceof ServiceError && file && others.length === 0 ? error.withFileName(file) : error;
  });
  const upright = (await decoding).map((photo, i) =>
    turnUpright(photo, answers[i]?.photo_metadata?.orientation, signal),
  );
  const photos = await Promise.all((await Promise.all(upright)).map((photo, i) => cropPhoto(photo, answers[i]?.crop)));
  if (signal.aborted) return;
  for (const { photo } of session?.views ?? []) URL.revokeObjectURL(photo.url);
  const views = photos.map((photo, i) => createView(photo, answers[i] as (typeof answers)[number], userInput));
  session = { views, index: 0, userInput };
  clearErrors();
  document.body.toggleAttribute("data-answered", true);
  result.hidden = false;
  setBusy(false);
  void offerByService();
  showPhoto(0);
  const seconds = ((performance.now() - startTime) / 1000).toFixed(1);
  const note = photos.some(({ byService }) => byService) ? " The service decoded it for this browser." : "";
  status.textContent = `${files.map(({ name }) => name).join(", ")}: answered in ${seconds} s.${note}`;
  await Promise.all(views.map((view) => showGround(view, userInput, signal)));
}

/** Where the photo's ground lies in the sun, once the service has said it. */
async function showGround(view: PhotoView, userInput: UserInput, signal: AbortSignal): Promise<void> {
  view.groundMask = await loadGroundMask(view.photo.file, userInput, signal);
  if (view === currentView()) object.show(currentState(view));
}

const decodePhotos = (files: File[], signal: AbortSignal): Promise<DecodedPhoto[]> =>
  Promise.all(files.map((file) => decodePhoto(file, signal)));

/** Shows one of the photos. */
function showPhoto(index: number): void {
  if (!session) return;
  session.index = index;
  const view = session.views[index];
  if (!view) return;
  const { estimate, photo } = view;
  const { title, text, kind } = buildHeadline(estimate);
  byId("title").textContent = title.replaceAll("° ", "°\u00a0"); // no line ends inside an angle
  byId("title").className = kind;
  byId("radii").textContent = text;
  foldResult(kind === "unsuitable");
  byId("model").textContent = `Network ${estimate.model.name} ${estimate.model.version}`;
  Object.assign(byId("photo"), { src: photo.url, alt: photo.file.name });
  byId("frame").style.setProperty("--aspect", String(aspectRatio(photo)));
  showPhotos(session, showPhoto);
  showNumbers(estimate);
  metadata.show(session, view);
  dome.show(estimate, aspectRatio(photo));
  object.open(view);
  sky.setExported(view.exported?.light ?? null);
  requested = undefined;
  refresh();
}

/** Leaves the headline alone in sight, of a picture whose answer means nothing. */
function foldResult(folded: boolean): void {
  result.toggleAttribute("data-folded", folded);
  byId("unfold").hidden = !folded;
}

/** Keeps what has the focus, or is scrolled to, out from under the picture that stays in sight. */
function watchViewer(): void {
  const viewer = byId("viewer");
  new ResizeObserver(() => {
    document.documentElement.style.setProperty("--viewer", `${viewer.getBoundingClientRect().height}px`);
  }).observe(viewer);
}

function showSliders(view: PhotoView): void {
  const { parameters } = currentState(view);
  sliders.show({ parameters, estimate: parametersFromRecord(view.estimate), irradiances: view.irradiances });
}

/** Changes light or object of the photo on show; `kind` says which steps may be undone together. */
function editState(part: Partial<EditState>, kind: string): void {
  const view = currentView();
  if (!view) return;
  clearErrors();
  view.history.push({ ...currentState(view), ...part }, kind, currentGesture());
  refresh();
}

/** Brings everything to the state that the history holds. */
function refresh(): void {
  const view = currentView();
  if (!view || !session) return;
  const state = currentState(view);
  hideSnippet();
  showSliders(view);
  sunHandle.show(view.estimate.camera, state.parameters);
  byId<HTMLButtonElement>("reset").disabled = !isChanged(view);
  showUndo(view.history);
  offerPreview(view, session);
  dome.mark(state.parameters);
  drawPhotoMarks();
  drawMapMarks();
  object.show(state);
  requestLight(view);
}

let requested: [PhotoView, string] | undefined; // whose light was asked for last, and which

/** Asks for the light of a view, unless it is the one that was asked for last, as when only the object moves. */
function requestLight(view: PhotoView): void {
  const question = skyRequest(view);
  const text = JSON.stringify(question);
  if (requested?.[0] === view && requested[1] === text) return;
  requested = [view, text];
  sky.request(question);
}

/** What is shown, once its light is known; undefined where it cannot be, which is shown as an error. */
async function settleLight(): Promise<Session | undefined> {
  clearErrors();
  return (await sky.settled()) ? session : undefined;
}

async function snippetInput(): Promise<SnippetInput | undefined> {
  const session = await settleLight();
  const view = session?.views[session.index];
  if (!view || !session) return undefined;
  return {
    origin: new URL(".", location.href).href,
    photo: view.photo.file.name,
    userInput: session.userInput,
    overrides: lightOverrides(view, session),
    height: mapHeight(),
    keyed: apiKey() !== null,
  };
}

/** Takes an error away, with the notes beside it, when something else is tried. */
function clearErrors(): void {
  for (const id of ["error", "previous-answer", "key-form", "key-note"]) byId(id).hidden = true;
}

/** A question to the service that failed. */
function failRequest(error: unknown): void {
  setBusy(false);
  status.textContent = "";
  showError(error);
}

/** Says what is wrong; a photo that is being looked at goes on. */
function showError(error: unknown): void {
  const { title, message } =
    error instanceof ServiceError
      ? error
      : { title: "That did not work", message: error instanceof Error ? error.message : String(error) };
  const box = byId("error");
  box.replaceChildren(Object.assign(document.createElement("strong"), { textContent: `${title}.` }), ` ${message}`);
  box.hidden = false;
  byId("key-form").hidden = !(error instanceof ServiceError && [401, 403].includes(error.status));
  const fileNames = session && photoFiles(session).map(({ name }) => name);
  byId("previous-answer").textContent = fileNames ? `Below is still the answer for ${fileNames.join(", ")}.` : ""; // not for what was refused
  byId("previous-answer").hidden = !fileNames || document.body.hasAttribute("data-busy");
}

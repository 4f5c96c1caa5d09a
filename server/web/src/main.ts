/** The page: photos go to the service, its answers to the views, and the controls change light and object on show. */

import { debounceLatest, estimatePhotos, type LightParameters, modelInfo, ServiceError, storeKey } from "./api";
import { byId, fitDrawing } from "./dom";
import { EXAMPLES } from "./examples";
import type { Angles } from "./geometry/angles";
import { currentGesture, History, isGestureUnderWay, listenForUndo, showUndo, type Undoable } from "./history";
import {
  aspectRatio,
  type DecodedPhoto,
  decodePhoto,
  loadGroundMask,
  type PhotoSource,
  preparePhoto,
  sourceFromExample,
  sourceInMemory,
} from "./photo";
import { SkyClient } from "./sky/client";
import type { SkyAnswer } from "./sky/worker";
import {
  cameraOf,
  createView,
  currentState,
  type EditState,
  isChanged,
  type Live,
  type PhotoView,
  parametersFromRecord,
  photoFiles,
  type Session,
  skyRequest,
} from "./state";
import { buildHeadline } from "./text/format";
import { NO_USER_INPUT, type UserInput } from "./text/metadata";
import {
  identifyPhoto,
  isSamePhoto,
  type PhotoIdentity,
  type Project,
  projectInput,
  projectOfFragment,
  readProject,
} from "./text/project";
import { Candidates } from "./views/candidates";
import { DayView } from "./views/day";
import { Dome } from "./views/dome";
import { Downloads, hideSnippet, offerForOne } from "./views/downloads";
import { EnvmapView } from "./views/envmap";
import { listenForLocation } from "./views/location";
import { drawMapMarkers, drawPhotoMarkers, listenForMapSun, SunHandle } from "./views/markers";
import { MetadataView, showNumbers } from "./views/metadata";
import { ObjectView } from "./views/object";
import { Sliders } from "./views/sliders";
import { PhotoTable, type Row } from "./views/table";
import type { Tools } from "./views/tools";
import { listenForUploads, showMatching, showPhotos } from "./views/upload";

interface EstimateRequest {
  sources: PhotoSource[];
  userInput: UserInput;
  row?: Row; // of the table, which it opens
  before?: Session; // the answer on show, of the same photos
}

let answers: History<Session> | undefined; // about the photos on show
let lastRequest: EstimateRequest | undefined;
let lastQuestion: [PhotoView, string] | undefined; // whose light was asked for last, and which
let awaited: Project | undefined; // whose photo has not come yet
let tools: Tools | undefined; // once there is something to draw on
let answerCount = 0; // each answer is a step of its own
let lastLight = ""; // the photo and the light that were shown last

const result = byId("result");
const status = byId("status");
const dome = new Dome(byId("dome"), byId("readout"), (sun) => moveSun(sun, "dome"));
const candidates = new Candidates(({ azimuth, elevation }) =>
  editLight({ sun_azimuth: azimuth, sun_elevation: elevation, sun: true }, "candidate"),
);
const sunHandle = new SunHandle((sun) => moveSun(sun, "sun in the picture"));
const sliders = new Sliders(editLight);
const day = new DayView(({ azimuth, elevation }) =>
  editLight({ sun_azimuth: azimuth, sun_elevation: elevation, sun: true }, "hour"),
);
const object = new ObjectView(editState, showError, requestMap);
const downloads = new Downloads(settleLight, showError, () => object.drawTurntable());
const metadata = new MetadataView(restate);
const table = new PhotoTable(
  (row) => submitPhotos({ sources: [row.source], userInput: NO_USER_INPUT, row }),
  (sources) => submitPhotos({ sources, userInput: NO_USER_INPUT }),
);
const envmap = new EnvmapView(() => object.isDrawn, showExported);
const sky = new SkyClient(showLight, showError);
const debouncedEstimate = debounceLatest<EstimateRequest>(runEstimate, 0, failRequest);
const drawPhotoMarks = fitDrawing(byId<SVGSVGElement>("marks"), (width, height) => {
  const view = currentView();
  if (!view || !byId<HTMLInputElement>("show-marks").checked) return [];
  return drawPhotoMarkers(cameraOf(view), currentState(view).parameters, width, height);
});
const drawMapMarks = fitDrawing(byId<SVGSVGElement>("map-marks"), (width, height) => {
  const view = currentView();
  if (!view) return [];
  const shown = { ...view.estimate, camera: cameraOf(view) };
  return drawMapMarkers(shown, currentState(view).parameters, aspectRatio(view.photo), width, height);
});

listenForUploads({
  takePhotos,
  takeModel,
  takeProject: (file) => file.text().then((text) => openProject(() => readProject(text))),
  onError: showError,
});
openLink();
addEventListener("hashchange", openLink);
listenForLocation();
listenForMapSun(currentSun, (sun) => moveSun(sun, "sun on the map"));
listenForUndo(undoables);
for (const end of ["pointerup", "pointercancel"] as const) addEventListener(end, finishLight);
listenForKey();
watchViewer();
byId("unfold").addEventListener("click", () => foldResult(false));
byId("reset").addEventListener("click", () => {
  const view = currentView();
  if (view) editState({ parameters: parametersFromRecord(view.estimate) }, "reset");
});
byId("show-marks").addEventListener("change", drawPhotoMarks);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dome.paint());
void offerByService();

function currentView(): PhotoView | undefined {
  const session = answers?.state;
  return session?.views[session.index];
}

/** What can be undone: what was done to light and object since the answer on show, then the answer itself. */
function undoables(): Undoable[] {
  const view = currentView();
  if (!view || !answers) return [];
  return [
    { history: view.history, show: refresh },
    { history: answers, show: showAnswer },
  ];
}

/** Keeps the API key that the user types, and asks once more what was refused without it. */
function listenForKey(): void {
  byId("key-form").addEventListener("submit", (event) => {
    event.preventDefault();
    const stored = storeKey(byId<HTMLInputElement>("key").value);
    byId("key-note").hidden = stored;
    if (stored && lastRequest) submitPhotos(lastRequest);
  });
}

/** What the service can do, once it has answered that. */
async function offerByService(): Promise<void> {
  const info = await modelInfo();
  if (!info) return;
  showMatching(info.matching);
  byId("jobs-note").hidden = !info.jobs;
  downloads.offer(info);
}

/** One photo is opened, several are listed. */
function takePhotos(sources: PhotoSource[]): void {
  table.show(sources.length > 1 ? sources : []);
  if (sources.length > 1) document.body.toggleAttribute("data-answered", true);
  else submitPhotos({ sources, userInput: NO_USER_INPUT });
}

function submitPhotos(request: EstimateRequest): void {
  lastRequest = request;
  status.textContent = `Looking at ${request.sources.map(({ name }) => name).join(", ")}…`;
  clearErrors();
  setBusy(true);
  document.body.toggleAttribute("data-asked-again", request.before !== undefined);
  sky.start();
  debouncedEstimate(request);
}

/** Asks again about the photos on show, with what is known of them; that can be undone. */
function restate(userInput: UserInput): void {
  const before = answers?.state;
  if (before) submitPhotos({ sources: photoFiles(before).map(sourceInMemory), userInput, before });
}

function openLink(): void {
  openProject(() => projectOfFragment(location.hash));
}

/** Opens a project on the photo on show, on an example, or on the photo that comes next. */
async function openProject(read: () => Project | undefined): Promise<void> {
  try {
    awaited = read() ?? awaited;
  } catch (error) {
    showError(error);
  }
  if (!awaited) return;
  clearErrors();
  const [shown, ...others] = answers ? photoFiles(answers.state) : [];
  const { photo } = awaited;
  const example = EXAMPLES.find(({ name }) => name === photo.name);
  if (shown && others.length === 0 && isSamePhoto(await identifyPhoto(shown), photo)) restate(NO_USER_INPUT);
  else if (shown) showError(anotherPhoto(photo));
  else if (example) submitPhotos({ sources: [sourceFromExample(example.name, example.url)], userInput: NO_USER_INPUT });
  else status.textContent = `These edits are of ${photo.name}. Choose that photo, and they are here again.`;
}

const anotherPhoto = ({ name }: PhotoIdentity): Error =>
  new Error(`These edits are of ${name}, and this is another photo. Choose ${name} to see them.`);

/** Whether the project that is awaited is of these photos. */
async function isAwaited([photo, ...others]: File[]): Promise<boolean> {
  if (!awaited || !photo || others.length > 0) return false;
  return isSamePhoto(await identifyPhoto(photo), awaited.photo);
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

async function runEstimate(request: EstimateRequest, signal: AbortSignal): Promise<void> {
  const { sources, before, row } = request;
  if (row?.answers) {
    answers = row.answers;
    showAnswers();
    status.textContent = "";
    return;
  }
  const files = await Promise.all(sources.map(({ load }) => load(signal)));
  const project = (await isAwaited(files)) ? awaited : undefined;
  const userInput = project ? projectInput(project) : request.userInput;
  const startTime = performance.now();
  const loading = import("./views/tools");
  loading.catch(() => {}); // thrown below, after the service's own errors
  const decoding = before ? Promise.resolve([]) : Promise.all(files.map((file) => decodePhoto(file, signal)));
  decoding.catch(() => {}); // thrown below: the service's error comes first, for it names the photo
  const known = userInput === NO_USER_INPUT && row?.estimate;
  const estimates = known ? [known] : await estimatePhotos(files, userInput, signal);
  const decoded = await decoding;
  for (const view of before?.views ?? []) delete view.live; // the answer takes its place
  const views = await Promise.all(
    estimates.map(async (estimate, i) => {
      const earlier = before?.views[i];
      const photo = earlier?.photo ?? (await preparePhoto(decoded[i] as DecodedPhoto, estimate, signal));
      return createView(photo, estimate, userInput, files.length > 1, earlier);
    }),
  );
  const { Tools } = await loading;
  if (signal.aborted) return;
  tools ??= new Tools({ preview: previewGesture, forward: (event) => sunHandle.drag(event), state: restate });
  showSession({ views, index: before?.index ?? 0 }, before, row);
  if (project) editState(project.edits, "project");
  else if (awaited && !before) showError(anotherPhoto(awaited.photo));
  if (project === awaited) awaited = undefined;
  const seconds = ((performance.now() - startTime) / 1000).toFixed(1);
  const note = views.some(({ photo }) => photo.byService) ? " The service decoded it for this browser." : "";
  status.textContent = `${files.map(({ name }) => name).join(", ")}: answered in ${seconds} s.${note}`;
  await Promise.all(views.map((view) => showGround(view, signal)));
}

/** Shows an answer: another one about the photos on show, which can be undone, or one about other photos. */
function showSession(answered: Session, before: Session | undefined, row: Row | undefined): void {
  if (before && answers) {
    for (const { history } of answers.state.views) history.dropRedo();
    answers.push(answered, "answer", ++answerCount);
  } else {
    if (!table.holds(answers)) for (const { photo } of answers?.state.views ?? []) URL.revokeObjectURL(photo.url);
    answers = new History(answered);
    if (row) row.answers = answers;
  }
  showAnswers();
}

/** Shows what has become of the question. */
function showAnswers(): void {
  clearErrors();
  document.body.toggleAttribute("data-answered", true);
  result.hidden = false;
  setBusy(false);
  void offerByService();
  showAnswer();
}

function showAnswer(): void {
  if (answers) showPhoto(answers.state.index);
}

/** Where the photo's ground lies in the sun, once the service has said it. */
async function showGround(view: PhotoView, signal: AbortSignal): Promise<void> {
  view.groundMask = await loadGroundMask(view.photo.file, view.userInput, signal);
  if (view === currentView()) object.show(view);
}

/** Shows one of the photos. */
function showPhoto(index: number): void {
  const session = answers?.state;
  if (!session) return;
  session.index = index;
  const view = session.views[index];
  if (!view) return;
  delete view.live;
  const { estimate, photo } = view;
  const { title, text, kind } = buildHeadline(estimate);
  byId("title").textContent = title.replaceAll("° ", "°\u00a0"); // no line ends inside an angle
  byId("title").className = kind;
  byId("more-text").textContent = text;
  foldResult(kind === "unsuitable");
  byId("model").textContent = `Network ${estimate.model.name} ${estimate.model.version}`;
  Object.assign(byId("photo"), { src: photo.url, alt: photo.file.name });
  byId("frame").style.setProperty("--aspect", String(aspectRatio(photo)));
  showPhotos(session, showPhoto);
  table.mark(answers);
  showNumbers(estimate);
  candidates.show(estimate);
  tools?.show(view, session.views.length === 1);
  day.show(view, session.views.length === 1);
  metadata.show(session, view);
  dome.show(estimate, aspectRatio(photo));
  object.open(view);
  sky.setExported(view.exported?.light ?? null);
  lastQuestion = undefined;
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

function editLight(part: Partial<LightParameters>, kind: string): void {
  const view = currentView();
  if (view) editState({ parameters: { ...view.history.state.parameters, ...part } }, kind);
}

/** Shows what a gesture changes until the service has answered what it states; undefined: no longer. */
function previewGesture(live: Live | undefined): void {
  const view = currentView();
  if (!view) return;
  if (live) view.live = live;
  else delete view.live;
  refresh();
}

function currentSun(): Angles | undefined {
  const view = currentView();
  if (!view) return undefined;
  const { sun_azimuth: azimuth, sun_elevation: elevation } = currentState(view).parameters;
  return { azimuth, elevation };
}

function moveSun({ azimuth, elevation }: Angles, kind: string): void {
  editLight({ sun_azimuth: azimuth, sun_elevation: elevation }, kind);
}

/** Changes light or object of the photo on show; `kind` says which steps may be undone together. */
function editState(part: Partial<EditState>, kind: string): void {
  const view = currentView();
  if (!view) return;
  clearErrors();
  view.history.push({ ...view.history.state, ...part }, kind, currentGesture());
  answers?.dropRedo();
  refresh();
}

/** Brings everything to the state that the history holds. */
function refresh(): void {
  const view = currentView();
  if (!view) return;
  const state = currentState(view);
  hideSnippet();
  showSliders(view);
  sunHandle.show(cameraOf(view), state.parameters);
  byId<HTMLButtonElement>("reset").disabled = !isChanged(view);
  showUndo(undoables());
  offerForOne(view);
  dome.mark(state.parameters);
  candidates.mark(state.parameters, cameraOf(view));
  drawPhotoMarks();
  drawMapMarks();
  object.show(view);
  requestLight(view);
}

/**
 * Asks for the light of a view, unless it is the one that was asked for last, as when only the object moves. While a
 * gesture moves it, a coarse one will do.
 */
function requestLight(view: PhotoView): void {
  const question = { ...skyRequest(view), coarse: isGestureUnderWay() };
  const text = JSON.stringify(question);
  if (lastQuestion?.[0] === view && lastQuestion[1] === text) return;
  lastQuestion = [view, text];
  sky.request(question);
}

/** Asks for the light that a gesture has left in full. */
function finishLight(): void {
  const view = currentView();
  if (view) requestLight(view);
}

/** Shows a light that the worker has rendered, and the sky alone until the service has rendered the map. */
function showLight({ light, picture }: SkyAnswer): void {
  const view = currentView();
  if (!view) return;
  view.irradiances = { sun: light.sun, sky: light.sky };
  showSliders(view);
  if (isGestureUnderWay() || !envmap.request(view)) envmap.drawDraft(picture);
  countLight(view);
  object.light(light, view);
}

/** How often the light on show has changed, for tests. */
function countLight(view: PhotoView): void {
  const light = JSON.stringify([view.photo.url, view.userInput, currentState(view).parameters]);
  const { dataset } = byId("envmap");
  if (light !== lastLight) dataset.lights = String(Number(dataset.lights ?? 0) + 1);
  lastLight = light;
}

/** The map that lights the object, once there is a stage for it: its light may have come before. */
function requestMap(): void {
  const view = currentView();
  if (view) envmap.request(view);
}

/** Lights the object by the map that the service has exported for a view. */
function showExported(view: PhotoView): void {
  if (view !== currentView()) return;
  sky.setExported(view.exported?.light ?? null);
  lastQuestion = undefined;
  requestLight(view);
}

/** What is shown, once its light is known; undefined where it cannot be, which is shown as an error. */
async function settleLight(): Promise<PhotoView | undefined> {
  clearErrors();
  return (await sky.settled()) ? currentView() : undefined;
}

/** Takes an error away, with the notes beside it, when something else is tried. */
function clearErrors(): void {
  for (const id of ["error", "previous-answer", "key-form", "key-note"]) byId(id).hidden = true;
}

/** A question to the service that failed. */
function failRequest(error: unknown): void {
  setBusy(false);
  status.textContent = "";
  const view = currentView();
  if (view) {
    delete view.live;
    tools?.show(view, answers?.state.views.length === 1);
    refresh();
  }
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
  const fileNames = answers && photoFiles(answers.state).map(({ name }) => name);
  byId("previous-answer").textContent = fileNames ? `Below is still the answer for ${fileNames.join(", ")}.` : ""; // not for what was refused
  byId("previous-answer").hidden = !fileNames || document.body.hasAttribute("data-busy");
}

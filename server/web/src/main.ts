/** The page: a photo goes to the service, its answer to the views, and the controls change the light on show. */

import { type Estimate, envmapUrl, estimate, file, type Parameters, Refusal } from "./api";
import { byId } from "./dom";
import { keepKey } from "./key";
import { isSame, parametersOf } from "./parameters";
import { decodePhoto, type Photo } from "./photo";
import { latest } from "./pure/latest";
import { headline, isSunny } from "./pure/words";
import { Dome } from "./views/dome";
import { linkDownloads, listenForDownloads } from "./views/downloads";
import { mapMarks, photoMarks } from "./views/marks";
import { showNumbers } from "./views/numbers";
import { ObjectView } from "./views/object";
import { listenForPhotos } from "./views/pick";
import { Sliders } from "./views/sliders";
import { fitted } from "./views/svg";

interface Shown {
  answer: Estimate;
  photo: Photo;
  parameters: Parameters;
}

let shown: Shown | undefined;
let asked: File | undefined;

const result = byId("result");
const status = byId("status");
const dome = new Dome(byId("dome"), byId("readout"), ({ azimuth, elevation }) =>
  change({ sun_azimuth: azimuth, sun_elevation: elevation }),
);
const sliders = new Sliders((parameters) => change(parameters));
const object = new ObjectView(fail);
const drawMap = latest<Parameters>(renderMap, 40, fail);
const submit = latest<File>(run, 0, fail);

const drawPhotoMarks = fitted(byId<SVGSVGElement>("marks"), (width, height) => {
  if (!shown || !byId<HTMLInputElement>("show-marks").checked) return [];
  return photoMarks(shown.answer.camera, shown.parameters, width, height);
});
const drawMapMarks = fitted(byId<SVGSVGElement>("map-marks"), (width, height) =>
  shown ? mapMarks(shown.answer, shown.parameters, aspectOf(shown.photo), width, height) : [],
);

listenForPhotos(take);
listenForDownloads(fail);
byId("key-form").addEventListener("submit", (event) => {
  event.preventDefault();
  keepKey(byId<HTMLInputElement>("key").value);
  if (asked) take(asked);
});
byId("reset").addEventListener("click", () => shown && change(parametersOf(shown.answer)));
byId("show-marks").addEventListener("change", drawPhotoMarks);
byId("size").addEventListener("change", () => change({}));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => dome.paint());

function take(photo: File): void {
  asked = photo;
  status.textContent = `Looking at ${photo.name}…`;
  byId("error").hidden = true;
  byId("key-form").hidden = true;
  setBusy(true);
  submit(photo);
}

function setBusy(busy: boolean): void {
  result.setAttribute("aria-busy", String(busy));
  document.body.toggleAttribute("data-busy", busy);
}

async function run(photo: File, signal: AbortSignal): Promise<void> {
  const began = performance.now();
  const [answer, decoded] = await Promise.all([estimate(photo, signal), decodePhoto(photo)]);
  if (signal.aborted) return;
  if (shown) URL.revokeObjectURL(shown.photo.url);
  show(answer, decoded ?? blank(photo.name));
  const seconds = ((performance.now() - began) / 1000).toFixed(1);
  const words = decoded ? "" : " This browser cannot show the photo itself.";
  status.textContent = `${photo.name}: answered in ${seconds} s.${words}`;
}

function show(answer: Estimate, photo: Photo): void {
  shown = { answer, photo, parameters: parametersOf(answer) };
  byId("intro").hidden = true;
  result.hidden = false;
  setBusy(false);
  const { title, text } = headline(answer);
  byId("title").textContent = title;
  byId("title").classList.toggle("sunny", isSunny(answer));
  byId("spread").textContent = text;
  byId("model").textContent = `Network ${answer.model.name} ${answer.model.version}`;
  Object.assign(byId("photo"), { src: photo.url, alt: photo.name });
  byId("frame").style.setProperty("--aspect", String(aspectOf(photo)));
  showNumbers(answer);
  dome.show(answer, aspectOf(photo));
  object.show(photo, answer.camera);
  change({});
}

/** Changes the light on show, and everything that shows it. */
function change(part: Partial<Parameters>): void {
  if (!shown) return;
  shown.parameters = { ...shown.parameters, ...part };
  const { answer, photo, parameters } = shown;
  const asked = parametersOf(answer);
  sliders.show(parameters, asked);
  byId<HTMLButtonElement>("reset").disabled = isSame(parameters, asked);
  dome.mark(parameters);
  drawPhotoMarks();
  drawMapMarks();
  linkDownloads(answer, parameters, photo.name);
  drawMap(parameters);
  object.mark(parameters);
}

async function renderMap(parameters: Parameters, signal: AbortSignal): Promise<void> {
  const picture = await file(envmapUrl(parameters, "png", 512), signal);
  if (signal.aborted) return;
  const image = byId<HTMLImageElement>("envmap");
  const before = image.src;
  image.src = URL.createObjectURL(picture);
  URL.revokeObjectURL(before);
}

function fail(error: unknown): void {
  const { title, message } =
    error instanceof Refusal ? error : { title: "Something went wrong", message: String(error) };
  const box = byId("error");
  box.replaceChildren(Object.assign(document.createElement("strong"), { textContent: `${title}.` }), ` ${message}`);
  box.hidden = false;
  byId("key-form").hidden = !(error instanceof Refusal && error.status === 401);
  status.textContent = "";
  setBusy(false);
}

function aspectOf({ picture }: Photo): number {
  return picture.width / picture.height;
}

/** A grey picture in place of a photo that the browser cannot decode. */
function blank(name: string): Photo {
  const picture = Object.assign(document.createElement("canvas"), { width: 1200, height: 900 });
  const context = picture.getContext("2d");
  if (context) Object.assign(context, { fillStyle: "#7d8085" }).fillRect(0, 0, 1200, 900);
  return { name, url: picture.toDataURL(), picture };
}

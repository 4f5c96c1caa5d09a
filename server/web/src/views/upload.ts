/** The first view: the ways a photo comes in, and the example that moves; and the photos that were estimated together. */

import { byId, createElement } from "../dom";
import { EXAMPLES, type Example } from "../examples";
import { type PhotoSource, sourceFromExample, sourceFromFile } from "../photo";
import type { Session } from "../state";
import { describeRotation, formatAzimuth, formatMatching, formatRotation } from "../text/format";

const MODEL = /\.(glb|gltf)$/i;
const PROJECT = /\.json$/i;

const TEXT_FIELDS = "input:not([type=file], [type=range], [type=radio], [type=checkbox]), textarea"; // for text

type TakePhotos = (photos: PhotoSource[]) => void;

/** What becomes of what comes in. */
interface Receivers {
  takePhotos: TakePhotos;
  takeModel: (file: File) => void; // an object of the user's own
  takeProject: (file: File) => Promise<void>;
  onError: (error: Error) => void; // what is wrong with the rest
}

export function listenForUploads({ takePhotos, takeModel, takeProject, onError }: Receivers): void {
  const accept = async (files: Iterable<File> | null | undefined): Promise<void> => {
    const all = [...(files ?? [])];
    const own = all.find(({ name }) => MODEL.test(name));
    const project = all.find(({ name }) => PROJECT.test(name));
    const photos = all.filter(({ name }) => !MODEL.test(name) && !PROJECT.test(name));
    if (own) takeModel(own);
    if (project) await takeProject(project);
    if (photos.length) takePhotos(photos.map(sourceFromFile));
  };
  for (const id of ["file", "model-file", "project-file"]) {
    const chooser = byId<HTMLInputElement>(id);
    chooser.addEventListener("change", () => {
      void accept([...(chooser.files ?? [])]);
      chooser.value = ""; // so that the same file can be chosen again
    });
  }
  const receive = (data: DataTransfer | null, how: string): void => {
    const dragged = EXAMPLES.find(({ thumb }) => new URL(thumb, location.href).href === data?.getData("text/uri-list"));
    if (data?.files.length) void accept([...data.files]);
    else if (dragged) takePhotos([sourceFromExample(dragged.name, dragged.url)]);
    else onError(new Error(`What you ${how} is no file. Save the photo, then choose or drop the file.`));
  };
  document.addEventListener("paste", (event) => {
    if (!isTextDrop(event, event.clipboardData)) receive(event.clipboardData, "pasted");
  });
  showMovingExample();
  listenForDrops((data) => receive(data, "dropped"));
  byId("examples").append(...EXAMPLES.map((one) => createElement("li", {}, exampleButton(one, takePhotos))));
  const [, secret, name] = /^#opened\/([\w-]+)\/(.+)$/.exec(location.hash) ?? []; // by `lighting open PHOTO`
  if (secret && name) takePhotos([sourceFromExample(decodeURIComponent(name), `opened/${secret}`)]);
}

/** What the service does with several photos. */
export function showMatching(matching: boolean): void {
  byId("matching").textContent = formatMatching(matching);
}

/** The whole page takes drops, so that a photo that misses the field does not replace the page. */
function listenForDrops(accept: (data: DataTransfer | null) => void): void {
  const field = byId("drop");
  const highlight = (on: boolean) => (event: DragEvent) => {
    if (isTextDrop(event, event.dataTransfer)) return;
    event.preventDefault();
    field.classList.toggle("over", on);
  };
  document.addEventListener("dragover", highlight(true));
  document.addEventListener("dragleave", highlight(false));
  document.addEventListener("drop", (event) => {
    highlight(false)(event);
    if (!isTextDrop(event, event.dataTransfer)) accept(event.dataTransfer);
  });
}

/** Whether what comes is text for a field for text, where the browser puts it. */
const isTextDrop = ({ target }: Event, data: DataTransfer | null): boolean =>
  target instanceof Element && target.matches(TEXT_FIELDS) && !data?.types.includes("Files");

function exampleButton({ name, title, url, thumb, credit }: Example, takePhotos: TakePhotos): HTMLButtonElement {
  const picture = createElement("img", { src: thumb, alt: "", width: 120, height: 90 });
  const button = createElement(
    "button",
    { type: "button", title: credit },
    picture,
    createElement("span", { textContent: title }),
  );
  button.addEventListener("click", () => takePhotos([sourceFromExample(name, url)]));
  return button;
}

export function showPhotos({ views, index }: Session, onChoice: (index: number) => void): void {
  const list = byId("photos");
  list.hidden = views.length < 2;
  list.replaceChildren(
    ...views.map(({ photo, estimate }, i) => {
      const rotation = formatRotation(estimate, i);
      const sun = [formatAzimuth(estimate.sun.azimuth), ...(estimate.trust ? [estimate.trust] : [])].join(", ");
      const label = `Photo ${i + 1}, ${rotation && `${rotation}, `}sun ${sun}`;
      const picture = createElement("img", { src: photo.url, alt: "", width: 96, height: 72 });
      const button = createElement("button", { type: "button", title: photo.file.name }, picture, label);
      button.setAttribute("aria-pressed", String(i === index));
      button.addEventListener("click", () => onChoice(i));
      return createElement("li", {}, button);
    }),
  );
  const view = views[index];
  const sentence = views.length > 1 && view ? describeRotation(view.estimate, index) : "";
  byId("rotation").textContent = sentence;
  byId("rotation").hidden = !sentence;
}

/** The example that moves, which can be paused, and stands still for those who ask for that; begins once all else has loaded. */
function showMovingExample(): void {
  const [figure, button] = [byId("moving"), byId<HTMLButtonElement>("pause")];
  const show = (paused: boolean): void => {
    figure.classList.toggle("paused", paused);
    button.setAttribute("aria-pressed", String(paused));
    button.textContent = paused ? "Play" : "Pause";
  };
  show(matchMedia("(prefers-reduced-motion: reduce)").matches);
  const begin = (): void => figure.classList.add("turning");
  if (document.readyState === "complete") begin();
  else addEventListener("load", begin);
  button.addEventListener("click", () => show(!figure.classList.contains("paused")));
}

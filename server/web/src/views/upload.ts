/** The ways a photo comes in (file chooser, drop, paste, examples), and the photos that were estimated together. */

import { modelInfo } from "../api";
import { byId, createElement } from "../dom";
import { EXAMPLES, type Example } from "../examples";
import { type PhotoSource, type Session, sourceFromExample, sourceFromFile } from "../state";
import { describeRotation, formatAzimuth, formatMatching, formatRotation } from "../text/format";

const MODEL = /\.(glb|gltf)$/i;

const TEXT_FIELDS = "input:not([type=file], [type=range], [type=radio], [type=checkbox]), textarea"; // for text

type TakePhotos = (photos: PhotoSource[]) => void;

/** `take` gets photos, `model` an object of the user's own, `fail` what is wrong with the rest. */
export function listenForUploads(
  takePhotos: TakePhotos,
  model: (file: File) => void,
  fail: (error: Error) => void,
): void {
  const accept = (files: Iterable<File> | null | undefined): void => {
    const all = [...(files ?? [])];
    const own = all.find(({ name }) => MODEL.test(name));
    const photos = all.filter(({ name }) => !MODEL.test(name));
    if (own) model(own);
    if (photos.length) takePhotos(photos.map(sourceFromFile));
  };
  for (const id of ["file", "model-file"]) {
    const chooser = byId<HTMLInputElement>(id);
    chooser.addEventListener("change", () => {
      accept(chooser.files);
      chooser.value = ""; // so that the same file can be chosen again
    });
  }
  const receive = (data: DataTransfer | null, how: string): void => {
    const dragged = EXAMPLES.find(({ thumb }) => new URL(thumb, location.href).href === data?.getData("text/uri-list"));
    if (data?.files.length) accept(data.files);
    else if (dragged) takePhotos([sourceFromExample(dragged.name, dragged.url)]);
    else fail(new Error(`What you ${how} is no file. Save the photo, then choose its file or drop it here.`));
  };
  document.addEventListener("paste", (event) => {
    if (!isTextDrop(event, event.clipboardData)) receive(event.clipboardData, "pasted");
  });
  listenForDrops((data) => receive(data, "dropped"));
  byId("examples").append(...EXAMPLES.map((one) => createElement("li", {}, exampleButton(one, takePhotos))));
}

/** What the service does with several photos, once it has told. */
export async function showMatching(): Promise<void> {
  const info = await modelInfo();
  if (info) byId("matching").textContent = formatMatching(info.matching);
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

export function showPhotos({ views, index: at }: Session, onChoice: (index: number) => void): void {
  const list = byId("photos");
  list.hidden = views.length < 2;
  list.replaceChildren(
    ...views.map(({ photo, estimate: answer }, index) => {
      const rotation = formatRotation(answer, index);
      const label = `Photo ${index + 1}, ${rotation && `${rotation}, `}sun ${formatAzimuth(answer.sun.azimuth)}`;
      const picture = createElement("img", { src: photo.url, alt: "", width: 96, height: 72 });
      const button = createElement("button", { type: "button", title: photo.file.name }, picture, label);
      button.setAttribute("aria-pressed", String(index === at));
      button.addEventListener("click", () => onChoice(index));
      return createElement("li", {}, button);
    }),
  );
  const view = views[at];
  const sentence = views.length > 1 && view ? describeRotation(view.estimate, at) : "";
  byId("turned").textContent = sentence;
  byId("turned").hidden = !sentence;
}

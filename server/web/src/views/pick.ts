/** The ways a photo comes in: the file chooser, drop, paste, and the examples. */

import { described } from "../described";
import { byId, make } from "../dom";
import { EXAMPLES, type Example } from "../examples";
import { matchingWords } from "../pure/turns";
import { chosen, example, type Source } from "../source";

const MODEL = /\.(glb|gltf)$/i;

const FIELDS = "input:not([type=file], [type=range], [type=radio], [type=checkbox]), textarea"; // for text

type Take = (photos: Source[]) => void;

/** `take` gets photos, `model` an object of the user's own, `fail` what is wrong with the rest. */
export function listenForPhotos(take: Take, model: (file: File) => void, fail: (error: Error) => void): void {
  const give = (files: Iterable<File> | null | undefined): void => {
    const all = [...(files ?? [])];
    const own = all.find(({ name }) => MODEL.test(name));
    const photos = all.filter(({ name }) => !MODEL.test(name));
    if (own) model(own);
    if (photos.length) take(photos.map(chosen));
  };
  for (const id of ["file", "model-file"]) {
    const chooser = byId<HTMLInputElement>(id);
    chooser.addEventListener("change", () => {
      give(chooser.files);
      chooser.value = ""; // so that the same file can be chosen again
    });
  }
  const brought = (data: DataTransfer | null, how: string): void => {
    const dragged = EXAMPLES.find(({ thumb }) => new URL(thumb, location.href).href === data?.getData("text/uri-list"));
    if (data?.files.length) give(data.files);
    else if (dragged) take([example(dragged.name, dragged.url)]);
    else fail(new Error(`What you ${how} is no file. Save the photo, then choose its file or drop it here.`));
  };
  document.addEventListener("paste", (event) => {
    if (!isText(event, event.clipboardData)) brought(event.clipboardData, "pasted");
  });
  listenForDrops((data) => brought(data, "dropped"));
  byId("examples").append(...EXAMPLES.map((one) => make("li", {}, exampleButton(one, take))));
}

/** What the service does with several photos, once it has told. */
export async function showMatching(): Promise<void> {
  const said = await described();
  if (said) byId("matching").textContent = matchingWords(said.matching);
}

/** The whole page takes drops, so that a photo that misses the field does not replace the page. */
function listenForDrops(give: (data: DataTransfer | null) => void): void {
  const field = byId("drop");
  const over = (on: boolean) => (event: DragEvent) => {
    if (isText(event, event.dataTransfer)) return;
    event.preventDefault();
    field.classList.toggle("over", on);
  };
  document.addEventListener("dragover", over(true));
  document.addEventListener("dragleave", over(false));
  document.addEventListener("drop", (event) => {
    over(false)(event);
    if (!isText(event, event.dataTransfer)) give(event.dataTransfer);
  });
}

/** Whether what comes is text for a field for text, where the browser puts it. */
const isText = ({ target }: Event, data: DataTransfer | null): boolean =>
  target instanceof Element && target.matches(FIELDS) && !data?.types.includes("Files");

function exampleButton({ name, title, url, thumb, credit }: Example, take: Take): HTMLButtonElement {
  const picture = make("img", { src: thumb, alt: "", width: 120, height: 90 });
  const button = make("button", { type: "button", title: credit }, picture, make("span", { textContent: title }));
  button.addEventListener("click", () => take([example(name, url)]));
  return button;
}

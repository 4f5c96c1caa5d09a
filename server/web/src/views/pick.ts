/** The ways a photo comes in: the file chooser, drop, paste, and the examples. */

import { exampleFile } from "../api";
import { described } from "../described";
import { byId, make } from "../dom";
import { EXAMPLES, type Example } from "../examples";
import { matchingWords } from "../pure/turns";

const MODEL = /\.(glb|gltf)$/i;

type Take = (files: File[]) => void;
type Failed = (error: unknown) => void;

/** `take` gets photos, `model` an object of the user's own, `failed` why there is no example. */
export function listenForPhotos(take: Take, model: (file: File) => void, failed: Failed): void {
  const give = (files: Iterable<File> | null | undefined): void => {
    const all = [...(files ?? [])];
    const own = all.find(({ name }) => MODEL.test(name));
    const photos = all.filter(({ name }) => !MODEL.test(name));
    if (own) model(own);
    if (photos.length) take(photos);
  };
  for (const id of ["file", "model-file"]) {
    const chooser = byId<HTMLInputElement>(id);
    chooser.addEventListener("change", () => {
      give(chooser.files);
      chooser.value = ""; // so that the same file can be chosen again
    });
  }
  document.addEventListener("paste", (event) => give(event.clipboardData?.files));
  listenForDrops(give);
  byId("examples").append(...EXAMPLES.map((example) => make("li", {}, exampleButton(example, take, failed))));
}

/** What the service does with several photos, once it has told. */
export async function showMatching(): Promise<void> {
  const said = await described();
  if (said) byId("matching").textContent = matchingWords(said.matching);
}

/** The whole page takes drops, so that a photo that misses the field does not replace the page. */
function listenForDrops(give: (files: Iterable<File> | undefined) => void): void {
  const field = byId("drop");
  const over = (on: boolean) => (event: DragEvent) => {
    event.preventDefault();
    field.classList.toggle("over", on);
  };
  document.addEventListener("dragover", over(true));
  document.addEventListener("dragleave", over(false));
  document.addEventListener("drop", (event) => {
    over(false)(event);
    give(event.dataTransfer?.files);
  });
}

function exampleButton({ name, title, url, thumb, credit }: Example, take: Take, failed: Failed): HTMLButtonElement {
  const picture = make("img", { src: thumb, alt: "", width: 120, height: 90 });
  const button = make("button", { type: "button", title: credit }, picture, make("span", { textContent: title }));
  button.addEventListener("click", () => {
    exampleFile(url).then((blob) => take([new File([blob], name, { type: "image/jpeg" })]), failed);
  });
  return button;
}

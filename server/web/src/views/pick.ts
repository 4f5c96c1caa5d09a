/** The ways a photo comes in: the file chooser, drop, paste, and the examples. */

import { described } from "../described";
import { byId, make } from "../dom";
import { EXAMPLES, type Example } from "../examples";
import { matchingWords } from "../pure/turns";
import { chosen, example, type Source } from "../source";

const MODEL = /\.(glb|gltf)$/i;

type Take = (photos: Source[]) => void;

/** `take` gets photos, `model` an object of the user's own. */
export function listenForPhotos(take: Take, model: (file: File) => void): void {
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
  document.addEventListener("paste", (event) => give(event.clipboardData?.files));
  listenForDrops(give);
  byId("examples").append(...EXAMPLES.map((one) => make("li", {}, exampleButton(one, take))));
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

function exampleButton({ name, title, url, thumb, credit }: Example, take: Take): HTMLButtonElement {
  const picture = make("img", { src: thumb, alt: "", width: 120, height: 90 });
  const button = make("button", { type: "button", title: credit }, picture, make("span", { textContent: title }));
  button.addEventListener("click", () => take([example(name, url)]));
  return button;
}

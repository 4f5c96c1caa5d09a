/** The ways a photo comes in: the file chooser, drop, paste, and the examples. */

import { byId, make } from "../dom";
import { EXAMPLES, type Example } from "../examples";

type Take = (file: File) => void;

export function listenForPhotos(take: Take): void {
  const chooser = byId<HTMLInputElement>("file");
  chooser.addEventListener("change", () => {
    takeFirst(chooser.files, take);
    chooser.value = ""; // so that the same file can be chosen again
  });
  document.addEventListener("paste", (event) => takeFirst(event.clipboardData?.files, take));
  listenForDrops(take);
  byId("examples").append(...EXAMPLES.map((example) => make("li", {}, exampleButton(example, take))));
}

function takeFirst(files: FileList | null | undefined, take: Take): void {
  const file = files?.[0];
  if (file) take(file);
}

/** The whole page takes drops, so that a photo that misses the field does not replace the page. */
function listenForDrops(take: Take): void {
  const field = byId("drop");
  const over = (on: boolean) => (event: DragEvent) => {
    event.preventDefault();
    field.classList.toggle("over", on);
  };
  document.addEventListener("dragover", over(true));
  document.addEventListener("dragleave", over(false));
  document.addEventListener("drop", (event) => {
    over(false)(event);
    takeFirst(event.dataTransfer?.files, take);
  });
}

function exampleButton({ name, title, url }: Example, take: Take): HTMLButtonElement {
  const picture = make("img", { src: url, alt: "", width: 120, height: 80 });
  const button = make("button", { type: "button", title }, picture, make("span", { textContent: title }));
  button.addEventListener("click", async () =>
    take(new File([await (await fetch(url)).blob()], name, { type: "image/jpeg" })),
  );
  return button;
}

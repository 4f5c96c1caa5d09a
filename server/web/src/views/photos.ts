/** The photos that were estimated together, to choose the one on show. */

import { byId, make } from "../dom";
import { turnSentence, turnWords } from "../pure/turns";
import { azimuthWords } from "../pure/words";
import type { Shown } from "../studio";

export function showPhotos({ views, at }: Shown, chosen: (index: number) => void): void {
  const list = byId("photos");
  list.hidden = views.length < 2;
  list.replaceChildren(
    ...views.map(({ photo, answer }, index) => {
      const turn = turnWords(answer, index);
      const words = `Photo ${index + 1}, ${turn && `${turn}, `}sun ${azimuthWords(answer.sun.azimuth)}`;
      const picture = make("img", { src: photo.url, alt: "", width: 96, height: 72 });
      const button = make("button", { type: "button", title: photo.file.name }, picture, words);
      button.setAttribute("aria-pressed", String(index === at));
      button.addEventListener("click", () => chosen(index));
      return make("li", {}, button);
    }),
  );
  const shown = views[at];
  const told = views.length > 1 && shown ? turnSentence(shown.answer, at) : "";
  byId("turned").textContent = told;
  byId("turned").hidden = !told;
}

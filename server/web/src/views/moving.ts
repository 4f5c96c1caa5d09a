/** The example that moves on the first view: it can be paused, and stands still for those who ask for that. */

import { byId } from "../dom";

export function listenForPause(): void {
  const [figure, button] = [byId("moving"), byId<HTMLButtonElement>("pause")];
  const show = (paused: boolean): void => {
    figure.classList.toggle("paused", paused);
    button.setAttribute("aria-pressed", String(paused));
    button.textContent = paused ? "Play" : "Pause";
  };
  show(matchMedia("(prefers-reduced-motion: reduce)").matches);
  button.addEventListener("click", () => show(!figure.classList.contains("paused")));
}

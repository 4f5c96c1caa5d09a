/** The example that moves on the first view: it can be paused, and stands still for those who ask for that. */

import { byId } from "../dom";

/** Begins once all else has loaded. */
export function showMovingExample(): void {
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

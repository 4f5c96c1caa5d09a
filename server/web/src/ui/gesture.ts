/** Which gesture of the pointer is under way, from its press to its release and the click that follows. */

import { NO_GESTURE } from "./history";

const CLICK = 500; // ms after the release within which a click or a change still belongs to it

let pressed = NO_GESTURE;
let count = NO_GESTURE;
let ended = Number.POSITIVE_INFINITY; // when the pointer was released

/** Must be called once. A key ends a gesture: what it changes is another step. */
export function listenForGestures(): void {
  const release = (): void => {
    ended = performance.now();
  };
  const listen = (event: "pointerdown" | "pointerup" | "pointercancel" | "keydown", act: () => void): void =>
    document.addEventListener(event, act, { capture: true });
  listen("pointerdown", () => {
    pressed = ++count;
    ended = Number.POSITIVE_INFINITY;
  });
  listen("pointerup", release);
  listen("pointercancel", release);
  listen("keydown", () => {
    pressed = NO_GESTURE;
  });
}

/** The number of the gesture under way. */
export const currentGesture = (): number => (performance.now() - ended > CLICK ? NO_GESTURE : pressed);

/** Undo and redo: two buttons, and the keys that everybody knows. */

import { byId } from "../dom";
import type { History } from "../pure/history";

/** `history` gives the one that counts now; `changed` is called after each step. */
export function listenForUndo<State>(history: () => History<State> | undefined, changed: () => void): void {
  const step = (kind: "undo" | "redo"): void => {
    history()?.[kind]();
    changed();
  };
  byId("undo").addEventListener("click", () => step("undo"));
  byId("redo").addEventListener("click", () => step("redo"));
  document.addEventListener("keydown", (event) => {
    if (!(event.ctrlKey || event.metaKey) || isTyped(event.target)) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    step(key === "y" || event.shiftKey ? "redo" : "undo");
  });
}

export function showUndo<State>(history: History<State>): void {
  byId<HTMLButtonElement>("undo").disabled = !history.canUndo;
  byId<HTMLButtonElement>("redo").disabled = !history.canRedo;
}

/** Whether keys go into a text: it has an undo of its own. */
function isTyped(target: EventTarget | null): boolean {
  return target instanceof HTMLInputElement && !["range", "checkbox", "radio", "file"].includes(target.type);
}

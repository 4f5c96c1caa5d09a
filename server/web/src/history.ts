/** Undo and redo: states one after another, two buttons, the keys that everybody knows, and what one gesture changes. */

import { byId } from "./dom";

const TOGETHER = 800; // ms within which changes of the same kind count as one, of keys

/** The number of no gesture. */
const NO_GESTURE = 0;

export class History<State> {
  private past: State[] = [];
  private future: State[] = [];
  private kind = "";
  private gesture = NO_GESTURE;
  private last = Number.NEGATIVE_INFINITY;

  constructor(
    private now: State,
    private readonly clock: () => number = () => performance.now(),
  ) {}

  get state(): State {
    return this.now;
  }

  get canUndo(): boolean {
    return this.past.length > 0;
  }

  get canRedo(): boolean {
    return this.future.length > 0;
  }

  /**
   * A new state. Steps of one `kind` are undone together if they are of one gesture of the pointer, however long it
   * takes, or, without one, follow each other quickly, as those of a key that is held down.
   */
  push(state: State, kind: string, gesture = NO_GESTURE): void {
    const time = this.clock();
    const quick = gesture !== NO_GESTURE || time - this.last <= TOGETHER;
    const together = kind === this.kind && gesture === this.gesture && quick;
    if (!together || this.past.length === 0) this.past.push(this.now);
    this.kind = kind;
    this.gesture = gesture;
    this.last = time;
    this.future = [];
    this.now = state;
  }

  undo(): State {
    const before = this.past.pop();
    if (before !== undefined) {
      this.future.push(this.now);
      this.now = before;
    }
    this.kind = "";
    return this.now;
  }

  /** Forgets what was undone. */
  dropRedo(): void {
    this.future = [];
  }

  redo(): State {
    const after = this.future.pop();
    if (after !== undefined) {
      this.past.push(this.now);
      this.now = after;
    }
    this.kind = "";
    return this.now;
  }
}

/** A history, and what shows the state that it steps to. */
export interface Undoable {
  history: Pick<History<unknown>, "canUndo" | "canRedo" | "undo" | "redo">;
  show: () => void;
}

/** `undoables` gives those that count now; the first one that can makes the step. Must be called once. */
export function listenForUndo(undoables: () => Undoable[]): void {
  listenForGestures();
  const step = (kind: "undo" | "redo"): void => {
    const able = undoables().find(({ history }) => (kind === "undo" ? history.canUndo : history.canRedo));
    able?.history[kind]();
    able?.show();
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

/** Whether the buttons do anything. */
export function showUndo(undoables: Undoable[]): void {
  byId<HTMLButtonElement>("undo").disabled = !undoables.some(({ history }) => history.canUndo);
  byId<HTMLButtonElement>("redo").disabled = !undoables.some(({ history }) => history.canRedo);
}

/** Whether keys go into a text: it has an undo of its own. */
function isTyped(target: EventTarget | null): boolean {
  return target instanceof HTMLInputElement && !["range", "checkbox", "radio", "file"].includes(target.type);
}

const CLICK = 500; // ms after the release within which a click or a change still belongs to it

let pressed = NO_GESTURE; // the gesture under way, until the click that follows its release
let count = NO_GESTURE;
let ended = Number.POSITIVE_INFINITY; // when the pointer was released

/** Follows the pointer from its press to its release. A key ends a gesture: what it changes is another step. */
function listenForGestures(): void {
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

/** Whether a finger or a button of the mouse is down. */
export const isGestureUnderWay = (): boolean => pressed !== NO_GESTURE && ended === Number.POSITIVE_INFINITY;

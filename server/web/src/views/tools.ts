/** The tool bar of the photo: what a drag on it means. What is drawn can be dragged again, and the light follows. */

import { addRadioButtons, arrowStep, byId, createElement, createSvg, drawPath, findRadio } from "../dom";
import { clamp } from "../geometry/angles";
import type { Point, Size } from "../geometry/camera";
import { horizonEnds, litShare } from "../geometry/marks";
import type { ImagePart } from "../photo";
import type { Live, PhotoView } from "../state";
import { type End, GUESS, hasFoot, type Mark, moveMarks, readMarks, writeMarks } from "../text/marks";
import { DRAWN_FIELDS, type DrawnField, type UserInput } from "../text/metadata";
import { HELP, KINDS, type Kind, LISTS, NAMES, TOOLS, type Tool } from "../text/tools";
import { liveOf } from "./live";
import { Loupe } from "./loupe";

const SHORTEST = 12; // CSS pixels of a drag that counts
const GRIP = 28; // CSS pixels around an end, from which a finger drags it
const BESIDE = 0.05; // of a thing's width, at its edges: a tap there is no border
const STEP = 1; // CSS pixels of a key; with Shift ten of them
const REST = 600; // ms without a key, after which the service is asked

/** What the page does with gestures. */
interface Actions {
  preview: (live: Live | undefined) => void; // while something is drawn
  forward: (event: PointerEvent) => void; // of the tool for the sun
  state: (userInput: UserInput) => void; // asks the service anew
}

/** What a finger drags: an end of a mark, which it holds so far away; a whole mark, from that point; or a new line. */
type Drag = { end: End; away: Point; marks: Mark[] } | { from: Point; marks: Mark[] } | { points: Point[] };

export class Tools {
  private readonly pad = byId<SVGSVGElement>("pad");
  private readonly grips = byId("grips");
  private readonly loupe = new Loupe();
  private readonly meters = byId<HTMLInputElement>("meters");
  private readonly kinds = byId<HTMLSelectElement>("kinds");
  private readonly guess = byId<HTMLInputElement>("guess");
  private view: PhotoView | undefined;
  private asked: UserInput | undefined; // by what was drawn last, until that is answered
  private tool: Tool = "place";
  private size: Size = { width: 0, height: 0 }; // of the pad, CSS pixels
  private drag: Drag | undefined;
  private pressed: Point = [0, 0]; // where the pointer went down, on the pad
  private touched = 0; // the mark that was drawn or dragged last
  private first: Point[] = []; // of two lines, the one that was drawn
  private resting: ReturnType<typeof setTimeout> | undefined; // after a key

  constructor(private readonly actions: Actions) {
    addRadioButtons(byId("tools"), TOOLS, (tool) => this.choose(tool));
    this.pad.addEventListener("pointerdown", (event) => this.begin(event));
    this.pad.addEventListener("pointermove", (event) => this.follow(event));
    this.pad.addEventListener("pointerup", (event) => this.finish(event));
    this.pad.addEventListener("pointercancel", () => this.clear());
    this.kinds.addEventListener("change", () => this.explain());
    this.meters.addEventListener("input", () => this.preview());
    byId("size-form").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.drag && "points" in this.drag) this.stateNew(this.drag.points);
    });
    this.guess.addEventListener("change", () => {
      const prefix = this.guess.checked ? GUESS : "";
      this.stateMarks(this.marks.map((mark, i) => (i === this.touched ? { ...mark, prefix } : mark)));
    });
    new ResizeObserver(() => {
      this.measure();
      this.draw();
    }).observe(this.pad);
    this.choose("place");
  }

  /** Another photo, or another answer about it. Tools that draw are for one photo whose pixels this browser knows. */
  show(view: PhotoView, alone: boolean): void {
    const isOther = view.photo !== this.view?.photo;
    this.view = view;
    this.asked = undefined;
    const last = readMarks(view.userInput.shadow).length - 1;
    if (this.touched < 0 || this.touched > last) this.touched = last;
    if (isOther) this.explain();
    const draws = alone && view.photo.area !== undefined;
    for (const tool of Object.keys(KINDS)) findRadio(byId("tools"), tool).disabled = !draws;
    if (!draws && this.tool in KINDS) this.choose("place");
    const drawn = DRAWN_FIELDS.filter((field) => view.userInput[field]);
    byId("drawn").replaceChildren(...drawn.map((field) => createElement("li", {}, this.chip(field))));
    const asked = view.estimate.warnings.filter((_, i) => view.estimate.warning_codes?.[i] === "shadow-contradicted");
    byId("tool-warning").textContent = asked.join(" ");
    this.draw();
  }

  private chip(field: DrawnField): HTMLButtonElement {
    const button = createElement("button", { type: "button", title: "Take it away" }, `${NAMES[field]} ×`);
    button.addEventListener("click", () => this.state({ [field]: "" }));
    return button;
  }

  private choose(tool: Tool): void {
    this.tool = tool;
    findRadio(byId("tools"), tool).checked = true;
    const kinds = tool in KINDS ? KINDS[tool as keyof typeof KINDS] : [];
    this.kinds.replaceChildren(...kinds.map(({ name }, i) => new Option(name, String(i))));
    this.kinds.hidden = kinds.length < 2;
    this.pad.toggleAttribute("hidden", tool === "place");
    byId("frame").dataset.tool = tool;
    this.measure();
    this.explain();
  }

  /** What a drag draws; undefined of tools that draw nothing. */
  private get kind(): Kind | undefined {
    return KINDS[this.tool as keyof typeof KINDS]?.[Number(this.kinds.value)];
  }

  private explain(): void {
    byId("tool-help").textContent = this.kind?.help ?? HELP[this.tool as keyof typeof HELP];
    this.first = [];
    this.clear();
  }

  /** Forgets a gesture that is not finished. */
  private clear(): void {
    this.drag = undefined;
    this.loupe.hide();
    byId("size-form").hidden = true;
    if (this.view?.live && !this.asked) this.actions.preview(undefined);
    this.draw();
  }

  /** What the user says of the photo, with what the service has not answered yet. */
  private get said(): UserInput | undefined {
    return this.asked ?? this.view?.userInput;
  }

  /** The marks that can be dragged: of the tool's field, and the estimated horizon until one is stated. */
  private get marks(): Mark[] {
    if (this.drag && "marks" in this.drag) return this.drag.marks;
    const { stated } = this;
    if (!this.view || this.kind?.field !== "horizon" || stated.length) return stated;
    const points = horizonEnds(this.view.estimate.camera, this.size).map((point) => this.toPhoto(point));
    return [{ prefix: "", points, meters: "" }];
  }

  private begin(event: PointerEvent): void {
    if (event.button !== 0) return;
    event.preventDefault();
    this.pad.setPointerCapture(event.pointerId);
    if (this.tool === "sun") {
      this.actions.forward(event);
      return;
    }
    const at = this.pointOf(event);
    this.pressed = at;
    const { marks } = this;
    const end = this.endAt(at, marks);
    byId("size-form").hidden = true;
    if (end) {
      const [x, y] = this.toPad(pointAt(marks, end));
      this.drag = { end, away: [x - at[0], y - at[1]], marks };
      this.touched = end[0];
    } else if (this.kind?.field === "horizon") this.drag = { from: this.toPhoto(at), marks };
    else this.drag = { points: [this.toPhoto(at)] };
    this.follow(event);
  }

  /** The nearest end under a finger. */
  private endAt(at: Point, marks: readonly Mark[]): End | undefined {
    const away = (point: Point): number => {
      const [x, y] = this.toPad(point);
      return Math.hypot(x - at[0], y - at[1]);
    };
    const ends = marks.flatMap(({ points }, i) =>
      points.map((point, j) => ({ end: [i, j] as const, far: away(point) })),
    );
    return ends.filter(({ far }) => far <= GRIP).sort((a, b) => a.far - b.far)[0]?.end;
  }

  private follow(event: PointerEvent): void {
    if (this.tool === "sun" && event.type === "pointermove") this.actions.forward(event);
    if (!this.drag || !event.buttons) return;
    const [left, top] = "away" in this.drag ? this.drag.away : [0, 0];
    const at = this.pointOf(event, left, top);
    const to = this.toPhoto(at);
    if ("end" in this.drag) this.drag.marks = moveEnd(this.drag.marks, this.drag.end, to);
    else if ("from" in this.drag) {
      this.drag.marks = this.shift(this.drag.marks, to[1] - this.drag.from[1]);
      this.drag.from = to;
    } else this.drag.points = [this.drag.points[0] ?? to, to];
    this.draw();
    if (this.view) this.loupe.show(this.view.photo.picture, this.onLine(at), this.size);
    this.preview();
  }

  /** The point of a line that is dragged as a whole, above or below a finger; else where the finger is. */
  private onLine([x, y]: Point): Point {
    const moved = this.drag && "from" in this.drag ? this.drag.marks[0]?.points : undefined;
    const [from, to] = (moved ?? []).map((point) => this.toPad(point));
    if (!from || !to || from[0] === to[0]) return [x, y];
    const height = from[1] + ((to[1] - from[1]) * (x - from[0])) / (to[0] - from[0]);
    return [x, clamp(height, 0, this.size.height)];
  }

  /** Marks moved down as a whole, as far as the picture goes. */
  private shift(marks: Mark[], down: number): Mark[] {
    const { top, height } = this.area;
    const rows = marks.flatMap(({ points }) => points.map(([, y]) => y));
    const most = clamp(down, top - Math.min(...rows), top + height - Math.max(...rows));
    return moveMarks(marks, ([x, y]) => [x, y + most]);
  }

  /** Shows at once what follows from what is drawn or dragged. */
  private preview(): void {
    const { view, kind, drag, said } = this;
    if (!view || !kind || !drag || !said) return;
    const marks = "points" in drag ? this.withNew(drag.points) : drag.marks;
    const mark = marks["points" in drag ? marks.length - 1 : "end" in drag ? drag.end[0] : 0];
    if (!mark || !this.isLongEnough(mark.points)) return;
    const onPad = (one: Mark): Mark => ({ ...one, points: this.onPad(one) });
    const read = (field: DrawnField): Mark[] => (field === kind.field ? marks : readMarks(said[field])).map(onPad);
    const live = liveOf(view.estimate, view.pixelCamera, this.size, kind.field, onPad(mark), read);
    if (live) this.actions.preview(live);
  }

  private finish(event: PointerEvent): void {
    this.loupe.hide();
    const { drag, kind } = this;
    const border = this.withBorder(event);
    if (this.tool === "sun") this.actions.forward(event);
    else if (!drag || !kind) this.clear();
    else if (border) this.stateMarks(border);
    else if ("marks" in drag) this.stateMarks(drag.marks);
    else if (kind.ends.length === 1 + this.first.length) this.stateNew(drag.points);
    else if (!this.isLongEnough(drag.points)) this.clear();
    else if (this.tool === "size") {
      byId("size-form").hidden = false;
      this.meters.focus();
      this.meters.select();
    } else if (kind.next && !this.first.length) {
      this.first = drag.points;
      byId("tool-help").textContent = kind.next;
      this.clear();
    } else this.stateNew(drag.points);
  }

  /** The lit side that was drawn last, if a tap between its edges says where shade turns into light. */
  private withBorder(event: PointerEvent): Mark[] | undefined {
    const at = this.pointOf(event);
    const away = ([x, y]: Point, from: Point): number => Math.hypot(x - from[0], y - from[1]);
    const marks = this.stated;
    const last = marks.pop();
    const [shaded, lit] = last ? this.onPad(last) : [];
    if (this.kind?.prefix !== "lit:" || last?.prefix !== "lit:" || !shaded || !lit) return undefined;
    const share = litShare(shaded, lit, at);
    const isFar = Math.min(away(shaded, at), away(lit, at)) > away(shaded, lit) + GRIP;
    if (isFar || !(share > BESIDE && share < 1 - BESIDE) || away(at, this.pressed) >= SHORTEST) return undefined;
    return [...marks, { ...last, points: [...last.points.slice(0, 2), this.toPhoto(at)] }];
  }

  /** What is said of the tool's field. */
  private get stated(): Mark[] {
    return this.kind && this.said ? readMarks(this.said[this.kind.field]) : [];
  }

  /** All marks of the tool's field with a new one. */
  private withNew(drawn: readonly Point[]): Mark[] {
    const { kind } = this;
    if (!kind) return [];
    const last = kind.ends.length === 1 + this.first.length ? drawn.slice(-1) : drawn;
    const mark = { prefix: kind.prefix ?? "", points: [...this.first, ...last] };
    return [
      ...(LISTS.includes(kind.field) ? this.stated : []),
      { ...mark, meters: kind.field === "reference" ? this.meters.value : "" },
    ];
  }

  private stateNew(drawn: readonly Point[]): void {
    const marks = this.withNew(drawn);
    this.touched = marks.length - 1;
    if (this.kind) this.state({ [this.kind.field]: writeMarks(marks) });
  }

  /** Says where marks were dragged to, if they were. */
  private stateMarks(marks: Mark[]): void {
    this.drag = undefined;
    const text = writeMarks(marks);
    if (this.kind && text !== writeMarks(this.marks)) this.state({ [this.kind.field]: text });
    else this.clear();
  }

  /** Asks for the answer with what was drawn. */
  private state(part: Partial<UserInput>): void {
    if (!this.said) return;
    this.asked = { ...this.said, ...part };
    this.explain();
    this.actions.state(this.asked);
  }

  /** Whether the last line of some points is as long as a drag; a point alone need not be. */
  private isLongEnough(points: readonly Point[]): boolean {
    const [from, to] = points.slice(points.length > 3 ? -2 : 0).map((point) => this.toPad(point));
    return (
      points.length === 1 ||
      (from !== undefined && to !== undefined && Math.hypot(to[0] - from[0], to[1] - from[1]) >= SHORTEST)
    );
  }

  private onPad({ points }: Mark): Point[] {
    return points.map((point) => this.toPad(point));
  }

  private measure(): void {
    const { width, height } = this.pad.getBoundingClientRect();
    this.size = { width, height };
  }

  private get area(): ImagePart {
    return this.view?.photo.area ?? { left: 0, top: 0, width: 1, height: 1 };
  }

  private toPad([x, y]: Point): Point {
    const { left, top, width, height } = this.area;
    return [((x - left) / width) * this.size.width, ((y - top) / height) * this.size.height];
  }

  private toPhoto([x, y]: Point): Point {
    const { left, top, width, height } = this.area;
    return [left + (x / this.size.width) * width, top + (y / this.size.height) * height];
  }

  /** Where a pointer is, or what it holds so far to the right and down, within the picture. */
  private pointOf(event: PointerEvent, right = 0, down = 0): Point {
    const { left, top, width, height } = this.pad.getBoundingClientRect();
    return [clamp(event.clientX - left + right, 0, width), clamp(event.clientY - top + down, 0, height)];
  }

  /** Draws the marks of the tool, what is being drawn, and the grips of all ends. */
  private draw(): void {
    const { width, height } = this.size;
    if (width < 1) {
      this.grips.replaceChildren();
      return;
    }
    this.pad.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const { marks } = this;
    const drawn = this.drag && "points" in this.drag ? this.drag.points : [];
    const lines = [...marks, ...[this.first, drawn].map((points) => ({ prefix: "", points, meters: "" }))];
    const isHorizon = this.kind?.field === "horizon";
    this.pad.replaceChildren(
      ...lines.flatMap((mark) => drawMark(this.onPad(mark), isHorizon ? width : 0, mark.prefix === GUESS)),
    );
    this.drawGrips(marks.map((mark) => this.onPad(mark)));
    const touched = this.kind?.field === "shadow" ? marks[this.touched] : undefined;
    byId("guess-label").hidden = !touched || !hasFoot(touched);
    this.guess.checked = touched?.prefix === GUESS;
  }

  /** Grips for keys: of each end, and of the horizon as a whole. They stay while they have the focus. */
  private drawGrips(marks: Point[][]): void {
    const grips = marks.flatMap((points, i) =>
      points.map((point, j) => ({ point, end: [i, j] as End | undefined, name: this.nameOf([i, j]) })),
    );
    const [from, to] = marks[0] ?? [];
    if (this.kind?.field === "horizon" && from && to) {
      const middle = [(from[0] + to[0]) / 2, (from[1] + to[1]) / 2] as const;
      grips.splice(1, 0, { point: middle, end: undefined, name: "Horizon" });
    }
    while (this.grips.children.length > grips.length) this.grips.lastElementChild?.remove();
    const { width, height } = this.size;
    grips.forEach(({ point: [x, y], end, name }, i) => {
      const grip = (this.grips.children[i] ?? this.grips.appendChild(this.createGrip())) as HTMLElement;
      const [right, down] = [Math.round((100 * x) / width), Math.round((100 * y) / height)];
      grip.ariaLabel = name;
      grip.ariaValueNow = String(down);
      grip.ariaValueText = `${right} % from the left, ${down} % from the top`;
      grip.dataset.end = end?.join(" ") ?? "";
      Object.assign(grip.style, { left: `${x}px`, top: `${y}px` });
    });
  }

  private nameOf([mark, point]: End): string {
    const { prefix = "", points: { length } = [] } = this.marks[mark] ?? {};
    const isLike = (one: Kind): boolean =>
      one.field === this.kind?.field && (one.prefix ?? "") === prefix.replace(GUESS, "") && one.ends.length >= length;
    const kind = KINDS[this.tool as keyof typeof KINDS]?.find(isLike) ?? this.kind;
    return `${kind?.name}: ${kind?.ends[point] ?? point + 1}`;
  }

  private createGrip(): HTMLElement {
    const grip = createElement("div", { tabIndex: 0, role: "slider", ariaValueMin: "0", ariaValueMax: "100" });
    grip.addEventListener("keydown", (event) => this.key(event, grip));
    grip.addEventListener("blur", () => this.settle());
    return grip;
  }

  /** An arrow key moves an end, or the horizon up and down. */
  private key(event: KeyboardEvent, grip: HTMLElement): void {
    const step = arrowStep(event, event.shiftKey ? 10 * STEP : STEP);
    if (!step) return;
    event.preventDefault();
    const [mark, point] = (grip.dataset.end ?? "").split(" ").map(Number);
    const { marks } = this;
    if (mark === undefined || point === undefined) {
      const down = (-step[1] * this.area.height) / this.size.height;
      this.drag = { from: [0, 0], marks: this.shift(marks, down) };
    } else {
      const [x, y] = this.toPad(pointAt(marks, [mark, point]));
      const { width, height } = this.size;
      const to = this.toPhoto([clamp(x + step[0], 0, width), clamp(y - step[1], 0, height)]);
      this.drag = { end: [mark, point], away: [0, 0], marks: moveEnd(marks, [mark, point], to) };
    }
    this.draw();
    this.preview();
    clearTimeout(this.resting);
    this.resting = setTimeout(() => this.settle(), REST);
  }

  /** Says what keys have moved. */
  private settle(): void {
    if (this.resting === undefined) return;
    clearTimeout(this.resting);
    this.resting = undefined;
    if (this.drag && "marks" in this.drag) this.stateMarks(this.drag.marks);
  }
}

const pointAt = (marks: readonly Mark[], [mark, point]: End): Point => marks[mark]?.points[point] ?? [0, 0];

const moveEnd = (marks: Mark[], [mark, point]: End, to: Point): Mark[] =>
  moveMarks(marks, (old, [i, j]) => (i === mark && j === point ? to : old));

/**
 * The lines of a mark with its ends, dashed if it is a guess; where `width` is not 0, its one line goes on to both sides
 * of a picture so wide.
 */
function drawMark(points: readonly Point[], width: number, isGuess: boolean): SVGElement[] {
  const [foot, ...others] = points;
  const lines = points.length === 3 ? others.map((end) => [foot, end]) : [points.slice(0, 2), points.slice(2)];
  const drawn = lines.flatMap(([from, to]) => {
    if (!from || !to) return [];
    const line = width ? [extend(to, from, width), extend(from, to, width)] : [from, to];
    return [drawPath(line, "rim"), drawPath(line, isGuess ? "line guess" : "line")];
  });
  return [...drawn, ...points.map(([cx, cy]) => createSvg("circle", { cx, cy, r: 7 }))];
}

/** The point that lies so far beyond `to`, as seen from `from`. */
function extend([x, y]: Point, to: Point, by: number): Point {
  const length = Math.max(Math.hypot(to[0] - x, to[1] - y), 1e-9);
  return [to[0] + ((to[0] - x) * by) / length, to[1] + ((to[1] - y) * by) / length];
}

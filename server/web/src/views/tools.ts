/** The tool bar of the photo: what a drag on it means. A loupe shows what is under the finger, and the light follows. */

import { addRadioButtons, byId, createElement, createSvg, drawPath, findRadio } from "../dom";
import type { Point } from "../geometry/camera";
import { shadowAzimuth } from "../geometry/marks";
import type { PhotoView } from "../state";
import { DRAWN_FIELDS, type DrawnField, type UserInput } from "../text/metadata";

const TOOLS = ["place", "sun", "shadow", "horizon", "size"] as const;
type Tool = (typeof TOOLS)[number];

/** What a drag of a tool draws. */
interface Kind {
  name: string;
  help: string;
  field: DrawnField;
  prefix?: string; // of what it states
  taps?: boolean; // whether one point is all that is asked for
}

const HELP = {
  place: "Tap the ground, and the object stands there.",
  sun: "Drag anywhere: left and right turn the sun, up and down raise it.",
};
const KINDS: Record<"shadow" | "horizon" | "size", Kind[]> = {
  shadow: [
    {
      name: "Shadow from a foot to its tip",
      help: "Drag from the foot of a thing to the tip of its shadow.",
      field: "shadow",
    },
    {
      name: "Shadow of my camera or hands",
      help: "Tap the shadow of your camera, or of the hands that hold it.",
      field: "shadow",
      prefix: "own:",
      taps: true,
    },
    { name: "Shadow of my head", help: "Tap the shadow of your head.", field: "shadow", prefix: "head:", taps: true },
    {
      name: "Shadow without a foot",
      help: "Drag along a straight edge of a shadow on the ground.",
      field: "shadow",
      prefix: "line:",
    },
    {
      name: "Shadow on a wall, post or trunk",
      help: "Drag from the side in shade to the side in light.",
      field: "shadow",
      prefix: "lit:",
    },
  ],
  horizon: [
    { name: "Horizon", help: "Drag along the horizon, from left to right.", field: "horizon" },
    { name: "Upright edges", help: "Drag along an edge that is upright, then along another.", field: "vertical" },
  ],
  size: [{ name: "Size", help: "Drag from a thing's foot to its top; then say how high it is.", field: "reference" }],
};
const NAMES: Record<DrawnField, string> = {
  shadow: "Shadow",
  horizon: "Horizon",
  vertical: "Upright edges",
  reference: "Size",
};
const LISTS: readonly DrawnField[] = ["shadow", "vertical"]; // to which another one is added
const LOUPE = 128; // CSS pixels
const ZOOM = 2.5; // of the loupe
const AWAY = 96; // CSS pixels from the finger to the loupe's middle
const SHORTEST = 12; // CSS pixels of a drag that counts

/** What the page does with gestures. */
interface Actions {
  turnSun: (azimuth: number) => void; // while a shadow is drawn
  forward: (event: PointerEvent) => void; // of the tool for the sun
  state: (userInput: UserInput) => void; // asks the service anew
}

export class Tools {
  private readonly pad = byId<SVGSVGElement>("pad");
  private readonly loupe = byId<HTMLCanvasElement>("loupe");
  private readonly meters = byId<HTMLInputElement>("meters");
  private readonly kinds = byId<HTMLSelectElement>("kinds");
  private view: PhotoView | undefined;
  private tool: Tool = "place";
  private start: Point | undefined;
  private end: Point | undefined;

  constructor(private readonly actions: Actions) {
    addRadioButtons(byId("tools"), TOOLS, (tool) => this.choose(tool));
    this.pad.addEventListener("pointerdown", (event) => this.begin(event));
    this.pad.addEventListener("pointermove", (event) => this.follow(event));
    this.pad.addEventListener("pointerup", (event) => this.finish(event));
    this.pad.addEventListener("pointercancel", () => this.clear());
    this.kinds.addEventListener("change", () => this.explain());
    byId("size-form").addEventListener("submit", (event) => {
      event.preventDefault();
      if (this.kind) this.state(this.kind, this.meters.value);
    });
    this.choose("place");
  }

  /** Another photo, or another answer about it. Tools that draw are for one photo whose pixels this browser knows. */
  show(view: PhotoView, alone: boolean): void {
    this.view = view;
    const draws = alone && view.photo.area !== undefined;
    for (const tool of Object.keys(KINDS)) findRadio(byId("tools"), tool).disabled = !draws;
    if (!draws && this.tool in KINDS) this.choose("place");
    const drawn = DRAWN_FIELDS.filter((field) => view.userInput[field]);
    byId("drawn").replaceChildren(...drawn.map((field) => createElement("li", {}, this.chip(field))));
    const asked = view.estimate.warnings.filter((_, i) => view.estimate.warning_codes?.[i] === "shadow-contradicted");
    byId("tool-warning").textContent = asked.join(" ");
    this.clear();
  }

  private chip(field: DrawnField): HTMLButtonElement {
    const button = createElement("button", { type: "button", title: "Take it away" }, `${NAMES[field]} ×`);
    button.addEventListener("click", () => {
      if (this.view) this.actions.state({ ...this.view.userInput, [field]: "" });
    });
    return button;
  }

  private choose(tool: Tool): void {
    this.tool = tool;
    findRadio(byId("tools"), tool).checked = true;
    const kinds = tool in KINDS ? KINDS[tool as keyof typeof KINDS] : [];
    this.kinds.replaceChildren(...kinds.map(({ name }, i) => new Option(name, String(i))));
    this.kinds.hidden = kinds.length < 2;
    this.pad.toggleAttribute("hidden", tool === "place");
    this.explain();
  }

  /** What a drag draws; undefined of tools that draw nothing. */
  private get kind(): Kind | undefined {
    return KINDS[this.tool as keyof typeof KINDS]?.[Number(this.kinds.value)];
  }

  private explain(): void {
    byId("tool-help").textContent = this.kind?.help ?? HELP[this.tool as keyof typeof HELP];
    this.clear();
  }

  private clear(): void {
    this.start = undefined;
    this.end = undefined;
    this.loupe.hidden = true;
    byId("size-form").hidden = true;
    this.pad.replaceChildren();
  }

  private begin(event: PointerEvent): void {
    if (event.button !== 0) return;
    event.preventDefault();
    this.pad.setPointerCapture(event.pointerId);
    this.clear();
    if (this.tool === "sun") this.actions.forward(event);
    else this.start = this.pointOf(event);
    this.follow(event);
  }

  private follow(event: PointerEvent): void {
    if (this.tool === "sun" && event.type === "pointermove") this.actions.forward(event);
    if (!this.start || !event.buttons) return;
    this.end = this.pointOf(event);
    this.draw();
    this.drawLoupe(this.end);
    if (this.tool !== "shadow" || this.kind?.prefix || !this.isLongEnough() || !this.view) return;
    const azimuth = shadowAzimuth(this.start, this.end, this.view.estimate.camera, this.size());
    if (azimuth !== undefined) this.actions.turnSun(azimuth);
  }

  private finish(event: PointerEvent): void {
    this.loupe.hidden = true;
    if (this.tool === "sun") this.actions.forward(event);
    else if (!this.start || !this.kind || !(this.isLongEnough() || this.kind.taps)) this.clear();
    else if (this.tool === "size") {
      byId("size-form").hidden = false;
      this.meters.focus();
      this.meters.select();
    } else this.state(this.kind);
  }

  /** Asks for the answer with what was drawn. */
  private state({ field, prefix = "", taps }: Kind, ...more: string[]): void {
    const area = this.view?.photo.area;
    if (!this.view || !area || !this.start || !this.end) return;
    const { width, height } = this.size();
    const points = taps ? [this.end] : [this.start, this.end];
    const pixels = points.flatMap(([x, y]) => [
      (area.left + (x / width) * area.width).toFixed(1),
      (area.top + (y / height) * area.height).toFixed(1),
    ]);
    const text = prefix + [...pixels, ...more].join(",");
    const before = this.view.userInput[field];
    this.actions.state({
      ...this.view.userInput,
      [field]: before && LISTS.includes(field) ? `${before};${text}` : text,
    });
  }

  private isLongEnough(): boolean {
    if (!this.start || !this.end) return false;
    return Math.hypot(this.end[0] - this.start[0], this.end[1] - this.start[1]) >= SHORTEST;
  }

  private size(): { width: number; height: number } {
    const { width, height } = this.pad.getBoundingClientRect();
    return { width, height };
  }

  private pointOf(event: PointerEvent): Point {
    const { left, top, width, height } = this.pad.getBoundingClientRect();
    const within = (value: number, most: number): number => Math.min(Math.max(value, 0), most);
    return [within(event.clientX - left, width), within(event.clientY - top, height)];
  }

  private draw(): void {
    if (!this.start || !this.end) return;
    const { width, height } = this.size();
    this.pad.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const line = [this.start, this.end];
    const [cx, cy] = this.start;
    this.pad.replaceChildren(drawPath(line, "rim"), drawPath(line, "line"), createSvg("circle", { cx, cy, r: 6 }));
  }

  /** The photo around a point, above the finger or, near the upper edge, below it. */
  private drawLoupe([x, y]: Point): void {
    const context = this.loupe.getContext("2d");
    if (!context || !this.view) return;
    const { picture } = this.view.photo;
    const { width, height } = this.size();
    const scale = picture.width / width;
    const side = (LOUPE / ZOOM) * scale;
    this.loupe.hidden = false;
    this.loupe.style.left = `${Math.min(Math.max(x - LOUPE / 2, 0), width - LOUPE)}px`;
    this.loupe.style.top = `${(y > AWAY + LOUPE / 2 ? y - AWAY : Math.min(y + AWAY, height - LOUPE / 2)) - LOUPE / 2}px`;
    context.fillStyle = "#000";
    context.fillRect(0, 0, LOUPE, LOUPE);
    context.drawImage(picture, x * scale - side / 2, y * scale - side / 2, side, side, 0, 0, LOUPE, LOUPE);
    context.strokeStyle = "#fff";
    context.beginPath();
    context.moveTo(LOUPE / 2, LOUPE / 2 - 12);
    context.lineTo(LOUPE / 2, LOUPE / 2 + 12);
    context.moveTo(LOUPE / 2 - 12, LOUPE / 2);
    context.lineTo(LOUPE / 2 + 12, LOUPE / 2);
    context.stroke();
  }
}

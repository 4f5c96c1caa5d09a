/** The tool bar of the photo: what a drag on it means. A loupe shows what is under the finger, and the light follows. */

import { addRadioButtons, byId, createElement, createSvg, drawPath, findRadio } from "../dom";
import type { Point } from "../geometry/camera";
import { shadowAzimuth } from "../geometry/marks";
import type { PhotoView } from "../state";
import type { UserInput } from "../text/metadata";

const TOOLS = ["place", "sun", "shadow", "horizon", "size"] as const;
type Tool = (typeof TOOLS)[number];
type DrawnField = "shadow" | "horizon" | "reference";

const FIELDS = { shadow: "shadow", horizon: "horizon", size: "reference" } as const;
const HELP: Record<Tool, string> = {
  place: "Tap the ground, and the object stands there.",
  sun: "Drag anywhere: left and right turn the sun, up and down raise it.",
  shadow: "Drag from the foot of a thing to the tip of its shadow.",
  horizon: "Drag along the horizon, from left to right.",
  size: "Drag from a thing's foot to its top; then say how high it is.",
};
const KINDS: Record<string, { name: string; help: string; taps?: boolean }> = {
  "": { name: "from a foot to its tip", help: HELP.shadow },
  own: {
    name: "of my camera or hands",
    help: "Tap the shadow of your camera, or of the hands that hold it.",
    taps: true,
  },
  head: { name: "of my head", help: "Tap the shadow of your head.", taps: true },
  line: { name: "without a foot", help: "Drag along a straight edge of a shadow on the ground." },
  lit: { name: "on a wall, post or trunk", help: "Drag from the side in shade to the side in light." },
};
const NAMES: Record<DrawnField, string> = { shadow: "Shadow", horizon: "Horizon", reference: "Size" };
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
  private readonly kind = byId<HTMLSelectElement>("shadow-kind");
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
    for (const [value, { name }] of Object.entries(KINDS)) this.kind.append(new Option(`Shadow ${name}`, value));
    this.kind.addEventListener("change", () => this.choose("shadow"));
    byId("size-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.state("reference", this.meters.value);
    });
    this.choose("place");
  }

  /** Another photo, or another answer about it. Tools that draw are for one photo whose pixels this browser knows. */
  show(view: PhotoView, alone: boolean): void {
    this.view = view;
    const draws = alone && view.photo.area !== undefined;
    for (const tool of ["shadow", "horizon", "size"] as const) findRadio(byId("tools"), tool).disabled = !draws;
    if (!draws && this.tool in FIELDS) this.choose("place");
    const drawn = (Object.keys(NAMES) as DrawnField[]).filter((field) => view.userInput[field]);
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
    this.kind.hidden = tool !== "shadow";
    byId("tool-help").textContent = tool === "shadow" ? (KINDS[this.kind.value]?.help ?? "") : HELP[tool];
    this.pad.toggleAttribute("hidden", tool === "place");
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
    if (this.tool !== "shadow" || this.kind.value || !this.isLongEnough() || !this.view) return;
    const azimuth = shadowAzimuth(this.start, this.end, this.view.estimate.camera, this.size());
    if (azimuth !== undefined) this.actions.turnSun(azimuth);
  }

  private finish(event: PointerEvent): void {
    this.loupe.hidden = true;
    if (this.tool === "sun") this.actions.forward(event);
    else if (!this.start || !(this.isLongEnough() || this.isTap())) this.clear();
    else if (this.tool === "size") {
      byId("size-form").hidden = false;
      this.meters.focus();
      this.meters.select();
    } else if (this.tool !== "place") this.state(FIELDS[this.tool]);
  }

  /** Asks for the answer with what was drawn; a second shadow is added to the first. */
  private state(field: DrawnField, ...more: string[]): void {
    const area = this.view?.photo.area;
    if (!this.view || !area || !this.start || !this.end) return;
    const { width, height } = this.size();
    const points = this.isTap() ? [this.end] : [this.start, this.end];
    const pixels = points.flatMap(([x, y]) => [
      (area.left + (x / width) * area.width).toFixed(1),
      (area.top + (y / height) * area.height).toFixed(1),
    ]);
    const prefix = field === "shadow" && this.kind.value ? `${this.kind.value}:` : "";
    const text = prefix + [...pixels, ...more].join(",");
    const before = field === "shadow" && this.view.userInput.shadow ? `${this.view.userInput.shadow};` : "";
    this.actions.state({ ...this.view.userInput, [field]: before + text });
  }

  /** Whether one point is all that is asked for. */
  private isTap(): boolean {
    return this.tool === "shadow" && KINDS[this.kind.value]?.taps === true;
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

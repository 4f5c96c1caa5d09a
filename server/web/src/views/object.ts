/** The stage with its controls; three.js is fetched when the first photo has its answer. */

import { byId, byTouch, choices, radio } from "../dom";
import { aspectOf } from "../photo";
import { FINISHES, SHAPES } from "../pure/objects";
import { distance, EYE_HEIGHT, footOf, largest, moved, type Place, shifted, sized, turned } from "../pure/place";
import { short } from "../pure/words";
import type { Stage } from "../scene/stage";
import type { Light } from "../sky/light";
import { type Look, lookOf, type View } from "../studio";

const KEYS = "Keys: arrows move it, < and > turn it, + and − scale it.";
const how = (where: string): string =>
  byTouch()
    ? `Tap the ${where} to move it, drag to turn it.`
    : `Click the ${where} to move it, drag to turn it. ${KEYS}`;
const AFLOAT = "The photo shows no ground, so the object floats.";
const NO_WEBGL = "This browser offers no WebGL, so the object cannot be drawn; everything else works.";
const NOT_LOADED = "What draws the object could not be loaded; everything else works. Load the page again to see it.";
const CLICK = 5; // pixels that a click may wander

type Change = (part: Partial<Look>, kind: string) => void;

export class ObjectView {
  private readonly canvas = byId<HTMLCanvasElement>("stage");
  private readonly note = byId("scene-note");
  private readonly size = byId<HTMLInputElement>("object-size");
  private readonly turn = byId<HTMLInputElement>("object-turn");
  private readonly stage: Promise<Stage | null>;
  private begin: () => void = () => {};
  private view: View | undefined;
  private dragged = 0;

  constructor(
    private readonly change: Change,
    private readonly failed: (error: unknown) => void,
  ) {
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `An object in the photo. ${KEYS}`);
    this.stage = new Promise<void>((resolve) => {
      this.begin = resolve;
    }).then(() => this.load());
    choices(byId("shapes"), SHAPES, (shape) => this.change({ shape }, "shape"));
    choices(byId("finishes"), FINISHES, (finish) => this.change({ finish }, "finish"));
    this.offerOwn(false);
    this.listen();
  }

  /** A new photo; the object appears with its first light. */
  open(view: View): void {
    this.view = view;
    this.begin();
    this.canvas.hidden = true;
    const { pixels, picture } = view.photo;
    const lit = { width: pixels.width, height: pixels.height, data: view.lit };
    this.with((stage) => stage.setPhoto(picture, view.answer.camera, lit));
  }

  /** The object as it is wanted now. */
  show({ place, shape, finish }: Look): void {
    this.with((stage) => {
      stage.setLook(shape, finish);
      stage.setPlace(place);
      this.tell(place, stage.objectHeight);
      this.note.textContent = place.grounded ? how("ground") : `${AFLOAT} ${how("photo")}`;
    });
    radio(byId("shapes"), shape).checked = true;
    radio(byId("finishes"), finish).checked = true;
    this.size.max = String(Math.log2(largest(place)));
    this.size.value = String(Math.log2(place.radius));
    this.turn.value = String(Math.round(place.turn));
    this.canvas.dataset.foot = this.view ? JSON.stringify(footOf(place, this.view.answer.camera, this.aspect)) : "";
  }

  light(light: Light, view: View): void {
    this.with((stage) => {
      stage.setLight(light, lookOf(view).parameters);
      this.canvas.hidden = false;
      this.fit(stage);
    });
  }

  /** Takes the user's own object. */
  async take(file: File): Promise<void> {
    try {
      const { readModel } = await import("../scene/model");
      const model = await readModel(file);
      byId("own-name").textContent = file.name;
      this.offerOwn(true);
      this.with((stage) => stage.setOwn(model));
      this.change({ shape: "own", finish: "file's own" }, `own ${file.name}`);
    } catch (error) {
      this.failed(error);
    }
  }

  /** Where the object stands and how large it is, in words. */
  private tell(place: Place, height: number): void {
    const words = `${metres(height)} high`;
    const away = place.grounded ? `, ${metres(distance(place))} away` : "";
    byId("object-where").textContent = `${words}${away}, if the camera was ${EYE_HEIGHT} m above the ground.`;
    this.size.setAttribute("aria-valuetext", words);
  }

  private offerOwn(there: boolean): void {
    radio(byId("shapes"), "own").disabled = !there;
    radio(byId("finishes"), "file's own").disabled = !there;
  }

  private async load(): Promise<Stage | null> {
    const drawing = await import("../scene/stage").catch(() => null);
    if (!drawing) {
      this.note.textContent = NOT_LOADED;
      return null;
    }
    try {
      const { Stage } = drawing;
      const stage = new Stage(this.canvas);
      new ResizeObserver(() => this.fit(stage)).observe(byId("frame"));
      return stage;
    } catch {
      this.note.textContent = NO_WEBGL;
      return null;
    }
  }

  private fit(stage: Stage): void {
    const { width, height } = byId("frame").getBoundingClientRect();
    if (width > 0 && height > 0) stage.setSize(width, height);
  }

  private with(act: (stage: Stage) => void): void {
    this.stage.then((stage) => {
      if (stage) act(stage);
    });
  }

  private get aspect(): number {
    return this.view ? aspectOf(this.view.photo) : 1;
  }

  private place(make: (place: Place) => Place | null, kind: string): void {
    const place = this.view && make(lookOf(this.view).place);
    if (place) this.change({ place }, kind);
    else this.note.textContent = "There is no ground: click below the horizon.";
  }

  private listen(): void {
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.dragged = 0;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      this.dragged += Math.hypot(event.movementX, event.movementY);
      if (this.dragged > CLICK) this.place((place) => turned(place, event.movementX * 0.6), "turn");
    });
    this.canvas.addEventListener("click", (event) => {
      if (this.dragged <= CLICK) this.moveTo(event);
    });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    this.size.addEventListener("input", () =>
      this.place((place) => sized(place, 2 ** this.size.valueAsNumber), "size"),
    );
    this.turn.addEventListener("input", () =>
      this.place((place) => ({ ...place, turn: this.turn.valueAsNumber }), "turn"),
    );
  }

  private moveTo(event: MouseEvent): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const spot = [(event.clientX - left) / width, (event.clientY - top) / height] as const;
    this.place((place) => (this.view ? moved(place, this.view.answer.camera, this.aspect, spot) : null), "move");
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const keys: Record<string, [string, (place: Place, step: number) => Place]> = {
      ArrowLeft: ["move", (place, step) => shifted(place, -step, 0)],
      ArrowRight: ["move", (place, step) => shifted(place, step, 0)],
      ArrowUp: ["move", (place, step) => shifted(place, 0, step)],
      ArrowDown: ["move", (place, step) => shifted(place, 0, -step)],
      "<": ["turn", (place) => turned(place, -10)],
      ",": ["turn", (place) => turned(place, -10)],
      ">": ["turn", (place) => turned(place, 10)],
      ".": ["turn", (place) => turned(place, 10)],
      "+": ["size", (place) => sized(place, place.radius * 1.1)],
      "=": ["size", (place) => sized(place, place.radius * 1.1)],
      "-": ["size", (place) => sized(place, place.radius / 1.1)],
    };
    const found = keys[event.key];
    if (!found) return;
    event.preventDefault();
    this.place((place) => found[1](place, 0.04 * distance(place)), found[0]);
  }
}

const metres = (value: number): string =>
  value < 1 ? `${(100 * value).toFixed(0)}\u00a0cm` : `${short(value)}\u00a0m`;

/** The stage with its controls; three.js is fetched when the first photo has its answer. */

import type { Parameters } from "../api";
import { byId, choices } from "../dom";
import type { Photo } from "../photo";
import { type Camera, placeFor } from "../pure/camera";
import { latest } from "../pure/latest";
import { FINISHES, SHAPES } from "../pure/objects";
import type { Stage } from "../scene/stage";

const TURN = "Drag to turn it, or use the arrow keys.";
const AFLOAT = `The photo shows no ground, so the object floats. ${TURN}`;
const NO_WEBGL = "This browser offers no WebGL, so the object cannot be drawn; everything else works.";

export class ObjectView {
  private readonly canvas = byId<HTMLCanvasElement>("stage");
  private readonly note = byId("scene-note");
  private readonly light: (parameters: Parameters) => void;
  private readonly stage: Promise<Stage | null>;
  private begin: () => void = () => {};

  constructor(failed: (error: unknown) => void) {
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", "An object in the photo, in its light: the arrow keys turn it");
    this.stage = new Promise<void>((resolve) => {
      this.begin = resolve;
    }).then(() => this.load());
    this.light = latest((parameters, signal) => this.relight(parameters, signal), 40, failed);
    choices(byId("shapes"), SHAPES, (shape) => this.with((stage) => stage.setShape(shape)));
    choices(byId("finishes"), FINISHES, (finish) => this.with((stage) => stage.setFinish(finish)));
    this.listen();
  }

  /** A new photo; the object appears with its first light. */
  show(photo: Photo, camera: Camera): void {
    this.begin();
    this.canvas.hidden = true;
    this.with((stage) => {
      stage.setPhoto(photo.picture, camera);
      this.note.textContent = placeFor(camera).grounded ? TURN : AFLOAT;
    });
  }

  mark(parameters: Parameters): void {
    this.light(parameters);
  }

  private async load(): Promise<Stage | null> {
    try {
      const { Stage } = await import("../scene/stage");
      const stage = new Stage(this.canvas);
      new ResizeObserver(() => this.fit(stage)).observe(byId("frame"));
      return stage;
    } catch {
      this.note.textContent = NO_WEBGL;
      return null;
    }
  }

  private async relight(parameters: Parameters, signal: AbortSignal): Promise<void> {
    const stage = await this.stage;
    if (!stage) return;
    const { fetchLight } = await import("../scene/maps");
    const light = await fetchLight(parameters, signal);
    if (signal.aborted) return;
    stage.setLight(light, parameters);
    this.canvas.hidden = false;
    this.fit(stage);
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

  private listen(): void {
    this.canvas.addEventListener("pointerdown", (event) => this.canvas.setPointerCapture(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons === 1) this.with((stage) => stage.turn(event.movementX * 0.6));
    });
    this.canvas.addEventListener("keydown", (event) => {
      const turn = { ArrowLeft: -10, ArrowRight: 10 }[event.key];
      if (turn === undefined) return;
      event.preventDefault();
      this.with((stage) => stage.turn(turn));
    });
  }
}

/** The stage with its controls; three.js is fetched when the first photo has its answer. */

import { addRadioButtons, byId, findRadio, isTouchDevice } from "../dom";
import {
  cameraHeight,
  footPoint,
  groundDistance,
  maxRadius,
  movePlacement,
  type Placement,
  resizePlacement,
  rotatePlacement,
  shiftPlacement,
} from "../geometry/placement";
import type { Stage } from "../scene/stage";
import type { SceneLight } from "../sky/lighting";
import { aspectRatio, currentState, type EditState, FINISHES, type PhotoView, SHAPES } from "../state";
import { formatShort } from "../text/format";

const KEYS = "Keys: arrows move it, < and > turn it, + and − scale it.";
const usageText = (where: string): string =>
  isTouchDevice()
    ? `Tap the ${where} to move it, drag to turn it.`
    : `Click the ${where} to move it, drag to turn it. ${KEYS}`;
const NO_GROUND =
  "The photo shows no firm, level ground with room for it, so the object floats before it until you click the ground.";
const NO_WEBGL = "This browser offers no WebGL, so the object cannot be drawn; everything else works.";
const STAGE_NOT_LOADED =
  "What draws the object could not be loaded; everything else works. Load the page again to see it.";
const CLICK = 5; // pixels that a click may wander

type Change = (part: Partial<EditState>, kind: string) => void;

export class ObjectView {
  private readonly canvas = byId<HTMLCanvasElement>("stage");
  private readonly note = byId("scene-note");
  private readonly size = byId<HTMLInputElement>("object-size");
  private readonly rotation = byId<HTMLInputElement>("object-turn");
  private readonly stage: Promise<Stage | null>;
  private startLoading: () => void = () => {};
  private view: PhotoView | undefined;
  private dragged = 0;

  constructor(
    private readonly change: Change,
    private readonly onError: (error: unknown) => void,
  ) {
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `An object in the photo. ${KEYS}`);
    this.stage = new Promise<void>((resolve) => {
      this.startLoading = resolve;
    }).then(() => this.load());
    addRadioButtons(byId("shapes"), SHAPES, (shape) => this.change({ shape }, "shape"));
    addRadioButtons(byId("finishes"), FINISHES, (finish) => this.change({ finish }, "finish"));
    this.offerOwnModel(false);
    this.listen();
  }

  /** A new photo; the object appears with its first light. */
  open(view: PhotoView): void {
    this.view = view;
    this.startLoading();
    this.canvas.hidden = true;
    const { photo, estimate, shadowMask } = view;
    this.withStage((stage) => stage.setPhoto(photo.picture, estimate.camera, shadowMask));
  }

  /** Shows the object in a state. */
  show({ placement: updatePlacement, shape, finish }: EditState): void {
    this.withStage((stage) => {
      stage.setAppearance(shape, finish);
      stage.setPlacement(updatePlacement);
      this.describePlacement(updatePlacement, stage.objectHeight);
      this.note.textContent = updatePlacement.grounded ? usageText("ground") : `${NO_GROUND} ${usageText("photo")}`;
    });
    findRadio(byId("shapes"), shape).checked = true;
    findRadio(byId("finishes"), finish).checked = true;
    this.size.max = String(Math.log2(maxRadius(updatePlacement)));
    this.size.value = String(Math.log2(updatePlacement.radius));
    this.rotation.value = String(Math.round(updatePlacement.rotation));
    this.canvas.dataset.foot = this.view
      ? JSON.stringify(footPoint(updatePlacement, this.view.estimate.camera, this.aspect))
      : "";
  }

  light(light: SceneLight, view: PhotoView): void {
    this.withStage((stage) => {
      stage.setLight(light, currentState(view).parameters);
      this.canvas.hidden = false;
      this.fit(stage);
    });
  }

  /** Takes the user's own object. */
  async takeModel(file: File): Promise<void> {
    try {
      const { readModel } = await import("../scene/model");
      const model = await readModel(file);
      byId("own-name").textContent = file.name;
      this.offerOwnModel(true);
      this.withStage((stage) => stage.setOwnModel(model));
      this.change({ shape: "own", finish: "file's own" }, `own ${file.name}`);
    } catch (error) {
      this.onError(error);
    }
  }

  /** Writes where the object stands and how large it is. */
  private describePlacement(updatePlacement: Placement, height: number): void {
    const text = `${formatMeters(height)} high`;
    const distance = updatePlacement.grounded ? `, ${formatMeters(groundDistance(updatePlacement))} away` : "";
    const above = this.view ? cameraHeight(this.view.estimate.camera) : 0;
    byId("object-where").textContent = `${text}${distance}, if the camera was ${above} m above the ground.`;
    this.size.setAttribute("aria-valuetext", text);
  }

  private offerOwnModel(available: boolean): void {
    findRadio(byId("shapes"), "own").disabled = !available;
    findRadio(byId("finishes"), "file's own").disabled = !available;
  }

  private async load(): Promise<Stage | null> {
    const drawing = await import("../scene/stage").catch(() => null);
    if (!drawing) {
      this.note.textContent = STAGE_NOT_LOADED;
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

  private withStage(act: (stage: Stage) => void): void {
    this.stage.then((stage) => {
      if (stage) act(stage);
    });
  }

  private get aspect(): number {
    return this.view ? aspectRatio(this.view.photo) : 1;
  }

  private updatePlacement(make: (updatePlacement: Placement) => Placement | null, kind: string): void {
    const updatePlacement = this.view && make(currentState(this.view).placement);
    if (updatePlacement) this.change({ placement: updatePlacement }, kind);
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
      if (this.dragged > CLICK)
        this.updatePlacement((updatePlacement) => rotatePlacement(updatePlacement, event.movementX * 0.6), "turn");
    });
    this.canvas.addEventListener("click", (event) => {
      if (this.dragged <= CLICK) this.moveTo(event);
    });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    this.size.addEventListener("input", () =>
      this.updatePlacement((updatePlacement) => resizePlacement(updatePlacement, 2 ** this.size.valueAsNumber), "size"),
    );
    this.rotation.addEventListener("input", () =>
      this.updatePlacement(
        (updatePlacement) => ({ ...updatePlacement, rotation: this.rotation.valueAsNumber }),
        "turn",
      ),
    );
  }

  private moveTo(event: MouseEvent): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const spot = [(event.clientX - left) / width, (event.clientY - top) / height] as const;
    this.updatePlacement(
      (updatePlacement) =>
        this.view ? movePlacement(updatePlacement, this.view.estimate.camera, this.aspect, spot) : null,
      "move",
    );
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions: Record<string, [string, (updatePlacement: Placement, step: number) => Placement]> = {
      ArrowLeft: ["move", (updatePlacement, step) => shiftPlacement(updatePlacement, -step, 0)],
      ArrowRight: ["move", (updatePlacement, step) => shiftPlacement(updatePlacement, step, 0)],
      ArrowUp: ["move", (updatePlacement, step) => shiftPlacement(updatePlacement, 0, step)],
      ArrowDown: ["move", (updatePlacement, step) => shiftPlacement(updatePlacement, 0, -step)],
      "<": ["turn", (updatePlacement) => rotatePlacement(updatePlacement, -10)],
      ",": ["turn", (updatePlacement) => rotatePlacement(updatePlacement, -10)],
      ">": ["turn", (updatePlacement) => rotatePlacement(updatePlacement, 10)],
      ".": ["turn", (updatePlacement) => rotatePlacement(updatePlacement, 10)],
      "+": ["size", (updatePlacement) => resizePlacement(updatePlacement, updatePlacement.radius * 1.1)],
      "=": ["size", (updatePlacement) => resizePlacement(updatePlacement, updatePlacement.radius * 1.1)],
      "-": ["size", (updatePlacement) => resizePlacement(updatePlacement, updatePlacement.radius / 1.1)],
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    this.updatePlacement(
      (updatePlacement) => action[1](updatePlacement, 0.04 * groundDistance(updatePlacement)),
      action[0],
    );
  }
}

const formatMeters = (value: number): string =>
  value < 1 ? `${(100 * value).toFixed(0)}\u00a0cm` : `${formatShort(value)}\u00a0m`;

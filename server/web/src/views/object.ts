/** The stage with its controls; three.js is fetched when the first photo has its answer. */

import { fetchLitSpot } from "../api";
import { addRadioButtons, byId, findRadio, isTouchDevice } from "../dom";
import type { Point } from "../geometry/camera";
import {
  cameraHeight,
  footPoint,
  groundDistance,
  isInSun,
  maxRadius,
  movePlacement,
  type Placement,
  resizePlacement,
  rotatePlacement,
  SUNLIT,
  shiftPlacement,
} from "../geometry/placement";
import { aspectRatio } from "../photo";
import type { Stage } from "../scene/stage";
import type { SceneLight } from "../sky/lighting";
import { cameraOf, currentState, type EditState, FINISHES, type PhotoView, SHAPES } from "../state";
import { formatShort } from "../text/format";

const KEYS = "Keys: arrows move it, < and > turn it, + and − scale it.";
const usageText = (where: string): string =>
  isTouchDevice()
    ? `Tap the ${where} to move it, drag to turn it.`
    : `Click the ${where} to move it, drag to turn it. ${KEYS}`;
const NO_GROUND = "No firm, level ground was found. Click the ground to place the object.";
const NO_WEBGL = "This browser has no WebGL, so no object is shown. Everything else works.";
const STAGE_NOT_LOADED = "The object could not be loaded. Load the page again to see it.";
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
  private drawn = false;

  constructor(
    private readonly change: Change,
    private readonly onError: (error: unknown) => void,
    private readonly onDrawn: () => void,
  ) {
    this.canvas.setAttribute("role", "application");
    this.canvas.setAttribute("aria-label", `An object in the photo. ${KEYS}`);
    this.stage = new Promise<void>((resolve) => {
      this.startLoading = resolve;
    }).then(() => this.load());
    addRadioButtons(byId("shapes"), SHAPES, (shape) => this.change({ shape }, "shape"), { own: "my model" });
    addRadioButtons(byId("finishes"), FINISHES, (finish) => this.change({ finish }, "finish"));
    this.offerOwnModel(false);
    this.listen();
  }

  /** Whether there is a canvas that draws it. */
  get isDrawn(): boolean {
    return this.drawn;
  }

  /** A new photo; the object appears with its first light. */
  open(view: PhotoView): void {
    this.view = view;
    this.startLoading();
    this.canvas.hidden = true;
    this.withStage((stage) => stage.setPhoto(view.photo.picture));
  }

  /** Shows the object as a view has it now. */
  show(view: PhotoView): void {
    const state = currentState(view);
    const { placement, shape, finish } = state;
    const camera = cameraOf(view);
    const mask = state.inSun ? SUNLIT : view.groundMask;
    const inSun = this.standsInSun(state);
    this.withStage((stage) => {
      stage.setCamera(camera);
      stage.setAppearance(shape, finish);
      stage.setGroundMask(mask);
      stage.setPlacement(placement, inSun);
      this.describePlacement(placement, stage.objectHeight);
      this.note.textContent = placement.grounded ? usageText("ground") : `${NO_GROUND} ${usageText("photo")}`;
    });
    byId("shade").hidden = !placement.grounded || !state.parameters.sun || inSun;
    findRadio(byId("shapes"), shape).checked = true;
    findRadio(byId("finishes"), finish).checked = true;
    this.size.max = String(Math.log2(maxRadius(placement)));
    this.size.value = String(Math.log2(placement.radius));
    this.rotation.value = String(Math.round(placement.rotation));
    this.canvas.dataset.foot = JSON.stringify(this.foot(placement));
  }

  /** Whether the object stands in the sun, by what the service says of the ground at its foot. */
  private standsInSun({ placement, inSun }: EditState): boolean {
    const foot = this.foot(placement);
    return inSun || !placement.grounded || !foot || !this.view || isInSun(this.view.groundMask, foot);
  }

  private foot(placement: Placement): Point | null {
    return this.view ? footPoint(placement, cameraOf(this.view), this.aspect) : null;
  }

  /** Moves the object to the nearest ground in the sun, or lights it where it stands if the photo shows none. */
  private async putInSun(): Promise<void> {
    const view = this.view;
    const foot = view && this.foot(currentState(view).placement);
    if (!view || !foot) return;
    const button = byId<HTMLButtonElement>("put-in-sun");
    button.disabled = true;
    try {
      const spot = await fetchLitSpot(view.photo.file, view.userInput, foot);
      if (view !== this.view) return; // another photo came meanwhile
      const { placement } = currentState(view);
      const moved = spot && movePlacement(placement, view.estimate.camera, this.aspect, spot);
      this.change(moved ? { placement: moved } : { inSun: true }, "put in the sun");
    } catch (error) {
      this.onError(error);
    } finally {
      button.disabled = false;
    }
  }

  light(light: SceneLight, view: PhotoView): void {
    this.withStage((stage) => {
      stage.setLight(light, currentState(view).parameters);
      if (this.canvas.hidden) this.fit(stage);
      this.canvas.hidden = false;
    });
  }

  /** The object turned once around in its photo, as a file; throws where this browser has no WebGL. */
  async drawTurntable(): Promise<Blob> {
    const stage = await this.stage;
    if (!stage) throw new Error(NO_WEBGL);
    return stage.drawTurntable();
  }

  /** Takes the user's own object. */
  async takeModel(file: File): Promise<void> {
    try {
      const { readModel } = await import("../scene/objects");
      const model = await readModel(file);
      byId("own-name").textContent = file.name;
      this.offerOwnModel(true);
      this.withStage((stage) => stage.setOwnModel(model));
      this.change({ shape: "own", finish: "original" }, `own ${file.name}`);
    } catch (error) {
      this.onError(error);
    }
  }

  /** Writes where the object stands and how large it is. */
  private describePlacement(placement: Placement, height: number): void {
    const text = `${formatMeters(height)} high`;
    const distance = placement.grounded ? `, ${formatMeters(groundDistance(placement))} away` : "";
    const above = this.view ? cameraHeight(this.view.estimate.camera) : 0;
    byId("object-where").textContent = `${text}${distance}, if the camera was ${above} m above the ground.`;
    this.size.setAttribute("aria-valuetext", text);
  }

  private offerOwnModel(available: boolean): void {
    findRadio(byId("shapes"), "own").disabled = !available;
    findRadio(byId("finishes"), "original").disabled = !available;
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
      this.drawn = true;
      this.onDrawn();
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

  private updatePlacement(make: (placement: Placement) => Placement | null, kind: string): void {
    const placement = this.view && make(currentState(this.view).placement);
    if (placement) this.change({ placement }, kind);
    else this.note.textContent = "There is no ground: click below the horizon.";
  }

  /** The wipe between the photo and the photo with the object. */
  private listenForWipe(): void {
    const wipe = byId<HTMLInputElement>("wipe");
    const compare = byId<HTMLInputElement>("compare");
    const move = (): void => byId("frame").style.setProperty("--wipe", `${wipe.value}%`);
    move();
    wipe.addEventListener("input", move);
    compare.addEventListener("change", () => {
      wipe.hidden = !compare.checked;
    });
  }

  private listen(): void {
    this.listenForWipe();
    byId("put-in-sun").addEventListener("click", () => this.putInSun());
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.dragged = 0;
    });
    this.canvas.addEventListener("pointermove", (event) => {
      if (event.buttons !== 1) return;
      this.dragged += Math.hypot(event.movementX, event.movementY);
      if (this.dragged > CLICK)
        this.updatePlacement((placement) => rotatePlacement(placement, event.movementX * 0.6), "turn");
    });
    this.canvas.addEventListener("click", (event) => {
      if (this.dragged <= CLICK) this.moveTo(event);
    });
    this.canvas.addEventListener("keydown", (event) => this.key(event));
    this.size.addEventListener("input", () =>
      this.updatePlacement((placement) => resizePlacement(placement, 2 ** this.size.valueAsNumber), "size"),
    );
    this.rotation.addEventListener("input", () =>
      this.updatePlacement((placement) => ({ ...placement, rotation: this.rotation.valueAsNumber }), "turn"),
    );
  }

  private moveTo(event: MouseEvent): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const spot = [(event.clientX - left) / width, (event.clientY - top) / height] as const;
    this.updatePlacement(
      (placement) => (this.view ? movePlacement(placement, this.view.estimate.camera, this.aspect, spot) : null),
      "move",
    );
  }

  private key(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const actions: Record<string, [string, (placement: Placement, step: number) => Placement]> = {
      ArrowLeft: ["move", (placement, step) => shiftPlacement(placement, -step, 0)],
      ArrowRight: ["move", (placement, step) => shiftPlacement(placement, step, 0)],
      ArrowUp: ["move", (placement, step) => shiftPlacement(placement, 0, step)],
      ArrowDown: ["move", (placement, step) => shiftPlacement(placement, 0, -step)],
      "<": ["turn", (placement) => rotatePlacement(placement, -10)],
      ",": ["turn", (placement) => rotatePlacement(placement, -10)],
      ">": ["turn", (placement) => rotatePlacement(placement, 10)],
      ".": ["turn", (placement) => rotatePlacement(placement, 10)],
      "+": ["size", (placement) => resizePlacement(placement, placement.radius * 1.1)],
      "=": ["size", (placement) => resizePlacement(placement, placement.radius * 1.1)],
      "-": ["size", (placement) => resizePlacement(placement, placement.radius / 1.1)],
    };
    const action = actions[event.key];
    if (!action) return;
    event.preventDefault();
    this.updatePlacement((placement) => action[1](placement, 0.04 * groundDistance(placement)), action[0]);
  }
}

const formatMeters = (value: number): string =>
  value < 1 ? `${(100 * value).toFixed(0)}\u00a0cm` : `${formatShort(value)}\u00a0m`;

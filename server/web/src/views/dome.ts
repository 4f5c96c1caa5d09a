/** The sky from above with the sun's probability: read by pointing at it or with the arrow keys, and the sun moved there. */

import { arrowStep, createSvg, drawPath, drawSun, drawText, isTouchDevice } from "../dom";
import { type Angles, angles, clamp, direction, type Vector, wrapAzimuth } from "../geometry/angles";
import type { Point } from "../geometry/camera";
import { mixColors, parseHexColor, type Rgb } from "../geometry/color";
import { type GridCell, gridCells, probabilityWithin, smoothDensity } from "../geometry/distribution";
import { circleAround, fromDome, photoOutline, placeShareLabels, sunRegions, toDome } from "../geometry/sphere";
import { formatAzimuth, formatPercent, isSunny } from "../text/format";
import type { Candidate, Estimate, LightParameters } from "../types";
import { candidatesOf, isCandidate } from "./candidates";
import { drawShareLabels } from "./markers";

const RADIUS = 100; // of the horizon in the drawing's units
const MARGIN = 22;
const DENSITY_SIZE = 160; // pixels of the density before enlargement
const READ_RADIUS = 10; // degrees around the pointer whose probability is read
const KEY_STEP = 5; // degrees
const GRIP = 20; // units of the drawing around the sun from which it is dragged: 22 pixels of a small drawing
const CHIP = 7.5; // units of the drawing, the radius of a sun's number
const SHARE = 8; // units of the drawing, the letters of a region's share
const CORNERS: [Point, Point] = [[-RADIUS, -RADIUS], [RADIUS, RADIUS]]; // biome-ignore format: two corners
const RINGS = "Rings hold 50 and 90 % of the probability.";
const hintText = (): string => `${RINGS} ${isTouchDevice() ? "Drag the sun." : "Point to read it, drag the sun."}`;

export class Dome {
  private readonly heat = document.createElement("canvas");
  private readonly drawing = createSvg("svg", { viewBox: [-1, -1, 2, 2].map((v) => v * (RADIUS + MARGIN)).join(" ") });
  private readonly cursor = createSvg("g", { class: "cursor" });
  private readonly grip = createSvg("circle", { r: GRIP, class: "grip" }); // stays while it is dragged
  private readonly sunMarker = createSvg("g", { class: "mark" });
  private cells: GridCell[] = [];
  private suns: Candidate[] = [];
  private chips: SVGElement[] = []; // of them
  private dragging = false;
  private at: Angles = { azimuth: 0, elevation: 45 };

  constructor(
    private readonly root: HTMLElement,
    private readonly readout: HTMLElement,
    private readonly onPick: (at: Angles) => void,
  ) {
    this.heat.width = DENSITY_SIZE;
    this.heat.height = DENSITY_SIZE;
    this.drawing.setAttribute("tabindex", "0");
    this.drawing.setAttribute("role", "application");
    this.drawing.setAttribute("aria-label", "Sky dome: arrow keys move the reading, Enter moves the sun there");
    this.drawing.append(...compass(), this.sunMarker, this.grip, this.cursor);
    root.append(this.heat, this.drawing);
    readout.textContent = hintText();
    this.listen();
  }

  show(estimate: Estimate, aspect: number): void {
    this.cells = gridCells(estimate.probability);
    this.at = { azimuth: Math.round(estimate.sun.azimuth), elevation: Math.round(estimate.sun.elevation) };
    this.paint();
    const view = photoOutline(estimate.camera, aspect).map(onDrawing);
    const regions = sunRegions(estimate.sun, isSunny(estimate));
    const rings = regions.flatMap(({ lines, kind }) => lines.map((line) => drawPath(line.map(onDrawing), kind)));
    this.suns = candidatesOf(estimate);
    this.chips = this.suns.map(drawChip);
    const labels = [
      ...ringLabels(estimate.sun.azimuth),
      ...drawShareLabels(placeShareLabels(regions, onDrawing, SHARE, CORNERS), SHARE),
    ];
    this.drawing.querySelector(".estimate")?.remove();
    this.sunMarker.before(
      createSvg("g", { class: "estimate" }, drawPath(view, "view"), ...rings, ...labels, ...this.chips),
    );
    this.leave();
  }

  mark(parameters: LightParameters): void {
    const ray = direction(parameters.sun_azimuth, parameters.sun_elevation);
    const [cx, cy] = onDrawing(ray);
    this.grip.setAttribute("cx", String(cx));
    this.grip.setAttribute("cy", String(cy));
    this.sunMarker.replaceChildren(drawSun([cx, cy], 4.5, parameters.sun ? "sun" : "sun pale"));
    this.chips.forEach((chip, i) => {
      chip.toggleAttribute("hidden", isCandidate(this.suns[i] as Candidate, parameters)); // its mark is there
    });
  }

  /** The density in colors, by the palette of the style sheet; its scale ends at 1 per steradian or at the peak. */
  paint(): void {
    const context = this.heat.getContext("2d");
    if (!context || this.cells.length === 0) return;
    const style = getComputedStyle(this.root);
    const palette = [0, 1, 2, 3, 4].map((i) => parseHexColor(style.getPropertyValue(`--heat-${i}`)));
    context.putImageData(drawDensity(smoothDensity(this.cells), palette), 0, 0);
  }

  private listen(): void {
    this.grip.addEventListener("touchstart", (event) => event.preventDefault(), { passive: false }); // which would scroll
    this.drawing.addEventListener("pointerdown", (event) => {
      this.dragging = event.target === this.grip || (event.pointerType === "mouse" && !this.candidateAt(event));
      if (this.dragging) this.drawing.setPointerCapture(event.pointerId);
    });
    this.drawing.addEventListener("pointermove", (event) => {
      if (!this.moveTo(event)) this.leave();
      else if (this.dragging && event.buttons === 1) this.onPick(this.at);
    });
    for (const end of ["pointerup", "pointercancel"] as const) {
      this.drawing.addEventListener(end, () => {
        this.dragging = false;
      });
    }
    this.drawing.addEventListener("pointerleave", () => this.leave());
    this.drawing.addEventListener("click", (event) => {
      const chosen = this.candidateAt(event);
      if (chosen) this.onPick(chosen);
      else if (this.moveTo(event)) this.onPick(this.at);
    });
    this.drawing.addEventListener("focus", () => {
      if (this.drawing.matches(":focus-visible")) this.read(this.at);
    });
    this.drawing.addEventListener("blur", () => this.leave());
    this.drawing.addEventListener("keydown", (event) => this.key(event));
  }

  private candidateAt({ target }: Event): Candidate | undefined {
    return this.suns[this.chips.findIndex((chip) => chip.contains(target as Node))];
  }

  private moveTo(event: MouseEvent): boolean {
    const { left, top, width } = this.drawing.getBoundingClientRect();
    const scale = (2 * (RADIUS + MARGIN)) / width / RADIUS;
    const ray = fromDome([(event.clientX - left - width / 2) * scale, (event.clientY - top - width / 2) * scale]);
    if (ray) this.read(angles(ray));
    return ray !== null;
  }

  private key(event: KeyboardEvent): void {
    const step = arrowStep(event, KEY_STEP);
    if (step) {
      const elevation = clamp(this.at.elevation + step[1], 0, 90);
      this.read({ azimuth: wrapAzimuth(this.at.azimuth + step[0]), elevation });
    } else if (event.key === "Enter" || event.key === " ") this.onPick(this.at);
    else return;
    event.preventDefault();
  }

  private read(at: Angles): void {
    this.at = at;
    const ray = direction(at.azimuth, at.elevation);
    const share = formatPercent(probabilityWithin(this.cells, ray, READ_RADIUS));
    this.readout.textContent = `${formatAzimuth(at.azimuth)}, ${at.elevation.toFixed(0)}° high: ${share} within ${READ_RADIUS}°`;
    this.cursor.replaceChildren(drawPath(circleAround(ray, READ_RADIUS).map(onDrawing), "reading"));
  }

  private leave(): void {
    this.cursor.replaceChildren();
    this.readout.textContent = hintText();
  }
}

/** The number of a sun to choose, and room for a finger. */
function drawChip({ azimuth, elevation }: Candidate, i: number): SVGElement {
  const [cx, cy] = onDrawing(direction(azimuth, Math.max(elevation, 0)));
  return createSvg(
    "g",
    { class: "candidate" },
    createSvg("circle", { cx, cy, r: GRIP }),
    createSvg("circle", { cx, cy, r: CHIP }),
    drawText([cx, cy + 3.2], String(i + 1), "middle"),
  );
}

function onDrawing(ray: Vector): Point {
  const [x, y] = toDome(ray);
  return [x * RADIUS, y * RADIUS];
}

function compass(): SVGElement[] {
  const ring = (elevation: number): SVGElement =>
    createSvg("circle", { r: (RADIUS * (90 - elevation)) / 90, class: elevation ? "ring" : "ring outer" });
  const out = RADIUS + 13; // beyond the rays of a sun on the horizon
  return [
    ...[0, 30, 60].map(ring),
    drawPath([[-RADIUS, 0], [RADIUS, 0]], "ring"), // biome-ignore format: a line
    drawPath([[0, -RADIUS], [0, RADIUS]], "ring"), // biome-ignore format: a line
    drawText([0, -out], "front", "side middle"),
    drawText([0, out + 7], "behind", "side middle"),
    createSvg("text", { class: "side middle", transform: `translate(${-out} 0) rotate(-90)` }, "left"),
    createSvg("text", { class: "side middle", transform: `translate(${out} 0) rotate(90)` }, "right"),
  ];
}

/** The rings' degrees: behind the zenith, or on its right where the regions' shares stand in that line. */
function ringLabels(sunAzimuth: number): SVGElement[] {
  const [x, , z] = direction(sunAzimuth, 0);
  const rightward = Math.abs(x) < Math.abs(z);
  return [30, 60].map((elevation) => {
    const out = (RADIUS * (90 - elevation)) / 90;
    return drawText(rightward ? [out + 2.5, -2.5] : [3, out - 2.5], `${elevation}°`, "degrees");
  });
}

function drawDensity(density: (ray: Vector) => number, palette: Rgb[]): ImageData {
  const levels = new Float64Array(DENSITY_SIZE * DENSITY_SIZE);
  for (let i = 0; i < levels.length; i++) {
    const side = (at: number): number => ((at + 0.5) / DENSITY_SIZE) * 2 - 1;
    const [x, y] = [side(i % DENSITY_SIZE), side(Math.floor(i / DENSITY_SIZE))];
    const radius = Math.max(Math.hypot(x, y), 1);
    levels[i] = density(fromDome([x / radius, y / radius]) ?? direction(0, 0));
  }
  const top = levels.reduce((most, level) => Math.max(most, level), 1);
  const image = new ImageData(DENSITY_SIZE, DENSITY_SIZE);
  levels.forEach((level, i) => {
    image.data.set([...mixColors(palette, Math.sqrt(level / top)), 255], 4 * i);
  });
  return image;
}

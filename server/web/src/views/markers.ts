/** What is drawn over the photo and over the map: horizon, sun, the sun's regions, the photo's frame; the sun can be dragged. */

import type { Lighting, LightParameters } from "../api";
import { arrowStep, byId, createSvg, drawPath, drawSun, drawText } from "../dom";
import { type Angles, angles, clamp, direction, type Vector, wrapAzimuth } from "../geometry/angles";
import { type Camera, horizon, type Point, pixelRay, type Size, type SunMark, sunMark } from "../geometry/camera";
import { photoOutline, placeShareLabels, type ShareLabel, splitAtSeam, sunRegions, toMap } from "../geometry/sphere";
import { formatAzimuth, isSunny } from "../text/format";

const SHARE = 12; // px, the letters of a region's share
const NAME_AT = 48; // px from the edge to the horizon's name, beyond the suns to choose from
const SUN_WIDTH = 130; // px from the left edge, within which the sun's mark and its label can meet that name
const SUN_HEIGHT = 52; // px, so for the distance in height

type Line = NonNullable<ReturnType<typeof horizon>>;

const sunClass = (parameters: LightParameters): string => (parameters.sun ? "sun" : "sun pale");

export function drawPhotoMarkers(camera: Camera, parameters: LightParameters, width: number, height: number): Node[] {
  const size = { width, height };
  const mark = sunMark(direction(parameters.sun_azimuth, parameters.sun_elevation), camera, size, EDGE);
  const line = horizon(camera, size);
  const sun = mark.inside
    ? [drawSun(mark.point, 8, sunClass(parameters))]
    : drawArrow(mark, size, line, sunClass(parameters));
  return [...(line ? drawHorizon(line, mark, width, height) : []), ...sun];
}

/** The horizon with its name at the left, or at the right where the sun's mark stands in the way. */
function drawHorizon(line: Line, sun: SunMark, width: number, height: number): Node[] {
  const occupied = sun.point[0] < SUN_WIDTH && Math.abs(sun.point[1] - lineHeight(line, NAME_AT)) < SUN_HEIGHT;
  const x = occupied ? width - NAME_AT : NAME_AT;
  const y = lineHeight(line, x);
  const label = y > 24 && y < height ? [drawText([x, y - 7], "horizon", occupied ? "label end" : "label")] : [];
  return [drawPath(line, "rim"), drawPath(line, "line"), ...label];
}

const lineHeight = ([[x0, y0], [x1, y1]]: Line, x: number): number => y0 + ((y1 - y0) * (x - x0)) / (x1 - x0);

/** An arrow towards the sun, and a label below or above it, on the side that the horizon does not cross. */
function drawArrow(
  { point: [x, y], ray: [u, v], behind }: SunMark,
  size: { width: number; height: number },
  line: Line | null,
  kind: string,
): Node[] {
  const corner = (back: number, sideways: number): Point => [x - u * back - v * sideways, y - v * back + u * sideways];
  const head = [[x, y] as Point, corner(20, 11), corner(14, 0), corner(20, -11)];
  const points = head.map((point) => point.map((value) => value.toFixed(1)).join(",")).join(" ");
  const caption = behind ? "sun behind" : "sun";
  const reach = 4 * caption.length + 8;
  const drop = line ? lineHeight(line, x) - y : SUN_HEIGHT;
  const under = Math.abs(drop) < SUN_HEIGHT ? drop < 0 : y < size.height / 2;
  const below = under ? 34 : -24;
  const label: Point = [clamp(x - 14 * u, reach, size.width - reach), clamp(y - 14 * v + below, 16, size.height - 10)];
  return [createSvg("polygon", { points, class: `arrow ${kind}` }), drawText(label, caption, `label middle ${kind}`)];
}

export function drawMapMarkers(
  lighting: Lighting,
  parameters: LightParameters,
  aspect: number,
  width: number,
  height: number,
): Node[] {
  const toPoint = (towards: Vector): Point => {
    const [x, y] = toMap(towards);
    return [(x * width) / 2, y * height];
  };
  const curve = (line: Vector[], kind: string): Node[] =>
    splitAtSeam(line.map(toPoint), width / 2).flatMap((piece) => [drawPath(piece, "rim"), drawPath(piece, kind)]);
  const regions = sunRegions(lighting.sun, isSunny(lighting));
  const caption = [
    [0.25, "90° left"],
    [0.5, "front"],
    [0.75, "90° right"],
  ] as const;
  return [
    ...curve(photoOutline(lighting.camera, aspect), "line"),
    ...regions.flatMap(({ lines, kind }) => lines.flatMap((line) => curve(line, kind))),
    ...caption.map(([share, word]) => drawText([width * share, height - 10], word, "label middle")),
    ...drawShareLabels(placeShareLabels(regions, toPoint, SHARE, [[0, 0], [width, height]]), SHARE), // biome-ignore format: corners
    drawSun(toPoint(direction(parameters.sun_azimuth, parameters.sun_elevation)), 6, sunClass(parameters)),
  ];
}

/** The labels of the sun's regions, with letters of that size. */
export const drawShareLabels = (spots: ShareLabel[], size: number): SVGElement[] =>
  spots.map(({ center: [x, y], share, pale }) =>
    drawText([x, y + 0.36 * size], share, `share middle${pale ? " pale" : ""}`),
  );

const EDGE = 12; // pixels from the picture's edge to the mark of a sun outside of it
const ELEVATIONS = [-4, 90] as const; // degrees, of the slider
const STEP = 1; // degrees of a key; with Shift five of them
const ACROSS = 180; // degrees of azimuth that the width of the picture drags a sun outside of it
const DOWN = 90; // degrees of elevation, so by the height

const GRIP = 28; // px around the sun on the map, from which a finger drags it

/** The sun goes where a mouse points on the map, or where a finger drags it to. */
export function listenForMapSun(sun: () => Angles | undefined, onMove: (sun: Angles) => void): void {
  const map = byId("latlong");
  let dragging = false;
  const isAtSun = ({ clientX, clientY }: PointerEvent | Touch): boolean => {
    const at = sun();
    if (!at) return false;
    const { left, top, width, height } = map.getBoundingClientRect();
    const [x, y] = toMap(direction(at.azimuth, at.elevation));
    return Math.hypot(left + (x * width) / 2 - clientX, top + y * height - clientY) <= GRIP;
  };
  const follow = ({ clientX, clientY }: PointerEvent): void => {
    const { left, top, width, height } = map.getBoundingClientRect();
    const azimuth = wrapAzimuth(360 * ((clientX - left) / width - 0.5));
    onMove({ azimuth, elevation: clamp(180 * (0.5 - (clientY - top) / height), ...ELEVATIONS) });
  };
  map.addEventListener(
    "touchstart",
    (event) => {
      if (event.touches[0] && isAtSun(event.touches[0])) event.preventDefault(); // which would scroll
    },
    { passive: false },
  );
  map.addEventListener("pointerdown", (event) => {
    dragging = event.button === 0 && (event.pointerType === "mouse" || isAtSun(event));
    if (!dragging) return;
    map.setPointerCapture(event.pointerId);
    follow(event);
  });
  map.addEventListener("pointermove", (event) => {
    if (dragging && event.buttons) follow(event);
  });
}

/** Where a drag began. */
interface Drag {
  x: number;
  y: number;
  sun: Angles;
  inside: boolean;
}

export class SunHandle {
  private readonly handle = byId("sun-handle");
  private readonly frame = byId("frame");
  private camera: Camera | undefined;
  private sun: Angles = { azimuth: 0, elevation: 0 };
  private grabbed: Drag | undefined;
  private size: Size = { width: 0, height: 0 }; // of the picture, CSS pixels

  constructor(private readonly onMove: (sun: Angles) => void) {
    new ResizeObserver(() => {
      this.size = this.frame.getBoundingClientRect();
      this.place();
    }).observe(this.frame);
    this.handle.addEventListener("pointerdown", (event) => this.begin(event));
    this.handle.addEventListener("pointermove", (event) => this.follow(event));
    for (const end of ["pointerup", "pointercancel"] as const) {
      this.handle.addEventListener(end, () => {
        this.grabbed = undefined;
      });
    }
    this.handle.addEventListener("keydown", (event) => this.key(event));
  }

  /** Shows the sun of a light, in the picture of a camera. */
  show(camera: Camera, { sun_azimuth, sun_elevation }: LightParameters): void {
    this.camera = camera;
    this.sun = { azimuth: sun_azimuth, elevation: sun_elevation };
    this.handle.setAttribute("aria-valuenow", String(Math.round(sun_azimuth)));
    this.handle.setAttribute("aria-valuetext", `${formatAzimuth(sun_azimuth)}, ${sun_elevation.toFixed(0)}° high`);
    this.place();
  }

  /** Drags the sun by a pointer that moves over the photo beside it. */
  drag(event: PointerEvent): void {
    if (event.type === "pointermove") this.follow(event);
    else if (event.type === "pointerup") this.grabbed = undefined;
    else this.grabbed = { x: event.clientX, y: event.clientY, sun: this.sun, inside: false };
  }

  private mark(): { x: number; y: number; inside: boolean } | undefined {
    if (!this.camera || this.size.width < 1) return undefined;
    const { point, inside } = sunMark(direction(this.sun.azimuth, this.sun.elevation), this.camera, this.size, EDGE);
    return { x: point[0], y: point[1], inside };
  }

  private place(): void {
    const at = this.mark();
    if (at) Object.assign(this.handle.style, { left: `${at.x}px`, top: `${at.y}px` });
  }

  private begin(event: PointerEvent): void {
    const at = this.mark();
    if (!at || event.button !== 0) return;
    event.preventDefault();
    this.handle.focus({ preventScroll: true });
    this.handle.setPointerCapture(event.pointerId);
    this.grabbed = { x: event.clientX, y: event.clientY, sun: this.sun, inside: at.inside };
  }

  /** A sun in the picture is where the pointer is; one outside of it is dragged by how far the pointer goes. */
  private follow(event: PointerEvent): void {
    if (!this.grabbed || !this.camera) return;
    const { left, top, width, height } = this.frame.getBoundingClientRect();
    if (this.grabbed.inside) {
      const ray = pixelRay([event.clientX - left, event.clientY - top], this.camera, { width, height });
      const length = Math.hypot(...ray);
      this.move(angles([ray[0] / length, ray[1] / length, ray[2] / length]));
    } else {
      const { azimuth, elevation } = this.grabbed.sun;
      const right = (ACROSS * (event.clientX - this.grabbed.x)) / width;
      const up = (DOWN * (this.grabbed.y - event.clientY)) / height;
      this.move({ azimuth: azimuth + right, elevation: elevation + up });
    }
  }

  private move({ azimuth, elevation }: Angles): void {
    const sun = { azimuth: wrapAzimuth(azimuth), elevation: clamp(elevation, ...ELEVATIONS) };
    if (sun.azimuth !== this.sun.azimuth || sun.elevation !== this.sun.elevation) this.onMove(sun);
  }

  private key(event: KeyboardEvent): void {
    const step = arrowStep(event, event.shiftKey ? 5 * STEP : STEP);
    if (!step) return;
    event.preventDefault();
    this.move({ azimuth: this.sun.azimuth + step[0], elevation: this.sun.elevation + step[1] });
  }
}

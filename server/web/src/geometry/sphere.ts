/** Curves on the sphere, and its two flat pictures: the dome seen from above and the lat-long map. */

import { angles, clamp, combine, cross, degrees, direction, radians, type Vector } from "./angles";
import { type Camera, cameraAxes, type Point } from "./camera";

const HORIZON_TOLERANCE = 0.02; // sine of the depth below the horizon to which lines in the sky are drawn

/** The dome from above: zenith at the origin, the photo's direction up (0, -1), the horizon at radius 1. */
export function toDome(ray: Vector): Point {
  const { azimuth, elevation } = angles(ray);
  const reach = (90 - Math.max(elevation, 0)) / 90;
  return [reach * Math.sin(radians(azimuth)), -reach * Math.cos(radians(azimuth))];
}

/** The direction that `toDome` puts at a point; null outside the horizon. */
export function fromDome([x, y]: Point): Vector | null {
  const reach = Math.hypot(x, y);
  if (reach > 1 + 1e-9) return null;
  return direction(degrees(Math.atan2(x, -y)), 90 * Math.max(1 - reach, 0));
}

/** The map: x from 0 to 2 and y from 0 to 1, azimuth 0 at the center, the zenith above. */
export function toMap(ray: Vector): Point {
  const { azimuth, elevation } = angles(ray);
  return [azimuth / 180 + 1, 0.5 - elevation / 180];
}

/** A closed circle of directions `radius` degrees around another, starting at its highest. */
export function circleAround(center: Vector, radius: number, steps = 180): Vector[] {
  const { azimuth, elevation } = angles(center);
  const right = direction(azimuth + 90, 0);
  const up = cross(right, direction(azimuth, elevation));
  const [c, s] = [Math.cos(radians(radius)), Math.sin(radians(radius))];
  return Array.from({ length: steps + 1 }, (_, i) => {
    const angle = (2 * Math.PI * i) / steps;
    return combine([c, center], [s * Math.sin(angle), right], [s * Math.cos(angle), up]);
  });
}

/** The pieces of a line of directions that lie above the horizon, or so little below it that they reach it. */
export function clipToSky(line: readonly Vector[]): Vector[][] {
  const cut: Vector[][] = [[]];
  for (const ray of line) {
    if (ray[1] > -HORIZON_TOLERANCE) cut.at(-1)?.push(ray);
    else cut.push([]);
  }
  return cut.filter((piece) => piece.length > 1);
}

/** Directions through the photo's border, a closed loop. */
export function photoOutline(camera: Camera, aspect: number, steps = 24): Vector[] {
  const { right, up, forward } = cameraAxes(camera);
  const tangent = Math.tan(radians(camera.vertical_fov) / 2);
  const corners: Point[] = [
    [-1, 1],
    [1, 1],
    [1, -1],
    [-1, -1],
  ];
  return corners.flatMap(([x, y], side) => {
    const [nextX, nextY] = corners[(side + 1) % 4] as Point;
    return Array.from({ length: steps + 1 }, (_, i) => {
      const share = i / steps;
      const [u, v] = [x + (nextX - x) * share, y + (nextY - y) * share];
      return combine([u * aspect * tangent, right], [v * tangent, up], [1, forward]);
    });
  });
}

/** A line cut where it jumps by more than `jump` in x, as it does at the map's seam. */
export function splitAtSeam(line: readonly Point[], jump: number): Point[][] {
  const cut: Point[][] = [];
  let last: Point | undefined;
  for (const point of line) {
    if (!last || Math.abs(point[0] - last[0]) > jump) cut.push([]);
    cut.at(-1)?.push(point);
    last = point;
  }
  return cut.filter((piece) => piece.length > 1);
}

/** A record's sun and the radii around it that hold 50 % and 90 % of the probability, degrees. */
export interface SunEstimate {
  azimuth: number;
  elevation: number;
  radius_50: number;
  radius_90: number;
}

export interface SunRegion {
  share: string;
  kind: string; // of the circle's line
  pale: boolean; // where no sun shines
  lines: Vector[][]; // what of the circle lies in the sky
  outwards: [sun: Vector, inside: Vector, top: Vector]; // up to where the circle is highest, by a step just inside
}

/** The circles that hold 50 % and 90 % of the sun's probability, as far as they reach the sky; pale where it is not `sunny`. */
export function sunRegions({ azimuth, elevation, radius_50, radius_90 }: SunEstimate, sunny: boolean): SunRegion[] {
  const sun = direction(azimuth, elevation);
  const pale = !sunny;
  const region = (radius: number, share: string, kind: string): SunRegion => {
    const line = circleAround(sun, radius);
    const outwards: SunRegion["outwards"] = [sun, circleAround(sun, 0.98 * radius)[0] as Vector, line[0] as Vector];
    return { share, kind: pale ? `${kind} pale` : kind, pale, lines: clipToSky(line), outwards };
  };
  const both = [region(radius_90, "90\u00a0%", "region wide"), region(radius_50, "50\u00a0%", "region")];
  return both.filter(({ outwards: [, , top] }) => top[1] > 0);
}

export interface ShareLabel {
  center: Point; // the middle of the letters
  share: string;
  pale: boolean;
}

/**
 * Where the shares stand: beyond the highest point of each circle, clear of the sun's sign and each other. `size` is
 * that of the letters in units of the drawing, and `corners` bound the drawing, which they do not leave.
 */
export function placeShareLabels(
  regions: readonly SunRegion[],
  toPoint: (towards: Vector) => Point,
  size: number,
  corners: readonly [Point, Point],
): ShareLabel[] {
  const room: Point = [3 * size, 1.2 * size];
  const labels: ShareLabel[] = [];
  for (const { share, pale, outwards } of [...regions].reverse()) {
    const [sun, [u, v], [x, y]] = outwards.map(toPoint) as [Point, Point, Point];
    const length = Math.hypot(x - u, y - v) || 1;
    const out: Point = [(x - u) / length, (y - v) / length];
    const gap = size * Math.max(0.9, 2.5 - Math.hypot(x - sun[0], y - sun[1]) / size);
    const beside: Point = [x + gap * out[0], y + gap * out[1]];
    const clear = labels.reduce((spot, { center }) => moveClear(center, spot, out, room), beside);
    labels.push({ center: clampToCorners(clear, room, corners), share, pale });
  }
  return labels;
}

const clampToCorners = (
  [x, y]: Point,
  [wide, high]: Point,
  [[left, top], [right, bottom]]: readonly [Point, Point],
): Point => [clamp(x, left + wide / 2, right - wide / 2), clamp(y, top + high / 2, bottom - high / 2)];

/** A spot moved along `out` as far as needed not to cover another one, where both take `room`. */
function moveClear(other: Point, spot: Point, out: Point, room: Point): Point {
  const missing = [0, 1].map((i) => {
    const gap = ((spot[i] as number) - (other[i] as number)) * Math.sign(out[i] as number);
    const covered = Math.abs((spot[i] as number) - (other[i] as number)) < (room[i] as number);
    return covered ? ((room[i] as number) - gap) / Math.max(Math.abs(out[i] as number), 1e-6) : 0;
  });
  const step = Math.min(...missing);
  return [spot[0] + step * out[0], spot[1] + step * out[1]];
}

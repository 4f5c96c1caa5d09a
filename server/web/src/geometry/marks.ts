/** What a person draws in a photo: a mark's sun, before the service has fused it with all else, and a horizon's ends. */

import type { Mark } from "../text/marks";
import { type Angles, angles, clamp, combine, degrees, radians, type Vector, wrapAzimuth } from "./angles";
import { type Camera, horizon, type Point, pixelRay, type Size } from "./camera";

const LEAST_DESCENT = radians(0.5); // below the horizon, from which on a point lies on the ground

/**
 * The sun by a mark of a shadow alone, its points in pixels: its azimuth, and its elevation where the mark tells it. Of
 * what it leaves open that is nearest to the azimuth so far. Undefined where it tells nothing.
 */
export function markedSun(
  { prefix, points }: Pick<Mark, "prefix" | "points">,
  camera: Camera,
  size: Size,
  azimuth: number,
): Partial<Angles> | undefined {
  const [first, second, third] = points;
  if (!first) return undefined;
  if (prefix === "own:" || prefix === "head:") {
    const sun = angles(combine([-1, pixelRay(first, camera, size)]));
    if (radians(sun.elevation) < LEAST_DESCENT) return undefined;
    return prefix === "own:" ? sun : { azimuth: sun.azimuth };
  }
  if (!second) return undefined;
  if (prefix === "lit:")
    return litSun(first, second, third, (at) => angles(pixelRay(at, camera, size)).azimuth, azimuth);
  const [base, end] = [groundRay(first, camera, size), groundRay(second, camera, size)];
  if (!base || !end) return undefined;
  const shadow: Vector = [base[0] - end[0], 0, base[2] - end[2]];
  const along = angles(shadow).azimuth;
  if (prefix === "line:" && Math.abs(wrapAzimuth(along - azimuth)) > 90) return { azimuth: wrapAzimuth(along + 180) };
  if (prefix === "line:" || !third) return { azimuth: along };
  const height = heightOver(base, pixelRay(third, camera, size));
  return { azimuth: along, elevation: degrees(Math.atan2(height, Math.hypot(...shadow))) };
}

/** The sun by the two sides of a thing: where its border says, as that of a moon; without one on the side that is lit. */
function litSun(
  shaded: Point,
  lit: Point,
  border: Point | undefined,
  azimuthOf: (point: Point) => number,
  azimuth: number,
): Partial<Angles> | undefined {
  const turn = wrapAzimuth(azimuthOf(lit) - azimuthOf(shaded));
  const between = azimuthOf(shaded) + turn / 2;
  if (!border) {
    const isBeside = Math.sin(radians(azimuth - between)) * turn > 0;
    return { azimuth: isBeside ? azimuth : wrapAzimuth(2 * between - azimuth) };
  }
  const share = litShare(shaded, lit, border);
  if (!(share >= 0 && share <= 1)) return undefined;
  return { azimuth: wrapAzimuth(between + 180 - Math.sign(turn) * degrees(Math.acos(2 * share - 1))) };
}

/** The share of a thing's width that is lit, by its edges and the border of shade and light; other than 0 to 1 beside it. */
export function litShare(shaded: Point, lit: Point, border: Point): number {
  const [x, y] = [shaded[0] - lit[0], shaded[1] - lit[1]];
  return ((border[0] - lit[0]) * x + (border[1] - lit[1]) * y) / (x * x + y * y);
}

/** The point of the ground behind a pixel, of a camera that stands 1 above it; undefined at the horizon and above. */
export function groundRay(point: Point, camera: Camera, size: Size): Vector | undefined {
  const [x, y, z] = pixelRay(point, camera, size);
  if (y > -Math.sin(LEAST_DESCENT) * Math.hypot(x, y, z)) return undefined;
  return [x / -y, -1, z / -y];
}

/** How high over a point of the ground a ray passes, of a camera that stands 1 above it; 0 on its other side. */
export function heightOver([x, , z]: Vector, ray: Vector): number {
  const level = x * ray[0] + z * ray[2];
  return level > 0 ? 1 + (ray[1] * (x * x + z * z)) / level : 0;
}

const REACH = 0.35; // of the picture, from the middle of a horizon to its ends
const MARGIN = 0.06; // of the picture, between its edges and those ends

/** Two pixels of the horizon by which it is dragged; of a horizon outside of the picture they lie at its edge. */
export function horizonEnds(camera: Camera, { width, height }: Size): [Point, Point] {
  const [[x, y], [right, down]] = horizon(camera, { width, height }) ?? [[0, height / 2], [width, height / 2]]; // biome-ignore format: a line
  const length = Math.hypot(right - x, down - y);
  const [u, v] = [(right - x) / length, (down - y) / length];
  const [edgeX, edgeY] = [MARGIN * width, MARGIN * height];
  const inside = (point: Point): Point => [
    clamp(point[0], edgeX, width - edgeX),
    clamp(point[1], edgeY, height - edgeY),
  ];
  const away = (width / 2 - x) * u + (height / 2 - y) * v; // of the point nearest to the picture's middle
  const middle = inside([x + away * u, y + away * v]);
  const reach = REACH * (Math.abs(u) * width + Math.abs(v) * height);
  const end = (sign: 1 | -1): Point => {
    const [right, down] = [sign * u, sign * v];
    const room = Math.min(
      ((right < 0 ? middle[0] : width - middle[0]) - edgeX) / Math.max(Math.abs(right), 1e-9),
      ((down < 0 ? middle[1] : height - middle[1]) - edgeY) / Math.max(Math.abs(down), 1e-9),
    );
    const far = room > 0 ? Math.min(reach, room) : reach; // along the edge where there is no room
    return inside([middle[0] + far * right, middle[1] + far * down]);
  };
  return [end(-1), end(1)];
}

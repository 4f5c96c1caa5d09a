/** What a shadow that a person draws says of the sun, before the service has fused it with all else. */

import { angles, type Vector } from "./angles";
import { type Camera, type Point, pixelRay } from "./camera";

const LEAST_DESCENT = Math.sin((0.5 * Math.PI) / 180); // below the horizon, from which on a point lies on the ground

/** The sun's azimuth by a shadow's foot and tip, in pixels; undefined where they do not lie on the ground. */
export function shadowAzimuth(
  foot: Point,
  tip: Point,
  camera: Camera,
  size: { width: number; height: number },
): number | undefined {
  const [base, end] = [groundPoint(foot, camera, size), groundPoint(tip, camera, size)];
  return base && end && angles([base[0] - end[0], 0, base[2] - end[2]]).azimuth;
}

/** The point of the ground behind a pixel, of a camera that stands 1 above it. */
function groundPoint(point: Point, camera: Camera, size: { width: number; height: number }): Vector | undefined {
  const [x, y, z] = pixelRay(point, camera, size);
  if (y > -LEAST_DESCENT * Math.hypot(x, y, z)) return undefined;
  return [x / -y, -1, z / -y];
}

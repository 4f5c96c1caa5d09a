/** What a person draws in a photo: a shadow's sun, before the service has fused it with all else, and a horizon's ends. */

import { angles, clamp, type Vector } from "./angles";
import { type Camera, horizon, type Point, pixelRay, type Size } from "./camera";

const LEAST_DESCENT = Math.sin((0.5 * Math.PI) / 180); // below the horizon, from which on a point lies on the ground

/** The sun's azimuth by a shadow's foot and tip, in pixels; undefined where they do not lie on the ground. */
export function shadowAzimuth(foot: Point, tip: Point, camera: Camera, size: Size): number | undefined {
  const [base, end] = [groundPoint(foot, camera, size), groundPoint(tip, camera, size)];
  return base && end && angles([base[0] - end[0], 0, base[2] - end[2]]).azimuth;
}

/** The point of the ground behind a pixel, of a camera that stands 1 above it. */
function groundPoint(point: Point, camera: Camera, size: Size): Vector | undefined {
  const [x, y, z] = pixelRay(point, camera, size);
  if (y > -LEAST_DESCENT * Math.hypot(x, y, z)) return undefined;
  return [x / -y, -1, z / -y];
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

/** Curves on the sphere, and the two flat pictures of it: the dome seen from above and the lat-long map. */

import { angles, combine, cross, degrees, direction, radians, type Vector } from "./angles";
import { type Camera, cameraAxes, type Point } from "./camera";

const BELOW = 0.02; // sine of the depth below the horizon to which lines in the sky are drawn

/** The dome from above: zenith at the origin, the photo's direction up (0, -1), the horizon at radius 1. */
export function toDome(towards: Vector): Point {
  const { azimuth, elevation } = angles(towards);
  const reach = (90 - Math.max(elevation, 0)) / 90;
  return [reach * Math.sin(radians(azimuth)), -reach * Math.cos(radians(azimuth))];
}

/** The direction that `toDome` puts at a point; null outside the horizon. */
export function fromDome([x, y]: Point): Vector | null {
  const reach = Math.hypot(x, y);
  if (reach > 1 + 1e-9) return null;
  return direction(degrees(Math.atan2(x, -y)), 90 * Math.max(1 - reach, 0));
}

/** The map: x from 0 to 2 and y from 0 to 1, azimuth 0 at the centre, the zenith above. */
export function toMap(towards: Vector): Point {
  const { azimuth, elevation } = angles(towards);
  return [azimuth / 180 + 1, 0.5 - elevation / 180];
}

/** A closed circle of directions `radius` degrees around another, starting at its highest. */
export function rim(around: Vector, radius: number, steps = 180): Vector[] {
  const { azimuth, elevation } = angles(around);
  const right = direction(azimuth + 90, 0);
  const up = cross(right, direction(azimuth, elevation));
  const [c, s] = [Math.cos(radians(radius)), Math.sin(radians(radius))];
  return Array.from({ length: steps + 1 }, (_, i) => {
    const turn = (2 * Math.PI * i) / steps;
    return combine([c, around], [s * Math.sin(turn), right], [s * Math.cos(turn), up]);
  });
}

/** The pieces of a line of directions that lie above the horizon, or so little below it that they reach it. */
export function inSky(line: readonly Vector[]): Vector[][] {
  const cut: Vector[][] = [[]];
  for (const towards of line) {
    if (towards[1] > -BELOW) cut.at(-1)?.push(towards);
    else cut.push([]);
  }
  return cut.filter((piece) => piece.length > 1);
}

/** Directions through the photo's border, a closed loop. */
export function frameOf(camera: Camera, aspect: number, steps = 24): Vector[] {
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
export function pieces(line: readonly Point[], jump: number): Point[][] {
  const cut: Point[][] = [];
  let last: Point | undefined;
  for (const point of line) {
    if (!last || Math.abs(point[0] - last[0]) > jump) cut.push([]);
    cut.at(-1)?.push(point);
    last = point;
  }
  return cut.filter((piece) => piece.length > 1);
}

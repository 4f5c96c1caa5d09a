/** The camera by what a person draws, while it is drawn: what `lighting/fusion/drawn_camera.py` answers afterwards. */

import { clamp, combine, cross, degrees, dot, radians, type Vector, wrapAzimuth } from "./angles";
import { type Camera, focalLength, type Point, pixelRay, type Size } from "./camera";
import { groundRay, heightOver } from "./marks";

export type Line = readonly [Point, Point];

/** Lines in pixels of a photo. */
interface DrawnLines {
  horizon?: Line | undefined;
  verticals: readonly Line[];
  levels: readonly (readonly Line[])[]; // of each level direction, edges that are parallel
}

const HAND = 0.003; // of an end of a line, as a share of the photo's longer side
const UPRIGHT = 0.3; // deg, of things that stand upright, or are level and parallel
const BY_PIXELS = [3.5, 2, 0.08]; // of the pixels' camera: elevation, roll, the logarithm of the lens's tangent
const KNOWN_LENS = 1e-4; // of that logarithm
const PRINCIPAL = 0.15; // of the principal point from the middle, as a share of the longer side
const CORNER = 0.5; // deg, of the right angle between two level directions
const MAX_CORNER = 20; // deg by which that angle may be off a right one, to be one
const MAX_LEAN = 30; // deg from the vertical, of an upright line
const STEPS = 20; // of Gauss and Newton
const MAX_STEP = [15, 15, 0.5, 0.1, 0.1];
const DIFFERENCE = 1e-4; // of numerical derivatives

/** The camera by lines and by the pixels; its height stays. Undefined where a line that is upright lies flat. */
export function fitCamera(camera: Camera, lines: DrawnLines, size: Size, lensKnown: boolean): Camera | undefined {
  if (lines.verticals.some((line) => Math.abs(lean(camera, line, size)) > MAX_LEAN)) return undefined;
  const { levels, verticals } = lines;
  const corners = levels.flatMap((_, i) =>
    levels.flatMap((_, j) => (i < j && isCorner(i, j) ? [[i, j] as const] : [])),
  );
  const isCropped = verticals.length > 0 && corners.length > 0 && !lensKnown;
  const stds = [...BY_PIXELS.slice(0, 2), lensKnown ? KNOWN_LENS : (BY_PIXELS[2] as number)];
  if (isCropped) stds.push(PRINCIPAL, PRINCIPAL);

  function isCorner(i: number, j: number): boolean {
    return Math.abs(offRightAngle(camera, lines, i, j, size)) <= MAX_CORNER;
  }
  const residuals = (change: readonly number[]): number[] => {
    const [moved, changed] = [moveLines(lines, shiftOf(change, size)), changeCamera(camera, change)];
    return [
      ...change.map((value, i) => value / (stds[i] as number)),
      ...lineResiduals(changed, moved, size),
      ...corners.map(([i, j]) => offRightAngle(changed, moved, i, j, size) / CORNER),
    ];
  };
  const change = leastSquares(residuals, stds.map(() => 0)); // biome-ignore format: a line
  const fitted = lookAtMiddle(changeCamera(camera, change), shiftOf(change, size), size);
  return lensKnown ? { ...fitted, vertical_fov: camera.vertical_fov } : fitted;
}

function leastSquares(residuals: (values: readonly number[]) => number[], start: number[]): number[] {
  let values = start;
  for (let step = 0; step < STEPS; step++) {
    const here = residuals(values);
    const columns = values.map((_, i) => {
      const at = (sign: number): number[] => residuals(values.map((v, j) => v + (i === j ? sign * DIFFERENCE : 0)));
      const [after, before] = [at(1), at(-1)];
      return after.map((value, k) => (value - (before[k] as number)) / (2 * DIFFERENCE));
    });
    const times = (a: number[], b: number[]): number => a.reduce((sum, value, k) => sum + value * (b[k] as number), 0);
    const rows = columns.map((column) => [...columns.map((other) => times(column, other)), -times(column, here)]);
    const changes = solve(rows).map((value, i) => clamp(value, -(MAX_STEP[i] as number), MAX_STEP[i] as number));
    values = values.map((value, i) => value + (changes[i] as number));
    if (Math.max(...changes.map(Math.abs)) < DIFFERENCE / 100) break;
  }
  return values;
}

/** The solution of linear equations, each a row with its right side last; of a positive definite matrix. */
function solve(equations: readonly (readonly number[])[]): number[] {
  const rows = equations.map((row) => [...row]);
  rows.forEach((row, i) => {
    const pivot = row[i] as number;
    for (let k = 0; k < row.length; k++) row[k] = (row[k] as number) / pivot;
    for (const other of rows) {
      if (other === row) continue;
      const share = other[i] as number;
      for (let k = 0; k < row.length; k++) other[k] = (other[k] as number) - share * (row[k] as number);
    }
  });
  return rows.map((row) => row.at(-1) as number);
}

/** By how many pixels lines move, so that the principal point comes to the picture's middle. */
function shiftOf([, , , right = 0, down = 0]: readonly number[], { width, height }: Size): Point {
  const side = Math.max(width, height);
  return [-side * right, -side * down];
}

function moveLines({ horizon, verticals, levels }: DrawnLines, [right, down]: Point): DrawnLines {
  const move = (line: Line): Line => line.map(([x, y]) => [x + right, y + down]) as unknown as Line;
  return {
    horizon: horizon && move(horizon),
    verticals: verticals.map(move),
    levels: levels.map((group) => group.map(move)),
  };
}

function changeCamera(camera: Camera, [elevation = 0, roll = 0, logTangent = 0]: readonly number[]): Camera {
  const tangent = Math.tan(radians(camera.vertical_fov / 2)) * Math.exp(logTangent);
  return {
    ...camera,
    elevation: clamp(camera.elevation + elevation, -89, 89),
    roll: wrapAzimuth(camera.roll + roll),
    vertical_fov: clamp(2 * degrees(Math.atan(tangent)), 1, 170),
  };
}

/** The camera turned to look at the middle of a picture whose points were moved. */
function lookAtMiddle(camera: Camera, [right, down]: Point, size: Size): Camera {
  if (!right && !down) return camera;
  const ray = (y: number): Vector => unit(pixelRay([size.width / 2 + right, y + down], camera, size));
  const [forward, top, bottom] = [ray(size.height / 2), ray(0), ray(size.height)];
  const level = unit(cross(forward, [0, 1, 0]));
  const across = unit(cross(forward, combine([1, top], [-1, bottom])));
  return {
    ...camera,
    elevation: degrees(Math.asin(forward[1])),
    roll: degrees(Math.atan2(-dot(across, cross(level, forward)), dot(across, level))),
    vertical_fov: degrees(Math.acos(clamp(dot(top, bottom), -1, 1))),
  };
}

/** How far lines are from what they stand for, in standard deviations of the hand that drew them. */
function lineResiduals(camera: Camera, { horizon, verticals, levels }: DrawnLines, size: Size): number[] {
  const hand = HAND * Math.max(size.width, size.height);
  const std = ([[x, y], [right, down]]: Line): number =>
    Math.hypot(degrees((Math.SQRT2 * hand) / Math.hypot(right - x, down - y)), UPRIGHT);
  return [
    ...(horizon ?? []).map(
      (end) => sine(unit(pixelRay(end, camera, size))[1]) / degrees(hand / focalLength(camera, size)),
    ),
    ...verticals.map((line) => lean(camera, line, size) / std(line)),
    ...levels.flatMap((group) => {
      const normals = group.map((line) => normalOf(camera, line, size));
      const along = levelDirection(normals);
      return group.map((line, i) => sine(dot(normals[i] as Vector, along)) / std(line));
    }),
  ];
}

/** By how much [deg] two level directions are off a right angle. */
function offRightAngle(camera: Camera, { levels }: DrawnLines, i: number, j: number, size: Size): number {
  const [one, other] = [i, j].map((k) => levelDirection((levels[k] ?? []).map((line) => normalOf(camera, line, size))));
  return one && other ? sine(dot(one, other)) : 0;
}

/** The level direction that lies nearest to planes, by their normals. */
function levelDirection(normals: readonly Vector[]): Vector {
  const sum = (term: (normal: Vector) => number): number => normals.reduce((all, normal) => all + term(normal), 0);
  const widest =
    Math.atan2(
      2 * sum(([x, , z]) => x * z),
      sum(([x, , z]) => x * x - z * z),
    ) / 2;
  return [-Math.sin(widest), 0, Math.cos(widest)];
}

/** The angle [deg] between the vertical and the plane that a line and the camera span. */
function lean(camera: Camera, [from, to]: Line, size: Size): number {
  const height = (point: Point): number => unit(pixelRay(point, camera, size))[1];
  const isUp = height(from) <= height(to);
  return sine(normalOf(camera, isUp ? [from, to] : [to, from], size)[1]);
}

const normalOf = (camera: Camera, [from, to]: Line, size: Size): Vector =>
  unit(cross(pixelRay(from, camera, size), pixelRay(to, camera, size)));

const sine = (value: number): number => degrees(Math.asin(clamp(value, -1, 1)));

const unit = (vector: Vector): Vector => combine([1 / Math.hypot(...vector), vector]);

/** The camera's height by a thing of known size that stands on the ground, or lies on it; undefined where it does not. */
export function heightByReference(
  [foot, end]: Line,
  meters: number,
  lies: boolean,
  camera: Camera,
  size: Size,
): number | undefined {
  const [base, ray] = [groundRay(foot, camera, size), pixelRay(end, camera, size)];
  const other = lies ? groundRay(end, camera, size) : undefined;
  if (!base || (lies && !other)) return undefined;
  const long = other ? Math.hypot(other[0] - base[0], other[2] - base[2]) : heightOver(base, ray);
  return long > 0 && meters / long >= 0.1 && meters / long <= 20000 ? meters / long : undefined;
}

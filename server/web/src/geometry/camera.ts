/** The pinhole camera of a photo: where directions lie in it. Pixels are continuous, (0, 0) is the top left corner. */

import { combine, cross, direction, dot, radians, type Vector } from "./angles";

/** As in the record: elevation positive looks up, roll positive turns the camera clockwise; degrees. */
export interface Camera {
  elevation: number;
  roll: number;
  vertical_fov: number;
  height?: number; // meters above the ground
}

export interface Size {
  width: number;
  height: number;
}

export type Point = readonly [x: number, y: number];

interface Axes {
  right: Vector;
  up: Vector;
  forward: Vector;
}

export function cameraAxes(camera: Camera): Axes {
  const forward = direction(0, camera.elevation);
  const right = direction(90, 0);
  const up = cross(right, forward);
  const [c, s] = [Math.cos(radians(camera.roll)), Math.sin(radians(camera.roll))];
  return { right: combine([c, right], [-s, up]), up: combine([s, right], [c, up]), forward };
}

/** The pixel of a direction; null behind the camera. */
export function project(ray: Vector, camera: Camera, size: Size): Point | null {
  const { right, up, forward } = cameraAxes(camera);
  const depth = dot(ray, forward);
  if (depth <= 1e-9) return null;
  const focal = focalLength(camera, size);
  return [size.width / 2 + (focal * dot(ray, right)) / depth, size.height / 2 - (focal * dot(ray, up)) / depth];
}

/** The direction, not of unit length, through a pixel. */
export function pixelRay([x, y]: Point, camera: Camera, size: Size): Vector {
  const { right, up, forward } = cameraAxes(camera);
  return combine([x - size.width / 2, right], [size.height / 2 - y, up], [focalLength(camera, size), forward]);
}

export function focalLength(camera: Camera, size: Size): number {
  return size.height / 2 / Math.tan(radians(camera.vertical_fov) / 2);
}

/** Two pixels far out on the horizon's straight line; null where the camera looks straight up or down. */
export function horizon(camera: Camera, size: Size): [Point, Point] | null {
  const left = project(direction(-85, 0), camera, size);
  const right = project(direction(85, 0), camera, size);
  return left && right ? [left, right] : null;
}

export interface SunMark {
  inside: boolean;
  behind: boolean;
  point: Point; // of the sun, or of the arrow's tip at the photo's edge
  ray: Point; // unit vector in the picture, from its middle to the sun
}

/** Where the sun is in the photo, or where at its edge an arrow leaves for it. */
export function sunMark(sun: Vector, camera: Camera, size: Size, margin: number): SunMark {
  const pixel = project(sun, camera, size);
  const { right, up, forward } = cameraAxes(camera);
  const behind = dot(sun, forward) <= 0;
  const lateral = dot(sun, right);
  const ray = unit(behind ? [lateral < 0 ? -1 : 1, 0] : [lateral, -dot(sun, up)]);
  if (pixel && isInside(pixel, size)) return { inside: true, behind, point: pixel, ray };
  const [midX, midY] = [size.width / 2, size.height / 2];
  const reach = Math.min(
    (midX - margin) / Math.max(Math.abs(ray[0]), 1e-9),
    (midY - margin) / Math.max(Math.abs(ray[1]), 1e-9),
  );
  return { inside: false, behind, point: [midX + ray[0] * reach, midY + ray[1] * reach], ray };
}

function isInside([x, y]: Point, { width, height }: Size): boolean {
  return x >= 0 && x < width && y >= 0 && y < height;
}

function unit([x, y]: Point): Point {
  const length = Math.max(Math.hypot(x, y), 1e-9);
  return [x / length, y / length];
}

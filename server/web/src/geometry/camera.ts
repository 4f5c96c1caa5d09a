/** The pinhole camera of a photo: where directions lie in it. Pixels are continuous, (0, 0) is the top left corner. */

import { angles, clamp, combine, cross, direction, dot, radians, type Vector } from "./angles";
import type { Pixels } from "./color";

/** As in the record: elevation positive looks up, roll positive turns the camera clockwise; degrees. */
export interface Camera {
  elevation: number;
  roll: number;
  vertical_fov: number;
  height?: number; // metres above the ground
}

interface Size {
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

function focalLength(camera: Camera, size: Size): number {
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

const FEATHER = 0.15; // of the photo's half width and half height, over which its view fades into the rest

interface PhotoPixel {
  pixel: number;
  weight: number;
}

/** The photo's pixel (its index in `data`) in a direction, and how far it counts; null outside the photo. */
export function photoPixelAt(photo: Pixels, camera: Camera, azimuth: number, elevation: number): PhotoPixel | null {
  const point = project(direction(azimuth, elevation), camera, photo);
  if (!point) return null;
  const [x, y] = point;
  const weight = featherWeight(x / photo.width, y / photo.height);
  return weight === 0 ? null : { pixel: 4 * (Math.floor(y) * photo.width + Math.floor(x)), weight };
}

/** The photo's weight at a point of it, 0 to 1 each way: 1 inside, less towards its edges, 0 outside. */
function featherWeight(x: number, y: number): number {
  const ramp = clamp((1 - 2 * Math.max(Math.abs(x - 0.5), Math.abs(y - 0.5))) / FEATHER, 0, 1);
  return ramp * ramp * (3 - 2 * ramp);
}

/** Degrees above the horizon of what a pixel shows. */
export function pixelElevation(x: number, y: number, camera: Camera, size: { width: number; height: number }): number {
  return angles(pixelRay([x + 0.5, y + 0.5], camera, size) as Vector).elevation;
}

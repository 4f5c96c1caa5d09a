/** Which of a photo's pixels lies in a direction. */

import { clamp, direction } from "../pure/angles";
import { type Camera, project } from "../pure/camera";
import type { Pixels } from "./pixels";

const FEATHER = 0.15; // of the photo's half width and half height, over which its view fades into the rest

interface Found {
  pixel: number;
  weight: number;
}

/** The photo's pixel (its index in `data`) in a direction, and how far it counts; null outside the photo. */
export function pixelAt(photo: Pixels, camera: Camera, azimuth: number, elevation: number): Found | null {
  const point = project(direction(azimuth, elevation), camera, photo);
  if (!point) return null;
  const [x, y] = point;
  const weight = weightAt(x / photo.width, y / photo.height);
  return weight === 0 ? null : { pixel: 4 * (Math.floor(y) * photo.width + Math.floor(x)), weight };
}

/** How far the photo counts at a place of it, 0 to 1 each way: 1 inside, less towards its edges, 0 outside. */
function weightAt(x: number, y: number): number {
  const ramp = clamp((1 - 2 * Math.max(Math.abs(x - 0.5), Math.abs(y - 0.5))) / FEATHER, 0, 1);
  return ramp * ramp * (3 - 2 * ramp);
}

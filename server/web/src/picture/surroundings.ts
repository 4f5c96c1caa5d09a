/** What stands around the camera, for reflections: the photo in its own view, its darker things repeated around. */

import { clamp, direction, radians } from "../pure/angles";
import { type Camera, project } from "../pure/camera";
import type { Latlong } from "../sky/paint";
import { linear, type Pixels } from "./pixels";

/** For each pixel of a map: what the photo shows there, linear, and in the fourth float how surely (0 to 1). */
export type Surroundings = Latlong;

const FEATHER = 0.08; // of the photo's shorter side, over which its view fades into the rest
const REPEATED = 0.001; // marks what is not in view: the same colours, folded around

/** The photo laid around the camera, in a map of `height` rows. */
export function layAround(photo: Pixels, camera: Camera, height: number): Surroundings {
  const width = 2 * height;
  const data = new Float32Array(4 * width * height);
  const reach = halfWidth(photo, camera);
  for (let y = 0; y < height; y++) {
    const elevation = 90 - ((y + 0.5) * 180) / height;
    for (let x = 0; x < width; x++) {
      const azimuth = ((x + 0.5) / width) * 360 - 180;
      const seen = Math.abs(azimuth) < 90 ? at(photo, camera, azimuth, elevation) : null;
      const shown = seen ?? at(photo, camera, fold(azimuth, reach), elevation);
      if (!shown) continue;
      const i = 4 * (y * width + x);
      for (const c of [0, 1, 2]) data[i + c] = linear(photo.data[shown.pixel + c] as number);
      data[i + 3] = Math.max(seen ? seen.sure : 0, REPEATED);
    }
  }
  return { width, height, data };
}

/** Degrees from the photo's middle to its side, along the horizon or as near to it as the photo goes. */
function halfWidth(photo: Pixels, camera: Camera): number {
  const tangent = Math.tan(radians(camera.vertical_fov) / 2) * (photo.width / photo.height);
  return clamp((Math.atan(tangent) * 180) / Math.PI, 5, 80);
}

/** An azimuth reflected to and fro between the photo's sides, so that nothing jumps. */
export function fold(azimuth: number, reach: number): number {
  const phase = (((azimuth + reach) % (4 * reach)) + 4 * reach) % (4 * reach);
  return phase <= 2 * reach ? phase - reach : 3 * reach - phase;
}

function at(photo: Pixels, camera: Camera, azimuth: number, elevation: number): { pixel: number; sure: number } | null {
  const point = project(direction(azimuth, elevation), camera, photo);
  if (!point) return null;
  const [x, y] = point;
  if (x < 0 || y < 0 || x >= photo.width || y >= photo.height) return null;
  const inside = Math.min(x, y, photo.width - x, photo.height - y) / (FEATHER * Math.min(photo.width, photo.height));
  return { pixel: 4 * (Math.floor(y) * photo.width + Math.floor(x)), sure: clamp(inside, 0, 1) };
}

const grey = (data: Float32Array, i: number): number =>
  0.2126 * (data[i] as number) + 0.7152 * (data[i + 1] as number) + 0.0722 * (data[i + 2] as number);

/**
 * A map of sky and ground with the photo in it. `gain` takes the photo to the light on show. Above the horizon the
 * photo's view is laid over the sky, and beyond it only what is darker than the sky (houses, trees, hills); below it
 * only what the photo shows. What is clipped in the photo leaves the sky's own value.
 */
export function withSurroundings(map: Latlong, around: Surroundings, gain: number): Latlong {
  const data = map.data.slice();
  for (let i = 0; i < data.length; i += 4) {
    const sure = around.data[i + 3] as number;
    if (sure === 0) continue;
    const above = i < data.length / 2;
    const ratio = (gain * grey(around.data, i)) / Math.max(grey(map.data, i), 1e-9);
    const repeated = above ? clamp((0.9 - ratio) / 0.3, 0, 1) : 0;
    const clipped = above && grey(around.data, i) > 0.9 && ratio < 1;
    const weight = clipped ? 0 : sure + (1 - sure) * repeated;
    for (const c of [0, 1, 2]) {
      data[i + c] = (data[i + c] as number) * (1 - weight) + gain * (around.data[i + c] as number) * weight;
    }
  }
  return { ...map, data };
}

/** Light and dark of a photo's own things, repeated around the camera, where no colour of them is known. */

import { clamp, radians } from "../pure/angles";
import type { Camera } from "../pure/camera";
import { luminance, type Pixels } from "./pixels";
import { pixelAt } from "./view";

const NEARBY = 12; // degrees within which the photo is light or dark against itself
const CONTRAST: [number, number] = [0.25, 1.5]; // the brightest is no second sun
const LEAST = 1e-9;

/** For each pixel of a map how light or dark the photo is there when it is folded around, against what surrounds it. */
export function contrastAround(photo: Pixels, camera: Camera, height: number): Float32Array {
  const width = 2 * height;
  const found = new Float32Array(width * height).fill(1);
  const reach = halfWidth(photo, camera);
  const [light, known] = [new Float32Array(width * height), new Float32Array(width * height)];
  for (let y = 0; y < height; y++) {
    const elevation = 90 - ((y + 0.5) * 180) / height;
    for (let x = 0; x < width; x++) {
      const there = pixelAt(photo, camera, fold(((x + 0.5) / width) * 360 - 180, reach), elevation);
      if (!there) continue;
      known[y * width + x] = there.weight;
      light[y * width + x] = there.weight * luminance(photo.data, there.pixel);
    }
  }
  const radius = Math.round((NEARBY / 180) * height);
  const [mean, weight] = [boxed(light, width, radius), boxed(known, width, radius)];
  for (let i = 0; i < light.length; i++) {
    const here = known[i] as number;
    if (here === 0) continue;
    const usual = (mean[i] as number) / (weight[i] as number);
    const contrast = clamp((light[i] as number) / here / Math.max(usual, LEAST), ...CONTRAST);
    found[i] = contrast ** here;
  }
  return found;
}

/** Degrees from the photo's middle to its side, a little inside it. */
function halfWidth(photo: Pixels, camera: Camera): number {
  const tangent = Math.tan(radians(camera.vertical_fov) / 2) * (photo.width / photo.height);
  return clamp((0.85 * Math.atan(tangent) * 180) / Math.PI, 5, 80);
}

/** An azimuth reflected to and fro between the photo's sides, so that nothing jumps. */
export function fold(azimuth: number, reach: number): number {
  const phase = (((azimuth + reach) % (4 * reach)) + 4 * reach) % (4 * reach);
  return phase <= 2 * reach ? phase - reach : 3 * reach - phase;
}

/** Sums over squares of 2 `radius` + 1 pixels of a map with `width` columns, which wrap. */
function boxed(values: Float32Array, width: number, radius: number): Float32Array {
  const height = values.length / width;
  const across = new Float32Array(values.length);
  const sums = new Float32Array(values.length);
  for (let i = 0; i < values.length; i++) {
    const row = i - (i % width);
    for (let d = -radius; d <= radius; d++) {
      (across[i] as number) += values[row + ((i + d + width) % width)] as number;
    }
  }
  for (let i = 0; i < values.length; i++) {
    const y = Math.floor(i / width);
    for (let d = -radius; d <= radius; d++) {
      if (y + d >= 0 && y + d < height) (sums[i] as number) += across[i + d * width] as number;
    }
  }
  return sums;
}

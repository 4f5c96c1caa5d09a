/**
 * What stands around the camera, for reflections: the photo in its own view, and beside it what the service says that
 * the place makes of the bare sky and ground. The rules are those of `lighting.envmap.surround`, but for one: what is
 * said of the rest is smooth, so light and dark of the photo's own things texture it, or mirrors would look empty.
 */

import { clamp, radians } from "../pure/angles";
import type { Camera } from "../pure/camera";
import type { Triple } from "../sky/model";
import type { Latlong } from "../sky/paint";
import { type Factors, PlaceFactors, type Suns } from "./factors";
import { linear, type Pixels } from "./pixels";
import { contrastAround } from "./texture";
import { pixelAt } from "./view";

/** What the photo shows, linear, with its weight (0 to 1) as the fourth float; the place, and what textures it. */
export interface Surroundings {
  seen: Latlong;
  factors: PlaceFactors | undefined;
  contrast: Float32Array | undefined; // for each pixel of the map
}

/** The place around the camera, in maps of `height` rows; `textured` with the photo's own things beside it. */
export function layAround(
  photo: Pixels,
  camera: Camera,
  factors: Factors | undefined,
  height: number,
  textured = true,
): Surroundings {
  const contrast = factors && textured ? contrastAround(photo, camera, height) : undefined;
  return { seen: layPhoto(photo, camera, height), factors: factors && new PlaceFactors(factors, height), contrast };
}

const CLIPPED = 0.95; // linear value from which a pixel may have been brighter
const REST: [number, number] = [0.1, 4]; // how far what the photo does not show is scaled
const LEAST = 1e-9;
const CHANNELS = [0, 1, 2] as const;

function layPhoto(photo: Pixels, camera: Camera, height: number): Latlong {
  const width = 2 * height;
  const data = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    const elevation = 90 - ((y + 0.5) * 180) / height;
    for (let x = 0; x < width; x++) {
      const found = pixelAt(photo, camera, ((x + 0.5) / width) * 360 - 180, elevation);
      if (!found) continue;
      const i = 4 * (y * width + x);
      for (const c of CHANNELS) data[i + c] = linear(photo.data[found.pixel + c] as number);
      data[i + 3] = found.weight;
    }
  }
  return { width, height, data };
}

/**
 * A map of sky and ground with the place in it; `gain` takes the photo to the light on show. Each half of the map gives
 * level ground as much light as before. What is clipped in the photo leaves the map's own value where that is brighter.
 */
export function withSurroundings(map: Latlong, around: Surroundings, gain: number, suns: Suns): Latlong {
  const { seen, factors, contrast } = around;
  const data = map.data.slice();
  if (factors) {
    const place = factors.under(suns);
    for (let pixel = 0; pixel < data.length / 4; pixel++) {
      const texture = contrast?.[pixel] ?? 1;
      for (const c of CHANNELS) (data[4 * pixel + c] as number) *= (place[3 * pixel + c] as number) * texture;
    }
  }
  const middle = data.length / 2;
  for (const [start, end] of [
    [0, middle],
    [middle, data.length],
  ] as const) {
    compose({ ...map, data }, seen, { start, end, gain, target: irradiance(map, start, end) });
  }
  return { ...map, data };
}

interface Half {
  start: number; // of its floats
  end: number;
  gain: number;
  target: Triple; // irradiance of level ground
}

/** Lays the photo over one half of a map and scales the rest, so that the half gives its target. */
function compose(map: Latlong, seen: Latlong, { start, end, gain, target }: Half): void {
  const { data } = map;
  const laid = new Float32Array(data.length); // the photo, where it counts in full
  for (let i = start; i < end; i += 4) {
    if (!seen.data[i + 3]) continue;
    const clipped = CHANNELS.some((c) => (seen.data[i + c] as number) > CLIPPED);
    for (const c of CHANNELS) {
      const value = gain * (seen.data[i + c] as number);
      laid[i + c] = clipped ? Math.max(value, data[i + c] as number) : value;
    }
  }
  const weight = (i: number): number => seen.data[i + 3] as number;
  const photo = irradiance({ ...map, data: laid }, start, end, weight);
  const rest = irradiance(map, start, end, (i) => 1 - weight(i));
  const factor = CHANNELS.map((c) => clamp((target[c] - photo[c]) / Math.max(rest[c], LEAST), ...REST));
  const reached = CHANNELS.map((c) => (factor[c] as number) * rest[c] + photo[c]);
  for (let i = start; i < end; i += 4) {
    for (const c of CHANNELS) {
      const beside = (factor[c] as number) * (data[i + c] as number);
      const mixed = beside + weight(i) * ((laid[i + c] as number) - beside);
      data[i + c] = (mixed * target[c]) / Math.max(reached[c] as number, LEAST);
    }
  }
}

/** Irradiance of level ground, seen from above or below, by the floats `start` to `end` of a map, each pixel weighted. */
function irradiance(map: Latlong, start: number, end: number, weight: (i: number) => number = () => 1): Triple {
  const sum: Triple = [0, 0, 0];
  const stride = 4 * map.width;
  for (let row = start; row < end; row += stride) {
    const elevation = radians(90 - ((row / stride + 0.5) * 180) / map.height);
    const level = Math.abs(Math.sin(elevation)) * Math.cos(elevation);
    for (let i = row; i < row + stride; i += 4) {
      const share = weight(i) * level;
      for (const c of CHANNELS) sum[c] += share * (map.data[i + c] as number);
    }
  }
  const pixel = (2 * Math.PI * Math.PI) / (map.width * map.height);
  return [sum[0] * pixel, sum[1] * pixel, sum[2] * pixel];
}

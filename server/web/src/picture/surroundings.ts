/**
 * What stands around the camera, for reflections: the photo in its own view, and beside it what the service says that
 * the place makes of the bare sky and ground. The rules are those of `lighting.envmap.surround`, but for one: what is
 * said of the rest is smooth, so light and dark of the photo's own things texture it, or mirrors would look empty.
 */

import { angleBetween, clamp, direction, radians, type Vector } from "../pure/angles";
import type { Camera } from "../pure/camera";
import type { Triple } from "../sky/model";
import type { Latlong } from "../sky/paint";
import { linear, type Pixels } from "./pixels";
import { contrastAround } from "./texture";
import { pixelAt } from "./view";

/** What the place makes of the bare map, by cells of equal angles, row by row from the zenith. */
export interface Factors {
  rows: number;
  columns: number;
  factors: Triple[];
}

/** What the photo shows, linear, with its weight (0 to 1) as the fourth float; the place, and what textures it. */
export interface Surroundings {
  seen: Latlong;
  factors: Factors | undefined;
  contrast: Float32Array | undefined; // for each pixel of the map
}

/** Directions of the sun in the estimate and in the light on show. */
export interface Suns {
  before: Vector;
  now: Vector;
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
  return { seen: layPhoto(photo, camera, height), factors, contrast };
}

const CLIPPED = 0.95; // linear value from which a pixel may have been brighter
const REST: [number, number] = [0.1, 4]; // how far what the photo does not show is scaled
const GLOW = 40; // degrees around a sun within which the sky's brightness is the sun's
const MOVED = 20; // degrees by which a sun was moved for its glow to have gone
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

/** Cells as a map, linear between their centres; columns wrap, rows end at the poles and at the horizon. */
function smooth({ rows, columns, factors }: Factors, height: number): Latlong {
  const width = 2 * height;
  const data = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    const first = y < height / 2 ? 0 : rows / 2;
    const down = between(((y + 0.5) * rows) / height, (row) => clamp(row, first, first + rows / 2 - 1));
    for (let x = 0; x < width; x++) {
      const across = between(((x + 0.5) * columns) / width, (column) => (column + columns) % columns);
      const i = 4 * (y * width + x);
      for (const [row, high] of down) {
        for (const [column, wide] of across) {
          const cell = factors[row * columns + column] as Triple;
          for (const c of CHANNELS) data[i + c] = (data[i + c] as number) + high * wide * cell[c];
        }
      }
    }
  }
  return { width, height, data };
}

/** The two cells beside a place, and how far each counts. */
function between(place: number, inside: (cell: number) => number): [number, number][] {
  const low = Math.floor(place - 0.5);
  const share = place - 0.5 - low;
  return [
    [inside(low), 1 - share],
    [inside(low + 1), share],
  ];
}

/** The factors for a sun that was moved: around where it was, they are those of their row. */
function withoutGlow({ rows, columns, factors }: Factors, { before, now }: Suns): Factors {
  const moved = 1 - Math.exp(-((angleBetween(before, now) / MOVED) ** 2));
  const changed = factors.slice();
  for (let row = 0; row < rows / 2; row++) {
    const elevation = 90 - ((row + 0.5) * 180) / rows;
    const cells = Array.from({ length: columns }, (_, column) => {
      const towards = direction(((column + 0.5) / columns) * 360 - 180, elevation);
      const near = Math.exp(-((angleBetween(towards, before) / GLOW) ** 2));
      return { near, at: row * columns + column };
    });
    const far = cells.reduce((sum, { near }) => sum + 1 - near, 0);
    const mean = CHANNELS.map(
      (c) => cells.reduce((sum, { near, at }) => sum + (1 - near) * Math.log((factors[at] as Triple)[c]), 0) / far,
    );
    for (const { near, at } of cells) {
      const share = moved * near;
      const cell = factors[at] as Triple;
      changed[at] = CHANNELS.map((c) =>
        Math.exp((1 - share) * Math.log(cell[c]) + share * (mean[c] as number)),
      ) as Triple;
    }
  }
  return { rows, columns, factors: changed };
}

/**
 * A map of sky and ground with the place in it; `gain` takes the photo to the light on show. Each half of the map gives
 * level ground as much light as before. What is clipped in the photo leaves the map's own value where that is brighter.
 */
export function withSurroundings(map: Latlong, around: Surroundings, gain: number, suns: Suns): Latlong {
  const { seen, factors, contrast } = around;
  const data = map.data.slice();
  if (factors) {
    const place = smooth(withoutGlow(factors, suns), map.height).data;
    for (let i = 0; i < data.length; i++) {
      if (i % 4 < 3) (data[i] as number) *= (place[i] as number) * (contrast?.[i >> 2] ?? 1);
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
    const clipped = Math.max(...CHANNELS.map((c) => seen.data[i + c] as number)) > CLIPPED;
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
  for (let i = start; i < end; i += 4) {
    const elevation = radians(90 - ((Math.floor(i / 4 / map.width) + 0.5) * 180) / map.height);
    const share = weight(i) * Math.abs(Math.sin(elevation)) * Math.cos(elevation);
    for (const c of CHANNELS) sum[c] += share * (map.data[i + c] as number);
  }
  const pixel = (2 * Math.PI * Math.PI) / (map.width * map.height);
  return [sum[0] * pixel, sum[1] * pixel, sum[2] * pixel];
}

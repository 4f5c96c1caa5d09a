/**
 * The surroundings of the camera, for reflections: the photo in its own view, and beside it the bare sky and ground
 * times the service's factors. The rules are those of `lighting/envmap/surroundings.py`, but for one: the factors are
 * smooth, so light and dark of the photo's own things texture them, or mirrors would look empty.
 */

import { angleBetween, clamp, direction, radians, type Vector } from "../geometry/angles";
import { type Camera, photoPixelAt } from "../geometry/camera";
import { luminance, type Pixels, srgbToLinear, type Triple } from "../geometry/color";
import type { Latlong } from "../sky/render";

/** What the photo shows, linear, with its weight (0 to 1) as the fourth float; the factors, and what textures them. */
export interface Surroundings {
  projected: Latlong;
  factors: SmoothFactors | undefined;
  contrast: Float32Array | undefined; // for each pixel of the map
}

/** The surroundings of a photo, in maps of `height` rows; `textured` with the photo's own things beside it. */
export function buildSurroundings(
  photo: Pixels,
  camera: Camera,
  factors: SurroundingsFactors | undefined,
  height: number,
  textured = true,
): Surroundings {
  const contrast = factors && textured ? foldedContrast(photo, camera, height) : undefined;
  return {
    projected: projectPhoto(photo, camera, height),
    factors: factors && new SmoothFactors(factors, height),
    contrast,
  };
}

const CLIPPED = 0.95; // linear value from which a pixel may have been brighter
const REST_SCALE: [number, number] = [0.1, 4]; // how far what the photo does not show is scaled
const EPSILON = 1e-9;
const CHANNELS = [0, 1, 2] as const;

function projectPhoto(photo: Pixels, camera: Camera, height: number): Latlong {
  const width = 2 * height;
  const data = new Float32Array(4 * width * height);
  for (let y = 0; y < height; y++) {
    const elevation = 90 - ((y + 0.5) * 180) / height;
    for (let x = 0; x < width; x++) {
      const pixel = photoPixelAt(photo, camera, ((x + 0.5) / width) * 360 - 180, elevation);
      if (!pixel) continue;
      const i = 4 * (y * width + x);
      for (const c of CHANNELS) data[i + c] = srgbToLinear(photo.data[pixel.pixel + c] as number);
      data[i + 3] = pixel.weight;
    }
  }
  return { width, height, data };
}

/**
 * A map of sky and ground with the surroundings in it; `gain` takes the photo to the light on show. Each half of the map gives
 * level ground as much light as before. What is clipped in the photo leaves the map's own value where that is brighter.
 */
export function addSurroundings(map: Latlong, surroundings: Surroundings, gain: number, suns: Suns): Latlong {
  const { projected, factors, contrast } = surroundings;
  const data = map.data.slice();
  if (factors) {
    const gains = factors.forSuns(suns);
    for (let pixel = 0; pixel < data.length / 4; pixel++) {
      const texture = contrast?.[pixel] ?? 1;
      for (const c of CHANNELS) (data[4 * pixel + c] as number) *= (gains[3 * pixel + c] as number) * texture;
    }
  }
  const middle = data.length / 2;
  for (const [start, end] of [
    [0, middle],
    [middle, data.length],
  ] as const) {
    composeHalf({ ...map, data }, projected, { start, end, gain, target: irradiance(map, start, end) });
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
function composeHalf(map: Latlong, projected: Latlong, { start, end, gain, target }: Half): void {
  const { data } = map;
  const photoLight = new Float32Array(data.length); // the photo, where it counts in full
  for (let i = start; i < end; i += 4) {
    if (!projected.data[i + 3]) continue;
    const clipped = CHANNELS.some((c) => (projected.data[i + c] as number) > CLIPPED);
    for (const c of CHANNELS) {
      const value = gain * (projected.data[i + c] as number);
      photoLight[i + c] = clipped ? Math.max(value, data[i + c] as number) : value;
    }
  }
  const weight = (i: number): number => projected.data[i + 3] as number;
  const photo = irradiance({ ...map, data: photoLight }, start, end, weight);
  const rest = irradiance(map, start, end, (i) => 1 - weight(i));
  const factor = CHANNELS.map((c) => clamp((target[c] - photo[c]) / Math.max(rest[c], EPSILON), ...REST_SCALE));
  const total = CHANNELS.map((c) => (factor[c] as number) * rest[c] + photo[c]);
  for (let i = start; i < end; i += 4) {
    for (const c of CHANNELS) {
      const scaledRest = (factor[c] as number) * (data[i + c] as number);
      const mixed = scaledRest + weight(i) * ((photoLight[i + c] as number) - scaledRest);
      data[i + c] = (mixed * target[c]) / Math.max(total[c] as number, EPSILON);
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

/** By cells of equal angles, row by row from the zenith. */
export interface SurroundingsFactors {
  rows: number;
  columns: number;
  factors: Triple[];
}

/** Directions of the sun in the estimate and in the light on show. */
interface Suns {
  before: Vector;
  now: Vector;
}

const GLOW_WIDTH = 40; // degrees around a sun within which the sky's brightness is the sun's
const MOVED_WIDTH = 20; // degrees by which a sun was moved for its glow to have gone

/** The upper cells under the estimate's sun. */
interface Glow {
  before: Vector;
  near: Float64Array; // of each cell, how much of its brightness is the sun's
  logs: Float64Array; // of its factors, three a cell
  means: Float64Array; // of the factors' logarithms beside the glow, three a row
}

/** The two cells beside a position, and how far the second counts. */
interface Interpolation {
  low: number;
  high: number;
  share: number;
}

/** The factors of one photo for maps of `height` rows. What was computed last is kept: most steps ask for it again. */
export class SmoothFactors {
  private readonly down: Interpolation[];
  private readonly across: Interpolation[];
  private glow: Glow | undefined;
  private last: { moved: number; map: Float32Array } | undefined;

  constructor(
    private readonly cells: SurroundingsFactors,
    readonly height: number,
  ) {
    const { rows, columns } = cells;
    this.down = Array.from({ length: height }, (_, y) => {
      const first = y < height / 2 ? 0 : rows / 2;
      return interpolationAt(((y + 0.5) * rows) / height, (row) => clamp(row, first, first + rows / 2 - 1));
    });
    this.across = Array.from({ length: 2 * height }, (_, x) =>
      interpolationAt(((x + 0.5) * columns) / (2 * height), (column) => (column + columns) % columns),
    );
  }

  /** The factors of each pixel, three a pixel, linear between the cells' centres; not to be changed. */
  forSuns({ before, now }: Suns): Float32Array {
    if (this.glow?.before.join() !== before.join()) {
      this.glow = measureGlow(this.cells, before);
      this.last = undefined;
    }
    const moved = 1 - Math.exp(-((angleBetween(before, now) / MOVED_WIDTH) ** 2));
    if (this.last?.moved !== moved) this.last = { moved, map: this.smooth(removeGlow(this.cells, this.glow, moved)) };
    return this.last.map;
  }

  /** Cells as a map; columns wrap, rows end at the poles and at the horizon. */
  private smooth(cells: Float64Array): Float32Array {
    const stride = 3 * this.cells.columns;
    const map = new Float32Array(3 * this.down.length * this.across.length);
    const line = new Float64Array(stride);
    let at = 0;
    for (const { low, high, share } of this.down) {
      for (let k = 0; k < stride; k++) line[k] = interpolateValues(cells, low * stride + k, high * stride + k, share);
      for (const { low, high, share } of this.across) {
        for (let c = 0; c < 3; c++) map[at++] = interpolateValues(line, 3 * low + c, 3 * high + c, share);
      }
    }
    return map;
  }
}

const interpolateValues = (values: Float64Array, a: number, b: number, share: number): number =>
  (1 - share) * (values[a] as number) + share * (values[b] as number);

function interpolationAt(position: number, inside: (cell: number) => number): Interpolation {
  const low = Math.floor(position - 0.5);
  return { low: inside(low), high: inside(low + 1), share: position - 0.5 - low };
}

function measureGlow({ rows, columns, factors }: SurroundingsFactors, before: Vector): Glow {
  const upper = (rows / 2) * columns;
  const logs = Float64Array.from({ length: 3 * upper }, (_, i) =>
    Math.log((factors[Math.floor(i / 3)] as Triple)[i % 3] as number),
  );
  const near = Float64Array.from({ length: upper }, (_, at) => {
    const elevation = 90 - ((Math.floor(at / columns) + 0.5) * 180) / rows;
    const ray = direction((((at % columns) + 0.5) / columns) * 360 - 180, elevation);
    return Math.exp(-((angleBetween(ray, before) / GLOW_WIDTH) ** 2));
  });
  const means = new Float64Array((3 * rows) / 2);
  for (let row = 0; row < rows / 2; row++) {
    let far = 0;
    for (let at = row * columns; at < (row + 1) * columns; at++) {
      const share = 1 - (near[at] as number);
      far += share;
      for (let c = 0; c < 3; c++) (means[3 * row + c] as number) += share * (logs[3 * at + c] as number);
    }
    for (let c = 0; c < 3; c++) (means[3 * row + c] as number) /= far;
  }
  return { before, near, logs, means };
}

/** The factors, three a cell, for a sun that was moved: around where it was, they are those of their row. */
function removeGlow(
  { columns, factors }: SurroundingsFactors,
  { near, logs, means }: Glow,
  moved: number,
): Float64Array {
  const changed = Float64Array.from(factors.flat());
  for (let i = 0; i < logs.length; i++) {
    const at = Math.floor(i / 3);
    const mean = means[3 * Math.floor(at / columns) + (i % 3)] as number;
    const share = moved * (near[at] as number);
    changed[i] = Math.exp((1 - share) * (logs[i] as number) + share * mean);
  }
  return changed;
}

const NEARBY = 12; // degrees within which the photo is light or dark against itself
const CONTRAST_RANGE: [number, number] = [0.25, 1.5]; // the brightest is no second sun

/** For each pixel of a map how light or dark the photo is there when it is folded around, against what surrounds it. */
function foldedContrast(photo: Pixels, camera: Camera, height: number): Float32Array {
  const width = 2 * height;
  const contrastMap = new Float32Array(width * height).fill(1);
  const reach = halfWidth(photo, camera);
  const [light, coverage] = [new Float32Array(width * height), new Float32Array(width * height)];
  for (let y = 0; y < height; y++) {
    const elevation = 90 - ((y + 0.5) * 180) / height;
    for (let x = 0; x < width; x++) {
      const pixel = photoPixelAt(photo, camera, foldAzimuth(((x + 0.5) / width) * 360 - 180, reach), elevation);
      if (!pixel) continue;
      coverage[y * width + x] = pixel.weight;
      light[y * width + x] = pixel.weight * luminance(photo.data, pixel.pixel);
    }
  }
  const radius = Math.round((NEARBY / 180) * height);
  const [mean, weight] = [boxSum(light, width, radius), boxSum(coverage, width, radius)];
  for (let i = 0; i < light.length; i++) {
    const covered = coverage[i] as number;
    if (covered === 0) continue;
    const average = (mean[i] as number) / (weight[i] as number);
    const contrast = clamp((light[i] as number) / covered / Math.max(average, EPSILON), ...CONTRAST_RANGE);
    contrastMap[i] = contrast ** covered;
  }
  return contrastMap;
}

/** Degrees from the photo's middle to its side, a little inside it. */
function halfWidth(photo: Pixels, camera: Camera): number {
  const tangent = Math.tan(radians(camera.vertical_fov) / 2) * (photo.width / photo.height);
  return clamp((0.85 * Math.atan(tangent) * 180) / Math.PI, 5, 80);
}

/** An azimuth reflected to and fro between the photo's sides, so that nothing jumps. */
export function foldAzimuth(azimuth: number, reach: number): number {
  const phase = (((azimuth + reach) % (4 * reach)) + 4 * reach) % (4 * reach);
  return phase <= 2 * reach ? phase - reach : 3 * reach - phase;
}

/** Sums over squares of 2 `radius` + 1 pixels of a map with `width` columns, which wrap. */
function boxSum(values: Float32Array, width: number, radius: number): Float32Array {
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

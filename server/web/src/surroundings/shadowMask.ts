/** Where the photo's ground lies in the sun or in shade. */

import type { Lighting } from "../api";
import { radians } from "../geometry/angles";
import { pixelElevation } from "../geometry/camera";
import { luminance, type Pixels, rgbLuminance } from "../geometry/color";

const MIN_GROUND = 0.02; // of the photo's pixels, below which it shows no ground to speak of

/** How much of the sun reaches the photo's ground, 0 to 255, rows from the top. */
export interface ShadowMask {
  width: number;
  height: number;
  data: Uint8Array;
}

const BINS = 64;
const [DARKEST, BRIGHTEST] = [-7, 0]; // stops
const MIN_STEP = 1; // stops between shade and sun, else the difference is the ground's own
const OF_PREDICTED = 0.6; // share of the step that the light predicts
const MIN_PART = 0.03; // of the ground, that the smaller of both takes
const GRAIN = 2; // pixels that are averaged, so that a dark stone is no shade
const DEPTH = 1; // degree below the horizon, where ground begins that may lie in shade
const ALBEDO = { mean: -3.4, std: 1.2 }; // log2 of a ground's reflectance
const SUNLIT = 0.8; // share of the ground that the sun reaches where it reaches the scene
const RARE = 0.05; // least such share
const NEAR = 1; // stops from the threshold of ordinary ground, within which the picture's own is sought

/** The light of an estimate by which shade is told from sun. */
export type EstimatedLight = Pick<Lighting, "sky" | "camera"> & {
  sun: Omit<Lighting["sun"], "radius_50" | "radius_90">;
};

/**
 * How much of the sun reaches each pixel's ground, 0 to 255: the rule of `lit_ground` in `lighting/envmap`, where it is
 * described. 255 everywhere if the record states no irradiances.
 */
export function groundShadowMask(pixels: Pixels, light: EstimatedLight): Uint8Array {
  const all = new Uint8Array(pixels.width * pixels.height).fill(255);
  const { sun, sky } = light;
  if (!sun.irradiance || !sky.irradiance) return all;
  const open = rgbLuminance(sky.irradiance);
  const direct = rgbLuminance(sun.irradiance) * Math.max(Math.sin(radians(sun.elevation)), 0);
  const step = Math.log2(1 + direct / Math.max(open, 1e-9));
  const level = Math.log2(Math.max(open + direct, 1e-9) / Math.PI);
  const blocks = averageBlocks(pixels);
  const ground = blocks.values.flatMap((_, i) => {
    const [x, y] = [i % blocks.width, Math.floor(i / blocks.width)];
    return pixelElevation(x, y, light.camera, blocks) < -DEPTH ? [i] : [];
  });
  if (step < MIN_STEP || ground.length < MIN_GROUND * blocks.values.length) return all;
  const stops = ground.map((i) => Math.log2(Math.min(Math.max(blocks.values[i] as number, 2 ** DARKEST), 1)));
  const shares = sunlitShares(stops, level, step, sun.visibility);
  const lit = blocks.values.map(() => 1);
  ground.forEach((i, n) => {
    lit[i] = shares[n] as number;
  });
  return all.map((_, i) => Math.round(255 * interpolateBlocks(lit, blocks, pixels, i)));
}

/**
 * How far ground in a window of a mask lies in the sun, 0 to 1: around a point, up to `reach` away, shares of the mask's
 * width and height from its upper left corner. 1 outside of the picture.
 */
export function meanSunlit(
  { width, height, data }: ShadowMask,
  [x, y]: [number, number],
  reach: [number, number],
): number {
  const span = (at: number, radius: number, count: number): [number, number] => [
    Math.max(0, Math.floor((at - radius) * count)),
    Math.min(count, Math.floor((at + radius) * count) + 1),
  ];
  const [left, right] = span(x, reach[0], width);
  const [top, bottom] = span(y, reach[1], height);
  let [sum, count] = [0, 0];
  for (let row = top; row < bottom; row++) {
    for (let column = left; column < right; column++) {
      sum += data[row * width + column] as number;
      count++;
    }
  }
  return count ? sum / count / 255 : 1;
}

/** The share of the sun at ground of log2 luminance; `level` is that of a white surface in the sun. */
function sunlitShares(stops: number[], level: number, step: number, visibility: number): number[] {
  const middle = level + ALBEDO.mean - step / 2; // between ordinary ground in the sun and in shade
  const least = Math.max(MIN_STEP, OF_PREDICTED * step);
  const classes = [NEAR, Number.POSITIVE_INFINITY]
    .map((reach) => otsuClasses(stops, middle, reach))
    .find(
      (candidate, i) =>
        candidate && candidate.bright - candidate.dark >= least && (i === 0 || candidate.dark < middle + NEAR),
    );
  if (!classes) {
    const whole = Number(median(stops) >= level + minLitReflectance(step, visibility));
    return stops.map(() => whole);
  }
  const { dark, bright } = classes;
  const threshold = (dark + bright) / 2;
  return stops.map((stop) => Math.min(Math.max((stop - threshold) / (0.5 * (bright - dark)) + 0.5, 0), 1));
}

/** Log2 of the reflectance, if it were lit, of ground that is as likely to lie in shade. */
function minLitReflectance(step: number, visibility: number): number {
  const lit = SUNLIT * visibility;
  return ALBEDO.mean - step / 2 - (ALBEDO.std ** 2 * Math.log(Math.max(lit, RARE) / (1 - lit))) / step;
}

function median(values: number[]): number {
  const sorted = values.toSorted((a, b) => a - b);
  const [low, high] = [(sorted.length - 1) >> 1, sorted.length >> 1];
  return ((sorted[low] as number) + (sorted[high] as number)) / 2;
}

interface Blocks {
  width: number;
  height: number;
  values: number[];
}

/** Mean luminance of blocks of GRAIN pixels each way; the last ones take what is left over. */
function averageBlocks({ width, height, data }: Pixels): Blocks {
  const [columns, rows] = [Math.max(1, Math.floor(width / GRAIN)), Math.max(1, Math.floor(height / GRAIN))];
  const sums = new Array<number>(columns * rows).fill(0);
  const counts = sums.slice();
  for (let i = 0; i < width * height; i++) {
    const x = Math.min(Math.floor((i % width) / GRAIN), columns - 1);
    const at = Math.min(Math.floor(i / width / GRAIN), rows - 1) * columns + x;
    sums[at] = (sums[at] as number) + luminance(data, 4 * i);
    counts[at] = (counts[at] as number) + 1;
  }
  return { width: columns, height: rows, values: sums.map((sum, at) => sum / (counts[at] as number)) };
}

/** The value at a pixel between those of the blocks, linearly. */
function interpolateBlocks(values: number[], blocks: Blocks, { width, height }: Pixels, i: number): number {
  const x = blockPosition((i % width) + 0.5, width, blocks.width);
  const y = blockPosition(Math.floor(i / width) + 0.5, height, blocks.height);
  const at = (column: number, row: number): number => values[row * blocks.width + column] as number;
  const upper = at(x.low, y.low) * (1 - x.share) + at(x.high, y.low) * x.share;
  const lower = at(x.low, y.high) * (1 - x.share) + at(x.high, y.high) * x.share;
  return upper * (1 - y.share) + lower * y.share;
}

/** The two blocks of `count` that a position along `length` pixels lies between, and how far it is on its way. */
function blockPosition(at: number, length: number, count: number): { low: number; high: number; share: number } {
  const where = Math.min(Math.max((at * count) / length - 0.5, 0), count - 1);
  const low = Math.floor(where);
  return { low, high: Math.min(low + 1, count - 1), share: where - low };
}

/** The means of the two kinds into which values fall by a threshold (Otsu) near the middle; null if one is rare. */
function otsuClasses(values: number[], middle: number, reach: number): { dark: number; bright: number } | null {
  const counts = new Array<number>(BINS).fill(0);
  const width = (BRIGHTEST - DARKEST) / BINS;
  for (const value of values) {
    const bin = Math.min(Math.max(Math.floor((value - DARKEST) / width), 0), BINS - 1);
    counts[bin] = (counts[bin] as number) + 1;
  }
  const middleOf = (bin: number): number => DARKEST + (bin + 0.5) * width;
  const whole = counts.reduce((sum, count, bin) => sum + count * middleOf(bin), 0);
  let best = { dark: 0, bright: 0, part: 0, std: -1 };
  let [below, sum] = [0, 0];
  for (let bin = 0; bin < BINS - 1; bin++) {
    below += counts[bin] as number;
    sum += (counts[bin] as number) * middleOf(bin);
    const above = values.length - below;
    if (below === 0 || above === 0) continue;
    const [dark, bright] = [sum / below, (whole - sum) / above];
    const std = below * above * (bright - dark) ** 2;
    if (Math.abs((dark + bright) / 2 - middle) > reach || std <= best.std) continue;
    best = { dark, bright, part: Math.min(below, above) / values.length, std };
  }
  return best.part < MIN_PART ? null : best;
}

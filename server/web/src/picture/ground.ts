/** The ground as the photo shows it: its colour, and where it lies in the sun or in shade. */

import type { Camera } from "../pure/camera";
import type { Triple } from "../sky/model";
import { groundPixels, linear, luminance, type Pixels } from "./pixels";

const DEPRESSION = 4; // degrees below the horizon, where ground begins: nearer to it stand things
const LEAST = 0.02; // of the photo's pixels, below which it shows no ground to speak of

/** The median colour of the ground, linear; undefined where the photo shows none. */
export function groundColour(pixels: Pixels, camera: Camera): Triple | undefined {
  const ground = groundPixels(pixels, camera, DEPRESSION);
  if (ground.length < LEAST * pixels.width * pixels.height) return undefined;
  const median = (c: number): number => {
    const bytes = ground.map((i) => pixels.data[i + c] as number).sort((a, b) => a - b);
    return linear(bytes[bytes.length >> 1] as number);
  };
  return [median(0), median(1), median(2)];
}

const BINS = 64;
const [DARKEST, BRIGHTEST] = [-7, 0]; // stops
const LEAST_STEP = 1; // stops between shade and sun, else the difference is the ground's own
const LEAST_PART = 0.03; // of the ground, that the smaller of both takes
const GRAIN = 4; // pixels that are averaged, so that a dark stone is no shade

/**
 * How much of the sun reaches each pixel's ground, 0 to 255, as far as the picture tells: 255 everywhere unless the
 * ground falls into two kinds, a dark and a bright one, at least a stop apart (Otsu's threshold on log luminance).
 */
export function litGround(pixels: Pixels, camera: Camera): Uint8Array {
  const lit = new Uint8Array(pixels.width * pixels.height).fill(255);
  const ground = groundPixels(pixels, camera, 1);
  if (ground.length < LEAST * lit.length) return lit;
  const stops = ground.map((i) => Math.log2(Math.max(smooth(pixels, i), 2 ** DARKEST)));
  const { threshold, step, part } = split(stops);
  if (step < LEAST_STEP || part < LEAST_PART) return lit;
  ground.forEach((i, n) => {
    const share = ((stops[n] as number) - threshold) / (0.5 * step) + 0.5;
    lit[i / 4] = Math.round(255 * Math.min(Math.max(share, 0), 1));
  });
  return lit;
}

/** Mean luminance around a pixel. */
function smooth({ width, height, data }: Pixels, i: number): number {
  const [x, y] = [(i / 4) % width, Math.floor(i / 4 / width)];
  let [sum, count] = [0, 0];
  for (let v = Math.max(0, y - GRAIN / 2); v <= Math.min(height - 1, y + GRAIN / 2); v++) {
    for (let u = Math.max(0, x - GRAIN / 2); u <= Math.min(width - 1, x + GRAIN / 2); u++) {
      sum += luminance(data, 4 * (v * width + u));
      count++;
    }
  }
  return sum / count;
}

/** The threshold between two kinds of values, the step between their means, and the share of the rarer kind. */
function split(values: number[]): { threshold: number; step: number; part: number } {
  const counts = new Array<number>(BINS).fill(0);
  const width = (BRIGHTEST - DARKEST) / BINS;
  for (const value of values) {
    const bin = Math.min(Math.max(Math.floor((value - DARKEST) / width), 0), BINS - 1);
    counts[bin] = (counts[bin] as number) + 1;
  }
  const middle = (bin: number): number => DARKEST + (bin + 0.5) * width;
  const whole = counts.reduce((sum, count, bin) => sum + count * middle(bin), 0);
  let best = { threshold: 0, step: 0, part: 0, spread: -1 };
  let [below, sum] = [0, 0];
  for (let bin = 0; bin < BINS - 1; bin++) {
    below += counts[bin] as number;
    sum += (counts[bin] as number) * middle(bin);
    const above = values.length - below;
    if (below === 0 || above === 0) continue;
    const [dark, bright] = [sum / below, (whole - sum) / above];
    const spread = below * above * (bright - dark) ** 2;
    const part = Math.min(below, above) / values.length;
    if (spread > best.spread) best = { threshold: (dark + bright) / 2, step: bright - dark, part, spread };
  }
  return best;
}

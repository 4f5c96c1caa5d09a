/** The photo's ground: its colour, and where on it an object has room, off people and things. */

import { type Camera, horizon, type Point, pixelElevation } from "../geometry/camera";
import { type Pixels, srgbToLinear, type Triple } from "../geometry/color";

const MIN_DEPRESSION = 4; // degrees below the horizon, where ground begins: nearer to it stand things
const MIN_GROUND = 0.02; // of the photo's pixels, below which it shows no ground to speak of

/** The median colour of the ground, linear; undefined where the photo shows none. */
export function estimateGroundColor(pixels: Pixels, camera: Camera): Triple | undefined {
  const ground = groundPixels(pixels, camera);
  if (ground.length < MIN_GROUND * pixels.width * pixels.height) return undefined;
  const median = (c: number): number => {
    const bytes = ground.map((i) => pixels.data[i + c] as number).sort((a, b) => a - b);
    return srgbToLinear(bytes[bytes.length >> 1] as number);
  };
  return [median(0), median(1), median(2)];
}

/** Indices (of `data`) of the pixels that show ground. */
function groundPixels(pixels: Pixels, camera: Camera): number[] {
  const indices: number[] = [];
  for (let y = 0; y < pixels.height; y++) {
    for (let x = 0; x < pixels.width; x++) {
      if (pixelElevation(x, y, camera, pixels) < -MIN_DEPRESSION) indices.push(4 * (y * pixels.width + x));
    }
  }
  return indices;
}

const GRAIN = 4; // pixels that are averaged: paving and grass are plain, people and bollards are not
const SIDE = 0.09; // of the photo's height, the half of the box that must be free
const LOWEST_EDGE = 0.95; // of the photo's height, where a foot may stand
const DISTANCE_COST = 25; // grey levels of unrest that one is ready to bear to stay in the middle

/**
 * The point of the photo, in shares of its width and height, where an object's foot disturbs least: the box above it
 * holds the least unrest (differences between neighbours), the nearer to the lower middle the better. Null where the
 * photo shows no ground.
 */
export function findFreeSpot(photo: Pixels, camera: Camera): Point | null {
  const pixels = downsample(photo);
  const unrest = unrestIn(pixels);
  const half = Math.max(2, Math.round(SIDE * pixels.height));
  const line = horizon(camera, pixels);
  const top = line ? (line[0][1] + line[1][1]) / 2 : 0;
  const ideal = Math.max(top, 0) + 0.62 * (pixels.height - Math.max(top, 0));
  let best: { cost: number; at: Point } | undefined;
  for (let y = 0; y < LOWEST_EDGE * pixels.height; y++) {
    for (let x = half; x < pixels.width - half; x++) {
      if (pixelElevation(x, y, camera, pixels) > -MIN_DEPRESSION) continue;
      const distance = Math.abs(x / pixels.width - 0.5) + Math.abs(y - ideal) / pixels.height;
      const cost =
        unrest(x - half, y - half, x + half, Math.min(y + half / 3, pixels.height)) + DISTANCE_COST * distance;
      if (!best || cost < best.cost) best = { cost, at: [(x + 0.5) / pixels.width, (y + 0.5) / pixels.height] };
    }
  }
  return best?.at ?? null;
}

/** The mean of each block of pixels. */
function downsample({ width, height, data }: Pixels): Pixels {
  const [columns, rows] = [Math.max(1, Math.floor(width / GRAIN)), Math.max(1, Math.floor(height / GRAIN))];
  const small = new Uint8ClampedArray(4 * columns * rows);
  for (let i = 0; i < small.length; i++) {
    const [x, y] = [(i >> 2) % columns, Math.floor((i >> 2) / columns)];
    let sum = 0;
    for (let k = 0; k < GRAIN * GRAIN; k++) {
      const [u, v] = [Math.min(x * GRAIN + (k % GRAIN), width - 1), Math.min(y * GRAIN + (k >> 2), height - 1)];
      sum += data[4 * (v * width + u) + (i & 3)] as number;
    }
    small[i] = sum / (GRAIN * GRAIN);
  }
  return { width: columns, height: rows, data: small };
}

/** A function that gives the mean difference between neighbours, in grey levels, within a box of pixels. */
function unrestIn({ width, height, data }: Pixels): (x0: number, y0: number, x1: number, y1: number) => number {
  const sums = new Float64Array((width + 1) * (height + 1));
  const grey = (x: number, y: number): number => {
    const i = 4 * (Math.min(y, height - 1) * width + Math.min(x, width - 1));
    return 0.3 * (data[i] as number) + 0.59 * (data[i + 1] as number) + 0.11 * (data[i + 2] as number);
  };
  const sum = (x: number, y: number): number => sums[y * (width + 1) + x] as number;
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const value = grey(x, y);
      const step = Math.abs(grey(x + 1, y) - value) + Math.abs(grey(x, y + 1) - value);
      sums[(y + 1) * (width + 1) + x + 1] = step + sum(x, y + 1) + sum(x + 1, y) - sum(x, y);
    }
  }
  return (x0, y0, x1, y1) => {
    const [left, right] = [Math.max(Math.round(x0), 0), Math.min(Math.round(x1), width)];
    const [above, below] = [Math.max(Math.round(y0), 0), Math.min(Math.round(y1), height)];
    const area = Math.max((right - left) * (below - above), 1);
    return (sum(right, below) - sum(left, below) - sum(right, above) + sum(left, above)) / area;
  };
}

/** What the service says of a photo's ground, cell by cell. */

import type { Point } from "../geometry/camera";
import type { Pixels } from "../geometry/color";

/** Values of 0 to 255, rows from the top. */
export interface GroundMask {
  width: number;
  height: number;
  firm: Uint8Array; // probability of firm, level ground
  lit: Uint8Array; // how far the sun reaches it
}

/** Ground that lies in the sun everywhere: of a photo whose mask is not known. */
export const SUNLIT: GroundMask = { width: 1, height: 1, firm: Uint8Array.of(255), lit: Uint8Array.of(255) };

/** The mask in a picture of the service: its red and its green. */
export function groundMaskFromPixels({ width, height, data }: Pixels): GroundMask {
  const channel = (c: number): Uint8Array =>
    Uint8Array.from({ length: width * height }, (_, i) => data[4 * i + c] as number);
  return { width, height, firm: channel(0), lit: channel(1) };
}

/**
 * How far the sun reaches the ground around a point of the photo, 0 to 1: the mean of the cells up to `reach` away. Both
 * are shares of width and height; 1 outside of the photo.
 */
export function sunlitAround({ width, height, lit }: GroundMask, [x, y]: Point, reach: Point): number {
  const span = (at: number, radius: number, count: number): readonly [number, number] => [
    Math.max(0, Math.floor((at - radius) * count)),
    Math.min(count, Math.floor((at + radius) * count) + 1),
  ];
  const [left, right] = span(x, reach[0], width);
  const [top, bottom] = span(y, reach[1], height);
  let [sum, count] = [0, 0];
  for (let row = top; row < bottom; row++) {
    for (let column = left; column < right; column++) {
      sum += lit[row * width + column] as number;
      count++;
    }
  }
  return count ? sum / count / 255 : 1;
}

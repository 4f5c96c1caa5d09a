/** What the service says of a photo's ground, cell by cell. */

import type { Point } from "../geometry/camera";
import type { Pixels } from "../geometry/color";

/** Values of 0 to 255, rows from the top. */
export interface GroundMask {
  width: number;
  height: number;
  lit: Uint8Array; // how far the sun reaches the ground
  sunny: Uint8Array; // 255 where an object stands in the sun, 0 where in shade
}

/** Ground that lies in the sun everywhere: of a photo whose mask is not known. */
export const SUNLIT: GroundMask = { width: 1, height: 1, lit: Uint8Array.of(255), sunny: Uint8Array.of(255) };

/** The mask in a picture of the service: its green and its blue. */
export function groundMaskFromPixels({ width, height, data }: Pixels): GroundMask {
  const channel = (c: number): Uint8Array =>
    Uint8Array.from({ length: width * height }, (_, i) => data[4 * i + c] as number);
  return { width, height, lit: channel(1), sunny: channel(2) };
}

/**
 * Whether an object whose foot is at a point of the photo, in shares of its width and height, stands in the sun. Outside of
 * the photo the nearest cell counts.
 */
export function isInSun({ width, height, sunny }: GroundMask, [x, y]: Point): boolean {
  const cell = (share: number, count: number): number => Math.min(Math.max(Math.floor(share * count), 0), count - 1);
  return sunny[cell(y, height) * width + cell(x, width)] === 255;
}

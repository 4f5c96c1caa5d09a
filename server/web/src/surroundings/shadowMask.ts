/** Where the sun reaches the photo's ground, as the service says. */

import type { Pixels } from "../geometry/color";

/** How much of the sun an object may take from the photo's ground, 0 to 255, rows from the top. */
export interface ShadowMask {
  width: number;
  height: number;
  data: Uint8Array;
}

/** Ground that lies in the sun everywhere: of a photo whose mask is not known. */
export const SUNLIT: ShadowMask = { width: 1, height: 1, data: Uint8Array.of(255) };

/** The mask in a picture of the service: its green. */
export function shadowMaskFromPixels({ width, height, data }: Pixels): ShadowMask {
  return { width, height, data: Uint8Array.from({ length: width * height }, (_, i) => data[4 * i + 1] as number) };
}

const MIN_SUNLIT = 0.5; // share of the sun under an object, below which it stands in shade

/** Whether an object stands in the sun, by the rule of \`lighting/envmap/shadow_mask\`; see \`meanSunlit\`. */
export const standsInSun = (mask: ShadowMask, at: [number, number], reach: [number, number]): boolean =>
  meanSunlit(mask, at, reach) >= MIN_SUNLIT;

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

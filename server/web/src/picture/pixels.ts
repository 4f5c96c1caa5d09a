/** A photo reduced to a few pixels, in which the page looks for ground, shade and room for an object. */

import { angles, type Vector } from "../pure/angles";
import { type Camera, rayThrough } from "../pure/camera";

/** As in the browser's ImageData: sRGB bytes, four a pixel, rows from the top. */
export interface Pixels {
  width: number;
  height: number;
  data: Uint8ClampedArray;
}

const LINEAR = Float32Array.from({ length: 256 }, (_, byte) => {
  const value = byte / 255;
  return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
});

/** The linear value, 0 to 1, of an sRGB byte. */
export const linear = (byte: number): number => LINEAR[byte] as number;

/** sRGB of a linear value, both 0 to 1. */
export function encoded(value: number): number {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

/** Linear luminance of the pixel that begins at `i`. */
export function luminance(data: Uint8ClampedArray, i: number): number {
  return (
    0.2126 * linear(data[i] as number) + 0.7152 * linear(data[i + 1] as number) + 0.0722 * linear(data[i + 2] as number)
  );
}

/** Degrees above the horizon of what a pixel shows. */
export function elevationOf(x: number, y: number, camera: Camera, size: { width: number; height: number }): number {
  return angles(rayThrough([x + 0.5, y + 0.5], camera, size) as Vector).elevation;
}

/** Indices (of `data`) of the pixels that show ground: at least `depression` degrees below the horizon. */
export function groundPixels(pixels: Pixels, camera: Camera, depression: number): number[] {
  const found: number[] = [];
  for (let y = 0; y < pixels.height; y++) {
    for (let x = 0; x < pixels.width; x++) {
      if (elevationOf(x, y, camera, pixels) < -depression) found.push(4 * (y * pixels.width + x));
    }
  }
  return found;
}

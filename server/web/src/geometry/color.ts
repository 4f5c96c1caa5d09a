/** Colors: of bytes, of linear values, and between them. */

/** Bytes. */
export type Rgb = readonly [red: number, green: number, blue: number];

/** Linear values. */
export type Triple = [red: number, green: number, blue: number];

export const CHANNELS = [0, 1, 2] as const;

/** "#1e222a" as three bytes. */
export function parseHexColor(hex: string): Rgb {
  const value = Number.parseInt(hex.trim().slice(1), 16);
  return [(value >> 16) & 255, (value >> 8) & 255, value & 255];
}

/** The color at `level` (0 to 1) between equally spaced stops. */
export function mixColors(stops: readonly Rgb[], level: number): Rgb {
  const position = Math.min(Math.max(level, 0), 1) * (stops.length - 1);
  const low = Math.min(Math.floor(position), stops.length - 2);
  const [a, b, share] = [stops[low] as Rgb, stops[low + 1] as Rgb, position - low];
  const mix = (i: 0 | 1 | 2): number => Math.round(a[i] + (b[i] - a[i]) * share);
  return [mix(0), mix(1), mix(2)];
}

/** As in the browser's ImageData: sRGB bytes, four a pixel, rows from the top. */
export interface Pixels {
  width: number;
  height: number;
  data: Uint8ClampedArray;
}

/** sRGB of a linear value, both 0 to 1. */
export function linearToSrgb(value: number): number {
  return value <= 0.0031308 ? 12.92 * value : 1.055 * value ** (1 / 2.4) - 0.055;
}

/** Luminance of linear values. */
export const rgbLuminance = ([red, green, blue]: Triple): number => 0.2126 * red + 0.7152 * green + 0.0722 * blue;

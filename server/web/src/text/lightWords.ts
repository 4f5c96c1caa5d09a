/** Light in the words of people who set lights; units stand beside them as a hint. */

import type { Irradiances, LightParameters } from "../api";
import { radians } from "../geometry/angles";
import { rgbLuminance, type Triple } from "../geometry/color";

/** A word for a value, and the value with its unit. */
export interface Wording {
  text: string;
  hint: string;
}

/** Words for ranges of a value, each up to its limit; the last one has none. */
type Scale = readonly (readonly [limit: number, text: string])[];

const wordFor = (scale: Scale, value: number): string =>
  (scale.find(([limit]) => value < limit) ?? scale.at(-1))?.[1] ?? "";

const HEIGHTS: Scale = [[0, "below the horizon"], [6, "on the horizon"], [15, "low"], [35, "medium"], [60, "high"], [91, "overhead"]]; // biome-ignore format: a table
const HAZES: Scale = [[2.2, "crystal clear"], [3.5, "clear"], [5, "slight haze"], [7.5, "hazy"], [99, "thick haze"]]; // biome-ignore format: a table
const COLORS: Scale = [[2800, "deep orange"], [3800, "golden"], [5200, "warm"], [7200, "neutral"], [9000, "cool"], [1e9, "blue"]]; // biome-ignore format: a table
const SHADOWS: Scale = [[0.15, "none"], [0.6, "very soft"], [1.2, "soft"], [2, "clear"], [99, "hard"]]; // biome-ignore format: a table, of stops

export const describeHeight = (elevation: number): Wording => ({
  text: wordFor(HEIGHTS, elevation),
  hint: `${elevation.toFixed(1)}°`,
});

export const describeHaze = (turbidity: number): Wording => ({
  text: wordFor(HAZES, turbidity),
  hint: `turbidity ${turbidity.toFixed(1)}`,
});

/** Exposure against the estimate's. */
export function describeExposure(exposure: number, estimated: number): Wording {
  const stops = Math.log2(exposure / estimated);
  const rounded = Math.abs(stops) < 0.05 ? 0 : stops;
  const text = rounded === 0 ? "as shot" : rounded > 0 ? "brighter" : "darker";
  return { text, hint: `${rounded > 0 ? "+" : ""}${rounded.toFixed(1).replace("-", "−")} EV` };
}

/** The color of the sun that shines, or of the sky where it does not. */
export function describeColor({ sun, sky }: Irradiances): Wording {
  const shines = Math.max(...sun) > 0;
  const kelvin = colorTemperature(shines ? sun : sky);
  const hint = kelvin === undefined ? "" : `${Math.round(kelvin / 100) * 100}\u00a0K`;
  const text = kelvin === undefined ? "saturated" : wordFor(COLORS, kelvin);
  return { text: shines ? text : `sky light: ${text}`, hint };
}

/** How much darker a shadow on level ground is than the ground beside it. */
export function describeShadows({ sun, sky }: Irradiances, { sun_elevation }: LightParameters): Wording {
  const direct = rgbLuminance(sun) * Math.max(Math.sin(radians(sun_elevation)), 0);
  const stops = Math.log2(1 + direct / Math.max(rgbLuminance(sky), 1e-9));
  return { text: wordFor(SHADOWS, stops), hint: `${stops.toFixed(1)} stops darker` };
}

/**
 * Correlated color temperature [K] of linear Rec.709, 1,500 to 25,000; undefined for colors far from it.
 *
 * C. S. McCamy, Correlated color temperature as an explicit function of chromaticity coordinates, 1992.
 */
export function colorTemperature([r, g, b]: Triple): number | undefined {
  const [x, y, z] = [
    0.4124 * r + 0.3576 * g + 0.1805 * b,
    0.2126 * r + 0.7152 * g + 0.0722 * b,
    0.0193 * r + 0.1192 * g + 0.9505 * b,
  ];
  const sum = x + y + z;
  if (!(sum > 0)) return undefined;
  const n = (x / sum - 0.332) / (0.1858 - y / sum);
  const kelvin = 449 * n ** 3 + 3525 * n ** 2 + 6823.3 * n + 5520.33;
  return kelvin >= 1500 && kelvin <= 25000 ? kelvin : undefined;
}

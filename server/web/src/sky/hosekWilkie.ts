/**
 * The sky of Hosek and Wilkie and its sun, as `lighting/sky/hosek_wilkie.py` has them: the same table, the same
 * formulae, linear Rec.709. Angles in degrees unless stated.
 */

import { clamp, radians } from "../geometry/angles";
import type { Triple } from "../geometry/color";

/** What a sky's radiance is computed from: nine coefficients and a mean radiance for each channel. */
export interface SkyShape {
  coefficients: [number[], number[], number[]];
  radiance: Triple;
}

/** The arrays of the model's table, in the order of its file. */
export type SkyTable = Record<keyof typeof TABLE_SIZES, Float32Array>;

const TABLE_SIZES = { sky: 10 * 2 * 6 * 27, sky_radiance: 10 * 2 * 6 * 3, sun: 10 * 45 * 3 * 4 * 6 };

/** The table in the bytes of its file; throws a TypeError for another length. */
export function parseSkyTable(bytes: ArrayBuffer): SkyTable {
  const { sky, sky_radiance, sun } = TABLE_SIZES;
  const floats = new Float32Array(bytes);
  if (floats.length !== sky + sky_radiance + sun) throw new TypeError("The table of the sky has another length.");
  return {
    sky: floats.subarray(0, sky),
    sky_radiance: floats.subarray(sky, sky + sky_radiance),
    sun: floats.subarray(sky + sky_radiance),
  };
}

const CIE_Y_INTEGRAL = 106.75; // nm
const SUN_RGB_FACTOR = 467.069280386; // nm
const SUN_RADIUS = 0.2679;
const SUN_SOLID_ANGLE = 2 * Math.PI * (1 - Math.cos(radians(SUN_RADIUS)));
const BINOMIAL = [1, 5, 10, 10, 5, 1];
const CHANNELS = [0, 1, 2] as const;

/** The sky of a sun elevation, turbidity and albedo, each brought into the model's range. */
export function skyShape(table: SkyTable, elevation: number, turbidity: number, albedo: number): SkyShape {
  const x = Math.cbrt(clamp(elevation, 0, 90) / 90);
  const weights = BINOMIAL.map((factor, i) => factor * x ** i * (1 - x) ** (5 - i));
  const share = clamp(albedo, 0, 1);
  const mix = (name: "sky" | "sky_radiance", width: number, column: number): number => {
    const at = atTurbidity(table[name], turbidity);
    return weights.reduce((sum, weight, point) => {
      const dark = at(point * width + column);
      const bright = at((6 + point) * width + column);
      return sum + weight * (dark * (1 - share) + bright * share);
    }, 0);
  };
  return {
    coefficients: [0, 1, 2].map((c) => Array.from({ length: 9 }, (_, i) => mix("sky", 27, 9 * c + i))) as [
      number[],
      number[],
      number[],
    ],
    radiance: CHANNELS.map((c) => mix("sky_radiance", 3, c) / CIE_Y_INTEGRAL) as Triple,
  };
}

/** One channel's factor and offset by the cosine from the zenith: radiance = mean x factor x (lobe + offset). */
export function gradation(coefficients: readonly number[], sinElevation: number): [factor: number, offset: number] {
  const [a = 0, b = 0] = coefficients;
  const cosine = Math.max(sinElevation, 0);
  return [1 + a * Math.exp(b / (cosine + 0.01)), (coefficients[7] as number) * Math.sqrt(cosine)];
}

/** What depends on the angle to the sun alone, `gamma` in radians. */
export function lobe(coefficients: readonly number[], gamma: number): number {
  const [, , c = 0, d = 0, e = 0, f = 0, g = 0, , h = 0] = coefficients;
  const cosine = Math.cos(gamma);
  const distance2 = (1 - h) * (1 - h) + 4 * h * Math.sin(gamma / 2) ** 2;
  return c + d * Math.exp(e * gamma) + f * cosine ** 2 + (g * (1 + cosine ** 2)) / (distance2 * Math.sqrt(distance2));
}

const RINGS = 8;
const SPOKES = 16;

/** Irradiance of a surface that faces the sun: the radiance of the disc above the horizon x its solid angle. */
export function sunIrradiance(table: SkyTable, elevation: number, turbidity: number): Triple {
  const at = atTurbidity(table.sun, turbidity);
  const [sinElevation, cosElevation] = [Math.sin(radians(elevation)), Math.cos(radians(elevation))];
  const sum: Triple = [0, 0, 0];
  for (let ring = 0; ring < RINGS; ring++) {
    const cosine = 1 - ((1 - Math.cos(radians(SUN_RADIUS))) * (ring + 0.5)) / RINGS;
    const sine = Math.sqrt(1 - cosine ** 2);
    const limb = Math.sqrt(1 - (sine / Math.sin(radians(SUN_RADIUS))) ** 2);
    for (let spoke = 0; spoke < SPOKES; spoke++) {
      const height = cosine * sinElevation + sine * Math.sin((2 * Math.PI * (spoke + 0.5)) / SPOKES) * cosElevation;
      if (height < 0) continue;
      for (const c of CHANNELS) sum[c] += discRadiance(at, Math.asin(Math.min(height, 1)), limb, c);
    }
  }
  return sum.map((value) => (value / (RINGS * SPOKES)) * SUN_SOLID_ANGLE) as Triple;
}

/** Radiance of a point of the disc at an elevation in radians; `limb` is the cosine of its surface to our sight. */
function discRadiance(at: (i: number) => number, elevation: number, limb: number, channel: number): number {
  const segments = 45;
  const segment = Math.min(Math.floor(Math.cbrt((elevation * 2) / Math.PI) * segments), segments - 1);
  const x = elevation - (Math.PI / 2) * (segment / segments) ** 3;
  let value = 0;
  for (let k = 0; k < 4; k++) {
    let byLimb = 0;
    for (let l = 5; l >= 0; l--) byLimb = byLimb * limb + at(((segment * 3 + channel) * 4 + k) * 6 + l);
    value += byLimb * x ** k;
  }
  return (Math.max(value, 0) * SUN_RGB_FACTOR) / CIE_Y_INTEGRAL;
}

/** Reads a table between whole turbidities; indices leave out the first axis. */
function atTurbidity(table: Float32Array, turbidity: number): (i: number) => number {
  const stride = table.length / 10;
  const position = clamp(turbidity, 1, 10) - 1;
  const low = Math.min(Math.floor(position), 8);
  const share = position - low;
  return (i) => (table[low * stride + i] as number) * (1 - share) + (table[(low + 1) * stride + i] as number) * share;
}

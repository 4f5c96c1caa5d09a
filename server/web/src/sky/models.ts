/**
 * The sky models: that of Hosek and Wilkie with its sun, and the clear sky of the Prague model, as `lighting/sky` has
 * them: the same tables, nodes and formulae, linear Rec.709. Angles in degrees unless stated.
 */

import { clamp, radians } from "../geometry/angles";
import { CHANNELS, type Triple } from "../geometry/color";

/** What a sky's radiance is computed from: nine coefficients and a mean radiance for each channel. */
export interface HosekWilkieSky {
  coefficients: [number[], number[], number[]];
  radiance: Triple;
}

/** The arrays of the model's table, in the order of its file. */
export type HosekWilkieTable = Record<keyof typeof TABLE_SIZES, Float32Array>;

const TABLE_SIZES = { sky: 10 * 2 * 6 * 27, sky_radiance: 10 * 2 * 6 * 3, sun: 10 * 45 * 3 * 4 * 6 };

/** The table in the bytes of its file; throws a TypeError for another length. */
export function parseHosekWilkieTable(bytes: ArrayBuffer): HosekWilkieTable {
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

/** The sky of a sun elevation, turbidity and albedo, each brought into the model's range. */
export function hosekWilkieSky(
  table: HosekWilkieTable,
  elevation: number,
  turbidity: number,
  albedo: number,
): HosekWilkieSky {
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
    coefficients: CHANNELS.map((c) => Array.from({ length: 9 }, (_, i) => mix("sky", 27, 9 * c + i))) as [
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
export function sunIrradiance(table: HosekWilkieTable, elevation: number, turbidity: number): Triple {
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

const VISIBILITIES = [20, 27.6, 40, 59.4, 90, 131.8]; // km
const SUN_ELEVATIONS = [
  -4.2, -3.5, -2.5, -1.5, -0.5, 1, 5.23, 11.25, 18.64, 27.17, 36.71, 47.16, 58.46, 70.53, 83.34, 90,
];
const RANK = 12; // of the table's product of factors

const range = (start: number, end: number, step: number): number[] =>
  Array.from({ length: Math.ceil((end - start) / step) }, (_, i) => start + i * step);

const SUN_ANGLES = [...range(0, 12, 0.5), ...range(12, 30, 1), ...range(30, 120, 2.5), ...range(120, 181, 5)];
const ZENITH_ANGLES = [
  ...[0, 1, 2, 4, 7, 10, 14],
  ...range(18, 59, 5),
  ...[62, 66],
  ...range(70, 84, 2),
  ...range(84, 90.1, 0.5),
];
const CHANNEL_SIZE = (SUN_ANGLES.length + ZENITH_ANGLES.length) * RANK;
const [CLEAREST, HAZIEST] = [4, 10]; // turbidities of the largest and the least visibility

/** The factors of log2 radiance by visibility, sun, channel and angle, as half floats. */
export type PragueTable = Uint16Array;

/** Radiance at the nodes of a sky, three channels for each angle from the zenith of each angle from the sun. */
export type PragueSky = Float32Array;

/** The table in the bytes of its file; throws a TypeError for another length. */
export function parsePragueTable(bytes: ArrayBuffer): PragueTable {
  const size = VISIBILITIES.length * SUN_ELEVATIONS.length * 3 * CHANNEL_SIZE;
  if (bytes.byteLength !== 2 * size) throw new TypeError("The table of the Prague sky has another length.");
  return new Uint16Array(bytes);
}

/** The sky of a sun elevation and turbidity, each brought into the model's range. */
export function pragueSky(table: PragueTable, sunElevation: number, turbidity: number): PragueSky {
  const sky = new Float32Array(SUN_ANGLES.length * ZENITH_ANGLES.length * 3);
  for (const [v, byVisibility] of neighbours(VISIBILITIES, visibility(turbidity))) {
    for (const [e, bySun] of neighbours(SUN_ELEVATIONS, sunElevation)) {
      for (let channel = 0; channel < 3; channel++) {
        const start = ((v * SUN_ELEVATIONS.length + e) * 3 + channel) * CHANNEL_SIZE;
        const factors = Float64Array.from(table.subarray(start, start + CHANNEL_SIZE), decodeHalf);
        addRadiance(sky, channel, factors, byVisibility * bySun);
      }
    }
  }
  return sky;
}

/** Radiance of a channel by the angle from the sun, at one angle from the zenith: at SUN_ANGLES, linear between them. */
export function pragueRow(sky: PragueSky, zenith: number, channel: number): (sunAngle: number) => number {
  const [[low, share], [high, part]] = neighbours(ZENITH_ANGLES, zenith);
  const at = (node: number, row: number): number => sky[(node * ZENITH_ANGLES.length + row) * 3 + channel] as number;
  const values = SUN_ANGLES.map((_, node) => share * at(node, low) + part * at(node, high));
  return (sunAngle) => {
    const [[near, weight], [far, rest]] = neighbours(SUN_ANGLES, sunAngle);
    return weight * (values[near] as number) + rest * (values[far] as number);
  };
}

function addRadiance(sky: PragueSky, channel: number, factors: Float64Array, weight: number): void {
  for (let i = 0; i < SUN_ANGLES.length; i++) {
    for (let j = 0; j < ZENITH_ANGLES.length; j++) {
      let stops = 0;
      for (let k = 0; k < RANK; k++) {
        const other = factors[(SUN_ANGLES.length + j) * RANK + k] as number;
        stops += (factors[i * RANK + k] as number) * other;
      }
      const at = (i * ZENITH_ANGLES.length + j) * 3 + channel;
      sky[at] = (sky[at] as number) + weight * 2 ** stops;
    }
  }
}

/** The visibility in km that goes with a turbidity. */
function visibility(turbidity: number): number {
  const share = (clamp(turbidity, CLEAREST, HAZIEST) - CLEAREST) / (HAZIEST - CLEAREST);
  return 131.8 * (20 / 131.8) ** share;
}

type Neighbour = [index: number, share: number];

/** The two places of sorted values around one, and their shares. */
function neighbours(values: readonly number[], value: number): [Neighbour, Neighbour] {
  let low = 0;
  let end = values.length - 1;
  while (end - low > 1) {
    const middle = (low + end) >> 1;
    if ((values[middle] as number) <= value) low = middle;
    else end = middle;
  }
  const [before, after] = [values[low] as number, values[low + 1] as number];
  const share = clamp((value - before) / (after - before), 0, 1);
  return [
    [low, 1 - share],
    [low + 1, share],
  ];
}

function decodeHalf(bits: number): number {
  const [sign, exponent, mantissa] = [bits & 0x8000 ? -1 : 1, (bits >> 10) & 31, bits & 1023];
  return sign * (exponent ? 2 ** (exponent - 15) * (1 + mantissa / 1024) : 2 ** -14 * (mantissa / 1024));
}

/**
 * The clear sky of the Prague model, as `lighting/sky/prague.py` has it: the same table, the same nodes, linear Rec.709.
 * Angles in degrees unless stated.
 */

import { clamp } from "../geometry/angles";

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
export function rowOf(sky: PragueSky, zenith: number, channel: number): (sunAngle: number) => number {
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

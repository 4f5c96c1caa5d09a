/** What an environment map makes of a surface; linear Rec.709 throughout. */

import type { Rgb } from "./colour";

/** A lat-long map, row 0 the zenith, four floats a pixel (red, green, blue and one unused). */
export interface Latlong {
  width: number;
  height: number;
  data: Float32Array;
}

export interface SceneLight {
  map: Latlong; // the sky without the sun's disc, above the ground that both light
  sky: Rgb; // irradiance of level ground by the sky alone
  sun: Rgb; // irradiance by the sun of a surface that faces it
}

/** Splits the light of two maps that differ by the sun's disc alone. */
export function splitLight(withSun: Latlong, withoutSun: Latlong): SceneLight {
  const rows = withSun.height / 2;
  const half = rows * withSun.width * 4;
  const data = withSun.data.slice();
  data.set(withoutSun.data.subarray(0, half));
  const edge = (row: number): number => Math.cos((Math.PI * row) / withSun.height);
  const column = (2 * Math.PI) / withSun.width;
  return {
    map: { ...withSun, data },
    sky: total(withoutSun, (row) => ((edge(row) ** 2 - edge(row + 1) ** 2) / 2) * column),
    sun: total(withSun, (row) => (edge(row) - edge(row + 1)) * column, withoutSun),
  };
}

/** The sum over the upper half, less `other`'s, of each pixel times its row's weight. */
function total({ width, height, data }: Latlong, weight: (row: number) => number, other?: Latlong): Rgb {
  const sum: [number, number, number] = [0, 0, 0];
  for (let row = 0; row < height / 2; row++) {
    const share = weight(row);
    for (let i = row * width * 4; i < (row + 1) * width * 4; i += 4) {
      for (const c of [0, 1, 2] as const) {
        sum[c] += share * ((data[i + c] as number) - (other ? (other.data[i + c] as number) : 0));
      }
    }
  }
  return sum;
}

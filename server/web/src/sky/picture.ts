/** A map as people look at it: with the sun's disc, bent to white, as sRGB bytes. */

import type { Parameters } from "../api";
import { encoded } from "../picture/pixels";
import { direction, radians } from "../pure/angles";
import { toMap } from "../pure/sphere";
import type { Light } from "./light";

export interface Picture {
  width: number;
  height: number;
  data: Uint8ClampedArray<ArrayBuffer>;
}

const STEPS = 4096; // of the table of the curve
const MOST = 8; // linear value beyond which all is white
const CURVE = Uint8ClampedArray.from({ length: STEPS + 1 }, (_, i) => 255 * encoded(shoulder((i / STEPS) * MOST)));

/** As `lighting preview`: values up to 0.6 stay as they are, brighter ones bend towards white. */
export function shoulder(value: number): number {
  return Math.min(value, 0.6) + 0.4 * (1 - Math.exp(-Math.max(value - 0.6, 0) / 0.4));
}

export function pictureOf({ map, sun }: Light, parameters: Parameters): Picture {
  const { width, height } = map;
  const values = map.data.slice();
  const [x, y] = toMap(direction(parameters.sun_azimuth, parameters.sun_elevation));
  const row = Math.min(Math.floor(y * height), height / 2 - 1);
  const at = 4 * (row * width + (Math.floor((x * width) / 2) % width));
  const solidAngle =
    (Math.PI / height) * ((2 * Math.PI) / width) * Math.cos(radians(90 - ((row + 0.5) * 180) / height));
  for (const c of [0, 1, 2] as const) values[at + c] = (values[at + c] as number) + sun[c] / Math.max(solidAngle, 1e-6);
  const data = new Uint8ClampedArray(values.length);
  for (let i = 0; i < values.length; i++) {
    data[i] = i % 4 === 3 ? 255 : (CURVE[Math.round((Math.min(values[i] as number, MOST) / MOST) * STEPS)] as number);
  }
  return { width, height, data };
}

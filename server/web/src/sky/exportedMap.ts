/** The map that the service exports, as a light for the object: without the sun's disc, which is a light of its own. */

import type { LightParameters } from "../api";
import { angleBetween, clamp, direction } from "../geometry/angles";
import type { Latlong } from "./render";

const DISC = 3; // degrees around the sun that hold its disc in a coarse map
const RING = 7; // degrees around it whose sky takes the disc's place
const FADING: [number, number] = [0.05, 20]; // how far a pixel follows a light that has changed since the export
const EPSILON = 1e-9;
const CHANNELS = [0, 1, 2] as const;

/** Directions of a map's pixels, row by row. */
const pixelDirection = ({ width, height }: Latlong, pixel: number): readonly [number, number, number] =>
  direction((((pixel % width) + 0.5) / width) * 360 - 180, 90 - ((Math.floor(pixel / width) + 0.5) / height) * 180);

/** A map whose sun's disc is replaced by the sky around it. */
export function removeDisc(map: Latlong, { sun_azimuth, sun_elevation, sun }: LightParameters): Latlong {
  if (!sun || sun_elevation < 0) return map;
  const towards = direction(sun_azimuth, sun_elevation);
  const data = map.data.slice();
  const inside: number[] = [];
  const around = [0, 0, 0];
  let count = 0;
  for (let pixel = 0; pixel < map.width * map.height; pixel++) {
    const angle = angleBetween(pixelDirection(map, pixel), towards);
    if (angle < DISC) inside.push(pixel);
    else if (angle < RING) {
      for (const c of CHANNELS) (around[c] as number) += map.data[4 * pixel + c] as number;
      count++;
    }
  }
  for (const pixel of inside) {
    for (const c of CHANNELS) {
      data[4 * pixel + c] = Math.min(data[4 * pixel + c] as number, (around[c] as number) / Math.max(count, 1));
    }
  }
  return { ...map, data };
}

/** Bare maps of two lights, by the same sky model. */
interface BareMaps {
  before: Latlong; // of the light that was exported
  now: Latlong; // of the light on show
}

/** An exported map in another light, until the service has exported that one: each pixel changes as the bare map does. */
export function followLight(exported: Latlong, { before, now }: BareMaps): Latlong {
  const data = exported.data.slice();
  for (let i = 0; i < data.length; i++) {
    if (i % 4 === 3) continue;
    const change = Math.max(now.data[i] as number, EPSILON) / Math.max(before.data[i] as number, EPSILON);
    data[i] = (data[i] as number) * clamp(change, ...FADING);
  }
  return { ...exported, data };
}

/** The sun's regions, and where the share of the probability stands beside each, as in `lighting preview`. */

import type { Lighting } from "../api";
import { clamp, direction, type Vector } from "./angles";
import type { Point } from "./camera";
import { inSky, rim } from "./sphere";
import { isSunny } from "./words";

export interface Region {
  share: string;
  kind: string; // of the circle's line
  pale: boolean; // where no sun shines
  lines: Vector[][]; // what of the circle lies in the sky
  outwards: [sun: Vector, inside: Vector, top: Vector]; // up to where the circle is highest, by a step just inside
}

/** The circles that hold 50 % and 90 % of the sun's probability, as far as they reach the sky. */
export function regions(lighting: Lighting): Region[] {
  const { azimuth, elevation, radius_50, radius_90 } = lighting.sun;
  const sun = direction(azimuth, elevation);
  const pale = !isSunny(lighting);
  const region = (radius: number, share: string, kind: string): Region => {
    const line = rim(sun, radius);
    const outwards: Region["outwards"] = [sun, rim(sun, 0.98 * radius)[0] as Vector, line[0] as Vector];
    return { share, kind: pale ? `${kind} pale` : kind, pale, lines: inSky(line), outwards };
  };
  const both = [region(radius_90, "90\u00a0%", "region wide"), region(radius_50, "50\u00a0%", "region")];
  return both.filter(({ outwards: [, , top] }) => top[1] > 0);
}

export interface Spot {
  at: Point; // the middle of the letters
  share: string;
  pale: boolean;
}

/**
 * Where the shares stand: beyond the highest point of each circle, clear of the sun's sign and each other. `size` is
 * that of the letters in units of the drawing, and `corners` bound the drawing, which they do not leave.
 */
export function shareSpots(
  around: readonly Region[],
  place: (towards: Vector) => Point,
  size: number,
  corners: readonly [Point, Point],
): Spot[] {
  const room: Point = [3 * size, 1.2 * size];
  const spots: Spot[] = [];
  for (const { share, pale, outwards } of [...around].reverse()) {
    const [sun, [u, v], [x, y]] = outwards.map(place) as [Point, Point, Point];
    const length = Math.hypot(x - u, y - v) || 1;
    const out: Point = [(x - u) / length, (y - v) / length];
    const gap = size * Math.max(0.9, 2.5 - Math.hypot(x - sun[0], y - sun[1]) / size);
    const beside: Point = [x + gap * out[0], y + gap * out[1]];
    const clear = spots.reduce((spot, { at }) => clearOf(at, spot, out, room), beside);
    spots.push({ at: inside(clear, room, corners), share, pale });
  }
  return spots;
}

const inside = ([x, y]: Point, [wide, high]: Point, [[left, top], [right, bottom]]: readonly [Point, Point]): Point => [
  clamp(x, left + wide / 2, right - wide / 2),
  clamp(y, top + high / 2, bottom - high / 2),
];

/** A spot moved along `out` as far as needed not to cover another one, where both take `room`. */
function clearOf(other: Point, spot: Point, out: Point, room: Point): Point {
  const lacking = [0, 1].map((i) => {
    const away = ((spot[i] as number) - (other[i] as number)) * Math.sign(out[i] as number);
    const covered = Math.abs((spot[i] as number) - (other[i] as number)) < (room[i] as number);
    return covered ? ((room[i] as number) - away) / Math.max(Math.abs(out[i] as number), 1e-6) : 0;
  });
  const step = Math.min(...lacking);
  return [spot[0] + step * out[0], spot[1] + step * out[1]];
}

/** What is drawn over the photo and over the map: horizon, sun, the sun's regions, the photo's frame. */

import type { Lighting, Parameters } from "../api";
import { clamp, direction, type Vector } from "../pure/angles";
import { type Camera, horizon, type Point, type SunMark, sunMark } from "../pure/camera";
import { regions, type Spot, shareSpots } from "../pure/regions";
import { frameOf, pieces, toMap } from "../pure/sphere";
import { path, sunSign, svg, text } from "./svg";

const SHARE = 12; // px, the letters of a region's share
const SUN_WIDTH = 90; // px from the left edge, within which the sun's mark and its words can meet the horizon's name
const SUN_HEIGHT = 52; // px, so for the distance in height

type Line = NonNullable<ReturnType<typeof horizon>>;

const sunKind = (parameters: Parameters): string => (parameters.sun ? "sun" : "sun pale");

export function photoMarks(camera: Camera, parameters: Parameters, width: number, height: number): Node[] {
  const size = { width, height };
  const mark = sunMark(direction(parameters.sun_azimuth, parameters.sun_elevation), camera, size, 12);
  const line = horizon(camera, size);
  const sun = mark.inside ? [sunSign(mark.at, 8, sunKind(parameters))] : arrow(mark, size, line, sunKind(parameters));
  return [...(line ? horizonMark(line, mark, width, height) : []), ...sun];
}

/** The horizon with its name at the left, or at the right where the sun's mark stands in the way. */
function horizonMark(line: Line, sun: SunMark, width: number, height: number): Node[] {
  const taken = sun.at[0] < SUN_WIDTH && Math.abs(sun.at[1] - heightAt(line, 10)) < SUN_HEIGHT;
  const x = taken ? width - 10 : 10;
  const y = heightAt(line, x);
  const label = y > 24 && y < height ? [text([x, y - 7], "horizon", taken ? "label end" : "label")] : [];
  return [path(line, "rim"), path(line, "line"), ...label];
}

const heightAt = ([[x0, y0], [x1, y1]]: Line, x: number): number => y0 + ((y1 - y0) * (x - x0)) / (x1 - x0);

/** An arrow towards the sun, and words below or above it, on the side that the horizon does not cross. */
function arrow(
  { at: [x, y], towards: [u, v], behind }: SunMark,
  size: { width: number; height: number },
  line: Line | null,
  kind: string,
): Node[] {
  const corner = (back: number, aside: number): Point => [x - u * back - v * aside, y - v * back + u * aside];
  const head = [[x, y] as Point, corner(20, 11), corner(14, 0), corner(20, -11)];
  const points = head.map((point) => point.map((value) => value.toFixed(1)).join(",")).join(" ");
  const words = behind ? "sun behind" : "sun";
  const reach = 4 * words.length + 8;
  const drop = line ? heightAt(line, x) - y : SUN_HEIGHT;
  const under = Math.abs(drop) < SUN_HEIGHT ? drop < 0 : y < size.height / 2;
  const below = under ? 34 : -24;
  const label: Point = [clamp(x - 14 * u, reach, size.width - reach), clamp(y - 14 * v + below, 16, size.height - 10)];
  return [svg("polygon", { points, class: `arrow ${kind}` }), text(label, words, `label middle ${kind}`)];
}

export function mapMarks(
  lighting: Lighting,
  parameters: Parameters,
  aspect: number,
  width: number,
  height: number,
): Node[] {
  const place = (towards: Vector): Point => {
    const [x, y] = toMap(towards);
    return [(x * width) / 2, y * height];
  };
  const curve = (line: Vector[], kind: string): Node[] =>
    pieces(line.map(place), width / 2).flatMap((piece) => [path(piece, "rim"), path(piece, kind)]);
  const around = regions(lighting);
  const words = [
    [0.25, "90° left"],
    [0.5, "front"],
    [0.75, "90° right"],
  ] as const;
  return [
    ...curve(frameOf(lighting.camera, aspect), "line"),
    ...around.flatMap(({ lines, kind }) => lines.flatMap((line) => curve(line, kind))),
    ...words.map(([share, word]) => text([width * share, height - 10], word, "label middle")),
    ...shareWords(shareSpots(around, place, SHARE, [[0, 0], [width, height]]), SHARE), // biome-ignore format: corners
    sunSign(place(direction(parameters.sun_azimuth, parameters.sun_elevation)), 6, sunKind(parameters)),
  ];
}

/** The shares of the sun's regions in words, with letters of that size. */
export const shareWords = (spots: Spot[], size: number): SVGElement[] =>
  spots.map(({ at: [x, y], share, pale }) => text([x, y + 0.36 * size], share, `share middle${pale ? " pale" : ""}`));

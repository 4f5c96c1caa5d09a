/** What is drawn on a photo, in the texts of the service: "310,820,455,790;own:600,430", in pixels of the photo. */

import type { Point } from "../geometry/camera";

export interface Mark {
  prefix: string; // as "own:"; empty where it has none
  points: readonly Point[];
  meters: string; // of a thing of known size; else empty
}

/** The number of a mark, and of a point of it. */
export type End = readonly [mark: number, point: number];

/** The marks of a text. */
export const readMarks = (text: string): Mark[] => text.split(";").filter(Boolean).map(readMark);

function readMark(text: string): Mark {
  const [, prefix = "", rest = ""] = /^([a-z]+:)?(.*)$/.exec(text) ?? [];
  const values = rest.split(",");
  const points = Array.from({ length: Math.floor(values.length / 2) }, (_, i): Point => {
    return [Number(values[2 * i]), Number(values[2 * i + 1])];
  });
  return { prefix, points, meters: values.length % 2 ? (values.at(-1) ?? "") : "" };
}

/** The text of marks, to a tenth of a pixel. */
export const writeMarks = (marks: readonly Mark[]): string => marks.map(writeMark).join(";");

function writeMark({ prefix, points, meters }: Mark): string {
  const values = points.flatMap((point) => point.map((value) => value.toFixed(1)));
  return prefix + [...values, ...(meters ? [meters] : [])].join(",");
}

/** The same marks, each point where `move` puts it. */
export const moveMarks = (marks: readonly Mark[], move: (point: Point, end: End) => Point): Mark[] =>
  marks.map((mark, i) => ({ ...mark, points: mark.points.map((point, j) => move(point, [i, j])) }));

/** Whether a mark is of a shadow with its foot, which may be a guess. */
export const hasFoot = ({ prefix }: Mark): boolean => prefix === "" || prefix === GUESS;

export const GUESS = "doubt:"; // the prefix of a shadow whose foot or tip is one

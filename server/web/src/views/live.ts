/** What follows from a drawing, shown until the service has answered: the sun of a mark, the camera of lines. */

import type { Estimate } from "../api";
import type { Camera, Point, Size } from "../geometry/camera";
import { fitCamera, heightByReference, type Line } from "../geometry/fit";
import { markedSun } from "../geometry/marks";
import type { Live } from "../state";
import type { Mark } from "../text/marks";
import type { DrawnField } from "../text/metadata";

/**
 * What a mark of a field says of light or camera, beside all lines that are drawn; undefined where that is nothing. Its
 * points and those that `read` gives of each field are pixels of a picture so large; `pixelCamera` is without lines.
 */
export function liveOf(
  { camera, sun, evidence }: Estimate,
  pixelCamera: Camera,
  size: Size,
  field: DrawnField,
  mark: Mark,
  read: (field: DrawnField) => Mark[],
): Live | undefined {
  if (field === "shadow") {
    const marked = markedSun(mark, camera, size, sun.azimuth);
    if (!marked) return undefined;
    const { azimuth = sun.azimuth, elevation } = marked;
    const height = elevation === undefined ? {} : { sun_elevation: elevation };
    return { parameters: { sun_azimuth: azimuth, ...height, sun: true } };
  }
  if (field === "reference") {
    const [line] = linesOf(mark);
    const height = line && heightByReference(line, Number(mark.meters), mark.prefix !== "", camera, size);
    return height === undefined ? undefined : { camera: { ...camera, height } };
  }
  const edges = read("vertical").map((one) => ({ prefix: one.prefix, lines: linesOf(one) }));
  const lines = {
    horizon: read("horizon").flatMap(linesOf)[0],
    verticals: edges.filter(({ prefix }) => !prefix).flatMap(({ lines }) => lines),
    levels: edges.filter(({ prefix, lines }) => prefix && lines.length > 1).map(({ lines }) => lines),
  };
  const isLensKnown = evidence.includes("focal length");
  const start = isLensKnown ? { ...pixelCamera, vertical_fov: camera.vertical_fov } : pixelCamera;
  const fitted = fitCamera(start, lines, size, isLensKnown);
  return fitted && { camera: { ...fitted, ...(camera.height === undefined ? {} : { height: camera.height }) } };
}

/** Each two points of a mark. */
const linesOf = ({ points }: Mark): Line[] =>
  points.flatMap((end, i) => (i % 2 ? [[points[i - 1] as Point, end] as const] : []));

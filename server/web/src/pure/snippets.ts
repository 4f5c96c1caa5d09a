/** The light on show as a command and as a program, to be copied. */

import { type Changed, photoQuery, valueText } from "../api";
import { isoOffset, readOffset } from "./clock";
import type { Given } from "./given";

export interface Subject {
  origin: string; // of the service, with a slash at its end
  photo: string; // its file name
  given: Given;
  changed: Changed | undefined; // the light on show where it is another than the estimate
  height: number;
  keyed: boolean; // whether the service asks for an API key
}

const quoted = (text: string): string => `'${text.replaceAll("'", "'\\''")}'`;
const text = (value: string): string => JSON.stringify(value);
const inForm = (name: string): string => `"${name.replaceAll(/["\\]/g, "\\$&")}"`; // as curl reads names in -F
const stem = (photo: string): string => photo.replace(/\.\w+$/, "") || "photo";

/** A curl command that writes the environment map. */
export function curlOf({ origin, photo, given, changed, height, keyed }: Subject): string {
  const key = keyed ? " -H 'Authorization: Bearer YOUR_KEY'" : "";
  const query = photoQuery(given, changed);
  query.set("height", String(height));
  const parts = [`photo=@${inForm(photo)}`, `${origin}v1/envmap?${query}`, `${stem(photo)}.exr`].map(quoted);
  return `curl -f${key} -F ${parts[0]} ${parts[1]} -o ${parts[2]}`;
}

/** A Python program that writes the same map with the library alone. */
export function pythonOf({ photo, given, changed, height }: Subject): string {
  const said = givenFields(given);
  const at = changed?.photo_exposure;
  const exposure = at === undefined ? "" : `, exposure=${valueText(at)}`;
  const lines = [
    ...(said.includes("datetime") ? ["from datetime import datetime", ""] : []),
    `from lighting import Estimator, ${said ? "Given, " : ""}write_exr`,
    `from lighting.envmap import ${changed ? "change, " : ""}place_of, view`,
    "from lighting.photo import read_photo",
    "",
    `name = ${text(photo)}`,
    "",
    "",
    "def finer(side):",
    "    return read_photo(name, target=side).pixels",
    "",
    "",
    "photo = read_photo(name)",
    `estimate = Estimator()(photo${said && `, Given(${said})`})`,
    ...(changed ? ["changes = {", ...changes(changed), "}"] : []),
    `lighting = ${changed ? "change(estimate.lighting, changes)" : "estimate.lighting"}`,
    `place = place_of(estimate, photo.pixels, ${height}, finer${exposure})`,
    `image, lighting = view(lighting, ${height}, ${changed ? `sun=${changed.sun ? "True" : "False"}, ` : ""}place=place)`,
    `write_exr(${text(`${stem(photo)}.exr`)}, image, lighting)`,
  ];
  return `${lines.join("\n")}\n`;
}

/** The entries of the dictionary of changes. */
function changes(light: Changed): string[] {
  const numbers = ["sun_azimuth", "sun_elevation", "turbidity", "exposure"] as const;
  const camera = ["camera_elevation", "camera_roll", "vertical_fov"] as const;
  const stated = ["sun_irradiance", "sky_irradiance", "sky_cover", "ground_color"] as const;
  return [...numbers, ...stated, ...camera].flatMap((name) => {
    const value = light[name];
    if (value === undefined) return [];
    return [`    "${name}": ${typeof value === "number" ? valueText(value) : `(${value.map(valueText).join(", ")})`},`];
  });
}

/** The arguments of `Given` for what the user said; empty where nothing was. */
function givenFields(given: Given): string {
  const parts = given.exif ? [] : ["use_exif=False"];
  const hours = readOffset(given.utc_offset);
  const offset = hours === undefined ? "" : isoOffset(hours);
  if (given.time) parts.push(`time=datetime.fromisoformat(${text(given.time + offset)})`);
  else if (hours !== undefined) parts.push(`utc_offset=${hours}`);
  const numbers = { latitude: given.lat, longitude: given.lon, heading: given.heading, vertical_fov: given.fov };
  for (const [name, value] of Object.entries(numbers)) if (value) parts.push(`${name}=${Number(value)}`);
  return parts.join(", ");
}

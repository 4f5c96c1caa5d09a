/** The light on show as a command and as a program, to be copied. */

import { type Lighting, numberText, type Parameters } from "../api";
import type { Given } from "./given";
import { givenQuery } from "./given";

export interface Subject {
  origin: string; // of the service, with a slash at its end
  photo: string; // its file name
  photos: number; // how many were taken together
  given: Given;
  lighting: Lighting;
  parameters: Parameters;
  changed: boolean; // whether the light on show is another than the estimate
  height: number;
  keyed: boolean; // whether the service asks for an API key
}

const quoted = (text: string): string => `'${text.replaceAll("'", "'\\''")}'`;
const stem = (photo: string): string => photo.replace(/\.\w+$/, "") || "photo";

/** A curl command that writes the environment map. */
export function curlOf(subject: Subject): string {
  const { origin, photo, photos, given, parameters, changed, height, keyed } = subject;
  const key = keyed ? " -H 'Authorization: Bearer YOUR_KEY'" : "";
  const file = quoted(`${stem(photo)}.exr`);
  if (!changed && photos === 1) {
    const query = givenQuery(given, 1);
    query.set("height", String(height));
    return `curl -f${key} -F ${quoted(`photo=@"${photo}"`)} ${quoted(`${origin}v1/envmap?${query}`)} -o ${file}`;
  }
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(parameters)) query.set(name, numberText(value));
  query.set("height", String(height));
  return `curl -f${key} ${quoted(`${origin}v1/envmap?${query}`)} -o ${file}`;
}

/** A Python program that writes the same map with the library alone. */
export function pythonOf(subject: Subject): string {
  const { photo, photos, changed, height } = subject;
  const write = `write_exr(${text(`${stem(photo)}.exr`)}, render(lighting, height=${height}), lighting)\n`;
  if (changed || photos > 1) {
    return `from lighting import Lighting, render, write_exr\n\nlighting = Lighting(\n${fields(subject)})\n${write}`;
  }
  const given = givenFields(subject.given);
  const names = given ? "Estimator, Given, render, write_exr" : "Estimator, render, write_exr";
  const call = given ? `Estimator()(photo, Given(${given}))` : "Estimator()(photo)";
  return (
    `${given.includes("datetime") ? "from datetime import datetime\n\n" : ""}from lighting import ${names}\n` +
    `from lighting.photo import read_photo\n\nphoto = read_photo(${text(photo)})\n` +
    `lighting = ${call}.lighting\n${write}`
  );
}

const text = (value: string): string => JSON.stringify(value);

function fields({ lighting: { camera }, parameters: p }: Subject): string {
  const values: Record<string, number> = {
    sun_azimuth: p.sun_azimuth,
    sun_elevation: p.sun_elevation,
    sun_visibility: Number(p.sun),
    turbidity: p.turbidity,
    exposure: p.exposure,
    ground_albedo: p.ground_albedo,
    camera_elevation: camera.elevation,
    camera_roll: camera.roll,
    vertical_fov: camera.vertical_fov,
  };
  return Object.entries(values)
    .map(([name, value]) => `    ${name}=${numberText(value)},\n`)
    .join("");
}

/** The arguments of `Given` for what the user said; empty where nothing was. */
function givenFields(given: Given): string {
  const parts = given.exif ? [] : ["use_exif=False"];
  const time = given.time + (given.utc_offset && given.time ? given.utc_offset : "");
  if (time) parts.push(`time=datetime.fromisoformat(${text(time)})`);
  if (given.utc_offset && !given.time) parts.push(`utc_offset=${hours(given.utc_offset)}`);
  const numbers = { latitude: given.lat, longitude: given.lon, heading: given.heading, vertical_fov: given.fov };
  for (const [name, value] of Object.entries(numbers)) if (value) parts.push(`${name}=${Number(value)}`);
  return parts.join(", ");
}

function hours(offset: string): number {
  const parts = /^([+-]?)(\d{1,2}):(\d\d)$/.exec(offset);
  if (!parts) return Number(offset) || 0;
  return (parts[1] === "-" ? -1 : 1) * (Number(parts[2]) + Number(parts[3]) / 60);
}

/** The light on show as a command and as a program, to be copied. */

import { formatValue, type LightOverrides, photoQuery } from "../api";
import { formatUtcOffset, parseUtcOffset, type UserInput } from "./metadata";

export interface SnippetInput {
  origin: string; // of the service, with a slash at its end
  photo: string; // its file name
  userInput: UserInput;
  overrides: LightOverrides | undefined; // the light on show where it is another than the estimate
  height: number;
  keyed: boolean; // whether the service asks for an API key
}

const quoteShell = (quotePython: string): string => `'${quotePython.replaceAll("'", "'\\''")}'`;
const quotePython = (value: string): string => JSON.stringify(value);
const quoteFormName = (name: string): string => `"${name.replaceAll(/["\\]/g, "\\$&")}"`; // as curl reads names in -F
const fileStem = (photo: string): string => photo.replace(/\.\w+$/, "") || "photo";

/** A curl command that writes the environment map. */
export function writeCurl({ origin, photo, userInput, overrides, height, keyed }: SnippetInput): string {
  const key = keyed ? " -H 'Authorization: Bearer YOUR_KEY'" : "";
  const query = photoQuery(userInput, overrides);
  query.set("height", String(height));
  const parts = [`photo=@${quoteFormName(photo)}`, `${origin}v1/envmap?${query}`, `${fileStem(photo)}.exr`].map(
    quoteShell,
  );
  return `curl -f${key} -F ${parts[0]} ${parts[1]} -o ${parts[2]}`;
}

/** A Python program that writes the same map with the library alone. */
export function writePython({ photo, userInput, overrides, height }: SnippetInput): string {
  const input = userInputArguments(userInput);
  const photoExposure = overrides?.photo_exposure;
  const exposure = photoExposure === undefined ? "" : `, photo_exposure=${formatValue(photoExposure)}`;
  const sun = overrides ? `, sun=${overrides.sun ? "True" : "False"}` : "";
  const lines = [
    ...(userInput.time ? ["from datetime import datetime", ""] : []),
    `from lighting import ${input ? "UserInput, " : ""}estimate`,
    "",
    `light = estimate(${quotePython(photo)}${input && `, UserInput(${input})`})`,
    ...(overrides ? ["changes = {", ...overrideEntries(overrides), "}", `light = light.edit(changes${exposure})`] : []),
    `light.save(${quotePython(`${fileStem(photo)}.exr`)}, ${height}${sun})`,
  ];
  return `${lines.join("\n")}\n`;
}

/** The entries of the dictionary of changes, by the record's names. */
function overrideEntries({ sky_exposure, camera_vertical_fov, ...light }: LightOverrides): string[] {
  const { sun_azimuth, sun_elevation, turbidity, sun_irradiance, sky_irradiance, sky_cover, ground_color } = light;
  const { camera_elevation, camera_roll } = light;
  const changes = {
    ...{ sun_azimuth, sun_elevation, turbidity, exposure: sky_exposure },
    ...{ sun_irradiance, sky_irradiance, sky_cover, ground_color },
    ...{ camera_elevation, camera_roll, vertical_fov: camera_vertical_fov },
  };
  return Object.entries(changes).flatMap(([name, value]) => {
    if (value === undefined) return [];
    return [
      `    "${name}": ${typeof value === "number" ? formatValue(value) : `(${value.map(formatValue).join(", ")})`},`,
    ];
  });
}

/** The arguments of `UserInput` for the user's input; empty where there is none. */
function userInputArguments(userInput: UserInput): string {
  const parts = userInput.metadata ? [] : ["metadata=False"];
  const hours = parseUtcOffset(userInput.utc_offset);
  const offset = hours === undefined ? "" : formatUtcOffset(hours);
  if (userInput.time) parts.push(`time=datetime.fromisoformat(${quotePython(userInput.time + offset)})`);
  else if (hours !== undefined) parts.push(`utc_offset=${hours}`);
  const numbers = {
    latitude: userInput.latitude,
    longitude: userInput.longitude,
    heading: userInput.heading,
    vertical_fov: userInput.vertical_fov,
    camera_height: userInput.camera_height,
  };
  for (const [name, value] of Object.entries(numbers)) if (value) parts.push(`${name}=${Number(value)}`);
  const { shadow, horizon, reference } = userInput;
  if (shadow) parts.push(`shadows=[${shadow.split(";").map(quotePython).join(", ")}]`);
  for (const [name, value] of Object.entries({ horizon, reference })) {
    if (value) parts.push(`${name}=${quotePython(value)}`);
  }
  return parts.join(", ");
}

/** The light on show as a command and as a program, to be copied. */

import { type Adjustments, formatValue, type LightOverrides, photoQuery } from "../api";
import { formatUtcOffset, parseUtcOffset, type UserInput } from "./metadata";

export interface SnippetInput {
  origin: string; // of the service, with a slash at its end
  photo: string; // its file name
  userInput: UserInput;
  overrides: LightOverrides | undefined; // the light on show where it is another than the estimate
  adjustments: Partial<Adjustments> | "record" | undefined; // the same in other words; "record": only that tells it
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

/** A Python program that writes the same map with the library alone; of some lights it reads the saved record. */
export function writePython({ photo, userInput, overrides, adjustments, height }: SnippetInput): string {
  const input = userInputArguments(userInput);
  const read = adjustments === "record";
  const names = ["estimate", ...(input ? ["UserInput"] : []), ...(read ? ["Lighting"] : [])].sort();
  const sun = overrides ? `, sun=${overrides.sun ? "True" : "False"}` : "";
  const lines = [
    ...(userInput.time ? ["from datetime import datetime"] : []),
    ...(read ? ["import json"] : []),
    `from lighting import ${names.join(", ")}`,
    "",
    `light = estimate(${quotePython(photo)}${input && `, UserInput(${input})`})`,
    ...(read ? readRecord(photo, overrides?.photo_exposure) : replaceLight(adjustments)),
    `light.save(${quotePython(`${fileStem(photo)}.exr`)}, ${height}${sun})`,
  ];
  return `${lines.join("\n")}\n`;
}

function replaceLight({ sun, exposure, haze }: Partial<Adjustments> = {}): string[] {
  const changes = [
    ...(sun ? [`sun=(${sun.map(formatValue).join(", ")})`] : []),
    ...(exposure ? [`exposure=${formatValue(exposure)}`] : []),
    ...(haze === undefined ? [] : [`haze=${formatValue(haze)}`]),
  ];
  return changes.length ? [`light = light.replace(${changes.join(", ")})`] : [];
}

const readRecord = (photo: string, photoExposure: number | undefined): string[] => [
  `record = Lighting.from_dict(json.load(open(${quotePython(`${fileStem(photo)}.json`)})))`,
  `light = light.edit({}, photo_exposure=${formatValue(photoExposure ?? 1)}).replace(lighting=record)`,
];

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
  const { shadow, vertical, horizon, reference } = userInput;
  for (const [name, value] of Object.entries({ shadows: shadow, verticals: vertical })) {
    if (value) parts.push(`${name}=[${value.split(";").map(quotePython).join(", ")}]`);
  }
  for (const [name, value] of Object.entries({ horizon, reference })) {
    if (value) parts.push(`${name}=${quotePython(value)}`);
  }
  return parts.join(", ");
}

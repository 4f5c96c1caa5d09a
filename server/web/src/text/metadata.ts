/** What a photo's metadata and the user say, as text, as the form's values and as a query. */

import type { Lighting, PhotoMetadata } from "../types";
import { formatShort, type NamedValue } from "./format";

/** What the user states of photos, in the names of the service; what is left out is left to the photo. */
export interface UserInput {
  metadata: boolean; // whether the photo's metadata count
  time: string; // local, as 2024-06-01T14:30
  utc_offset: string; // as +02:00
  latitude: string;
  longitude: string;
  heading: string; // of one photo, degrees from true north
  vertical_fov: string; // degrees
  headings: string; // of several photos, as 0,45,90
  camera_height: string; // meters above the ground
  shadow: string; // drawn in one photo, as are the next three: x,y,x,y in its pixels, separated by ;
  horizon: string; // x,y,x,y
  vertical: string; // upright edges, as the shadows
  reference: string; // x,y,x,y,meters
}

export type UserInputField = Exclude<keyof UserInput, "metadata" | DrawnField>;

/** What is drawn on a photo. */
export const DRAWN_FIELDS = ["shadow", "horizon", "vertical", "reference"] as const;
export type DrawnField = (typeof DRAWN_FIELDS)[number];

export const NO_USER_INPUT: UserInput = {
  metadata: true,
  time: "",
  utc_offset: "",
  latitude: "",
  longitude: "",
  heading: "",
  vertical_fov: "",
  headings: "",
  camera_height: "",
  shadow: "",
  horizon: "",
  vertical: "",
  reference: "",
};

/** The query of the user's input; `headings` goes with several photos only, `heading` with one. */
export function userInputQuery(userInput: UserInput, photos: number): URLSearchParams {
  const query = new URLSearchParams();
  if (!userInput.metadata) query.set("metadata", "false");
  for (const [name, value] of Object.entries(userInput)) {
    if (typeof value !== "string" || !value.trim() || name === (photos > 1 ? "heading" : "headings")) continue;
    query.set(name, value.trim());
  }
  return query;
}

/** What the file says, as text; what it does not say is left out. */
export function describeMetadata(metadata: PhotoMetadata): NamedValue[] {
  const { focal_length, camera_height } = metadata;
  const texts: Record<string, string | undefined> = {
    Time: formatTime(metadata),
    Place: formatLocation(metadata),
    Heading: formatHeading(metadata),
    Lens: focal_length && `${formatShort(focal_length)} mm (as of a 35 mm camera)`,
    "Camera height": camera_height && `${formatShort(camera_height)}\u00a0m above the ground`,
  } as Record<string, string | undefined>;
  return Object.entries(texts).flatMap(([name, value]) => (value ? [{ name, value }] : []));
}

/** Where the answer has a time, a place or a heading from that neither the user nor this photo states. */
export function describeBorrowed(
  evidence: readonly string[],
  userInput: UserInput,
  own: PhotoMetadata,
  others: readonly PhotoMetadata[],
): NamedValue[] {
  const sources = [
    { name: "Time", evidence: "time+place", fields: ["time"], metadata: "time" },
    { name: "Place", evidence: "time+place", fields: ["latitude"], metadata: "latitude" },
    { name: "Heading", evidence: "heading", fields: ["heading", "headings"], metadata: "heading" },
  ] as const;
  return sources
    .filter(
      ({ evidence: kind, fields, metadata }) =>
        evidence.includes(kind) &&
        own[metadata] === undefined &&
        fields.every((field) => !userInput[field]) &&
        others.some((other) => other[metadata] !== undefined),
    )
    .map(({ name }) => ({ name, value: "from another photo" }));
}

/** The camera's tilt by the answer, where the file states one. */
export function describeCameraTilt({ camera, evidence, warning_codes = [] }: Lighting): NamedValue[] {
  const name = "Tilt";
  if (warning_codes.includes("gravity-contradicted")) return [{ name, value: "not used, see the warning" }];
  if (!evidence.includes("gravity")) return [];
  const [up, roll] = [Math.round(camera.elevation), Math.round(camera.roll)];
  const tilt = `looks ${Math.abs(up)}° ${up < 0 ? "down" : "up"} with a roll of ${roll}°`;
  return [{ name, value: `${tilt}, by the file and the picture` }];
}

/** When the photo was taken, as the answer believes, on the clock of its offset from UTC; nothing where no zone is known. */
export function describeBelievedTime({ time }: Lighting): NamedValue[] {
  const moment = new Date(time?.utc ?? "");
  if (Number.isNaN(moment.getTime())) return [];
  const hours = time?.utc_offset ?? 0;
  const local = formatUtcTime(new Date(moment.getTime() + 3_600_000 * hours)).replace("T", " ");
  return [{ name: "Taken", value: `${local} ${formatUtcOffset(hours)}${time?.source ? ` (${time.source})` : ""}` }];
}

function formatTime({ time, utc_offset, gps_time }: PhotoMetadata): string | undefined {
  if (!time) return gps_time && `${gps_time.slice(0, 19).replace("T", " ")} UTC`;
  const gps = gps_time ? "(time zone by GPS)" : "(no time zone)";
  return `${time.replace("T", " ")} ${utc_offset === undefined ? gps : formatUtcOffset(utc_offset)}`;
}

function formatLocation({ latitude, longitude }: PhotoMetadata): string | undefined {
  if (latitude === undefined || longitude === undefined) return undefined;
  const degrees = (value: number, sides: string): string =>
    `${Math.abs(value).toFixed(4)}°\u00a0${sides[value < 0 ? 1 : 0]}`;
  return `${degrees(latitude, "NS")}, ${degrees(longitude, "EW")}`;
}

function formatHeading({ heading, heading_reference: north }: PhotoMetadata): string | undefined {
  return heading === undefined ? undefined : `${heading.toFixed(0)}° from ${north ? `${north} ` : ""}north`;
}

/** What each part of `evidence` means. */
const EVIDENCE_TEXTS: Record<string, string> = {
  pixels: "the picture itself",
  "time+place": "time and place (where the sun was then)",
  heading: "the compass heading",
  "focal length": "the lens's focal length",
  gravity: "how the camera was held",
  shadow: "the shadow that you drew",
  "drawn camera": "the lines that you drew",
  "camera exposure": "the camera's exposure (how bright the scene was)",
  turns: "the turns between the photos",
  "other photos": "the other photos",
};

/** "Used: the picture itself, the compass heading." */
export function formatEvidence(evidence: readonly string[]): string {
  const texts = evidence.map((name) => EVIDENCE_TEXTS[name] ?? name);
  return texts.length ? `Used: ${texts.join(", ")}.` : "Set by hand.";
}

/** What the form shows: the user's input, else the photo's metadata. */
export function fillForm(metadata: PhotoMetadata, userInput: UserInput): UserInput {
  if (!userInput.metadata) return userInput;
  return {
    ...userInput,
    time: userInput.time || metadata.time || "",
    utc_offset: userInput.utc_offset || (metadata.utc_offset === undefined ? "" : formatUtcOffset(metadata.utc_offset)),
    latitude: userInput.latitude || formatNumber(metadata.latitude),
    longitude: userInput.longitude || formatNumber(metadata.longitude),
    heading: userInput.heading || formatNumber(metadata.heading),
    camera_height: userInput.camera_height || formatNumber(metadata.camera_height),
  };
}

/** The user's input by a form: what differs from the photo's own metadata. */
export function readForm(form: UserInput, metadata: PhotoMetadata): UserInput {
  const fromPhoto = fillForm(metadata, { ...NO_USER_INPUT, metadata: form.metadata, headings: form.headings });
  const unlessFromPhoto = (
    name: "time" | "utc_offset" | "latitude" | "longitude" | "heading" | "camera_height",
  ): string => (form.metadata && form[name] === fromPhoto[name] ? "" : form[name]);
  const time = unlessFromPhoto("time");
  const utc_offset = time ? form.utc_offset : unlessFromPhoto("utc_offset"); // a time replaces the photo's offset too
  const [heading, camera_height] = [unlessFromPhoto("heading"), unlessFromPhoto("camera_height")];
  const userInput = { ...form, time, utc_offset, heading, camera_height };
  const isMoved = unlessFromPhoto("latitude") || unlessFromPhoto("longitude");
  return isMoved ? userInput : { ...userInput, latitude: "", longitude: "" };
}

const formatNumber = (value: number | undefined): string =>
  value === undefined ? "" : String(Number(value.toFixed(5)));

const OFFSETS = [-12, 14] as const; // hours from UTC of all zones

/** Hours from UTC in "+02:00", "-0330", "5.5" or "Z"; undefined where a text is none of these. */
export function parseUtcOffset(text: string): number | undefined {
  const parts = /^(?:([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|Z)$/.exec(text.trim());
  if (!parts) return undefined;
  const size = Number(parts[2] ?? 0) + Number(parts[3] ?? 0) / 60;
  const hours = parts[4] === undefined ? (parts[1] === "-" ? -size : size) : Number(parts[4]);
  return hours >= OFFSETS[0] && hours <= OFFSETS[1] ? hours : undefined;
}

/** Hours from UTC as ISO 8601 writes them: 5.5 is "+05:30". */
export function formatUtcOffset(hours: number): string {
  const minutes = Math.round(60 * Math.abs(hours));
  return `${hours < 0 ? "-" : "+"}${twoDigits(Math.floor(minutes / 60))}:${twoDigits(minutes % 60)}`;
}

/** A moment in UTC as 2024-06-01T14:30:05. */
const formatUtcTime = (time: Date): string => time.toISOString().slice(0, 19);

const twoDigits = (value: number): string => String(value).padStart(2, "0");

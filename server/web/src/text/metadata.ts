/** What a photo's metadata and the user say, as text, as the form's values and as a query. */

import type { Lighting } from "../api";
import type { PhotoMetadata } from "./exif";
import { formatShort, type NamedValue } from "./format";
import { formatUtcOffset, formatUtcTime } from "./time";

/** What the user states of photos, in the names of the service; what is left out is left to the photo. */
export interface UserInput {
  exif: boolean; // whether the photo's metadata count
  time: string; // local, as 2024-06-01T14:30
  utc_offset: string; // as +02:00
  lat: string;
  lon: string;
  heading: string; // of one photo, degrees from true north
  fov: string; // degrees
  headings: string; // of several photos, as 0,45,90
}

export type UserInputField = Exclude<keyof UserInput, "exif">;

export const NO_USER_INPUT: UserInput = {
  ...{ exif: true, time: "", utc_offset: "", lat: "", lon: "", heading: "", fov: "", headings: "" },
};

/** The query of the user's input; `headings` goes with several photos only, `heading` with one. */
export function userInputQuery(userInput: UserInput, photos: number): URLSearchParams {
  const query = new URLSearchParams();
  if (!userInput.exif) query.set("exif", "false");
  for (const [name, value] of Object.entries(userInput)) {
    if (typeof value !== "string" || !value.trim() || name === (photos > 1 ? "heading" : "headings")) continue;
    query.set(name, value.trim());
  }
  return query;
}

/** Metadata as text; what a photo lacks is named too, since the user can state it. `used`: see `unreadSources`. */
export function describeMetadata(metadata: PhotoMetadata, used: SourceNotes = {}): NamedValue[] {
  const unknown = metadata.incomplete ? "cannot be read here" : "not in the file";
  const lens = metadata.focal && `${formatShort(metadata.focal)} mm (as of a 35 mm camera)`;
  const texts: Record<MetadataName | "Camera", string | undefined> = {
    Time: formatTime(metadata),
    Place: formatLocation(metadata),
    Heading: formatHeading(metadata),
    Lens: lens || undefined,
    Camera: metadata.camera,
  };
  return Object.entries(texts).map(([name, value]) => ({
    name,
    value: value ?? used[name as MetadataName] ?? unknown,
  }));
}

/** The parts of an answer's evidence that a file may hold. */
const EVIDENCE_SOURCES = {
  Time: { evidence: "time+place", userInput: ["time"], metadata: "time" },
  Place: { evidence: "time+place", userInput: ["lat"], metadata: "latitude" },
  Heading: { evidence: "heading", userInput: ["heading", "headings"], metadata: "heading" },
  Lens: { evidence: "focal length", userInput: ["fov"], metadata: "focal" },
} as const;
type MetadataName = keyof typeof EVIDENCE_SOURCES;
type SourceNotes = Partial<Record<MetadataName, string>>;

/** Sources of what the answer used, though neither the user nor the metadata read here state it. */
export function unreadSources(
  evidence: readonly string[],
  userInput: UserInput,
  photos: readonly PhotoMetadata[],
): SourceNotes {
  const used = (Object.keys(EVIDENCE_SOURCES) as MetadataName[]).filter(
    (name) =>
      evidence.includes(EVIDENCE_SOURCES[name].evidence) &&
      !EVIDENCE_SOURCES[name].userInput.some((field) => userInput[field]),
  );
  const fromOtherPhoto = (name: MetadataName): boolean =>
    name !== "Lens" && photos.some((metadata) => metadata[EVIDENCE_SOURCES[name].metadata] !== undefined);
  return Object.fromEntries(
    used.map((name) => [name, fromOtherPhoto(name) ? "from another photo" : "read by the service"]),
  );
}

/** The camera's tilt by the answer: the service alone reads the angles of phones and drones. */
export function describeCameraTilt(lighting: Lighting, { exif }: UserInput): NamedValue {
  const { camera, evidence, warning_codes = [] } = lighting;
  const name = "Held";
  if (warning_codes.includes("gravity-contradicted")) return { name, value: "not used, see the warning" };
  if (!evidence.includes("gravity")) return { name, value: exif ? "not in the file" : "not looked for" };
  const [up, roll] = [Math.round(camera.elevation), Math.round(camera.roll)];
  const tilt = `looks ${Math.abs(up)}° ${up < 0 ? "down" : "up"} with a roll of ${roll}°`;
  return { name, value: `${tilt}, by the file and the picture` };
}

/** When the photo was taken, as the answer believes, on the clock of its offset from UTC; nothing where no zone is known. */
export function describeBelievedTime({ time }: Lighting): NamedValue[] {
  const moment = new Date(time?.utc ?? "");
  if (Number.isNaN(moment.getTime())) return [];
  const hours = time?.utc_offset ?? 0;
  const local = formatUtcTime(new Date(moment.getTime() + 3_600_000 * hours)).replace("T", " ");
  return [{ name: "Taken", value: `${local} ${formatUtcOffset(hours)}${time?.source ? ` (${time.source})` : ""}` }];
}

function formatTime({ time, offset, satellites }: PhotoMetadata): string | undefined {
  const zone = offset ?? (satellites ? "(time zone by GPS)" : "(no time zone)");
  return time && `${time.replace("T", " ")} ${zone}`;
}

function formatLocation({ latitude, longitude }: PhotoMetadata): string | undefined {
  if (latitude === undefined || longitude === undefined) return undefined;
  const degrees = (value: number, sides: string): string =>
    `${Math.abs(value).toFixed(4)}°\u00a0${sides[value < 0 ? 1 : 0]}`;
  return `${degrees(latitude, "NS")}, ${degrees(longitude, "EW")}`;
}

function formatHeading({ heading, north }: PhotoMetadata): string | undefined {
  return heading === undefined ? undefined : `${heading.toFixed(0)}° from ${north ? `${north} ` : ""}north`;
}

/** What each part of `evidence` means. */
const EVIDENCE_TEXTS: Record<string, string> = {
  pixels: "the picture itself",
  "time+place": "time and place (where the sun stood then)",
  heading: "the compass heading",
  "focal length": "the lens's focal length",
  gravity: "how the camera was held",
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
  if (!userInput.exif) return userInput;
  return {
    ...userInput,
    time: userInput.time || metadata.time || "",
    utc_offset: userInput.utc_offset || metadata.offset || "",
    lat: userInput.lat || formatNumber(metadata.latitude),
    lon: userInput.lon || formatNumber(metadata.longitude),
    heading: userInput.heading || formatNumber(metadata.heading),
  };
}

/** The user's input by a form: what differs from the photo's own metadata. */
export function readForm(form: UserInput, metadata: PhotoMetadata): UserInput {
  const fromPhoto = fillForm(metadata, { ...form, time: "", utc_offset: "", lat: "", lon: "", heading: "", fov: "" });
  const unlessFromPhoto = (name: "time" | "utc_offset" | "lat" | "lon" | "heading"): string =>
    form.exif && form[name] === fromPhoto[name] ? "" : form[name];
  const time = unlessFromPhoto("time");
  const utc_offset = time ? form.utc_offset : unlessFromPhoto("utc_offset"); // a time replaces the photo's offset too
  const userInput = { ...form, time, utc_offset, heading: unlessFromPhoto("heading") };
  const [lat, lon] = [unlessFromPhoto("lat"), unlessFromPhoto("lon")];
  return lat || lon ? { ...userInput, lat: form.lat, lon: form.lon } : { ...userInput, lat: "", lon: "" };
}

const formatNumber = (value: number | undefined): string =>
  value === undefined ? "" : String(Number(value.toFixed(5)));

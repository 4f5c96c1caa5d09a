/** What a photo says of itself: the metadata that the service reads, as words and as the form's values. */

import type { Given } from "./given";
import { short } from "./words";

/** As `exifr` gives the tags, by their names; anything may be missing or broken. */
export type Tags = Record<string, unknown>;

export interface Facts {
  time?: string; // local, as 2024-06-01T14:30:05
  offset?: string; // as +02:00
  satellites?: boolean; // whether GPS gave the time too, and so the time zone
  latitude?: number;
  longitude?: number;
  heading?: number;
  magnetic?: boolean; // whether the heading counts from magnetic north
  focal?: number; // mm of a 35 mm camera
  camera?: string;
}

export function factsOf(tags: Tags): Facts {
  const facts: Facts = {};
  const time = /^(\d{4}):(\d\d):(\d\d) (\d\d:\d\d:\d\d)/.exec(text(tags.DateTimeOriginal));
  if (time) facts.time = `${time[1]}-${time[2]}-${time[3]}T${time[4]}`;
  if (/^[+-]\d\d:\d\d$/.test(text(tags.OffsetTimeOriginal))) facts.offset = text(tags.OffsetTimeOriginal);
  if (tags.GPSTimeStamp && tags.GPSDateStamp) facts.satellites = true;
  if (isAngle(tags.latitude, 90) && isAngle(tags.longitude, 180)) {
    Object.assign(facts, { latitude: tags.latitude, longitude: tags.longitude });
  }
  if (isAngle(tags.GPSImgDirection, 360)) {
    Object.assign(facts, { heading: tags.GPSImgDirection, magnetic: text(tags.GPSImgDirectionRef).startsWith("M") });
  }
  const focal = tags.FocalLengthIn35mmFormat;
  if (typeof focal === "number" && focal > 0) facts.focal = focal;
  const camera = [text(tags.Make), text(tags.Model)].filter(Boolean).join(" ");
  if (camera) facts.camera = camera;
  return facts;
}

const text = (value: unknown): string => (typeof value === "string" ? value.trim() : "");
const isAngle = (value: unknown, most: number): value is number =>
  typeof value === "number" && Number.isFinite(value) && Math.abs(value) <= most;

export interface Said {
  name: string;
  value: string;
}

/** The facts in words; what a photo does not say is named too, since it can be given. */
export function said(facts: Facts): Said[] {
  const unknown = "not in the file";
  return [
    { name: "Time", value: timeWords(facts) ?? unknown },
    { name: "Place", value: placeWords(facts) ?? unknown },
    { name: "Heading", value: headingWords(facts) ?? unknown },
    { name: "Lens", value: facts.focal ? `${short(facts.focal)} mm (as of a 35 mm camera)` : unknown },
    { name: "Camera", value: facts.camera ?? unknown },
  ];
}

function timeWords({ time, offset, satellites }: Facts): string | undefined {
  const zone = offset ?? (satellites ? "(time zone by GPS)" : "(no time zone)");
  return time && `${time.replace("T", " ")} ${zone}`;
}

function placeWords({ latitude, longitude }: Facts): string | undefined {
  if (latitude === undefined || longitude === undefined) return undefined;
  const degrees = (value: number, sides: string): string =>
    `${Math.abs(value).toFixed(4)}°\u00a0${sides[value < 0 ? 1 : 0]}`;
  return `${degrees(latitude, "NS")}, ${degrees(longitude, "EW")}`;
}

function headingWords({ heading, magnetic }: Facts): string | undefined {
  return heading === undefined ? undefined : `${heading.toFixed(0)}° from ${magnetic ? "magnetic" : "true"} north`;
}

/** What each part of `evidence` means. */
const USED: Record<string, string> = {
  pixels: "the picture itself",
  "time+place": "time and place (where the sun stood then)",
  heading: "the compass heading",
  "focal length": "the lens's focal length",
  turns: "the turns between the photos",
  "other photos": "the other photos",
};

/** "Used: the picture itself, the compass heading." */
export function evidenceWords(evidence: readonly string[]): string {
  const words = evidence.map((name) => USED[name] ?? name);
  return words.length ? `Used: ${words.join(", ")}.` : "Set by hand.";
}

/** What the form shows: what the user said, else what the photo says. */
export function formValues(facts: Facts, given: Given): Given {
  if (!given.exif) return given;
  return {
    ...given,
    time: given.time || facts.time || "",
    utc_offset: given.utc_offset || facts.offset || "",
    lat: given.lat || numberWords(facts.latitude),
    lon: given.lon || numberWords(facts.longitude),
    heading: given.heading || numberWords(facts.heading),
  };
}

/** What the user says by a form: what differs from the photo's own facts. */
export function givenBy(form: Given, facts: Facts): Given {
  const own = formValues(facts, { ...form, time: "", utc_offset: "", lat: "", lon: "", heading: "", fov: "" });
  const unless = (name: "time" | "utc_offset" | "lat" | "lon" | "heading"): string =>
    form.exif && form[name] === own[name] ? "" : form[name];
  const given = { ...form, time: unless("time"), utc_offset: unless("utc_offset"), heading: unless("heading") };
  const [lat, lon] = [unless("lat"), unless("lon")];
  return lat || lon ? { ...given, lat: form.lat, lon: form.lon } : { ...given, lat: "", lon: "" };
}

const numberWords = (value: number | undefined): string =>
  value === undefined ? "" : String(Number(value.toFixed(5)));

/** What a photo's metadata say, by the rules of the service: what cannot be read, or cannot be true, counts as absent. */

import { isoOffset, isoTime, readOffset, readTime } from "./clock";

/** As `exifr` gives the tags, by their names; anything may be missing or broken. */
export type Tags = Record<string, unknown>;

export interface Facts {
  time?: string; // local, as 2024-06-01T14:30:05
  offset?: string; // as +02:00
  satellites?: boolean; // whether GPS gave the time too, and so the time zone
  latitude?: number;
  longitude?: number;
  heading?: number;
  north?: "true" | "magnetic"; // that the heading counts from
  focal?: number; // mm of a 35 mm camera
  camera?: string;
  turned?: boolean; // whether browsers may show it another way up than the service reads it
  unread?: boolean; // whether there may be more that cannot be read here
}

const TIMES = [
  ["DateTimeOriginal", "OffsetTimeOriginal"],
  ["CreateDate", "OffsetTimeDigitized"], // DateTimeDigitized in the words of EXIF
] as const;

export function factsOf(tags: Tags): Facts {
  const focal = tags.FocalLengthIn35mmFormat;
  const camera = [text(tags.Make), text(tags.Model)].filter(Boolean).join(" ");
  return {
    ...clockOf(tags),
    ...placeOf(tags),
    ...headingOf(tags),
    ...(typeof focal === "number" && focal > 0 && Number.isFinite(focal) ? { focal } : {}),
    ...(camera ? { camera } : {}),
    ...(tags.errors ? { unread: true } : {}),
  };
}

/** Whether a photo lies another way in its file than it is to be seen. */
export const isTurned = ({ Orientation: way }: Tags): boolean => typeof way === "number" && way >= 2 && way <= 8;

/** The first local time that can be read with the offset of that time; else the time of GPS, which is in UTC. */
function clockOf(tags: Tags): Facts {
  const times = TIMES.map(([time, offset]) => ({ time: readTime(text(tags[time])), offset: text(tags[offset]) }));
  const time = times.find((one) => one.time)?.time;
  const gps = gpsTime(tags);
  if (!time) return gps ? { time: gps, offset: isoOffset(0) } : {};
  const offsets = times.filter((one) => one.time === time).map(({ offset }) => readOffset(offset));
  const offset = offsets.find((hours) => hours !== undefined);
  return { time, ...(offset === undefined ? {} : { offset: isoOffset(offset) }), ...(gps ? { satellites: true } : {}) };
}

/** The time of GPS; many programs write midnight where it is unknown. */
function gpsTime(tags: Tags): string | undefined {
  const date = text(tags.GPSDateStamp).match(/\d+/g) ?? [];
  const day = date.length === 3 && readTime(`${date.join(":")} 0:0:0`);
  const [hours = -1, minutes = -1, seconds = -1] = numbers(tags.GPSTimeStamp);
  const real = isWithin(hours, 24) && isWithin(minutes, 60) && isWithin(seconds, 61) && hours + minutes + seconds > 0;
  if (!day || !real) return undefined;
  return isoTime(new Date(Date.parse(`${day}Z`) + 1000 * (3600 * hours + 60 * minutes + seconds)));
}

/** Latitude and longitude; many programs write 0, 0 where the place is unknown. */
function placeOf(tags: Tags): Facts {
  const latitude = angleOf(tags.GPSLatitude, text(tags.GPSLatitudeRef), "NS");
  const longitude = angleOf(tags.GPSLongitude, text(tags.GPSLongitudeRef), "EW");
  const known = Math.abs(latitude) <= 90 && Math.abs(longitude) <= 180 && (latitude !== 0 || longitude !== 0);
  return known ? { latitude, longitude } : {};
}

/** Degrees from degrees, minutes and seconds, the last two of which may be absent; NaN where they are no angle. */
function angleOf(parts: unknown, reference: string, signs: string): number {
  const values = numbers(parts);
  const size = values.reduce((sum, part, power) => sum + part / 60 ** power, 0);
  const side = signs.indexOf(reference.slice(0, 1).toUpperCase() || "?");
  return values.length && size >= 0 && side >= 0 ? (side ? -size : size) : Number.NaN;
}

function headingOf(tags: Tags): Facts {
  const heading = tags.GPSImgDirection;
  if (typeof heading !== "number" || !(heading >= 0 && heading <= 360)) return {};
  const north = { T: "true", M: "magnetic" }[text(tags.GPSImgDirectionRef).slice(0, 1).toUpperCase()];
  return { heading: heading % 360, ...(north === "true" || north === "magnetic" ? { north } : {}) };
}

const text = (value: unknown): string => (typeof value === "string" ? value.trim() : "");

/** The numbers of an array, none of them infinite; empty where it is no such array. */
function numbers(value: unknown): number[] {
  const all = Array.isArray(value) || ArrayBuffer.isView(value) ? Array.from(value as ArrayLike<unknown>) : [];
  const finite = all.filter((one): one is number => typeof one === "number" && Number.isFinite(one));
  return finite.length === all.length ? finite : [];
}

const isWithin = (value: number, end: number): boolean => value >= 0 && value < end;

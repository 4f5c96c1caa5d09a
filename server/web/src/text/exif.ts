/** A file's metadata, read in the browser by the rules of the service: what cannot be true counts as absent. */

import { formatUtcOffset, formatUtcTime, parseLocalTime, parseUtcOffset } from "./time";

const MAX_BYTES = 256e6; // bytes that are looked at; photos have fewer
const EXIFR_OPTIONS = { reviveValues: false, translateValues: false };

export async function readMetadata(file: Blob): Promise<PhotoMetadata> {
  try {
    const bytes = new Uint8Array(await file.slice(0, MAX_BYTES).arrayBuffer());
    const block = findExifBlock(bytes);
    if (!block) return {};
    const { parse } = await import("exifr");
    const tags = (await parse(block, EXIFR_OPTIONS)) ?? {};
    return { ...metadataFromTags(tags), ...(isRotated(tags) && !isJpeg(bytes) ? { rotated: true } : {}) };
  } catch {
    return { incomplete: true };
  }
}

const EXIF_PREFIX = "Exif\0\0";

/** The EXIF block of a WebP or HEIF file, null where a WebP has none; any other file as a whole, for `exifr` to read. */
function findExifBlock(file: Uint8Array): Uint8Array | null {
  if (readAscii(file, 0, 4) === "RIFF" && readAscii(file, 8, 12) === "WEBP") return findWebpBlock(file);
  return readAscii(file, 4, 8) === "ftyp" ? (findHeifBlock(file) ?? file) : file;
}

/** Whether every browser shows a file the way up that its EXIF block says: a JPEG. */
const isJpeg = (file: Uint8Array): boolean => file[0] === 0xff && file[1] === 0xd8;

/** The chunk EXIF of a WebP (RFC 9649, 2.3), without the prefix that some programs write. */
function findWebpBlock(file: Uint8Array): Uint8Array | null {
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  for (let offset = 12; offset + 8 <= file.length; ) {
    const size = view.getUint32(offset + 4, true);
    const start = offset + 8;
    if (readAscii(file, offset, offset + 4) === "EXIF") {
      const bare = readAscii(file, start, start + EXIF_PREFIX.length) === EXIF_PREFIX ? EXIF_PREFIX.length : 0;
      return file.subarray(start + bare, start + size);
    }
    offset = start + size + (size % 2);
  }
  return null;
}

/** What follows the prefix of an EXIF item in HEIF: `exifr` misses the items that libheif writes. */
function findHeifBlock(file: Uint8Array): Uint8Array | null {
  const first = EXIF_PREFIX.charCodeAt(0);
  for (let offset = file.indexOf(first); offset >= 0; offset = file.indexOf(first, offset + 1)) {
    const start = offset + EXIF_PREFIX.length;
    if (readAscii(file, offset, start) === EXIF_PREFIX && /^(II\*\0|MM\0\*)$/.test(readAscii(file, start, start + 4))) {
      return file.subarray(start);
    }
  }
  return null;
}

const readAscii = (file: Uint8Array, start: number, end: number): string =>
  String.fromCharCode(...file.subarray(start, end));

/** As `exifr` gives the tags, by their names; anything may be missing or broken. */
type ExifTags = Record<string, unknown>;

export interface PhotoMetadata {
  time?: string; // local, as 2024-06-01T14:30:05
  offset?: string; // as +02:00
  satellites?: boolean; // whether GPS gave the time too, and so the time zone
  latitude?: number;
  longitude?: number;
  heading?: number;
  north?: "true" | "magnetic"; // that the heading counts from
  focal?: number; // mm of a 35 mm camera
  camera?: string;
  rotated?: boolean; // whether browsers may show it another way up than the service reads it
  incomplete?: boolean; // whether there may be more that cannot be read here
}

const TIME_TAGS = [
  ["DateTimeOriginal", "OffsetTimeOriginal"],
  ["CreateDate", "OffsetTimeDigitized"], // DateTimeDigitized in the words of EXIF
] as const;

export function metadataFromTags(tags: ExifTags): PhotoMetadata {
  const focal = tags.FocalLengthIn35mmFormat;
  const camera = [textTag(tags.Make), textTag(tags.Model)].filter(Boolean).join(" ");
  return {
    ...timeFromTags(tags),
    ...locationFromTags(tags),
    ...headingFromTags(tags),
    ...(typeof focal === "number" && focal > 0 && Number.isFinite(focal) ? { focal } : {}),
    ...(camera ? { camera } : {}),
    ...(tags.errors ? { incomplete: true } : {}),
  };
}

/** Whether a photo's pixels lie another way up in its file. */
const isRotated = ({ Orientation: way }: ExifTags): boolean => typeof way === "number" && way >= 2 && way <= 8;

/** The first local time that can be read with the offset of that time; else the time of GPS, which is in UTC. */
function timeFromTags(tags: ExifTags): PhotoMetadata {
  const times = TIME_TAGS.map(([time, offset]) => ({
    time: parseLocalTime(textTag(tags[time])),
    offset: textTag(tags[offset]),
  }));
  const time = times.find((one) => one.time)?.time;
  const gps = gpsTime(tags);
  if (!time) return gps ? { time: gps, offset: formatUtcOffset(0) } : {};
  const offsets = times.filter((one) => one.time === time).map(({ offset }) => parseUtcOffset(offset));
  const offset = offsets.find((hours) => hours !== undefined);
  return {
    time,
    ...(offset === undefined ? {} : { offset: formatUtcOffset(offset) }),
    ...(gps ? { satellites: true } : {}),
  };
}

/** The time of GPS; many programs write midnight where it is unknown. */
function gpsTime(tags: ExifTags): string | undefined {
  const date = textTag(tags.GPSDateStamp).match(/\d+/g) ?? [];
  const day = date.length === 3 && parseLocalTime(`${date.join(":")} 0:0:0`);
  const [hours = -1, minutes = -1, seconds = -1] = numberTags(tags.GPSTimeStamp);
  const valid = isWithin(hours, 24) && isWithin(minutes, 60) && isWithin(seconds, 61) && hours + minutes + seconds > 0;
  if (!day || !valid) return undefined;
  return formatUtcTime(new Date(Date.parse(`${day}Z`) + 1000 * (3600 * hours + 60 * minutes + seconds)));
}

/** Latitude and longitude; many programs write 0, 0 where the location is unknown. */
function locationFromTags(tags: ExifTags): PhotoMetadata {
  const latitude = parseAngle(tags.GPSLatitude, textTag(tags.GPSLatitudeRef), "NS");
  const longitude = parseAngle(tags.GPSLongitude, textTag(tags.GPSLongitudeRef), "EW");
  const valid = Math.abs(latitude) <= 90 && Math.abs(longitude) <= 180 && (latitude !== 0 || longitude !== 0);
  return valid ? { latitude, longitude } : {};
}

/** Degrees from degrees, minutes and seconds, the last two of which may be absent; NaN where they are no angle. */
function parseAngle(parts: unknown, reference: string, signs: string): number {
  const values = numberTags(parts);
  const size = values.reduce((sum, part, power) => sum + part / 60 ** power, 0);
  const sign = signs.indexOf(reference.slice(0, 1).toUpperCase() || "?");
  return values.length && size >= 0 && sign >= 0 ? (sign ? -size : size) : Number.NaN;
}

function headingFromTags(tags: ExifTags): PhotoMetadata {
  const heading = tags.GPSImgDirection;
  if (typeof heading !== "number" || !(heading >= 0 && heading <= 360)) return {};
  const north = { T: "true", M: "magnetic" }[textTag(tags.GPSImgDirectionRef).slice(0, 1).toUpperCase()];
  return { heading: heading % 360, ...(north === "true" || north === "magnetic" ? { north } : {}) };
}

const textTag = (value: unknown): string => (typeof value === "string" ? value.trim() : "");

/** The numbers of an array, none of them infinite; empty where it is no such array. */
function numberTags(value: unknown): number[] {
  const all = Array.isArray(value) || ArrayBuffer.isView(value) ? Array.from(value as ArrayLike<unknown>) : [];
  const finite = all.filter((one): one is number => typeof one === "number" && Number.isFinite(one));
  return finite.length === all.length ? finite : [];
}

const isWithin = (value: number, end: number): boolean => value >= 0 && value < end;

import { describe, expect, it } from "vitest";
import { metadataFromTags, type PhotoMetadata, readMetadata } from "../src/text/exif";
import { describeMetadata, NO_USER_INPUT, readForm, unreadSources } from "../src/text/metadata";
import { formatUtcOffset, parseLocalTime, parseUtcOffset } from "../src/text/time";
import { heic, joinBytes, jpeg, png, tiff, webp } from "./exifFiles";

const BLOCK = tiff([[0x0110, "Lumia"]], [[0x9004, "2024:06:01 14:30:05"], [0x9012, "+05:30"], [0xa405, 26]]); // biome-ignore format: a line
const FACTS: PhotoMetadata = { time: "2024-06-01T14:30:05", offset: "+05:30", focal: 26, camera: "Lumia" };
const sideways = (way: number): Uint8Array => tiff([[0x0112, way]], []);

const read = (file: Uint8Array<ArrayBuffer>): Promise<PhotoMetadata> => readMetadata(new Blob([file]));

describe("the metadata of a file", () => {
  it.each([
    ["JPEG", jpeg(BLOCK)],
    ["PNG", png(BLOCK)],
    ["TIFF", BLOCK],
    ["WebP", webp(BLOCK)],
    ["WebP with a prefix", webp(joinBytes("Exif\0\0", BLOCK))],
    ["HEIC", heic(BLOCK)],
  ])("is read from %s", async (_, file) => {
    expect(await read(file)).toEqual(FACTS);
  });

  it("is nothing in a WebP without it", async () => {
    expect(await read(webp(null))).toEqual({});
  });

  it("is unread, not absent, where a file cannot be read here", async () => {
    expect(await read(joinBytes("what is this?"))).toEqual({ incomplete: true });
    expect(await read(jpeg(joinBytes("MM\0*", new Uint8Array(12))))).toEqual({ incomplete: true });
  });

  it("tells which files browsers may show another way up than the service reads them", async () => {
    expect(await Promise.all([6, 3, 1, 0, 9].map(async (way) => (await read(webp(sideways(way)))).rotated))).toEqual([
      ...[true, true],
      ...[undefined, undefined, undefined],
    ]);
    expect((await read(jpeg(sideways(6)))).rotated).toBeUndefined();
  });
});

describe("what the tags say", () => {
  const gps = { GPSDateStamp: "2024:06:01", GPSTimeStamp: [12, 30, 5] };

  it("is the time of the picture before that of its scan, with the offset of that time", () => {
    const scanned = { CreateDate: "2024:06:02 10:00:00", OffsetTimeDigitized: "+02:00" };
    expect(metadataFromTags(scanned)).toEqual({ time: "2024-06-02T10:00:00", offset: "+02:00" });
    expect(metadataFromTags({ ...scanned, DateTimeOriginal: "1999:01:02 03:04:05" })).toEqual({
      time: "1999-01-02T03:04:05",
    });
    expect(metadataFromTags({ ...scanned, DateTimeOriginal: "2024-06-02T10:00:00" }).offset).toBe("+02:00");
    expect(metadataFromTags({ ...scanned, DateTimeOriginal: "0000:00:00 00:00:00" }).time).toBe("2024-06-02T10:00:00");
  });

  it("is the time of GPS where there is no other, and the zone where there is", () => {
    expect(metadataFromTags(gps)).toEqual({ time: "2024-06-01T12:30:05", offset: "+00:00" });
    expect(metadataFromTags({ ...gps, GPSTimeStamp: [0, 0, 0] })).toEqual({});
    expect(metadataFromTags({ ...gps, GPSDateStamp: "2024:13:01" })).toEqual({});
    expect(metadataFromTags({ ...gps, DateTimeOriginal: "2024:06:01 14:30:05" }).satellites).toBe(true);
  });

  it("is a place only where it can be true", () => {
    const gpsTags = { GPSLatitude: [41.5], GPSLatitudeRef: "s", GPSLongitude: [12, 30], GPSLongitudeRef: "W" };
    expect(metadataFromTags(gpsTags)).toEqual({ latitude: -41.5, longitude: -12.5 });
    const wrong = [{ GPSLatitude: [0], GPSLongitude: [0] }, { GPSLatitudeRef: "" }, { GPSLongitude: [-12] }];
    for (const tags of [...wrong, { GPSLatitude: [91] }]) expect(metadataFromTags({ ...gpsTags, ...tags })).toEqual({});
  });

  it("is a heading from the north that is named", () => {
    expect(metadataFromTags({ GPSImgDirection: 360, GPSImgDirectionRef: "T" })).toEqual({ heading: 0, north: "true" });
    expect(metadataFromTags({ GPSImgDirection: 12 })).toEqual({ heading: 12 });
    expect(metadataFromTags({ GPSImgDirection: -12 })).toEqual({});
    expect(describeMetadata({ heading: 12 }).find(({ name }) => name === "Heading")?.value).toBe("12° from north");
  });
});

describe("clocks", () => {
  it("read the times that there are", () => {
    expect(
      ["2024:02:29 23:59:59", "2023:02:29 0:0:0", "1899:01:01 0:0:0", "2024:06:01", "now"].map(parseLocalTime),
    ).toEqual(["2024-02-29T23:59:59", ...[undefined, undefined, undefined, undefined]]);
  });

  it("read and write offsets", () => {
    expect(["+02:00", "-0330", "330", "5.5", "-3", "2", "Z"].map(parseUtcOffset)).toEqual([
      2, -3.5, 3.5, 5.5, -3, 2, 0,
    ]);
    expect(["", "2:99", "15", "-13", "CET"].map(parseUtcOffset)).toEqual(Array(5).fill(undefined));
    expect([2, 5.5, -3, -3.5, 0, 12.75].map(formatUtcOffset)).toEqual([
      ...["+02:00", "+05:30", "-03:00", "-03:30", "+00:00", "+12:45"],
    ]);
  });
});

describe("what the page did not read", () => {
  const value = (
    metadata: PhotoMetadata,
    evidence: string[],
    userInput = NO_USER_INPUT,
    photos = [metadata],
  ): string[] => describeMetadata(metadata, unreadSources(evidence, userInput, photos)).map((line) => line.value);

  it("is not called absent where the answer used it", () => {
    expect(value({}, ["pixels", "time+place", "heading", "focal length"])).toEqual([
      ...["read by the service", "read by the service", "read by the service", "read by the service"],
      "not in the file",
    ]);
    expect(new Set(value({}, ["pixels"]))).toEqual(new Set(["not in the file"]));
    expect(new Set(value({ incomplete: true }, ["pixels"]))).toEqual(new Set(["cannot be read here"]));
  });

  it("may have come from the user or from another photo", () => {
    const [time, gpsTags] = value({}, ["time+place"], { ...NO_USER_INPUT, lat: "48", lon: "11" });
    expect([time, gpsTags]).toEqual(["read by the service", "not in the file"]);
    const other = { time: "2024-06-01T14:30:05", latitude: 48, longitude: 11 };
    expect(value({}, ["time+place"], NO_USER_INPUT, [{}, other])[1]).toBe("from another photo");
    expect(value(other, ["time+place"], NO_USER_INPUT, [{}, other])[1]).toBe("48.0000°\u00a0N, 11.0000°\u00a0E");
    expect(value({}, ["heading"], { ...NO_USER_INPUT, headings: "0,90" })[2]).toBe("not in the file");
  });
});

it("a time that is corrected keeps the offset beside it", () => {
  const form = { ...NO_USER_INPUT, time: "2024-06-01T15:00:00", utc_offset: "+05:30" };
  expect(readForm(form, FACTS)).toEqual(form);
});

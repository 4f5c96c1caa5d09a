/** Where a file keeps its EXIF block, for the containers in which `exifr` does not find it. */

const PREFIX = "Exif\0\0";

/** The EXIF block of a WebP or HEIF file, null where a WebP has none; any other file as a whole, for `exifr` to read. */
export function exifBlock(file: Uint8Array): Uint8Array | null {
  if (ascii(file, 0, 4) === "RIFF" && ascii(file, 8, 12) === "WEBP") return webpBlock(file);
  return ascii(file, 4, 8) === "ftyp" ? (heifBlock(file) ?? file) : file;
}

/** Whether every browser shows a file the way up that its EXIF block says: a JPEG. */
export const isJpeg = (file: Uint8Array): boolean => file[0] === 0xff && file[1] === 0xd8;

/** The chunk EXIF of a WebP (RFC 9649, 2.3), without the prefix that some programs write. */
function webpBlock(file: Uint8Array): Uint8Array | null {
  const view = new DataView(file.buffer, file.byteOffset, file.byteLength);
  for (let at = 12; at + 8 <= file.length; ) {
    const size = view.getUint32(at + 4, true);
    const start = at + 8;
    if (ascii(file, at, at + 4) === "EXIF") {
      const bare = ascii(file, start, start + PREFIX.length) === PREFIX ? PREFIX.length : 0;
      return file.subarray(start + bare, start + size);
    }
    at = start + size + (size % 2);
  }
  return null;
}

/** What follows the prefix of an EXIF item in HEIF: `exifr` misses the items that libheif writes. */
function heifBlock(file: Uint8Array): Uint8Array | null {
  const first = PREFIX.charCodeAt(0);
  for (let at = file.indexOf(first); at >= 0; at = file.indexOf(first, at + 1)) {
    const start = at + PREFIX.length;
    if (ascii(file, at, start) === PREFIX && /^(II\*\0|MM\0\*)$/.test(ascii(file, start, start + 4))) {
      return file.subarray(start);
    }
  }
  return null;
}

const ascii = (file: Uint8Array, start: number, end: number): string =>
  String.fromCharCode(...file.subarray(start, end));

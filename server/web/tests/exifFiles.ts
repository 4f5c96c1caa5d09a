/** Files with an EXIF block, as small as they can be. */

type Entry = [tag: number, value: string | number];

const encoder = new TextEncoder();
const latin1Bytes = (text: string): Uint8Array => Uint8Array.from(text, (letter) => letter.charCodeAt(0));

export function joinBytes(...parts: (Uint8Array | string)[]): Uint8Array<ArrayBuffer> {
  const all = parts.map((part) => (typeof part === "string" ? latin1Bytes(part) : part));
  const whole = new Uint8Array(all.reduce((sum, { length }) => sum + length, 0));
  let offset = 0;
  for (const part of all) {
    whole.set(part, offset);
    offset += part.length;
  }
  return whole;
}

function number(value: number, size: number, little = false): Uint8Array {
  const digits = Array.from({ length: size }, (_, i) => Math.floor(value / 256 ** i) % 256);
  return Uint8Array.from(little ? digits : digits.reverse());
}

/** A directory that begins `at` that byte of its block: texts and short numbers. */
function directory(entries: Entry[], offset: number): Uint8Array {
  let end = offset + 2 + 12 * entries.length + 4;
  const [rows, texts]: [Uint8Array[], Uint8Array[]] = [[], []];
  for (const [tag, value] of entries) {
    const long = tag === EXIF ? 4 : 3;
    if (typeof value === "number")
      rows.push(joinBytes(number(tag, 2), number(long, 2), number(1, 4), short(value, long)));
    else {
      const text = encoder.encode(`${value}\0`);
      rows.push(joinBytes(number(tag, 2), number(2, 2), number(text.length, 4), number(end, 4)));
      texts.push(text);
      end += text.length;
    }
  }
  return joinBytes(number(entries.length, 2), ...rows, number(0, 4), ...texts);
}

const EXIF = 0x8769;
const short = (value: number, kind: number): Uint8Array =>
  kind === 4 ? number(value, 4) : joinBytes(number(value, 2), "\0\0");

/** A TIFF block: its first directory, and the one about the camera. */
export function tiff(first: Entry[], camera: Entry[]): Uint8Array<ArrayBuffer> {
  const [start, withExif] = [8, [...first, [EXIF, 0] as Entry]];
  const next = start + directory(withExif, start).length;
  return joinBytes("MM\0*", number(start, 4), directory([...first, [EXIF, next]], start), directory(camera, next));
}

export const jpeg = (block: Uint8Array): Uint8Array<ArrayBuffer> =>
  joinBytes(
    "\xff\xd8\xff\xe1",
    number(block.length + 8, 2),
    "Exif\0\0",
    block,
    "\xff\xda\0\x02",
    new Uint8Array(64),
    "\xff\xd9",
  );

export const png = (block: Uint8Array): Uint8Array<ArrayBuffer> =>
  joinBytes(
    "\x89PNG\r\n\x1a\n",
    number(block.length, 4),
    "eXIf",
    block,
    number(0, 4),
    number(0, 4),
    "IEND",
    number(0, 4),
  );

/** A WebP whose first chunk is of odd length; `null` has no EXIF. */
export function webp(block: Uint8Array | null): Uint8Array<ArrayBuffer> {
  const chunk = (name: string, data: Uint8Array): Uint8Array =>
    joinBytes(name, number(data.length, 4, true), data, data.length % 2 ? "\0" : "");
  const chunks = joinBytes(chunk("VP8 ", latin1Bytes("EXIF.")), block ? chunk("EXIF", block) : "");
  return joinBytes("RIFF", number(chunks.length + 4, 4, true), "WEBP", chunks);
}

/** A HEIC as libheif writes it: where its EXIF lies is told by a base offset. */
export function heic(block: Uint8Array): Uint8Array<ArrayBuffer> {
  const box = (name: string, ...data: (Uint8Array | string)[]): Uint8Array => {
    const inside = joinBytes(...data);
    return joinBytes(number(inside.length + 8, 4), name, inside);
  };
  const item = joinBytes("Exif\0\0", block);
  const meta = (base: number): Uint8Array =>
    box(
      "meta",
      "\0\0\0\0",
      box("iinf", "\0\0\0\0\0\x01", box("infe", "\x02\0\0\0\0\x01\0\0Exif\0")),
      box("iloc", "\0\0\0\0\x44\x40\0\x01\0\x01\0\0", number(base, 4), "\0\x01\0\0\0\0", number(item.length + 4, 4)),
    );
  const type = box("ftyp", "heic\0\0\0\0mif1heic");
  const base = type.length + meta(0).length + 8;
  return joinBytes(type, meta(base), box("mdat", number(6, 4), item));
}

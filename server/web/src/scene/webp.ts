/** Pictures as one animated WebP: the frames' own chunks in the container of RFC 9649. */

const FRAME_CHUNKS = ["ALPH", "VP8 ", "VP8L"];

/** The frames of WebP files of one size, one after another, again and again, each for so many milliseconds. */
export function animateWebp(
  files: ArrayBuffer[],
  width: number,
  height: number,
  milliseconds: number,
): Uint8Array<ArrayBuffer> {
  const size = [...little(width - 1, 3), ...little(height - 1, 3)];
  const header = chunk("VP8X", Uint8Array.from([2, 0, 0, 0, ...size])); // 2: it is an animation
  const loop = chunk("ANIM", new Uint8Array(6)); // without an end
  const frames = files.map((file) =>
    chunk("ANMF", Uint8Array.from([...little(0, 6), ...size, ...little(milliseconds, 3), 2]), ...pictureChunks(file)),
  );
  return chunk("RIFF", ascii("WEBP"), header, loop, ...frames);
}

/** What of a WebP is its picture. */
function pictureChunks(file: ArrayBuffer): Uint8Array[] {
  const bytes = new Uint8Array(file);
  const name = (at: number): string => String.fromCharCode(...bytes.subarray(at, at + 4));
  const chunks: Uint8Array[] = [];
  for (let at = 12; at + 8 <= bytes.length; ) {
    const length = new DataView(file).getUint32(at + 4, true);
    const end = at + 8 + length + (length % 2);
    if (FRAME_CHUNKS.includes(name(at))) chunks.push(bytes.subarray(at, end));
    at = end;
  }
  return chunks;
}

const ascii = (text: string): Uint8Array => new TextEncoder().encode(text);
const little = (value: number, count: number): number[] =>
  Array.from({ length: count }, (_, i) => Math.floor(value / 256 ** i) % 256);

function chunk(name: string, ...parts: Uint8Array[]): Uint8Array<ArrayBuffer> {
  const length = parts.reduce((sum, part) => sum + part.length, 0);
  const bytes = new Uint8Array(8 + length + (length % 2));
  bytes.set([...ascii(name), ...little(length, 4)]);
  let at = 8;
  for (const part of parts) {
    bytes.set(part, at);
    at += part.length;
  }
  return bytes;
}

/** Pictures as one animated GIF, for browsers that write no WebP. */

import { applyPalette, GIFEncoder, quantize } from "gifenc";

const COLORS = 256;
const SAMPLES = 4; // frames that the palette is of

/** The frames of one size, one after another, again and again, each for so many milliseconds, with one palette. */
export function animateGif(frames: readonly ImageData[], milliseconds: number): Uint8Array<ArrayBuffer> {
  const sampled = frames.filter((_, i) => i % Math.ceil(frames.length / SAMPLES) === 0);
  const pixels = new Uint8ClampedArray(sampled.reduce((sum, { data }) => sum + data.length, 0));
  let at = 0;
  for (const { data } of sampled) {
    pixels.set(data, at);
    at += data.length;
  }
  const palette = quantize(pixels, COLORS);
  const encoder = GIFEncoder();
  frames.forEach(({ data, width, height }, i) => {
    const shared = i === 0 ? { palette } : {}; // the first one's is that of the file
    encoder.writeFrame(applyPalette(data, palette), width, height, { ...shared, delay: milliseconds, repeat: 0 });
  });
  encoder.finish();
  return encoder.bytes();
}

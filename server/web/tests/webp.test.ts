import { describe, expect, it } from "vitest";
import { animateWebp } from "../src/scene/webp";

const text = (bytes: Uint8Array): string => String.fromCharCode(...bytes);

/** A WebP of one chunk, as browsers write it. */
function webp(name: string, body: number[]): ArrayBuffer {
  const chunk = [...new TextEncoder().encode(name), body.length, 0, 0, 0, ...body, ...(body.length % 2 ? [0] : [])];
  return Uint8Array.from([...new TextEncoder().encode("RIFF"), 4 + chunk.length, 0, 0, 0, ...new TextEncoder().encode("WEBP"), ...chunk]).buffer; // biome-ignore format: a file
}

describe("an animated WebP", () => {
  it("holds the frames' pictures and times", () => {
    const file = animateWebp([webp("VP8 ", [1, 2, 3]), webp("VP8L", [9, 8])], 640, 480, 80);
    expect(text(file.subarray(0, 4))).toBe("RIFF");
    expect(new DataView(file.buffer).getUint32(4, true)).toBe(file.length - 8);
    expect(text(file.subarray(8, 16))).toBe("WEBPVP8X");
    expect(text(file.subarray(30, 34))).toBe("ANIM");
    expect([...file.subarray(20, 30)]).toEqual([2, 0, 0, 0, 127, 2, 0, 223, 1, 0]);
    expect(text(file).match(/ANMF/g)).toHaveLength(2);
    const first = text(file).indexOf("ANMF") + 8;
    expect([...file.subarray(first + 12, first + 16)]).toEqual([80, 0, 0, 2]);
    expect([...file.subarray(first + 16, first + 28)]).toEqual([86, 80, 56, 32, 3, 0, 0, 0, 1, 2, 3, 0]);
  });
});

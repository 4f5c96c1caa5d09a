import { describe, expect, it } from "vitest";
import { animateGif } from "../src/scene/gif";

const SIZE = { width: 5, height: 3 };
const WHOLE = [5, 0, 3, 0]; // as GIF writes it

/** A picture of one color. */
const frame = (...color: [number, number, number]): ImageData =>
  ({ ...SIZE, data: Uint8ClampedArray.from({ length: 60 }, (_, i) => [...color, 255][i % 4] as number) }) as ImageData;

/** Where a sequence of bytes begins, each time. */
const find = (file: Uint8Array, bytes: number[]): number[] =>
  [...file.keys()].filter((at) => bytes.every((byte, i) => file[at + i] === byte));

describe("an animated GIF", () => {
  const file = animateGif([frame(255, 0, 0), frame(0, 0, 255)], 80);

  it("has the size, goes on for ever, and shows each frame for its time", () => {
    expect(String.fromCharCode(...file.subarray(0, 6))).toBe("GIF89a");
    expect([...file.subarray(6, 10)]).toEqual(WHOLE);
    const [loop] = find(
      file,
      [..."NETSCAPE2.0"].map((letter) => letter.charCodeAt(0)),
    );
    expect([...file.subarray((loop as number) + 11, (loop as number) + 15)]).toEqual([3, 1, 0, 0]);
    const controls = find(file, [0x21, 0xf9, 4]);
    expect(controls.map((at) => file[at + 4])).toEqual([8, 8]); // hundredths of a second
    expect(file.at(-1)).toBe(0x3b);
  });

  it("has each frame's colors in one palette", () => {
    const colors = Array.from({ length: 2 }, (_, i) => [...file.subarray(13 + 3 * i, 16 + 3 * i)]);
    expect(colors).toContainEqual([255, 0, 0]);
    expect(colors).toContainEqual([0, 0, 255]);
  });
});

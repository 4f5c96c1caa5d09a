import { describe, expect, it } from "vitest";
import { groundColour, litGround } from "../src/picture/ground";
import { encoded, linear, type Pixels } from "../src/picture/pixels";
import { quietSpot } from "../src/picture/room";
import { fold, layAround, withSurroundings } from "../src/picture/surroundings";

const LEVEL = { elevation: 0, roll: 0, vertical_fov: 60 };
const UP = { elevation: 60, roll: 0, vertical_fov: 40 };

/** A photo of 64 x 48 pixels by a rule for its grey levels or colours. */
function photo(rule: (x: number, y: number) => number | [number, number, number]): Pixels {
  const data = new Uint8ClampedArray(4 * 64 * 48);
  for (let i = 0; i < 64 * 48; i++) {
    const value = rule(i % 64, Math.floor(i / 64));
    data.set([...(typeof value === "number" ? [value, value, value] : value), 255], 4 * i);
  }
  return { width: 64, height: 48, data };
}

describe("the photo's ground", () => {
  it("has the median colour below the horizon", () => {
    const colour = groundColour(
      photo((_, y) => (y < 24 ? 250 : [120, 90, 60])),
      LEVEL,
    );
    expect(colour).toEqual([linear(120), linear(90), linear(60)]);
    expect(
      groundColour(
        photo(() => 100),
        UP,
      ),
    ).toBeUndefined();
  });

  it("is in shade where it is dark beside what is bright", () => {
    const lit = litGround(
      photo((x, y) => (y < 24 ? 250 : x < 24 ? 60 : 180)),
      LEVEL,
    );
    const row = 40 * 64;
    expect([lit[row + 5], lit[row + 55]]).toEqual([0, 255]);
    expect(lit[10 * 64 + 5]).toBe(255);
  });

  it("counts as lit where its kinds hardly differ, and where there is none", () => {
    expect(
      new Set(
        litGround(
          photo((x, y) => (y < 24 ? 250 : 110 + (x % 7))),
          LEVEL,
        ),
      ),
    ).toEqual(new Set([255]));
    expect(
      new Set(
        litGround(
          photo((x) => (x < 30 ? 10 : 200)),
          UP,
        ),
      ),
    ).toEqual(new Set([255]));
  });
});

describe("room for an object", () => {
  it("is off a person in the middle", () => {
    const person = (x: number, y: number): boolean => x > 26 && x < 38 && y > 15 && y < 46;
    const spot = quietSpot(
      photo((x, y) => (y < 24 ? 220 : person(x, y) ? (((x >> 2) + (y >> 2)) % 2 ? 20 : 240) : 130)),
      LEVEL,
    );
    expect(Math.abs((spot?.[0] ?? 0.5) - 0.5) * 64).toBeGreaterThan(6);
    expect(spot?.[1]).toBeGreaterThan(0.5);
  });

  it("is in the lower middle of plain ground, and nowhere without ground", () => {
    const spot = quietSpot(
      photo((_, y) => (y < 24 ? 220 : 130)),
      LEVEL,
    );
    expect(spot?.[0]).toBeCloseTo(0.5, 0);
    expect(
      quietSpot(
        photo(() => 130),
        UP,
      ),
    ).toBeNull();
  });
});

describe("what stands around", () => {
  it("folds angles to and fro without a jump", () => {
    expect([0, 30, 40, 60, 90, -40, 180].map((azimuth) => fold(azimuth, 30))).toEqual([0, 30, 20, 0, -30, -20, 0]);
  });

  it("shows the photo in its view and only its dark things elsewhere", () => {
    const houses = photo((_, y) => (y < 12 ? 200 : y < 24 ? [80, 30, 30] : 100));
    const sky = { width: 64, height: 32, data: new Float32Array(4 * 64 * 32).fill(0.6) };
    const { data } = withSurroundings(sky, layAround(houses, LEVEL, 32), 1);
    const at = (row: number, column: number): number[] => [
      ...data.slice(4 * (row * 64 + column), 4 * (row * 64 + column) + 3),
    ];
    expect(at(14, 32)[0]).toBeCloseTo(linear(80), 2); // ahead, just above the horizon: a house
    expect(at(14, 2)[0]).toBeCloseTo(linear(80), 1); // behind: houses too
    expect(at(1, 32)[0]).toBeCloseTo(0.6); // overhead: the sky
    expect(at(28, 2)[0]).toBeCloseTo(0.6); // the ground behind: as it was
  });

  it("becomes brighter with the light on show, and what is clipped stays sky", () => {
    const white = layAround(
      photo(() => 255),
      LEVEL,
      32,
    );
    const sky = { width: 64, height: 32, data: new Float32Array(4 * 64 * 32).fill(3) };
    expect(withSurroundings(sky, white, 1).data[4 * (15 * 64 + 32)]).toBe(3);
    const grey = layAround(
      photo(() => 128),
      LEVEL,
      32,
    );
    expect(withSurroundings(sky, grey, 2).data[4 * (15 * 64 + 32)]).toBeCloseTo(2 * linear(128), 1);
  });

  it("is decoded as the photo was encoded", () => {
    for (const byte of [0, 5, 40, 128, 255]) expect(encoded(linear(byte)) * 255).toBeCloseTo(byte, 3);
  });
});

import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { groundColour, litGround, type Told } from "../src/picture/ground";
import { encoded, linear, type Pixels } from "../src/picture/pixels";
import { quietSpot } from "../src/picture/room";
import { fold, layAround, withSurroundings } from "../src/picture/surroundings";

const LEVEL = { elevation: 0, roll: 0, vertical_fov: 60 };
const UP = { elevation: 60, roll: 0, vertical_fov: 40 };

/** A picture and its light in tests/lighting/envmap/lit_ground.json, with the service's answer. */
interface Case extends Light {
  width: number;
  height: number;
  pixels: string;
  lit: string;
}

interface Light {
  sun_elevation: number;
  visibility: number;
  sun: [number, number, number];
  sky: [number, number, number] | undefined;
  camera_elevation: number;
  roll: number;
  vertical_fov: number;
}

const DARK: Light = {
  ...{ sun_elevation: 40, visibility: 0.8, sun: [9, 8, 6], sky: [0.4, 0.5, 0.8] },
  ...{ camera_elevation: 0, roll: 0, vertical_fov: 60 },
};

const bytesOf = (text: string): Uint8Array => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

function toldBy({ sun_elevation, visibility, sun, sky, ...camera }: Light): Told {
  const { camera_elevation: elevation, roll, vertical_fov } = camera;
  return {
    sun: { ...{ azimuth: 0, elevation: sun_elevation, direction: [0, 1, 0] }, visibility, irradiance: sun },
    sky: { ...{ model: "", turbidity: 3, ground_albedo: 0.3, exposure: 1 }, ...(sky ? { irradiance: sky } : {}) },
    camera: { elevation, roll, vertical_fov },
  };
}

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

  it("is in shade where the service finds it in shade", () => {
    const file = readFileSync(new URL("../../../tests/lighting/envmap/lit_ground.json", import.meta.url));
    const { cases } = JSON.parse(new TextDecoder().decode(file)) as { cases: Case[] };
    expect(cases.length).toBeGreaterThan(3);
    for (const given of cases) {
      const { width, height } = given;
      const rgb = bytesOf(given.pixels);
      const data = Uint8ClampedArray.from({ length: 4 * width * height }, (_, i) =>
        i % 4 < 3 ? (rgb[3 * (i >> 2) + (i % 4)] as number) : 255,
      );
      const lit = litGround({ width, height, data }, toldBy(given));
      const expected = bytesOf(given.lit);
      expect(lit).toHaveLength(expected.length);
      expect(Math.max(...lit.map((value, i) => Math.abs(value - (expected[i] as number))))).toBeLessThanOrEqual(1);
    }
  });

  it("counts as lit where the record states no irradiances", () => {
    const [given] = [{ ...DARK, sky: undefined }];
    expect(
      new Set(
        litGround(
          photo(() => 10),
          toldBy(given),
        ),
      ),
    ).toEqual(new Set([255]));
    expect(
      litGround(
        photo(() => 10),
        toldBy(DARK),
      )[40 * 64],
    ).toBe(0);
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

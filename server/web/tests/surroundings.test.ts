import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { direction } from "../src/geometry/angles";
import { linearToSrgb, type Pixels, srgbToLinear, type Triple } from "../src/geometry/color";
import type { Latlong } from "../src/sky/render";
import { meanSunlit, shadowMaskFromPixels, standsInSun } from "../src/surroundings/shadowMask";
import { addSurroundings, buildSurroundings, foldAzimuth, SmoothFactors } from "../src/surroundings/surroundings";

const LEVEL = { elevation: 0, roll: 0, vertical_fov: 60 };
const STILL = { before: direction(0, 30), now: direction(0, 30) };

const bytesOf = (text: string): Uint8Array => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

/** A photo of 64 x 48 pixels by a rule for its grey levels or colours. */
function photo(rule: (x: number, y: number) => number | [number, number, number]): Pixels {
  const data = new Uint8ClampedArray(4 * 64 * 48);
  for (let i = 0; i < 64 * 48; i++) {
    const value = rule(i % 64, Math.floor(i / 64));
    data.set([...(typeof value === "number" ? [value, value, value] : value), 255], 4 * i);
  }
  return { width: 64, height: 48, data };
}

describe("the mask of the service", () => {
  it("has its sunlit ground in green", () => {
    const { width, height, data } = shadowMaskFromPixels(photo((x, y) => [255, x < 32 ? 0 : 200, y]));
    expect([width, height, data.length]).toEqual([64, 48, 64 * 48]);
    expect([data[0], data[63]]).toEqual([0, 200]);
  });
});

describe("the light on what stands on the ground", () => {
  const half = { width: 10, height: 4, data: Uint8Array.from({ length: 40 }, (_, i) => (i % 10 < 5 ? 0 : 255)) };

  it("is that of the ground around its foot", () => {
    expect(meanSunlit(half, [0.2, 0.5], [0.1, 0.1])).toBe(0);
    expect(meanSunlit(half, [0.85, 0.5], [0.1, 0.1])).toBe(1);
    expect(meanSunlit(half, [0.5, 0.5], [0.199, 0.1])).toBeCloseTo(0.5);
    expect([0.2, 0.85].map((x) => standsInSun(half, [x, 0.5], [0.1, 0.1]))).toEqual([false, true]);
  });

  it("is whole where the foot is out of the picture", () => {
    expect(meanSunlit(half, [-0.5, 0.5], [0.1, 0.1])).toBe(1);
    expect(meanSunlit(half, [0.2, 3], [0.1, 0.1])).toBe(1);
  });
});

/** What the service's library makes of a photo in its place, in tests/lighting/envmap/surroundings.json. */
interface SurroundingsCase {
  camera: typeof LEVEL;
  photo: string;
  factors: string;
  maps: OneMap[]; // of the estimate, and of a light whose sun was moved
}

interface OneMap {
  sun: [azimuth: number, elevation: number];
  bare: string;
  map: string;
}

describe("what stands around", () => {
  const uniformSurroundings = (byte: number) =>
    buildSurroundings(
      photo(() => byte),
      LEVEL,
      undefined,
      32,
    );
  const uniformMap = (value: number): Latlong => ({
    width: 64,
    height: 32,
    data: new Float32Array(4 * 64 * 32).fill(value),
  });

  it("is what the service's maps show", () => {
    const file = readFileSync(new URL("../../../tests/lighting/envmap/surroundings.json", import.meta.url));
    const testCase = JSON.parse(new TextDecoder().decode(file)) as SurroundingsCase;
    const floats = (text: string): Float32Array => new Float32Array(bytesOf(text).buffer);
    const rgb = bytesOf(testCase.photo);
    const cells = floats(testCase.factors);
    const factors = Array.from({ length: cells.length / 3 }, (_, i) => [...cells.slice(3 * i, 3 * i + 3)] as Triple);
    const surroundings = buildSurroundings(
      photo((x, y) => [0, 1, 2].map((c) => rgb[3 * (64 * y + x) + c]) as Triple),
      testCase.camera,
      { rows: 24, columns: 48, factors },
      32,
      false,
    );
    const [first, second] = testCase.maps as [OneMap, OneMap];
    const before = direction(...first.sun);
    for (const { one, limit } of [
      { one: first, limit: 0.01 },
      { one: second, limit: 0.02 },
    ]) {
      const [bare, expected] = [floats(one.bare), floats(one.map)];
      const map = uniformMap(0);
      for (let i = 0; i < bare.length; i++) map.data[4 * Math.floor(i / 3) + (i % 3)] = bare[i] as number;
      const { data } = addSurroundings(map, surroundings, 1, { before, now: direction(...one.sun) });
      const errors = [...expected].map((value, i) =>
        Math.abs((data[4 * Math.floor(i / 3) + (i % 3)] as number) / value - 1),
      );
      errors.sort((a, b) => a - b);
      expect(errors[Math.floor(0.9 * errors.length)]).toBeLessThan(limit);
      expect(errors[Math.floor(0.99 * errors.length)]).toBeLessThan(0.1);
    }
  });

  it("is made smooth once for each sun", () => {
    const factors = {
      rows: 4,
      columns: 8,
      factors: Array.from({ length: 32 }, (_, i): Triple => [0.5 + i / 9, 1, 0.3]),
    };
    const [firstSun, secondSun] = [direction(20, 40), direction(-70, 10)];
    const smoothFactors = new SmoothFactors(factors, 16);
    const first = smoothFactors.forSuns({ before: firstSun, now: firstSun });
    expect(smoothFactors.forSuns({ before: firstSun, now: direction(20, 40) })).toBe(first);
    for (const suns of [
      { before: firstSun, now: secondSun },
      { before: secondSun, now: firstSun },
    ]) {
      expect(smoothFactors.forSuns(suns)).toEqual(new SmoothFactors(factors, 16).forSuns(suns));
      expect(smoothFactors.forSuns(suns)).not.toEqual(first);
      expect(smoothFactors.forSuns(suns)).toBe(smoothFactors.forSuns(suns));
    }
  });

  it("folds angles to and fro without a jump", () => {
    expect([0, 30, 40, 60, 90, -40, 180].map((azimuth) => foldAzimuth(azimuth, 30))).toEqual([
      0, 30, 20, 0, -30, -20, 0,
    ]);
  });

  it("has light and dark of the photo's own things behind the camera, in the colours that are said of it", () => {
    const houses = photo((x, y) => (y < 24 ? ((x >> 3) % 2 ? [200, 40, 40] : [20, 4, 4]) : 100));
    const factors = { rows: 2, columns: 4, factors: Array.from({ length: 8 }, (): Triple => [1, 0.5, 0.25]) };
    const [smooth, textured] = [false, true].map(
      (testCase) =>
        addSurroundings(uniformMap(0.6), buildSurroundings(houses, LEVEL, factors, 32, testCase), 1, STILL).data,
    );
    const behind = [...Array(16).keys()].map((x) => 4 * (64 * 13 + (x < 8 ? x : x + 48)));
    const red = (data: Float32Array | undefined) => behind.map((i) => data?.[i] as number);
    expect(Math.max(...red(smooth)) / Math.min(...red(smooth))).toBeCloseTo(1, 3);
    expect(Math.max(...red(textured)) / Math.min(...red(textured))).toBeGreaterThan(2);
    const tint = (data: Float32Array | undefined, i: number) => (data?.[i] as number) / (data?.[i + 1] as number);
    for (const i of behind) expect(tint(textured, i) / tint(smooth, i)).toBeCloseTo(1, 1);
  });

  it("keeps the light of each half, whatever the photo and the place are", () => {
    const bright = photo((_, y) => (y < 24 ? 240 : 20));
    const factors = Array.from({ length: 8 }, (_, i): Triple => [0.2 + i, 1, 0.3]);
    const surroundings = buildSurroundings(bright, LEVEL, { rows: 2, columns: 4, factors }, 32);
    const { data } = addSurroundings(uniformMap(0.6), surroundings, 1, STILL);
    for (const half of [0, 16]) {
      let [sum, whole] = [0, 0];
      for (let y = half; y < half + 16; y++) {
        const angle = (Math.PI * (y + 0.5)) / 32;
        const share = Math.abs(Math.cos(angle)) * Math.sin(angle);
        for (let x = 0; x < 64; x++) sum += share * (data[4 * (64 * y + x)] as number);
        whole += 64 * share * 0.6;
      }
      expect(sum / whole).toBeCloseTo(1, 3);
    }
  });

  it("is the photo in its view alone where nothing is said of the rest", () => {
    const grey = uniformSurroundings(100);
    const { data } = addSurroundings(uniformMap(srgbToLinear(100)), grey, 1, STILL);
    expect(new Set([...data].filter((_, i) => i % 4 < 3).map((value) => value.toFixed(4)))).toEqual(
      new Set([srgbToLinear(100).toFixed(4)]),
    );
  });

  it("becomes brighter with the light on show, and what is clipped stays sky", () => {
    const white = uniformSurroundings(255);
    const ahead = 4 * (15 * 64 + 32);
    expect(addSurroundings(uniformMap(3), white, 1, STILL).data[ahead]).toBeCloseTo(3, 2);
    const grey = uniformSurroundings(128);
    const [once, twice] = [1, 2].map(
      (gain) => addSurroundings(uniformMap(gain), grey, gain, STILL).data[ahead] as number,
    );
    expect(twice).toBeCloseTo(2 * (once as number), 3);
  });

  it("is decoded as the photo was encoded", () => {
    for (const byte of [0, 5, 40, 128, 255]) expect(linearToSrgb(srgbToLinear(byte)) * 255).toBeCloseTo(byte, 3);
  });
});

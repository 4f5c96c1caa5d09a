import { describe, expect, it } from "vitest";
import { angles, direction } from "../src/geometry/angles";
import { type Camera, type Point, project } from "../src/geometry/camera";
import { shadowAzimuth } from "../src/geometry/marks";
import { trustText } from "../src/text/format";
import type { Lighting } from "../src/types";

const CAMERA: Camera = { elevation: -8, roll: 3, vertical_fov: 55 };
const SIZE = { width: 800, height: 600 };

/** The pixel of a point on the ground, below a camera 1 above it. */
function pixel(x: number, z: number): Point {
  const length = Math.hypot(x, 1, z);
  return project([x / length, -1 / length, z / length], CAMERA, SIZE) as Point;
}

describe("a shadow that is drawn", () => {
  it("tells the sun's azimuth, whatever the camera's tilt", () => {
    for (const azimuth of [-150, -60, 0, 35, 170]) {
      const [x, , z] = direction(azimuth, 0); // the shadow goes the other way
      const found = shadowAzimuth(pixel(0.4, -4), pixel(0.4 - 0.9 * x, -4 - 0.9 * z), CAMERA, SIZE);
      expect(found).toBeCloseTo(angles([x, 0, z]).azimuth, 6);
    }
  });

  it("says nothing where an end lies over the horizon", () => {
    expect(shadowAzimuth(pixel(0, -4), [400, 20], CAMERA, SIZE)).toBeUndefined();
    expect(shadowAzimuth([400, 20], pixel(0, -4), CAMERA, SIZE)).toBeUndefined();
  });
});

describe("the word of trust", () => {
  const light = (changes: Partial<Lighting>): Lighting =>
    ({ evidence: ["pixels"], sun: { candidates: [{}, {}] }, ...changes }) as unknown as Lighting;

  it("says what would help", () => {
    expect(trustText(light({ trust: "sure" }))).toBe("Sure");
    expect(trustText(light({ trust: "no sun" }))).toBe("No sun: set it by eye if you want one");
    expect(trustText(light({ trust: "unsure" }))).toBe(
      "Unsure: draw a shadow, give time and place or pick another sun",
    );
    expect(trustText(light({ trust: "unsure", evidence: ["shadow", "time+place"] }))).toBe("Unsure: pick another sun");
    expect(trustText(light({}))).toBe("");
  });
});

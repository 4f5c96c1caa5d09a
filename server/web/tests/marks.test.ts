import { describe, expect, it } from "vitest";
import { angles, direction } from "../src/geometry/angles";
import { type Camera, horizon, levelCamera, type Point, project } from "../src/geometry/camera";
import { horizonEnds, shadowAzimuth } from "../src/geometry/marks";
import { trustText } from "../src/text/format";
import { moveMarks, readMarks, writeMarks } from "../src/text/marks";
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

describe("a horizon that is dragged", () => {
  it("has the estimated one's ends, which tell the same camera", () => {
    for (const camera of [CAMERA, { elevation: 12, roll: -7, vertical_fov: 40 }, { ...CAMERA, roll: 75 }]) {
      const [from, to] = horizonEnds(camera, SIZE);
      const found = levelCamera({ elevation: 0, roll: 0, vertical_fov: camera.vertical_fov }, [from, to], SIZE);
      expect(found.elevation).toBeCloseTo(camera.elevation, 6);
      expect(found.roll).toBeCloseTo(camera.roll, 6);
      for (const [x, y] of [from, to]) {
        expect([x > 0, x < SIZE.width, y > 0, y < SIZE.height]).toEqual([true, true, true, true]);
      }
    }
  });

  it("tells the camera whichever end comes first, and keeps the lens and the height", () => {
    const line = horizon(CAMERA, SIZE) as [Point, Point];
    const found = levelCamera({ ...CAMERA, elevation: 0, roll: 0, height: 3 }, [line[1], line[0]], SIZE);
    expect(found).toMatchObject({ vertical_fov: 55, height: 3 });
    expect([found.elevation, found.roll]).toEqual([expect.closeTo(-8, 6), expect.closeTo(3, 6)]);
  });

  it("looks higher the lower the line is, by half of the field of view at the lower edge", () => {
    const found = levelCamera(CAMERA, [[0, SIZE.height], [SIZE.width, SIZE.height]], SIZE); // biome-ignore format: a line
    expect([found.elevation, found.roll]).toEqual([expect.closeTo(55 / 2, 6), expect.closeTo(0, 6)]);
  });

  it("lies at the picture's edge where the estimated one is outside of it", () => {
    const [from, to] = horizonEnds({ elevation: 60, roll: 0, vertical_fov: 40 }, SIZE);
    expect([from[1], to[1]]).toEqual([0.94 * SIZE.height, 0.94 * SIZE.height]);
    expect(to[0]).toBeGreaterThan(from[0] + SIZE.width / 2);
  });
});

describe("the text of what is drawn", () => {
  const TEXT = "310.0,820.0,455.0,790.5;own:600.0,430.0;level:1.0,2.0,3.0,4.0,5.0,6.0,7.0,8.0";

  it("is read and written", () => {
    const marks = readMarks(TEXT);
    expect(marks.map(({ prefix, points }) => [prefix, points.length])).toEqual([
      ["", 2],
      ["own:", 1],
      ["level:", 4],
    ]);
    expect(writeMarks(marks)).toBe(TEXT);
    expect(readMarks("")).toEqual([]);
  });

  it("keeps the meters of a thing of known size", () => {
    expect(writeMarks(readMarks("310,820,305,400,1.8"))).toBe("310.0,820.0,305.0,400.0,1.8");
  });

  it("has one end moved", () => {
    const moved = moveMarks(readMarks(TEXT), (point, [mark, end]) => (mark === 0 && end === 1 ? [1, 2] : point));
    expect(writeMarks(moved)).toBe(TEXT.replace("455.0,790.5", "1.0,2.0"));
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

/** Expected values are what `lighting.geometry` gives for the same arguments. */

import { describe, expect, it } from "vitest";
import { angles, cross, direction, dot, type Vector, wrapAzimuth } from "../src/pure/angles";
import { type Camera, cameraAxes, horizon, project, rayThrough, sunMark } from "../src/pure/camera";
import { frameOf, fromDome, inSky, pieces, rim, toDome, toMap } from "../src/pure/sphere";

const SIZE = { width: 640, height: 480 };
const CAMERA: Camera = { elevation: 4.1, roll: -7.5, vertical_fov: 48.7 };
const DOWN: Camera = { elevation: -15, roll: 12, vertical_fov: 70 };

function near(actual: readonly number[] | null, expected: readonly number[], digits = 5): void {
  expect(actual).toHaveLength(expected.length);
  expected.forEach((value, i) => {
    expect(actual?.[i]).toBeCloseTo(value, digits);
  });
}

const degreesBetween = (a: Vector, b: Vector): number => (Math.acos(Math.min(dot(a, b), 1)) * 180) / Math.PI;

describe("angles", () => {
  it("puts azimuth 0 on -Z and grows to the right, +X", () => {
    near(direction(0, 0), [0, 0, -1]);
    near(direction(90, 0), [1, 0, 0]);
    near(direction(0, 90), [0, 1, 0]);
    near(direction(-41.2, 33), [-0.552423, 0.544639, -0.631028]);
  });

  it("comes back from directions", () => {
    const { azimuth, elevation } = angles(direction(-41.2, 33));
    near([azimuth, elevation], [-41.2, 33]);
  });

  it("wraps into (-180, 180]", () => {
    expect([190, -180, 180, 540, -190, -900].map(wrapAzimuth)).toEqual([-170, 180, 180, 180, 170, 180]);
  });
});

describe("camera", () => {
  it("has the axes of lighting.geometry", () => {
    const { right, up, forward } = cameraAxes(CAMERA);
    near(right, [0.991445, 0.130192, 0.009332]);
    near(up, [-0.130526, 0.988908, 0.070886]);
    near(forward, [0, 0.071497, -0.997441]);
    near(
      cross(right, up),
      forward.map((value) => -value),
    );
  });

  it("projects as lighting.geometry does", () => {
    near(project(direction(20, 10), CAMERA, SIZE), [517.22954, 204.762709], 4);
    near(project(direction(-30, -12), DOWN, SIZE), [130.466695, 272.885481], 4);
    expect(project(direction(170, 0), CAMERA, SIZE)).toBeNull();
  });

  it("sends a ray back through the pixel it came from", () => {
    near(project(rayThrough([123, 345], DOWN, SIZE), DOWN, SIZE), [123, 345]);
  });

  it("draws a level camera's horizon across its middle", () => {
    const line = horizon({ elevation: 0, roll: 0, vertical_fov: 50 }, SIZE);
    near(line?.map(([, y]) => y) ?? null, [240, 240]);
    expect(horizon({ elevation: 90, roll: 0, vertical_fov: 50 }, SIZE)).toBeNull();
  });

  it("turns the horizon counter-clockwise when the camera rolls clockwise", () => {
    const line = horizon({ elevation: 0, roll: 10, vertical_fov: 50 }, SIZE);
    const [left, right] = line?.map(([, y]) => y) ?? [];
    expect(left).toBeGreaterThan(right as number);
  });
});

describe("the sun in the photo", () => {
  const level: Camera = { elevation: 0, roll: 0, vertical_fov: 60 };

  it("is marked where it is", () => {
    const mark = sunMark(direction(10, 15), level, SIZE, 12);
    expect(mark.inside).toBe(true);
    near(mark.at, project(direction(10, 15), level, SIZE) ?? []);
  });

  it("is pointed at from the edge nearest to it", () => {
    const right = sunMark(direction(80, 5), level, SIZE, 12);
    expect([right.inside, right.behind, right.at[0]]).toEqual([false, false, 628]);
    const above = sunMark(direction(0, 70), level, SIZE, 12);
    near(above.at, [320, 12]);
  });

  it("is to the side when it is behind", () => {
    const mark = sunMark(direction(-170, 30), level, SIZE, 12);
    expect(mark.behind).toBe(true);
    near(mark.at, [12, 240]);
    near(mark.towards, [-1, 0]);
  });
});

describe("the sphere's pictures", () => {
  it("show the dome from above with the photo's direction up", () => {
    near(toDome(direction(0, 0)), [0, -1]);
    near(toDome(direction(90, 45)), [0.5, 0]);
    near(toDome(direction(37, 90)), [0, 0]);
  });

  it("read the dome back", () => {
    near(fromDome(toDome(direction(-120, 20))), direction(-120, 20));
    expect(fromDome([0.9, 0.9])).toBeNull();
  });

  it("show the map with azimuth 0 at its centre and right on the right", () => {
    near(toMap(direction(0, 0)), [1, 0.5]);
    near(toMap(direction(90, 45)), [1.5, 0.25]);
  });

  it("draw a circle at its angle, from its highest point on", () => {
    const around = direction(50, 30);
    const circle = rim(around, 25);
    for (const towards of circle) expect(degreesBetween(towards, around)).toBeCloseTo(25, 4);
    near(circle[0] ?? null, direction(50, 55));
  });

  it("cut a circle where it sinks below the horizon", () => {
    const [down, up] = inSky(rim(direction(50, 10), 25));
    expect(inSky(rim(direction(50, 10), 25))).toHaveLength(2);
    near(down?.[0] ?? null, direction(50, 35));
    near(up?.at(-1) ?? null, direction(50, 35));
    for (const end of [down?.at(-1), up?.[0]]) expect(Math.abs(end?.[1] ?? 1)).toBeLessThan(0.02);
    expect(inSky(rim(direction(50, 40), 25))).toHaveLength(1);
    expect(inSky(rim(direction(50, 40), 170))).toEqual([]);
  });

  it("outline what the camera sees", () => {
    const pixels = frameOf(CAMERA, 4 / 3).map((towards) => project(towards, CAMERA, SIZE) ?? [Number.NaN, 0]);
    near([Math.min(...pixels.map(([x]) => x)), Math.max(...pixels.map(([x]) => x))], [0, 640]);
    near([Math.min(...pixels.map(([, y]) => y)), Math.max(...pixels.map(([, y]) => y))], [0, 480]);
  });

  it("cut a line at the seam", () => {
    const cut = pieces([[0.2, 0], [0.1, 0], [1.9, 0], [1.8, 0]], 1); // biome-ignore format: a line
    expect(cut).toEqual([[[0.2, 0], [0.1, 0]], [[1.9, 0], [1.8, 0]]]); // biome-ignore format: two lines
  });
});

/** Expected values are what `lighting.geometry` gives for the same arguments. */

import { describe, expect, it } from "vitest";
import { angles, cross, direction, dot, type Vector, wrapAzimuth } from "../src/geometry/angles";
import { type Camera, cameraAxes, horizon, pixelRay, project, sunMark } from "../src/geometry/camera";
import { circleAround, clipToSky, fromDome, photoOutline, splitAtSeam, toDome, toMap } from "../src/geometry/sphere";

const SIZE = { width: 640, height: 480 };
const CAMERA: Camera = { elevation: 4.1, roll: -7.5, vertical_fov: 48.7 };
const DOWN: Camera = { elevation: -15, roll: 12, vertical_fov: 70 };

function expectNear(actual: readonly number[] | null, expected: readonly number[], digits = 5): void {
  expect(actual).toHaveLength(expected.length);
  expected.forEach((value, i) => {
    expect(actual?.[i]).toBeCloseTo(value, digits);
  });
}

const degreesBetween = (a: Vector, b: Vector): number => (Math.acos(Math.min(dot(a, b), 1)) * 180) / Math.PI;

describe("angles", () => {
  it("puts azimuth 0 on -Z and grows to the right, +X", () => {
    expectNear(direction(0, 0), [0, 0, -1]);
    expectNear(direction(90, 0), [1, 0, 0]);
    expectNear(direction(0, 90), [0, 1, 0]);
    expectNear(direction(-41.2, 33), [-0.552423, 0.544639, -0.631028]);
  });

  it("comes back from directions", () => {
    const { azimuth, elevation } = angles(direction(-41.2, 33));
    expectNear([azimuth, elevation], [-41.2, 33]);
  });

  it("wraps into (-180, 180]", () => {
    expect([190, -180, 180, 540, -190, -900].map(wrapAzimuth)).toEqual([-170, 180, 180, 180, 170, 180]);
  });
});

describe("camera", () => {
  it("has the axes of lighting.geometry", () => {
    const { right, up, forward } = cameraAxes(CAMERA);
    expectNear(right, [0.991445, 0.130192, 0.009332]);
    expectNear(up, [-0.130526, 0.988908, 0.070886]);
    expectNear(forward, [0, 0.071497, -0.997441]);
    expectNear(
      cross(right, up),
      forward.map((value) => -value),
    );
  });

  it("projects as lighting.geometry does", () => {
    expectNear(project(direction(20, 10), CAMERA, SIZE), [517.22954, 204.762709], 4);
    expectNear(project(direction(-30, -12), DOWN, SIZE), [130.466695, 272.885481], 4);
    expect(project(direction(170, 0), CAMERA, SIZE)).toBeNull();
  });

  it("sends a ray back through the pixel it came from", () => {
    expectNear(project(pixelRay([123, 345], DOWN, SIZE), DOWN, SIZE), [123, 345]);
  });

  it("draws a level camera's horizon across its middle", () => {
    const line = horizon({ elevation: 0, roll: 0, vertical_fov: 50 }, SIZE);
    expectNear(line?.map(([, y]) => y) ?? null, [240, 240]);
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
    expectNear(mark.point, project(direction(10, 15), level, SIZE) ?? []);
  });

  it("is pointed at from the edge nearest to it", () => {
    const right = sunMark(direction(80, 5), level, SIZE, 12);
    expect([right.inside, right.behind, right.point[0]]).toEqual([false, false, 628]);
    const above = sunMark(direction(0, 70), level, SIZE, 12);
    expectNear(above.point, [320, 12]);
  });

  it("is to the side when it is behind", () => {
    const mark = sunMark(direction(-170, 30), level, SIZE, 12);
    expect(mark.behind).toBe(true);
    expectNear(mark.point, [12, 240]);
    expectNear(mark.ray, [-1, 0]);
  });
});

describe("the sphere's pictures", () => {
  it("show the dome from above with the photo's direction up", () => {
    expectNear(toDome(direction(0, 0)), [0, -1]);
    expectNear(toDome(direction(90, 45)), [0.5, 0]);
    expectNear(toDome(direction(37, 90)), [0, 0]);
  });

  it("read the dome back", () => {
    expectNear(fromDome(toDome(direction(-120, 20))), direction(-120, 20));
    expect(fromDome([0.9, 0.9])).toBeNull();
  });

  it("show the map with azimuth 0 at its center and right on the right", () => {
    expectNear(toMap(direction(0, 0)), [1, 0.5]);
    expectNear(toMap(direction(90, 45)), [1.5, 0.25]);
  });

  it("draw a circle at its angle, from its highest point on", () => {
    const center = direction(50, 30);
    const circle = circleAround(center, 25);
    for (const ray of circle) expect(degreesBetween(ray, center)).toBeCloseTo(25, 4);
    expectNear(circle[0] ?? null, direction(50, 55));
  });

  it("cut a circle where it sinks below the horizon", () => {
    const [down, up] = clipToSky(circleAround(direction(50, 10), 25));
    expect(clipToSky(circleAround(direction(50, 10), 25))).toHaveLength(2);
    expectNear(down?.[0] ?? null, direction(50, 35));
    expectNear(up?.at(-1) ?? null, direction(50, 35));
    for (const end of [down?.at(-1), up?.[0]]) expect(Math.abs(end?.[1] ?? 1)).toBeLessThan(0.02);
    expect(clipToSky(circleAround(direction(50, 40), 25))).toHaveLength(1);
    expect(clipToSky(circleAround(direction(50, 40), 170))).toEqual([]);
  });

  it("outline what the camera sees", () => {
    const pixels = photoOutline(CAMERA, 4 / 3).map((ray) => project(ray, CAMERA, SIZE) ?? [Number.NaN, 0]);
    expectNear([Math.min(...pixels.map(([x]) => x)), Math.max(...pixels.map(([x]) => x))], [0, 640]);
    expectNear([Math.min(...pixels.map(([, y]) => y)), Math.max(...pixels.map(([, y]) => y))], [0, 480]);
  });

  it("cut a line at the seam", () => {
    const cut = splitAtSeam([[0.2, 0], [0.1, 0], [1.9, 0], [1.8, 0]], 1); // biome-ignore format: a line
    expect(cut).toEqual([[[0.2, 0], [0.1, 0]], [[1.9, 0], [1.8, 0]]]); // biome-ignore format: two lines
  });
});

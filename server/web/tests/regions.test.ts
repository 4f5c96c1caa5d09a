import { describe, expect, it } from "vitest";
import { direction, type Vector } from "../src/geometry/angles";
import type { Point } from "../src/geometry/camera";
import {
  placeShareLabels,
  type ShareLabel,
  type SunEstimate,
  type SunRegion,
  sunRegions,
  toDome,
  toMap,
} from "../src/geometry/sphere";

const regionsWith = ({ sunny = true, ...sun }: Partial<SunEstimate> & { sunny?: boolean }): SunRegion[] =>
  sunRegions({ azimuth: 120, elevation: 20, radius_50: 13, radius_90: 27, ...sun }, sunny);

const dome = (ray: Vector): Point => {
  const [x, y] = toDome(ray);
  return [100 * x, 100 * y];
};

const labelsOnDome = (sun: Partial<SunEstimate> & { sunny?: boolean }): ShareLabel[] =>
  placeShareLabels(regionsWith(sun), dome, 8, [[-100, -100], [100, 100]]); // biome-ignore format: two corners

const areApart = ([a, b]: ShareLabel[]): boolean =>
  !!a && !!b && (Math.abs(a.center[0] - b.center[0]) >= 23.9 || Math.abs(a.center[1] - b.center[1]) >= 9.5);

describe("the sun's regions", () => {
  it("are pale where no sun shines, and their shares too", () => {
    expect(regionsWith({}).map(({ kind }) => kind)).toEqual(["region wide", "region"]);
    expect(regionsWith({ sunny: false }).map(({ kind }) => kind)).toEqual(["region wide pale", "region pale"]);
    expect(labelsOnDome({ sunny: false }).map(({ pale }) => pale)).toEqual([true, true]);
  });

  it("that no longer reach the sky are left out", () => {
    expect(regionsWith({ elevation: 60, radius_90: 130 }).map(({ share }) => share)).toEqual(["50\u00a0%"]);
  });

  it("have their shares beside them, clear of each other", () => {
    expect(labelsOnDome({}).map(({ share }) => share)).toEqual(["50\u00a0%", "90\u00a0%"]);
    for (const azimuth of [-170, -90, -60, -10, 0, 45, 90, 120, 180]) {
      for (const [radius_50, radius_90] of [
        [3, 5],
        [13, 27],
        [40, 90],
      ] as const) {
        expect(areApart(labelsOnDome({ azimuth, radius_50, radius_90 })), `${azimuth} ${radius_50}`).toBe(true);
      }
    }
  });

  it("have their shares off the sun's sign, however small they are", () => {
    for (const azimuth of [0, 34, 90, -120]) {
      const [x, y] = dome(direction(azimuth, 13));
      for (const { center: at } of labelsOnDome({ azimuth, elevation: 13, radius_50: 2, radius_90: 4 })) {
        expect(Math.hypot(at[0] - x, at[1] - y)).toBeGreaterThan(19);
      }
    }
  });

  it("keep their shares in the map", () => {
    const toPoint = (ray: Vector): Point => {
      const [x, y] = toMap(ray);
      return [150 * x, 150 * y];
    };
    const labels = placeShareLabels(regionsWith({ azimuth: 179, elevation: 70 }), toPoint, 12, [[0, 0], [300, 150]]); // biome-ignore format: two corners
    for (const { center: at } of labels) {
      expect(at[0]).toBeLessThanOrEqual(300 - 18);
      expect(at[1]).toBeGreaterThanOrEqual(7);
    }
  });
});

import { describe, expect, it } from "vitest";
import { direction } from "../src/geometry/angles";
import { mixColors, parseHexColor, type Rgb } from "../src/geometry/color";
import { gridCells, probabilityWithin, smoothDensity } from "../src/geometry/distribution";

describe("the sun's probability", () => {
  const distribution = { grid: "any", azimuth: [0, 90, 180], elevation: [10, 20, 60], probability: [0.5, 0.3, 0.2] };
  const cells = gridCells(distribution);

  it("is the sum of the cells within a radius", () => {
    expect(probabilityWithin(cells, direction(2, 12), 5)).toBeCloseTo(0.5);
    expect(probabilityWithin(cells, direction(45, 80), 180)).toBeCloseTo(1);
    expect(probabilityWithin(cells, direction(-90, 10), 20)).toBe(0);
  });

  it("is spread over the neighbourhood and sums to one", () => {
    const density = smoothDensity(fibonacci(1024));
    let sum = 0;
    for (let row = 0; row < 180; row++) {
      for (let column = 0; column < 180; column++) {
        const elevation = row - 89.5;
        sum += density(direction(2 * column, elevation)) * Math.cos((elevation * Math.PI) / 180);
      }
    }
    expect(sum * (Math.PI / 180) * (Math.PI / 90)).toBeCloseTo(1, 2);
  });
});

/** The golden spiral of `lighting.sun_grid` with a lobe of 6 degrees at azimuth 50, elevation 40. */
function fibonacci(count: number): { ray: readonly [number, number, number]; probability: number }[] {
  const center = direction(50, 40);
  const cells = Array.from({ length: count }, (_, i) => {
    const elevation = (Math.asin(1 - (i + 0.5) / count) * 180) / Math.PI;
    const ray = direction(i * 180 * (3 - Math.sqrt(5)), elevation);
    const cosine = ray[0] * center[0] + ray[1] * center[1] + ray[2] * center[2];
    return { ray, probability: Math.exp(80 * (cosine - 1)) };
  });
  const total = cells.reduce((sum, { probability }) => sum + probability, 0);
  return cells.map(({ ray, probability }) => ({ ray, probability: probability / total }));
}

describe("colours", () => {
  const stops: Rgb[] = [[0, 0, 0], [100, 50, 0], [200, 50, 80]]; // biome-ignore format: a table

  it("are read from hex", () => {
    expect(parseHexColor(" #1e22fa")).toEqual([30, 34, 250]);
  });

  it("are mixed between stops and clamped at the ends", () => {
    expect(mixColors(stops, 0.25)).toEqual([50, 25, 0]);
    expect(mixColors(stops, 0.75)).toEqual([150, 50, 40]);
    expect([mixColors(stops, -1), mixColors(stops, 7)]).toEqual([stops[0], stops[2]]);
  });
});

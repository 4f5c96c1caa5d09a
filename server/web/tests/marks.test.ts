import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import { type Angles, angles, combine, direction, type Vector } from "../src/geometry/angles";
import { type Camera, type Point, pixelRay, project } from "../src/geometry/camera";
import { fitCamera, heightByReference, type Line } from "../src/geometry/fit";
import { horizonEnds, markedSun } from "../src/geometry/marks";
import type { Live } from "../src/state";
import { trustText } from "../src/text/format";
import { type Mark, moveMarks, readMarks, writeMarks } from "../src/text/marks";
import type { DrawnField } from "../src/text/metadata";
import type { Estimate, Lighting } from "../src/types";
import { liveOf } from "../src/views/live";

interface DrawnCase {
  name: string;
  lens_known: boolean;
  horizon: number[] | null;
  verticals: number[][];
  levels: number[][][];
  camera: [elevation: number, roll: number, vertical_fov: number];
}

const DRAWN: { size: [number, number]; pixels: [number, number, number]; cases: DrawnCase[] } = JSON.parse(
  new TextDecoder().decode(readFileSync(new URL("../../../tests/lighting/fusion/drawn_cameras.json", import.meta.url))),
);
const CAMERA: Camera = { elevation: -8, roll: 3, vertical_fov: 55 };
const SIZE = { width: 800, height: 600 };

/** The pixel of a point, by default on the ground, seen by a camera 1 above it. */
function pixel(x: number, z: number, y = 0, camera = CAMERA): Point {
  const ray: Vector = [x, y - 1, z];
  return project(combine([1 / Math.hypot(...ray), ray]), camera, SIZE) as Point;
}

/** What a mark tells of the sun, if the network's stands at that azimuth. */
const sunOf = (prefix: string, points: Point[], azimuth = 0): Partial<Angles> | undefined =>
  markedSun({ prefix, points }, CAMERA, SIZE, azimuth);

describe("a shadow that is drawn", () => {
  it.each(["", "doubt:"])("tells the sun's azimuth, whatever the camera's tilt: %s", (prefix) => {
    for (const azimuth of [-150, -60, 0, 35, 170]) {
      const [x, , z] = direction(azimuth, 0); // the shadow goes the other way
      const sun = sunOf(prefix, [pixel(0.4, -4), pixel(0.4 - 0.9 * x, -4 - 0.9 * z)]);
      expect(sun).toEqual({ azimuth: expect.closeTo(angles([x, 0, z]).azimuth, 6) });
    }
  });

  it("tells its elevation by what throws the tip", () => {
    const [x, , z] = direction(70, 0);
    const sun = sunOf("", [pixel(0.4, -4), pixel(0.4 - 2 * x, -4 - 2 * z), pixel(0.4, -4, 1.5)]);
    expect(sun).toEqual({ azimuth: expect.closeTo(70, 6), elevation: expect.closeTo(36.87, 2) }); // of 3, 4 and 5
  });

  it("says nothing where an end lies over the horizon", () => {
    expect(sunOf("", [pixel(0, -4), [400, 20]])).toBeUndefined();
    expect(sunOf("", [[400, 20], pixel(0, -4)])).toBeUndefined();
    expect(sunOf("own:", [[400, 20]])).toBeUndefined();
  });

  it("is the camera's own opposite the sun, a head's by its azimuth alone", () => {
    const [x, y, z] = direction(165, 25);
    const at = project([-x, -y, -z], CAMERA, SIZE) as Point;
    const sun = { azimuth: expect.closeTo(165, 6), elevation: expect.closeTo(25, 6) };
    expect(sunOf("own:", [at])).toEqual(sun);
    expect(sunOf("head:", [at])).toEqual({ azimuth: sun.azimuth });
  });

  it("has, without a foot, the end that is nearer to the network's sun", () => {
    const [x, , z] = direction(35, 0);
    const line = [pixel(0.4, -4), pixel(0.4 - 0.9 * x, -4 - 0.9 * z)];
    for (const [network, azimuth] of [
      [60, 35],
      [-100, -145],
    ] as const)
      expect(sunOf("line:", line, network)?.azimuth).toBeCloseTo(azimuth, 6);
  });
});

describe("a lit side that is drawn", () => {
  const [left, middle, right] = [300, 400, 500].map((x): Point => [x, 300]) as [Point, Point, Point];
  const ahead = angles([0, 0, -1]).azimuth;

  it("takes the network's sun to that side, if it is on the other", () => {
    expect(sunOf("lit:", [left, right], 70)?.azimuth).toBe(70);
    expect(sunOf("lit:", [left, right], -70)?.azimuth).toBeCloseTo(70, 0);
    expect(sunOf("lit:", [right, left], 120)?.azimuth).toBeCloseTo(-120, 0);
  });

  it("has a border, which tells the sun as a moon's does", () => {
    const share = (1 - Math.cos((50 * Math.PI) / 180)) / 2; // of a sun 50 degrees off the line of sight, ahead
    expect(sunOf("lit:", [left, right, middle])?.azimuth).toBeCloseTo(ahead + 90, 0);
    expect(sunOf("lit:", [right, left, middle])?.azimuth).toBeCloseTo(ahead - 90, 0);
    expect(sunOf("lit:", [left, right, [500 - 200 * share, 300]])?.azimuth).toBeCloseTo(50, 0);
  });

  it("says nothing by a border outside of its edges", () => {
    expect(sunOf("lit:", [left, middle, right])).toBeUndefined();
  });
});

describe("the ends of a horizon", () => {
  it("are those of the estimated one, inside of the picture", () => {
    for (const camera of [CAMERA, { elevation: 12, roll: -7, vertical_fov: 40 }, { ...CAMERA, roll: 75 }]) {
      const [from, to] = horizonEnds(camera, SIZE);
      for (const [x, y] of [from, to]) {
        expect(pixelRay([x, y], camera, SIZE)[1]).toBeCloseTo(0, 6);
        expect([x > 0, x < SIZE.width, y > 0, y < SIZE.height]).toEqual([true, true, true, true]);
      }
    }
  });

  it("lie at the picture's edge where the estimated one is outside of it", () => {
    const [from, to] = horizonEnds({ elevation: 60, roll: 0, vertical_fov: 40 }, SIZE);
    expect([from[1], to[1]]).toEqual([0.94 * SIZE.height, 0.94 * SIZE.height]);
    expect(to[0]).toBeGreaterThan(from[0] + SIZE.width / 2);
  });
});

describe("lines that are drawn", () => {
  const [[width, height], [elevation, roll, vertical_fov]] = [DRAWN.size, DRAWN.pixels];
  const camera = { elevation, roll, vertical_fov, height: 3 };
  const toLine = ([x, y, right, down]: number[]): Line => [[x, y], [right, down]] as Line; // biome-ignore format: a line

  it.each(DRAWN.cases)("tell the camera that the service answers: $name", (one) => {
    const lines = {
      horizon: one.horizon ? toLine(one.horizon) : undefined,
      verticals: one.verticals.map(toLine),
      levels: one.levels.map((group) => group.map(toLine)),
    };
    const found = fitCamera(camera, lines, { width, height }, one.lens_known);
    const [up, clockwise, fov] = one.camera.map((value) => expect.closeTo(value, 2));
    expect(found).toEqual({ elevation: up, roll: clockwise, vertical_fov: fov, height: 3 });
  });

  it("say nothing where an upright one lies flat", () => {
    const flat = toLine([100, 300, 300, 310]);
    expect(fitCamera(camera, { verticals: [flat], levels: [] }, { width, height }, false)).toBeUndefined();
  });
});

describe("a thing of known size", () => {
  it("tells the camera's height, whether it stands or lies", () => {
    const height = (foot: Point, end: Point, lies: boolean): number | undefined =>
      heightByReference([foot, end], 3, lies, CAMERA, SIZE);
    expect(height(pixel(0.4, -4), pixel(0.4, -4, 1.5), false)).toBeCloseTo(2, 6); // 1.5 where the camera stands 1 high
    expect(height(pixel(0.4, -4), pixel(0.4, -6), true)).toBeCloseTo(1.5, 6);
    expect(height([400, 20], pixel(0.4, -4), true)).toBeUndefined();
  });
});

describe("what is shown while something is drawn", () => {
  const estimate = { camera: { ...CAMERA, height: 1.6 }, sun: { azimuth: 20 }, evidence: ["pixels"] } as Estimate;
  const live = (field: DrawnField, text: string, vertical = ""): Live | undefined => {
    const marks = readMarks(text);
    const read = (name: DrawnField): Mark[] =>
      name === field ? marks : readMarks(name === "vertical" ? vertical : "");
    return liveOf(estimate, CAMERA, SIZE, field, marks.at(-1) as Mark, read);
  };
  const text = (...points: Point[]): string => points.flat().join(",");

  it("is the sun of a shadow, on", () => {
    const [x, , z] = direction(70, 0);
    const shadow = text(pixel(0.4, -4), pixel(0.4 - x, -4 - z));
    expect(live("shadow", shadow)).toEqual({ parameters: { sun_azimuth: expect.closeTo(70, 6), sun: true } });
  });

  it("is the camera's height by a thing of known size", () => {
    const thing = `${text(pixel(0.4, -4), pixel(0.4, -4, 1.5))},3`;
    expect(live("reference", thing)).toEqual({ camera: { ...CAMERA, height: expect.closeTo(2, 6) } });
    expect(live("reference", text(pixel(0.4, -4), pixel(0.4, -4, 1.5)))).toBeUndefined(); // without meters
  });

  it("is the camera by all lines, but for one of level edges whose other is still to come", () => {
    const upright = text(pixel(-1, -5), pixel(-1, -5, 2.5));
    const alone = live("vertical", upright);
    expect(live("vertical", `${upright};level:100,200,300,210`)).toEqual(alone);
    expect(live("horizon", "60,246,740,207", upright)?.camera).not.toEqual(live("horizon", "60,246,740,207")?.camera);
    expect(alone?.camera?.height).toBe(1.6);
  });

  it("has the lens of the answer where that is known, also one that was said after lines", () => {
    const said = {
      ...estimate,
      camera: { ...estimate.camera, vertical_fov: 40 },
      evidence: ["focal length"],
    } as Estimate;
    const [mark] = readMarks(text(pixel(-1, -5), pixel(-1, -5, 2.5))) as [Mark];
    const shown = liveOf(said, CAMERA, SIZE, "vertical", mark, (name) => (name === "vertical" ? [mark] : []));
    expect(shown?.camera?.vertical_fov).toBe(40);
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

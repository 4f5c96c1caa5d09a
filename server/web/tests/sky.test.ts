/** Expected values are what `lighting.sky` and `lighting.envmap` give for the same arguments. */

import { readFileSync } from "node:fs";
import { beforeAll, describe, expect, it } from "vitest";
import type { Lighting } from "../src/api";
import { direction } from "../src/geometry/angles";
import { rgbLuminance, type Triple } from "../src/geometry/color";
import { prepareLight, renderLight, type SceneLight, type SkyRequest, type SkyTables } from "../src/sky/lighting";
import { hosekWilkieSky, parseHosekWilkieTable, parsePragueTable, sunIrradiance } from "../src/sky/models";
import {
  followLight,
  halveMap,
  horizontalIrradiance,
  type Latlong,
  removeDisc,
  renderHosekWilkieSky,
  toneMap,
} from "../src/sky/render";

let tables: SkyTables;

beforeAll(() => {
  const [hosekWilkie, prague] = ["hosek_wilkie.f32", "prague.f16"].map((name) => {
    const bytes = readFileSync(new URL(`../../../lighting/data/${name}`, import.meta.url));
    return new Uint8Array(bytes).buffer;
  }) as [ArrayBuffer, ArrayBuffer];
  tables = { hosekWilkie: parseHosekWilkieTable(hosekWilkie), prague: parsePragueTable(prague) };
});

const P = {
  sun_azimuth: -41.2,
  sun_elevation: 33,
  turbidity: 3.4,
  exposure: 5,
  ground_albedo: 0.3,
  sun: true,
  warmth: 0,
  softness: 0,
};

function expectNear(actual: readonly number[], expected: readonly number[], share = 1e-3): void {
  expect(actual).toHaveLength(expected.length);
  expected.forEach((value, i) => {
    expect(Math.abs((actual[i] as number) / value - 1)).toBeLessThan(share);
  });
}

const pixel = ({ width, data }: Latlong, row: number, column: number): number[] => [
  ...data.slice(4 * (row * width + column), 4 * (row * width + column) + 3),
];

/** A record that Python wrote, with the irradiances of sun and sky and the ground's radiance as Python has them. */
interface StoredLight {
  record: Lighting;
  sun: Triple;
  sky: Triple;
  ground: Triple;
}

const STORED: StoredLight[] = JSON.parse(
  new TextDecoder().decode(readFileSync(new URL("../../../tests/lighting/envmap/sun_light.json", import.meta.url))),
);

describe("the light of a record", () => {
  it.each(STORED)("is that of Python: sun, sky and ground of $record.sun.elevation degrees", (stored) => {
    const { sun, sky, ground } = stored.record;
    const parameters = {
      ...P,
      sun_azimuth: sun.azimuth,
      sun_elevation: sun.elevation,
      turbidity: sky.turbidity,
      exposure: sky.exposure,
      ground_albedo: sky.ground_albedo,
    };
    const stated = {
      ...(sun.irradiance ? { sun: sun.irradiance } : {}),
      ...(sky.irradiance ? { sky: sky.irradiance } : {}),
      ...(ground?.color ? { groundColor: ground.color } : {}),
      ...(sky.cover === undefined ? {} : { cover: sky.cover }),
    };
    const light = renderLight(tables, { parameters, estimated: parameters, stated }, 64);
    expectClose(light.sun, stored.sun);
    expectClose(light.sky, stored.sky);
    expectClose(light.ground, stored.ground);
  });
});

function expectClose(actual: Triple, expected: Triple): void {
  actual.forEach((value, i) => {
    expect(Math.abs(value - (expected[i] as number))).toBeLessThanOrEqual(0.02 * (expected[i] as number) + 1e-9);
  });
}

describe("the sky in the browser", () => {
  it("has the coefficients of the record", () => {
    const { coefficients, radiance } = hosekWilkieSky(tables.hosekWilkie, 33, 3.4, 0.3);
    expectNear(coefficients[0], [-1.07305, -0.14831, 1.20856, 1.09883, -2.47119, 1.00631, 0.225885, 1.26059, 0.692973]);
    expectNear(radiance, [0.0808307, 0.111253, 0.150349]);
  });

  it("is the map of the service, pixel by pixel", () => {
    const { map, sky, sun } = renderLight(tables, { parameters: P, estimated: P, stated: {} }, 64);
    expectNear(pixel(map, 0, 0), [0.0977541, 0.173998, 0.338024]);
    expectNear(pixel(map, 20, 40), [0.645378, 0.783341, 0.962248]);
    expectNear(pixel(map, 31, 100), [0.772792, 0.969318, 1.00184]);
    expectNear(pixel(map, 40, 10), [0.442336, 0.404372, 0.373209], 5e-3);
    expectNear(sky, [0.846854, 1.22553, 1.84393], 5e-3);
    expectNear(sun, [6.95008, 5.52486, 3.79021], 5e-3);
  });

  it("is painted by the Prague model where the record says so", () => {
    const stated = { sun: [3, 2, 1], sky: [0.5, 0.6, 0.9], cover: 0.25 } as SkyRequest["stated"];
    const request = { parameters: P, estimated: P, stated, painted: "prague" };
    const high = renderLight(tables, request, 64);
    expectNear(pixel(high.map, 0, 0), [0.104158, 0.130174, 0.212171], 0.01);
    expectNear(pixel(high.map, 20, 40), [0.306389, 0.337175, 0.45288], 0.01);
    expectNear(pixel(high.map, 31, 100), [0.461801, 0.444484, 0.460969], 0.01);
    expectNear(pixel(high.map, 30, 49), [0.918169, 0.863184, 0.827809], 0.01);
    expectNear(horizontalIrradiance(high.map), [0.5, 0.6, 0.9], 0.01);
    const low = { ...P, sun_elevation: 2, turbidity: 8 };
    const { map } = renderLight(tables, { ...request, parameters: low, estimated: low }, 64);
    expectNear(pixel(map, 0, 0), [0.100486, 0.132794, 0.223185], 0.01);
    expectNear(pixel(map, 30, 49), [1.834382, 1.041162, 0.484811], 0.01);
    expectNear(pixel(map, 31, 100), [0.134077, 0.140352, 0.185818], 0.01);
  });

  it("is that of twilight where the sun is moved below the horizon", () => {
    const stated = { sun: [3, 2, 1], sky: [0.5, 0.6, 0.9], cover: 0.25 } as SkyRequest["stated"];
    const estimated = { ...P, sun_elevation: 10, turbidity: 5 };
    const request = { parameters: { ...estimated, sun_elevation: -3 }, estimated, stated, painted: "prague" };
    const { map, sky, sun } = renderLight(tables, request, 64);
    expect(sun).toEqual([0, 0, 0]);
    expectNear(sky, [0.0104506, 0.0114328, 0.0172583], 0.08);
    expectNear(pixel(map, 30, 49), [0.0360172, 0.0167355, 0.0103836], 0.1);
    expectNear(pixel(map, 0, 0), [0.0021947, 0.0025592, 0.004171], 0.08);
    const plain = renderLight(tables, { ...request, painted: "hosek-wilkie" }, 64);
    expect(pixel(plain.map, 30, 49)).toEqual(pixel(map, 30, 49));
  });

  it("has the sun of a low and of a high elevation", () => {
    expectNear(sunIrradiance(tables.hosekWilkie, 0.1, 2).slice(0, 2), [0.0796472, 0.010731], 0.03);
    expectNear(sunIrradiance(tables.hosekWilkie, 90, 9.5), [1.11112, 0.910308, 0.733481], 5e-3);
  });
});

describe("what a record may state", () => {
  const question = (parts: Partial<SkyRequest>): SkyRequest => ({ parameters: P, estimated: P, stated: {}, ...parts });

  it("is computed once for a photo, for all that its sliders say", () => {
    const stated = { sun: [3, 2, 1], sky: [0.5, 0.6, 0.9], cover: 0.5 } as SkyRequest["stated"];
    const ofPhoto = { estimated: P, stated };
    const base = prepareLight(tables, ofPhoto);
    for (const sun_elevation of [33, 10]) {
      const request = { ...ofPhoto, parameters: { ...P, sun_elevation } };
      expect(renderLight(tables, request, 32, base)).toEqual(renderLight(tables, request, 32));
    }
  });

  it("is kept: irradiances and the ground's colour", () => {
    const stated = {
      sun: [3, 2, 1],
      sky: [0.5, 0.6, 0.9],
      groundColor: [0.2, 0.1, 0.05],
      cover: 0.5,
    } as SkyRequest["stated"];
    const { sky, sun, ground } = renderLight(tables, question({ stated }), 64);
    expectNear(sun, [3, 2, 1], 1e-6);
    expectNear(sky, [0.5, 0.6, 0.9], 0.01);
    expectNear(
      ground,
      [0, 1, 2].map((c) => ((stated.groundColor?.[c] ?? 0) / Math.PI) * ((sky[c] ?? 0) + (sun[c] ?? 0) * 0.544639)),
    );
  });

  it("makes an ordinary sun of a low one that is raised, and gives the low one back", () => {
    const low = { ...P, sun_elevation: 1 };
    const stated = { sun: [15, 10, 1.5] as [number, number, number] };
    const high = renderLight(tables, question({ parameters: { ...P, sun_elevation: 35 }, estimated: low, stated }), 32);
    high.sun.forEach((value, c) => {
      expect(value).toBeGreaterThan(stated.sun[c] as number);
      expect(value).toBeLessThan(25 * (stated.sun[c] as number));
    });
    expectNear(renderLight(tables, question({ parameters: low, estimated: low, stated }), 32).sun, stated.sun, 1e-6);
  });

  it("becomes a sun as strong against the sky as the model's where one is turned on", () => {
    const estimated = { ...P, sun: false };
    const stated = { sun: [1e-5, 1e-5, 1e-5], sky: [0.5, 0.6, 0.9], cover: 0.9 } as SkyRequest["stated"];
    const model = renderLight(tables, question({}), 32);
    const lit = renderLight(tables, { parameters: P, estimated, stated }, 32);
    const strength = ({ sun, sky }: SceneLight): number => rgbLuminance(sun) / rgbLuminance(sky);
    expect(strength(lit) / strength(model)).toBeCloseTo(1, 1);
    expectNear(lit.sky, [0.5, 0.6, 0.9], 0.01);
    expect(renderLight(tables, { parameters: estimated, estimated, stated }, 32).sun).toEqual([0, 0, 0]);
  });

  it("leaves the photo exposed where a low sun is raised", () => {
    const estimated = { ...P, sun_elevation: 1 };
    const stated = { sun: [1, 0.6, 0.2], sky: [0.5, 0.6, 0.9], cover: 0.5 } as SkyRequest["stated"];
    const { sky, map } = renderLight(tables, { parameters: P, estimated, stated }, 32);
    expect(rgbLuminance(sky)).toBeCloseTo(2 * rgbLuminance([0.5, 0.6, 0.9]));
    expectNear(horizontalIrradiance(map), sky, 0.01);
  });

  it("holds its ratio when a slider moves", () => {
    const before = renderLight(tables, question({}), 32);
    const stated = { sun: before.sun.map((value) => 2 * value) as [number, number, number] };
    const moved = { ...P, sun_elevation: 60 };
    const free = renderLight(tables, question({ parameters: moved }), 32);
    expectNear(
      renderLight(tables, question({ parameters: moved, stated }), 32).sun,
      free.sun.map((value) => 2 * value),
      1e-6,
    );
  });

  it("may be an overcast sky, brightest overhead, of the same irradiance", () => {
    const shape = hosekWilkieSky(tables.hosekWilkie, 33, 3.4, 0.3);
    const painting = { azimuth: 0, elevation: 33, gain: [1, 1, 1] as [number, number, number] };
    const clear = renderHosekWilkieSky(64, shape, { ...painting, cover: 0 });
    const grey = renderHosekWilkieSky(64, shape, { ...painting, cover: 1 });
    const [zenith = 0, edge = 0] = [pixel(grey, 0, 0)[1], pixel(grey, 31, 0)[1]];
    expect(zenith / edge).toBeGreaterThan(2.7);
    const grade = ([r, g, b]: number[]): number => 0.2126 * (r ?? 0) + 0.7152 * (g ?? 0) + 0.0722 * (b ?? 0);
    expectNear([grade(horizontalIrradiance(grey))], [grade(horizontalIrradiance(clear))], 5e-3);
  });
});

describe("the ground", () => {
  it("has its colour and follows the light", () => {
    const [dim, bright] = [P, { ...P, exposure: 2 * P.exposure }].map((parameters) =>
      renderLight(tables, { parameters, estimated: P, stated: { groundColor: [0.2, 0.15, 0.1] } }, 32),
    ) as [ReturnType<typeof renderLight>, ReturnType<typeof renderLight>];
    expectNear(
      bright.ground,
      dim.ground.map((value) => 2 * value),
      1e-6,
    );
    expectNear(pixel(dim.map, 20, 5), dim.ground, 1e-6);
  });
});

describe("the map's picture", () => {
  it("shows the sun where it is, and nothing brighter", () => {
    const light = renderLight(tables, { parameters: P, estimated: P, stated: {} }, 64);
    const { data } = toneMap(light, P);
    const column = Math.floor(((P.sun_azimuth + 180) / 360) * 128);
    const row = Math.floor(((90 - P.sun_elevation) / 180) * 64);
    expect([...data.slice(4 * (row * 128 + column), 4 * (row * 128 + column) + 3)]).toEqual([255, 255, 255]);
    expect(direction(P.sun_azimuth, P.sun_elevation)[1]).toBeCloseTo(0.5446, 3);
  });
});

describe("a table", () => {
  it("of another length is refused", () => {
    expect(() => parseHosekWilkieTable(new ArrayBuffer(100))).toThrow("another length");
    expect(() => parsePragueTable(new ArrayBuffer(100))).toThrow("another length");
  });
});

describe("a light in the artist's hands", () => {
  const lit = (part: Partial<typeof P>) =>
    renderLight(tables, { parameters: { ...P, ...part }, estimated: P, stated: { cover: 0.2 } }, 32);

  it("is softer without its sun, which the sky gives back in part", () => {
    const [hard, soft, none] = [lit({}), lit({ softness: 0.5 }), lit({ softness: 1 })];
    expectNear(
      soft.sun,
      hard.sun.map((value) => value / 2),
    );
    expect(none.sun).toEqual([0, 0, 0]);
    expect(none.sky[1]).toBeGreaterThan(hard.sky[1]);
    expectNear(horizontalIrradiance(none.map), none.sky, 0.01);
    const level = (light: SceneLight): number => light.sky[1] + light.sun[1] * Math.sin((33 * Math.PI) / 180);
    expect(level(none)).toBeLessThan(level(hard));
  });

  it("is warmer and as bright", () => {
    const [before, warm] = [lit({}).sun, lit({ warmth: 1 }).sun];
    expect(warm[2] / warm[0] / (before[2] / before[0])).toBeCloseTo(2 ** -1.5);
    expect(rgbLuminance(warm)).toBeCloseTo(rgbLuminance(before));
  });
});

describe("the map that the service exports", () => {
  const map = (value: number): Latlong => ({ width: 64, height: 32, data: new Float32Array(4 * 64 * 32).fill(value) });

  it("lights the object without the sun's disc", () => {
    const exported = map(0.5);
    const at = { sun_azimuth: 2.8, sun_elevation: 30.9 };
    const sun = 4 * (10 * 64 + 32);
    exported.data.set([900, 800, 700], sun);
    const without = removeDisc(exported, { ...P, ...at });
    expect([...without.data.slice(sun, sun + 3)]).toEqual([0.5, 0.5, 0.5]);
    expect(removeDisc(exported, { ...P, ...at, sun: false })).toBe(exported);
    expect(exported.data[sun]).toBe(900);
  });

  it("follows a light that changes as the bare map does", () => {
    const followed = followLight(map(0.25), { before: map(2), now: map(3) });
    expect(followed.data[0]).toBeCloseTo(0.375);
    expect(followLight(map(1), { before: map(0), now: map(5) }).data[0]).toBe(20);
  });
});

describe("a coarse map", () => {
  it("has the mean of each four pixels", () => {
    const data = Float32Array.from({ length: 32 }, (_, i) => (i % 4) + 10 * Math.floor(i / 4)); // two rows of four pixels
    expect(halveMap({ width: 4, height: 2, data })).toEqual({
      width: 2,
      height: 1,
      data: Float32Array.of(25, 26, 27, 28, 45, 46, 47, 48),
    });
  });
});

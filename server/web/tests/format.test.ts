import { describe, expect, it } from "vitest";
import type { Estimate, Irradiances, Lighting, LightParameters } from "../src/api";
import type { Triple } from "../src/geometry/color";
import { buildRecord, parametersFromRecord, sameParameters } from "../src/state";
import {
  buildHeadline,
  colorTemperature,
  describeColor,
  describeExposure,
  describeHaze,
  describeHeight,
  describeRotation,
  describeShadows,
  estimateRows,
  explainAccuracy,
  formatAzimuth,
  formatFactor,
  formatMatching,
  formatPercent,
  formatRotation,
  formatShort,
  formatSide,
} from "../src/text/format";
import { describeBelievedTime, describeCameraTilt } from "../src/text/metadata";

const RECORD: Lighting = {
  model: { name: "outdoor", version: "1.0.0" },
  sun: {
    azimuth: 54,
    elevation: 24.2,
    direction: [0.738, 0.41, -0.536],
    visibility: 0.97,
    radius_50: 9.54,
    radius_90: 25,
  },
  sky: { model: "hosek-wilkie", turbidity: 4.5, ground_albedo: 0.3, exposure: 10.4567, coefficients: { r: [1] } },
  camera: { elevation: -3.6, roll: -0.04, vertical_fov: 63.1 },
  evidence: ["pixels", "time+place"],
  warnings: [],
};

const ESTIMATE: Estimate = {
  ...RECORD,
  links: { envmap: "v1/envmap" },
  probability: { grid: "rings:1x1", azimuth: [0], elevation: [45], probability: [1] },
};

describe("words", () => {
  it("say where the sun is", () => {
    expect([0.4, -41.2, 54, -120, 179.7, 90.4].map(formatAzimuth)).toEqual([
      "straight ahead",
      "41° left",
      "54° right",
      "120° left (behind)",
      "straight behind",
      "90° right",
    ]);
  });

  it("round numbers as far as they mean something", () => {
    expect([9.94, 9.96, 25.4].map(formatShort)).toEqual(["9.9", "10", "25"]);
    expect([0, 0.0002, 0.004, 0.32, 1].map(formatPercent)).toEqual([
      "0\u00a0%",
      "<\u00a00.1\u00a0%",
      "0.4\u00a0%",
      "32\u00a0%",
      "100\u00a0%",
    ]);
    expect([10.4567, 0.0213, 1234].map(formatFactor)).toEqual(["10.5", "0.0213", "1230"]);
  });

  it("explain why this photo's radius and the usual error differ", () => {
    const text = explainAccuracy(RECORD, { sun_azimuth_median: 24.8 });
    expect(text).toContain("The 9.5° are for this photo");
    expect(text).toContain("surer than most");
    expect(
      explainAccuracy({ ...RECORD, sun: { ...RECORD.sun, radius_50: 40 } }, { sun_azimuth_median: 24.8 }),
    ).toContain("no surer than most");
    expect(explainAccuracy(RECORD, {})).toBe("");
  });

  it("name the numbers, with their errors where these are known", () => {
    const rows = estimateRows(RECORD, { camera_elevation_median: 3.4 });
    expect(rows.find(({ name }) => name === "Camera elevation")).toEqual({
      name: "Camera elevation",
      value: "3.6° down",
      medianError: "± 3.4°",
    });
    expect(rows.find(({ name }) => name === "Camera roll")).toEqual({ name: "Camera roll", value: "0.0°" });
    const level = estimateRows({ ...RECORD, camera: { ...RECORD.camera, elevation: -0.04 } }, {});
    expect(level.find(({ name }) => name === "Camera elevation")).toEqual({
      name: "Camera elevation",
      value: "0.0° up",
    });
  });
});

describe("the headline", () => {
  const titleFor = (sun: Partial<Lighting["sun"]>, rest: Partial<Lighting> = {}): string =>
    buildHeadline({ ...RECORD, ...rest, sun: { ...RECORD.sun, ...sun } }).title;

  it("is as soft as the answer", () => {
    expect(titleFor({ radius_50: 6 })).toBe("Sun 54° right, 24° high");
    expect(titleFor({ radius_50: 12 })).toBe("Sun about 54° right, 24° high");
    expect(titleFor({ radius_50: 30, azimuth: 95 })).toBe("Sun probably right of the camera");
    expect(titleFor({ radius_50: 60 })).toBe("The sun shines, but from where is hard to tell");
    expect(buildHeadline(RECORD).text).toBe("");
  });

  it("says when no sun is to be seen", () => {
    expect(titleFor({ visibility: 0.2 })).toBe("No direct sun");
    expect(titleFor({ visibility: 0.4 })).toBe("Probably no direct sun");
    const { text } = buildHeadline({ ...RECORD, sun: { ...RECORD.sun, visibility: 0.2 } });
    expect(text).toContain("is 80\u00a0% likely. If the sun shone, it would be ahead, to the right, at half height.");
  });

  it("says when the photo is none of outdoor daylight, where the service tells", () => {
    expect(titleFor({}, { suitable: 0.2 })).toBe("This does not look like an outdoor daylight photo");
    expect(titleFor({ radius_50: 6 }, { suitable: 0.9 })).toBe("Sun 54° right, 24° high");
  });

  it("names every side", () => {
    expect([0, 40, -90, 130, -179].map(formatSide)).toEqual([
      "in front of the camera",
      "ahead, to the right",
      "left of the camera",
      "behind the camera, to the right",
      "behind the camera",
    ]);
  });
});

describe("when the photo was taken", () => {
  it("is told on the believed clock, with where that comes from", () => {
    const time = { utc: "2024-06-01T16:49:00Z", utc_offset: 2, source: "zone of the place" };
    const value = "2024-06-01 18:49:00 +02:00 (zone of the place)";
    expect(describeBelievedTime({ ...RECORD, time })).toEqual([{ name: "Taken", value }]);
    const early = { utc: "2025-09-14T02:18:00Z", utc_offset: -9.5 };
    expect(describeBelievedTime({ ...RECORD, time: early })[0]?.value).toBe("2025-09-13 16:48:00 -09:30");
  });

  it("is left out where no zone is known", () => {
    expect(describeBelievedTime(RECORD)).toEqual([]);
  });
});

describe("how the camera was held", () => {
  const gravity = { ...RECORD, evidence: ["pixels", "gravity"] };

  it("is told as the answer has it where the file says it", () => {
    const value = "looks 4° down with a roll of 0°, by the file and the picture";
    expect(describeCameraTilt(gravity)).toEqual([{ name: "Tilt", value }]);
    const up = { ...gravity, camera: { ...RECORD.camera, elevation: 12.4, roll: -2.6 } };
    expect(describeCameraTilt(up)[0]?.value).toBe("looks 12° up with a roll of -3°, by the file and the picture");
  });

  it("is not used where the picture contradicts it, by the code of a warning", () => {
    const contradicted = { ...RECORD, warnings: ["Another one.", "It looks up."] };
    const warning_codes = ["other", "gravity-contradicted"];
    const value = "not used, see the warning";
    expect(describeCameraTilt({ ...contradicted, warning_codes })).toEqual([{ name: "Tilt", value }]);
  });

  it("is left out where the file does not say it", () => {
    expect(describeCameraTilt(RECORD)).toEqual([]);
  });
});

describe("light in words", () => {
  const irradiances = (sun: Triple, sky: Triple) => ({ sun, sky });
  const light = { sun_elevation: 90 } as LightParameters;

  it("names the height of the sun and the haze", () => {
    expect([-2, 3, 10, 24, 50, 80].map((elevation) => describeHeight(elevation).text)).toEqual([
      ...["below the horizon", "on the horizon", "low", "medium", "high", "overhead"],
    ]);
    expect(describeHaze(6.5)).toEqual({ text: "hazy", hint: "" });
  });

  it("counts the exposure from the photo's", () => {
    expect(describeExposure(5, 5)).toEqual({ text: "as shot", hint: "0.0 EV" });
    expect(describeExposure(10, 5)).toEqual({ text: "brighter", hint: "+1.0 EV" });
    expect(describeExposure(2.5, 5)).toEqual({ text: "darker", hint: "−1.0 EV" });
  });

  it("knows white, and illuminants A and D75", () => {
    expect(colorTemperature([1, 1, 1])).toBeCloseTo(6504, -1.5);
    expect(Math.abs((colorTemperature([1.9088, 0.8297, 0.2259]) ?? 0) - 2856)).toBeLessThan(60);
    expect(colorTemperature([0, 0, 0])).toBeUndefined();
    expect(describeColor(irradiances([1, 1, 1], [0, 0, 0]))).toEqual({ text: "neutral", hint: "6500\u00a0K" });
    expect(describeColor(irradiances([0, 0, 0], [0.6, 0.8, 1.4])).text).toMatch(/^sky light: /);
  });

  it("says how hard shadows are", () => {
    const shadows = (sun: number) => describeShadows(irradiances([sun, sun, sun], [1, 1, 1]), light);
    expect(shadows(0)).toEqual({ text: "none", hint: "0.0 stops darker" });
    expect(shadows(1)).toEqual({ text: "soft", hint: "1.0 stops darker" });
    expect(shadows(7)).toEqual({ text: "hard", hint: "3.0 stops darker" });
  });
});

describe("the turns of several photos", () => {
  const rotatedLighting = (relative_heading: number, evidence: string[], warnings: string[] = []): Lighting => ({
    ...RECORD,
    ...{ evidence, warnings, camera: { ...RECORD.camera, relative_heading } },
    warning_codes: warnings.map((warning) => (warning === guessed ? "turn-inferred" : "other")),
  });
  const matched = ["pixels", "turns", "other photos"];
  const guessed = "The service says so in any words.";

  it("are told as the photos show them", () => {
    expect(formatRotation(rotatedLighting(32.13, matched), 1)).toBe("32° right of photo 1");
    expect(formatRotation(rotatedLighting(340, matched), 1)).toBe("20° left of photo 1");
    expect(formatRotation(rotatedLighting(359.9, matched), 1)).toBe("as photo 1");
    expect(formatRotation(rotatedLighting(0, matched), 0)).toBe("");
    expect(describeRotation(rotatedLighting(32.13, matched), 1)).toMatch(
      /in common: this one 32\.1° right of photo 1\.$/,
    );
    expect(describeRotation(rotatedLighting(0, matched), 0)).toMatch(/in common\.$/);
  });

  it("are promised where the service matches photos, and only there", () => {
    expect(formatMatching(true)).toContain("in common");
    expect(formatMatching(false)).toContain("does not compare their pixels");
  });

  it("are a guess where nothing in common says them", () => {
    expect(formatRotation(rotatedLighting(57, ["pixels", "other photos"], [guessed]), 1)).toBe(
      "perhaps 57° right of photo 1",
    );
    expect(describeRotation(rotatedLighting(57, ["pixels", "other photos"], [guessed]), 1)).toBe(guessed);
    expect(formatRotation(rotatedLighting(244, matched, [guessed]), 2)).toBe("perhaps 116° left of photo 1");
    expect(describeRotation(rotatedLighting(244, matched, ["Its heading is off.", guessed]), 2)).toBe(guessed);
  });

  it("are left out where the headings were given", () => {
    expect([formatRotation(RECORD, 1), describeRotation(RECORD, 1)]).toEqual(["", ""]);
  });
});

describe("the record on show", () => {
  const parameters = parametersFromRecord(RECORD);
  const irradiances: Irradiances = { sun: [3, 2, 1], sky: [1, 2, 3] };

  it("is the estimate's own until something is changed", () => {
    expect(sameParameters(parameters, parametersFromRecord(RECORD))).toBe(true);
    const answer = { ...ESTIMATE, warning_codes: [] };
    expect(buildRecord(answer, parameters, irradiances)).toEqual(RECORD);
  });

  it("leaves out what no longer follows when it is edited", () => {
    const edited = buildRecord(ESTIMATE, { ...parameters, sun_azimuth: 90, sun_elevation: 0, sun: false }, irradiances);
    expect(edited.sky).not.toHaveProperty("coefficients");
    expect(edited.sun.visibility).toBe(0);
    expect(edited.sun.direction.map(Math.round)).toEqual([1, 0, -0]);
    expect(edited.camera).toEqual(RECORD.camera);
    expect(edited.evidence).toEqual([]);
  });

  it("has no direct sun once the sun is set below the horizon", () => {
    expect(buildRecord(ESTIMATE, { ...parameters, sun_elevation: -3, sun: true }, irradiances).sun.visibility).toBe(0);
  });

  it("carries no radii and no visibility of the estimate once it is edited", () => {
    const { sun } = buildRecord(ESTIMATE, { ...parameters, sun_azimuth: 90 }, irradiances);
    const probed = { ...ESTIMATE, light_probe: { coefficients: [] } };
    expect(buildRecord(probed, { ...parameters, sun_azimuth: 90 }, irradiances)).not.toHaveProperty("light_probe");
    expect(Object.keys(sun).sort()).toEqual(["azimuth", "direction", "elevation", "visibility"]);
    expect(sun.visibility).toBe(1);
  });

  it("states the power of the light on show where the estimate states one", () => {
    const sky = { ...RECORD.sky, cover: 0.3, irradiance: [9, 9, 9] as [number, number, number] };
    const edited = buildRecord({ ...ESTIMATE, sky }, { ...parameters, turbidity: 5 }, irradiances);
    expect([edited.sun.irradiance, edited.sky.irradiance, edited.sky.cover]).toEqual([
      irradiances.sun,
      irradiances.sky,
      0.3,
    ]);
    expect(buildRecord(ESTIMATE, { ...parameters, turbidity: 5 }, irradiances).sky).not.toHaveProperty("irradiance");
  });
});

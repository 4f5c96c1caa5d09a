import { describe, expect, it } from "vitest";
import type { Estimate, Lighting } from "../src/api";
import { isSame, parametersOf, recordOf } from "../src/parameters";
import { azimuthWords, factor, headline, numbers, percent, short } from "../src/pure/words";

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
    expect([0.4, -41.2, 54, -120, 179.7, 90.4].map(azimuthWords)).toEqual([
      "straight ahead",
      "41° left",
      "54° right",
      "120° left (behind)",
      "straight behind",
      "90° right",
    ]);
  });

  it("round numbers as far as they mean something", () => {
    expect([9.94, 9.96, 25.4].map(short)).toEqual(["9.9", "10", "25"]);
    expect([0, 0.0002, 0.004, 0.32, 1].map(percent)).toEqual([
      "0\u00a0%",
      "<\u00a00.1\u00a0%",
      "0.4\u00a0%",
      "32\u00a0%",
      "100\u00a0%",
    ]);
    expect([10.4567, 0.0213, 1234].map(factor)).toEqual(["10.5", "0.0213", "1230"]);
  });

  it("head a sunny photo with the sun, another without", () => {
    expect(headline(RECORD).title).toBe("Sun 54° right, 24° high");
    expect(headline(RECORD).text).toContain("within 9.5°, 90\u00a0% within 25°");
    const grey = headline({ ...RECORD, sun: { ...RECORD.sun, visibility: 0.2 } });
    expect(grey.title).toBe("No direct sun");
    expect(grey.text).toContain("54° right, 24° high");
  });

  it("name the numbers, with their errors where these are known", () => {
    const rows = numbers(RECORD, { camera_elevation_median: 3.4 });
    expect(rows.find(({ name }) => name === "Camera elevation")).toEqual({
      name: "Camera elevation",
      value: "3.6° down",
      note: "± 3.4°",
    });
    expect(rows.find(({ name }) => name === "Camera roll")).toEqual({ name: "Camera roll", value: "0.0°" });
  });
});

describe("the record on show", () => {
  const asked = parametersOf(RECORD);

  it("is the estimate's own until something is changed", () => {
    expect(isSame(asked, parametersOf(RECORD))).toBe(true);
    expect(recordOf(ESTIMATE, asked)).toEqual(RECORD);
  });

  it("leaves out what no longer follows when it is edited", () => {
    const edited = recordOf(ESTIMATE, { ...asked, sun_azimuth: 90, sun_elevation: 0, sun: false });
    expect(edited.sky).not.toHaveProperty("coefficients");
    expect(edited.sun.visibility).toBe(0);
    expect(edited.sun.direction.map(Math.round)).toEqual([1, 0, -0]);
    expect(edited.camera).toEqual(RECORD.camera);
    expect(edited.evidence).toEqual([]);
  });

  it("keeps the estimated visibility when only the sky is edited", () => {
    expect(recordOf(ESTIMATE, { ...asked, turbidity: 2 }).sun.visibility).toBe(0.97);
  });
});

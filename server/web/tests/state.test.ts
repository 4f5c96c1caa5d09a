import { readFileSync } from "node:fs";
import { describe, expect, it } from "vitest";
import type { Estimate, Irradiances, Lighting, PhotoMetadata } from "../src/api";
import { combine, type Vector } from "../src/geometry/angles";
import type { Camera, Point } from "../src/geometry/camera";
import {
  cameraHeight,
  footPoint,
  groundDistance,
  groundMaskFromPixels,
  groundPoint,
  initialPlacement,
  isInSun,
  maxRadius,
  movePlacement,
  type Placement,
  resizePlacement,
  rotatePlacement,
  shiftPlacement,
} from "../src/geometry/placement";
import { History } from "../src/history";
import { imagePart, type Photo } from "../src/photo";
import {
  buildRecord,
  cameraOf,
  cameraOverrides,
  createView,
  currentState,
  type EditState,
  overridesFromParameters,
  type PhotoView,
  parametersFromRecord,
  statedOverrides,
} from "../src/state";
import {
  describeBorrowed,
  describeMetadata,
  fillForm,
  formatEvidence,
  NO_USER_INPUT,
  readForm,
  userInputQuery,
} from "../src/text/metadata";
import { type SnippetInput, writeCurl, writePython } from "../src/text/snippets";
import {
  findCities,
  formatLocation,
  locationOfPoint,
  moveLocation,
  parseCities,
  pointOfLocation,
} from "../src/views/location";

const CAMERA = { elevation: 4.1, roll: -7.5, vertical_fov: 48.7 };
const METADATA: PhotoMetadata = {
  time: "2024-08-10T17:27:34",
  gps_time: "2024-08-10T15:27:34+00:00",
  latitude: 41.9010055,
  longitude: -12.4795,
  heading: 87.4,
  heading_reference: "magnetic",
  focal_length: 20,
};

describe("the part of a picture that is shown", () => {
  const crop = { left: 0, top: 131, width: 1920, height: 818, picture_width: 1920, picture_height: 1080 };

  it("is all of it without a border", () => {
    expect(imagePart(undefined, 640, 480)).toEqual({ left: 0, top: 0, width: 640, height: 480 });
  });

  it("is what lies inside the border", () => {
    expect(imagePart(crop, 1920, 1080)).toEqual({ left: 0, top: 131, width: 1920, height: 818 });
  });

  it("is the same part of an image of another size", () => {
    expect(imagePart(crop, 960, 540)).toEqual({ left: 0, top: 65.5, width: 960, height: 409 });
  });
});

describe("what a photo says", () => {
  it("is told in words, without what it does not say", () => {
    expect(describeMetadata(METADATA).map(({ value }) => value)).toEqual([
      "2024-08-10 17:27:34 (time zone by GPS)",
      "41.9010°\u00a0N, 12.4795°\u00a0W",
      "87° from magnetic north",
      "20 mm (as of a 35 mm camera)",
    ]);
    expect(describeMetadata({})).toEqual([]);
    expect(describeMetadata({ camera_height: 42, utc_offset: 2 })).toEqual([
      { name: "Camera height", value: "42\u00a0m above the ground" },
    ]);
    const zoned = { time: "2024-08-10T17:27:34", utc_offset: -3.5 };
    expect(describeMetadata(zoned)[0]?.value).toBe("2024-08-10 17:27:34 -03:30");
    expect(describeMetadata({ gps_time: METADATA.gps_time as string })[0]?.value).toBe("2024-08-10 15:27:34 UTC");
  });

  it("may come from another photo", () => {
    const evidence = ["pixels", "time+place"];
    const rows = describeBorrowed(evidence, NO_USER_INPUT, { time: "2024-08-10T17:27:34" }, [METADATA]);
    expect(rows).toEqual([{ name: "Place", value: "from another photo" }]);
    expect(describeBorrowed(evidence, { ...NO_USER_INPUT, latitude: "1", time: "x" }, {}, [METADATA])).toEqual([]);
    expect(describeBorrowed(["pixels"], NO_USER_INPUT, {}, [METADATA])).toEqual([]);
  });

  it("fills the form, and only what was changed is given", () => {
    const metadata = { ...METADATA, camera_height: 3 };
    const form = fillForm(metadata, NO_USER_INPUT);
    expect(form.camera_height).toBe("3");
    expect(readForm({ ...form, camera_height: "2" }, metadata)).toEqual({ ...NO_USER_INPUT, camera_height: "2" });
    expect([form.time, form.latitude, form.heading]).toEqual(["2024-08-10T17:27:34", "41.90101", "87.4"]);
    expect(readForm(form, metadata)).toEqual(NO_USER_INPUT);
    expect(readForm({ ...form, latitude: "42" }, metadata)).toEqual({
      ...NO_USER_INPUT,
      latitude: "42",
      longitude: "-12.4795",
    });
    expect(readForm({ ...form, metadata: false }, metadata).time).toBe("2024-08-10T17:27:34");
  });

  it("was used, in words", () => {
    expect(formatEvidence(["pixels", "time+place", "heading"])).toBe(
      "Used: the picture itself, time and place (where the sun was then), the compass heading.",
    );
    expect(formatEvidence(["pixels", "gravity"])).toBe("Used: the picture itself, how the camera was held.");
    expect(formatEvidence(["something new"])).toBe("Used: something new.");
  });

  it("goes to the service under its own names", () => {
    const userInput = { ...NO_USER_INPUT, time: "2024-06-01T14:30", utc_offset: "+02:00", headings: "0,45" };
    expect(userInputQuery(userInput, 1).toString()).toBe("time=2024-06-01T14%3A30&utc_offset=%2B02%3A00");
  });
});

describe("undo", () => {
  it("takes back what was done in one go, one by one otherwise", () => {
    let time = 0;
    const history = new History("a", () => time);
    history.push("b", "slide");
    time = 100;
    history.push("c", "slide");
    history.push("d", "click");
    time = 2000;
    history.push("e", "click");
    expect([history.undo(), history.undo(), history.undo(), history.canUndo]).toEqual(["d", "c", "a", false]);
    expect([history.undo(), history.redo(), history.redo()]).toEqual(["a", "c", "d"]);
    history.push("f", "click");
    expect([history.canRedo, history.undo()]).toEqual([false, "d"]);
  });

  it("takes a gesture back in one step, whatever its pauses, and each gesture alone", () => {
    let time = 0;
    const history = new History("a", () => time);
    for (const [state, gesture] of [
      ["b", 1],
      ["c", 1],
      ["d", 1],
      ["e", 2],
      ["f", 0],
      ["g", 0],
    ] as const) {
      time += state === "c" ? 5000 : 10;
      history.push(state, "slide", gesture);
    }
    expect([history.undo(), history.undo(), history.undo(), history.canUndo]).toEqual(["e", "d", "a", false]);
  });
});

describe("the object's place", () => {
  const spot = (camera: Camera): Vector => {
    const ray = groundPoint(camera, 4 / 3, [0.5, 0.9]) as Vector;
    return combine([1 / Math.hypot(...ray), ray]);
  };
  const nearPlacement = initialPlacement(CAMERA, 4 / 3, spot(CAMERA));

  it("is on the spot that the record states, below the camera", () => {
    const high = { ...CAMERA, height: 5 };
    expect(initialPlacement(high, 4 / 3, spot(high)).position[1]).toBeCloseTo(-5);
    expect(nearPlacement.grounded).toBe(true);
    expect(nearPlacement.position[1]).toBeCloseTo(-1.6);
    const foot = footPoint(nearPlacement, CAMERA, 4 / 3);
    expect(foot?.[0]).toBeCloseTo(0.5);
    expect(foot?.[1]).toBeCloseTo(0.9);
  });

  it("is where the scenes of the service have it", () => {
    const file = readFileSync(new URL("../../../tests/lighting/scene/spot.json", import.meta.url));
    const { camera, aspect, shares, point } = JSON.parse(new TextDecoder().decode(file)) as {
      camera: Camera;
      aspect: number;
      shares: Point;
      point: number[];
    };
    const groundHit = groundPoint(camera, aspect, shares) ?? [];
    expect(groundHit.map((metres) => metres.toFixed(4))).toEqual(point.map((metres) => metres.toFixed(4)));
    expect(point[1]).toBe(-cameraHeight(camera));
  });

  it("keeps its size in metres when it moves, so that it shrinks with distance", () => {
    const far = movePlacement(nearPlacement, CAMERA, 4 / 3, [0.5, 0.7]);
    expect(far?.radius).toBe(nearPlacement.radius);
    expect(groundDistance(far as typeof nearPlacement)).toBeGreaterThan(2 * groundDistance(nearPlacement));
    expect(movePlacement(nearPlacement, CAMERA, 4 / 3, [0.5, 0.2])).toBeNull();
    expect(groundPoint({ elevation: 0, roll: 0, vertical_fov: 50 }, 1, [0.5, 0.51])).toBeNull();
  });

  it("is afloat before a camera that sees no ground", () => {
    const floating = initialPlacement({ elevation: 50, roll: 0, vertical_fov: 40 }, 1, null);
    expect(floating.grounded).toBe(false);
    expect(Math.hypot(...floating.position)).toBeCloseTo(4);
    expect(movePlacement(floating, CAMERA, 1, [0.5, 0.1])?.grounded).toBe(false);
    const down = movePlacement(floating, CAMERA, 1, [0.5, 0.9]);
    expect([down?.grounded, down?.position[1]]).toEqual([true, -1.6]);
  });

  it("is shifted, turned and scaled within bounds", () => {
    expect(shiftPlacement(nearPlacement, 0, -1000).position[2]).toBeCloseTo(-0.3);
    expect(rotatePlacement({ ...nearPlacement, rotation: 175 }, 10).rotation).toBeCloseTo(-175);
    expect(resizePlacement({ ...nearPlacement, position: [0, -1.6, -80] }, 1e9).radius).toBe(20);
  });

  it("never comes so near that it takes more than 60 degrees of the view", () => {
    for (const placement of [
      nearPlacement,
      shiftPlacement(nearPlacement, 0, -1000),
      shiftPlacement(nearPlacement, 3, 20),
    ]) {
      const { position, radius } = resizePlacement(placement, 1e9);
      expect(radius).toBe(maxRadius(placement));
      expect(Math.hypot(position[0], position[1] + radius, position[2]) / radius).toBeCloseTo(2);
    }
    const grown = resizePlacement(shiftPlacement(nearPlacement, 0, 50), 1e9);
    expect(maxRadius(shiftPlacement(grown, 0, -45))).toBe(shiftPlacement(grown, 0, -45).radius);
    expect(movePlacement(grown, CAMERA, 4 / 3, [0.5, 0.9])?.radius).toBe(maxRadius(nearPlacement));
  });
});

describe("a gesture under way", () => {
  const parameters = { sun_azimuth: 10, sun_elevation: 30, turbidity: 3, exposure: 1 } as EditState["parameters"];
  const placement = initialPlacement(CAMERA, 1.5, [0, -0.3, -0.954]);
  const view = {
    photo: { picture: { width: 300, height: 200 } },
    estimate: { camera: CAMERA },
    history: new History({ parameters, placement } as EditState),
  } as PhotoView;

  it("turns the sun alone, and leaves the history as it is", () => {
    const shown = currentState({ ...view, live: { parameters: { sun_azimuth: 70 } } });
    expect(shown.parameters).toEqual({ ...parameters, sun_azimuth: 70 });
    expect(view.history.canUndo).toBe(false);
    expect(currentState(view).parameters).toBe(parameters);
  });

  it("tilts the camera under an object that stays where the photo shows it", () => {
    const live = { ...view, live: { camera: { ...CAMERA, elevation: -3 } } };
    expect(cameraOf(live).elevation).toBe(-3);
    const [x, y] = footPoint(placement, CAMERA, 1.5) as Point;
    const shown = currentState(live).placement;
    expect(footPoint(shown, cameraOf(live), 1.5)).toEqual([expect.closeTo(x, 9), expect.closeTo(y, 9)]);
    expect(shown.position).not.toEqual(placement.position);
  });
});

describe("another answer about a photo", () => {
  const record = (azimuth: number): Estimate =>
    ({
      sun: { azimuth, elevation: 30, visibility: 1 },
      sky: { turbidity: 3, exposure: 2, ground_albedo: 0.3 },
      camera: CAMERA,
    }) as Estimate;
  const photo = { picture: { width: 300, height: 200 } } as unknown as Photo;
  const edited = (): PhotoView => {
    const view = createView(photo, record(10), NO_USER_INPUT, false);
    const { parameters } = view.history.state;
    view.history.push({ ...view.history.state, parameters: { ...parameters, sun_azimuth: -80, exposure: 4 } }, "sun");
    return view;
  };
  const parametersAfter = (said: Partial<typeof NO_USER_INPUT>): EditState["parameters"] =>
    currentState(createView(photo, record(20), { ...NO_USER_INPUT, ...said }, false, edited())).parameters;

  it("keeps what was done to the light where the camera alone was corrected", () => {
    expect(parametersAfter({ horizon: "1,2,3,4" })).toMatchObject({ sun_azimuth: -80, sun_elevation: 30, exposure: 4 });
  });

  it("keeps the object's meters where a size was said, and shows it smaller from higher up", () => {
    const ground = { spot: { pixel: [150, 150], direction: [0, -0.3, -0.954] } } as Estimate["ground"];
    const low = createView(photo, { ...record(10), ground } as Estimate, NO_USER_INPUT, false);
    const tall: Estimate = { ...record(10), ground, camera: { ...CAMERA, height: 4.8 } } as Estimate;
    const placementBy = (said: Partial<typeof NO_USER_INPUT>): Placement =>
      currentState(createView(photo, tall, { ...NO_USER_INPUT, ...said }, false, low)).placement;
    const { radius, position } = currentState(low).placement;
    const sized = placementBy({ reference: "1,2,3,4,6" });
    expect(sized.radius).toBe(radius);
    expect(sized.position[2] / position[2]).toBeCloseTo(4.8 / 1.6, 6);
    expect(placementBy({ vertical_fov: "50" }).radius).toBeGreaterThan(radius); // as large as looks well
  });

  it("shows its own sun where more is known of that", () => {
    expect(parametersAfter({ horizon: "1,2,3,4", shadow: "1,2,3,4" })).toMatchObject({ sun_azimuth: 20, exposure: 2 });
  });
});

describe("the light on show as text", () => {
  const subject: SnippetInput = {
    origin: "http://127.0.0.1:8000/",
    photo: "it's.jpg",
    userInput: {
      ...NO_USER_INPUT,
      time: "2024-06-01T14:30",
      utc_offset: "+02:00",
      latitude: "48.14",
      longitude: "11.58",
    },
    overrides: undefined,
    adjustments: undefined,
    height: 512,
    keyed: false,
  };
  const light = {
    sun_azimuth: -41.2,
    sun_elevation: 33,
    turbidity: 3,
    exposure: 5,
    ground_albedo: 0.3,
    sun: false,
    warmth: 0,
    softness: 0,
  };
  const movedInput = { ...subject, overrides: overridesFromParameters(light) };

  it("is a curl command", () => {
    expect(writeCurl(subject)).toBe(
      `curl -f -F 'photo=@"it'\\''s.jpg"' 'http://127.0.0.1:8000/v1/envmap?time=2024-06-01T14%3A30&` +
        `utc_offset=%2B02%3A00&latitude=48.14&longitude=11.58&height=512' -o 'it'\\''s.exr'`,
    );
    expect(writeCurl({ ...subject, keyed: true })).toContain("-H 'Authorization: Bearer YOUR_KEY'");
  });

  it("quotes the file's name as curl reads it", () => {
    expect(writeCurl({ ...subject, photo: 'a "b"; c,\\d.jpg' })).toContain(`-F 'photo=@"a \\"b\\"; c,\\\\d.jpg"' `);
  });

  it("replaces the light in the curl command", () => {
    expect(writeCurl(movedInput)).toContain(
      "&sun_azimuth=-41.2&sun_elevation=33&turbidity=3&sun=false&sky_exposure=5&",
    );
  });

  it("is a Python program", () => {
    expect(writePython(subject)).toContain(
      'UserInput(time=datetime.fromisoformat("2024-06-01T14:30+02:00"), latitude=48.14, longitude=11.58)',
    );
    expect(writePython({ ...subject, userInput: NO_USER_INPUT })).not.toContain("UserInput");
  });

  it("writes every offset as ISO 8601 does, in the Python program", () => {
    const program = (utc_offset: string): string =>
      writePython({ ...subject, userInput: { ...subject.userInput, utc_offset } });
    const offsets = { 2: "+02:00", "5.5": "+05:30", "-3": "-03:00", "-0330": "-03:30", Z: "+00:00" };
    for (const [offset, iso] of Object.entries(offsets)) expect(program(offset)).toContain(`"2024-06-01T14:30${iso}"`);
    const alone = { ...NO_USER_INPUT, utc_offset: "-0330" };
    expect(writePython({ ...subject, userInput: alone })).toContain("UserInput(utc_offset=-3.5)");
  });

  it("replaces the light in the Python program", () => {
    expect(writePython(subject)).not.toContain("light.replace");
    const changed = writePython({ ...movedInput, adjustments: { sun: [-41.2, 33], exposure: 0.5, haze: 4 } });
    expect(changed).toContain("light = light.replace(sun=(-41.2, 33), exposure=0.5, haze=4)\n");
    expect(changed).toContain(", 512, sun=False)");
    expect(writePython({ ...movedInput, adjustments: { exposure: 0 } })).not.toContain("light.replace");
  });

  it("reads the record where more has changed", () => {
    const program = writePython({ ...movedInput, userInput: NO_USER_INPUT, adjustments: "record" });
    expect(program).toContain("import json\nfrom lighting import Lighting, estimate\n");
    expect(program).toContain(".replace(lighting=record)\n");
    expect(program.trim().split("\n").length).toBeLessThanOrEqual(7);
  });

  it("states what was drawn in the Python program", () => {
    const userInput = { ...NO_USER_INPUT, vertical: "1,2,3,4;5,6,7,8", horizon: "0,5,9,5" };
    expect(writePython({ ...subject, userInput })).toContain(
      'UserInput(verticals=["1,2,3,4", "5,6,7,8"], horizon="0,5,9,5")',
    );
  });

  it("replaces the camera where photos have one together", () => {
    const record = { camera: { elevation: -1.25, roll: 0.5, vertical_fov: 51.9834 } } as Lighting;
    const changed = { ...overridesFromParameters(light), ...cameraOverrides(record) };
    expect(writeCurl({ ...subject, overrides: changed })).toContain(
      "&camera_elevation=-1.25&camera_roll=0.5&camera_vertical_fov=51.9834&",
    );
  });

  it("is a record without what the page alone asks for", () => {
    const answer = {
      ...{ model: { name: "", version: "" }, camera: CAMERA, evidence: [], warnings: [] },
      sun: { azimuth: 1, elevation: 2, direction: [0, 1, 0], visibility: 1, radius_50: 9, radius_90: 30 },
      sky: { model: "hosek-wilkie", turbidity: 3, ground_albedo: 0.3, exposure: 5 },
      ...{ links: { envmap: "" }, crop: {}, probability: {}, photo_metadata: {} },
    } as unknown as Estimate;
    const record = buildRecord(answer, parametersFromRecord(answer), { sun: [0, 0, 0], sky: [0, 0, 0] });
    expect(Object.keys(record).sort()).toEqual(["camera", "evidence", "model", "sky", "sun", "warnings"]);
  });

  it("states the power of a light that the photo alone does not have", () => {
    const record = {
      ...{ model: { name: "", version: "" }, camera: CAMERA, evidence: [], warnings: [] },
      sun: { azimuth: -41.2, elevation: 33, direction: [0, 1, 0], visibility: 0, radius_50: 9, radius_90: 30 },
      sky: { model: "hosek-wilkie", turbidity: 3, ground_albedo: 0.3, exposure: 5 },
    } as Lighting;
    const stated = {
      ...record,
      sun: { ...record.sun, irradiance: [3.89, 4.28, 3.3612345] },
      sky: { ...record.sky, cover: 0.25, irradiance: [0.35, 0.62, 1.12] },
      ground: { color: [0.143, 0.1, 0.1] },
    } as Lighting;
    const irradiances: Irradiances = { sun: [0, 0, 0], sky: [1, 2, 3] };
    expect(statedOverrides(record, light, irradiances)).toEqual({
      ...overridesFromParameters(light),
      photo_exposure: 5,
    });
    const rotated = statedOverrides(stated, { ...light, exposure: 10 }, irradiances);
    expect(writeCurl({ ...subject, overrides: rotated })).toContain(
      "&sun=false&sky_exposure=10&photo_exposure=5&sun_irradiance=0%2C0%2C0&sky_irradiance=1%2C2%2C3&sky_cover=0.25&ground_color=0.143%2C0.1%2C0.1&",
    );
  });
});

describe("the ground", () => {
  const data = new Uint8ClampedArray(4 * 100);
  for (let i = 0; i < 100; i++) data.set([200, 128, i % 10 < 5 ? 0 : 255, 255], 4 * i);
  const mask = groundMaskFromPixels({ width: 10, height: 10, data });

  it("is read where an object stands in the sun and where not", () => {
    const read = (x: number, y: number): boolean => isInSun(mask, [x, y]);
    expect([read(0.25, 0.5), read(0.45, 0.95), read(0.5, 0.95)]).toEqual([false, false, true]);
    expect([read(1.2, 0.5), read(-0.1, 0.5), read(0.25, 1)]).toEqual([true, false, false]);
    expect([mask.lit[0], mask.sunny[0], mask.sunny[9]]).toEqual([128, 0, 255]);
  });
});

describe("the small map", () => {
  it("gives the place of a point, and the point of a place", () => {
    expect(locationOfPoint(0.5, 0.5)).toEqual({ latitude: 0, longitude: 0 });
    expect(locationOfPoint(0.53222, 0.2325)).toEqual({ latitude: 48.15, longitude: 11.6 });
    expect(pointOfLocation({ latitude: -90, longitude: 180 })).toEqual([1, 1]);
    expect(locationOfPoint(1.2, -1)).toEqual({ latitude: 90, longitude: 180 });
  });

  it("goes on around the earth, and ends at its poles", () => {
    expect(moveLocation({ latitude: 89.8, longitude: 179.8 }, 0.5, 0.5)).toEqual({ latitude: 90, longitude: -179.7 });
    expect(moveLocation({ latitude: 0, longitude: -175 }, -10, -10)).toEqual({ latitude: -10, longitude: 175 });
    expect(formatLocation({ latitude: -33.9, longitude: -70.66 })).toBe("33.9° S, 70.7° W");
  });
});

describe("cities", () => {
  const cities = parseCities(
    "Munich\tDE\t48.14\t11.58\tMünchen\nSão Paulo\tBR\t-23.55\t-46.64\nPaulo Afonso\tBR\t-9.41\t-38.21\n",
    (code) => (code === "DE" ? "Germany" : "Brazil"),
  );
  const found = (text: string): string[] => findCities(cities, text).map(({ label }) => label);

  it("are found by any of their names, without accents, the beginning first", () => {
    expect(found("munch")).toEqual(["Munich (München), Germany"]);
    expect(found("paulo")).toEqual(["Paulo Afonso, Brazil", "São Paulo, Brazil"]);
    expect(found("sao p")).toEqual(["São Paulo, Brazil"]);
    expect(found("m")).toEqual([]);
  });

  it("are found by what was chosen", () => {
    expect(found("Munich (München), Germany")).toEqual(["Munich (München), Germany"]);
    expect(found("Paulo, Germany")).toEqual([]);
  });
});

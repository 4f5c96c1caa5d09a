import { describe, expect, it } from "vitest";
import type { EditState } from "../src/state";
import { NO_USER_INPUT } from "../src/text/metadata";
import {
  buildProject,
  identifyPhoto,
  isSamePhoto,
  projectInput,
  projectLink,
  projectOfFragment,
  readProject,
} from "../src/text/project";

const STATE: EditState = {
  parameters: {
    ...{ sun_azimuth: -41.2, sun_elevation: 33, turbidity: 3.4, exposure: 0.021, ground_albedo: 0.3 },
    ...{ sun: true, warmth: 0.25, softness: 0 },
  },
  placement: { position: [0.5, -1.6, -4], radius: 0.3, rotation: 20, grounded: true },
  ...{ shape: "teapot", finish: "glossy", inSun: false },
};
const INPUT = {
  ...NO_USER_INPUT,
  shadow: "doubt:310,400,455,385;lit:500,300,560,300,520,300",
  latitude: "48.14",
  longitude: "11.58",
};
const PHOTO = { name: "Straße.jpg", bytes: 9, crc32: 0xcbf43926 };
const PROJECT = buildProject(PHOTO, INPUT, STATE);

describe("a project", () => {
  it("holds all that was done and said, as a file and as a link", () => {
    const text = JSON.stringify(PROJECT);
    const link = new URL(projectLink(PROJECT, "http://localhost:8000/sun/?a=b#opened/x/photo.jpg"));
    expect(link.pathname + link.search).toBe("/sun/?a=b");
    for (const read of [readProject(text), projectOfFragment(link.hash)]) {
      expect(read?.edits).toEqual(STATE);
      expect(read?.photo).toEqual(PHOTO);
      expect(read && projectInput(read)).toEqual(INPUT);
    }
    expect(text).not.toContain("heading");
  });

  it("has a ball for the user's own model, which stays out", () => {
    const { edits } = buildProject(PHOTO, NO_USER_INPUT, { ...STATE, shape: "own", finish: "original" });
    expect([edits.shape, edits.finish]).toEqual(["sphere", "mirror"]);
  });

  it("is of the photo whose bytes it knows, by their CRC-32", async () => {
    const photo = await identifyPhoto(new File(["123456789"], "other name.jpg"));
    expect(isSamePhoto(photo, PHOTO)).toBe(true);
    expect(isSamePhoto(await identifyPhoto(new File(["123456780"], PHOTO.name)), PHOTO)).toBe(false);
  });

  it.each([
    ["no JSON", "sun"],
    ["a record", '{"sun":{"azimuth":3}}'],
    ["null", "null"],
    ["a later version", JSON.stringify({ ...PROJECT, project: 2 })],
    ["a sun too high", JSON.stringify(withParameter("sun_elevation", 91))],
    ["a text for a number", JSON.stringify(withParameter("exposure", "1"))],
    ["an unknown shape", JSON.stringify({ ...PROJECT, edits: { ...STATE, shape: "cow" } })],
    ["an unknown input", JSON.stringify({ ...PROJECT, user_input: { probability: "x" } })],
    ["an input of another type", JSON.stringify({ ...PROJECT, user_input: { latitude: 48 } })],
    ["two numbers for a place", JSON.stringify({ ...PROJECT, edits: withPosition([1, 2]) })],
  ])("that is %s is refused with a sentence", (_, text) => {
    expect(() => readProject(text)).toThrow("This is no project that was saved here, or it was damaged.");
  });

  it.each(["#edits/", "#edits/%%%", "#edits/A", "#edits/_-8"])("in the fragment %s is refused so, too", (fragment) => {
    expect(() => projectOfFragment(fragment)).toThrow("no project");
  });

  it("is not looked for in another fragment", () => {
    expect(projectOfFragment("#opened/secret/photo.jpg")).toBeUndefined();
  });
});

function withParameter(name: string, value: unknown): object {
  return { ...PROJECT, edits: { ...STATE, parameters: { ...STATE.parameters, [name]: value } } };
}

function withPosition(position: number[]): object {
  return { ...STATE, placement: { ...STATE.placement, position } };
}

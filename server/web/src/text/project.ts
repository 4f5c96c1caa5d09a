/** A photo's edits as a file or a link. The photo stays out: its checksum tells whether another one is the same. */

import { type EditState, FINISHES, SHAPES } from "../state";
import { NO_USER_INPUT, type UserInput } from "./metadata";

/** A photo's name and what tells it from others. */
export interface PhotoIdentity {
  name: string;
  bytes: number;
  crc32: number; // of the file
}

/** What a user did to a photo's light and object, and said of the photo. */
export interface Project {
  project: typeof VERSION;
  photo: PhotoIdentity;
  user_input: Partial<UserInput>;
  edits: EditState;
}

const VERSION = 1;
const LINK = "#edits/";
const NO_PROJECT = "This is no project that was saved here, or it was damaged.";

export const isSamePhoto = (a: PhotoIdentity, b: PhotoIdentity): boolean => a.bytes === b.bytes && a.crc32 === b.crc32;

/** A project of the light on show. The user's own model stays out, and a ball stands in for it. */
export function buildProject(photo: PhotoIdentity, userInput: UserInput, state: EditState): Project {
  const said = Object.entries(userInput).filter(([name, value]) => value !== NO_USER_INPUT[name as keyof UserInput]);
  const edits: EditState = state.shape === "own" ? { ...state, shape: "sphere", finish: "mirror" } : state;
  return { project: VERSION, photo, user_input: Object.fromEntries(said), edits };
}

/** What the user said of the photo, whole. */
export const projectInput = ({ user_input }: Project): UserInput => ({ ...NO_USER_INPUT, ...user_input });

/** The project of a file; throws an Error with a sentence for anything else. */
export function readProject(text: string): Project {
  const value = parse(text);
  if (value?.project !== VERSION || !isLike(value, EXAMPLE) || !isRight(value as unknown as Project))
    throw new Error(NO_PROJECT);
  return value as unknown as Project;
}

type Loose = Record<string, unknown>;

function parse(text: string): Loose | undefined {
  try {
    return JSON.parse(text);
  } catch {
    return undefined;
  }
}

/** What each project is like. */
const EXAMPLE = {
  photo: { name: "", bytes: 0, crc32: 0 },
  user_input: {},
  edits: {
    parameters: {
      ...{ sun_azimuth: 0, sun_elevation: 0, turbidity: 0, exposure: 0, ground_albedo: 0 },
      ...{ sun: true, warmth: 0, softness: 0 },
    },
    placement: { position: [0, 0, 0], radius: 0, rotation: 0, grounded: true },
    ...{ shape: "", finish: "", inSun: true },
  },
};

/** Whether a value has all that an example has, of the same types. */
function isLike(value: unknown, example: unknown): boolean {
  if (typeof example !== "object" || example === null)
    return typeof value === typeof example && (typeof value !== "number" || Number.isFinite(value));
  if (typeof value !== "object" || value === null || Array.isArray(value) !== Array.isArray(example)) return false;
  return Object.entries(example).every(([name, part]) => isLike((value as Loose)[name], part));
}

const within = (value: number, low: number, high: number): boolean => value >= low && value <= high;

function isRight({ user_input, edits: { parameters, placement, shape, finish } }: Project): boolean {
  const { sun_azimuth, sun_elevation, turbidity, exposure, ground_albedo, warmth, softness } = parameters;
  return [
    within(sun_azimuth, -180, 180) && within(sun_elevation, -90, 90) && within(turbidity, 1, 10),
    exposure > 0 && within(ground_albedo, 0, 1) && within(warmth, -1, 1) && within(softness, 0, 1),
    placement.radius > 0 && shape !== "own" && SHAPES.includes(shape) && FINISHES.includes(finish),
    isLike({ ...NO_USER_INPUT, ...user_input }, NO_USER_INPUT),
    Object.keys(user_input).every((name) => name in NO_USER_INPUT),
  ].every(Boolean);
}

/** The address of the page at `page` that opens a project; browsers send nothing of it to a server. */
export function projectLink(project: Project, page: string): string {
  const bytes = new TextEncoder().encode(JSON.stringify(project));
  const text = btoa(String.fromCharCode(...bytes));
  return `${page.replace(/#.*$/, "")}${LINK}${text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

/** The project that an address's fragment holds; undefined where it holds none. Throws as `readProject` does. */
export function projectOfFragment(fragment: string): Project | undefined {
  if (!fragment.startsWith(LINK)) return undefined;
  const text = fragment.slice(LINK.length).replaceAll("-", "+").replaceAll("_", "/");
  if (!/^[A-Za-z0-9+/]*$/.test(text) || text.length % 4 === 1) throw new Error(NO_PROJECT);
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return readProject(new TextDecoder().decode(bytes));
}

/** What tells a photo from others. Browsers offer no better digest to pages that came without encryption. */
export async function identifyPhoto(file: File): Promise<PhotoIdentity> {
  const bytes = new Uint8Array(await file.arrayBuffer());
  return { name: file.name, bytes: bytes.length, crc32: crc32(bytes) };
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let rest = byte;
  for (let bit = 0; bit < 8; bit++) rest = rest & 1 ? 0xedb88320 ^ (rest >>> 1) : rest >>> 1;
  return rest;
});

/** The CRC-32 of ZIP and PNG. */
export function crc32(bytes: Uint8Array): number {
  let rest = 0xffffffff;
  for (const byte of bytes) rest = (CRC_TABLE[(rest ^ byte) & 0xff] as number) ^ (rest >>> 8);
  return (rest ^ 0xffffffff) >>> 0;
}

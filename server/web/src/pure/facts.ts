/** What a photo says of itself, in words and as the form's values. */

import type { Lighting } from "../api";
import type { Given } from "./given";
import type { Facts } from "./metadata";
import { short } from "./words";

export interface Said {
  name: string;
  value: string;
}

/** The facts in words; what a photo does not say is named too, since it can be given. `used`: see `usedUnseen`. */
export function said(facts: Facts, used: Sources = {}): Said[] {
  const unknown = facts.unread ? "cannot be read here" : "not in the file";
  const lens = facts.focal && `${short(facts.focal)} mm (as of a 35 mm camera)`;
  const words: Record<Fact | "Camera", string | undefined> = {
    Time: timeWords(facts),
    Place: placeWords(facts),
    Heading: headingWords(facts),
    Lens: lens || undefined,
    Camera: facts.camera,
  };
  return Object.entries(words).map(([name, value]) => ({
    name,
    value: value ?? used[name as Fact] ?? unknown,
  }));
}

/** The parts of an answer's evidence that a file may hold. */
const SOURCES = {
  Time: { evidence: "time+place", given: ["time"], fact: "time" },
  Place: { evidence: "time+place", given: ["lat"], fact: "latitude" },
  Heading: { evidence: "heading", given: ["heading", "headings"], fact: "heading" },
  Lens: { evidence: "focal length", given: ["fov"], fact: "focal" },
} as const;
type Fact = keyof typeof SOURCES;
type Sources = Partial<Record<Fact, string>>;

/** Where the answer has from what it used, though neither the user nor the photo, as it is read here, says it. */
export function usedUnseen(evidence: readonly string[], given: Given, photos: readonly Facts[]): Sources {
  const used = (Object.keys(SOURCES) as Fact[]).filter(
    (name) => evidence.includes(SOURCES[name].evidence) && !SOURCES[name].given.some((field) => given[field]),
  );
  const lent = (name: Fact): boolean =>
    name !== "Lens" && photos.some((facts) => facts[SOURCES[name].fact] !== undefined);
  return Object.fromEntries(used.map((name) => [name, lent(name) ? "from another photo" : "read by the service"]));
}

const REFUSED = /^By its metadata the camera (looks .+?), by the pixels it /; // the service's words

/** How the camera was held, as the answer has it: of a phone's or drone's own angles the service alone reads. */
export function held({ camera, evidence, warnings }: Lighting, { exif }: Given): Said {
  const name = "Held";
  const refused = warnings.map((text) => text.match(REFUSED)?.[1]).find(Boolean);
  if (refused) return { name, value: `${refused}: not used, see the warning` };
  if (!evidence.includes("gravity")) return { name, value: exif ? "not in the file" : "not looked for" };
  const [up, roll] = [Math.round(camera.elevation), Math.round(camera.roll)];
  const looks = `looks ${Math.abs(up)}° ${up < 0 ? "down" : "up"} with a roll of ${roll}°`;
  return { name, value: `${looks}, by the file and the picture` };
}

function timeWords({ time, offset, satellites }: Facts): string | undefined {
  const zone = offset ?? (satellites ? "(time zone by GPS)" : "(no time zone)");
  return time && `${time.replace("T", " ")} ${zone}`;
}

function placeWords({ latitude, longitude }: Facts): string | undefined {
  if (latitude === undefined || longitude === undefined) return undefined;
  const degrees = (value: number, sides: string): string =>
    `${Math.abs(value).toFixed(4)}°\u00a0${sides[value < 0 ? 1 : 0]}`;
  return `${degrees(latitude, "NS")}, ${degrees(longitude, "EW")}`;
}

function headingWords({ heading, north }: Facts): string | undefined {
  return heading === undefined ? undefined : `${heading.toFixed(0)}° from ${north ? `${north} ` : ""}north`;
}

/** What each part of `evidence` means. */
const USED: Record<string, string> = {
  pixels: "the picture itself",
  "time+place": "time and place (where the sun stood then)",
  heading: "the compass heading",
  "focal length": "the lens's focal length",
  gravity: "how the camera was held",
  "camera exposure": "the camera's exposure (how bright the scene was)",
  turns: "the turns between the photos",
  "other photos": "the other photos",
};

/** "Used: the picture itself, the compass heading." */
export function evidenceWords(evidence: readonly string[]): string {
  const words = evidence.map((name) => USED[name] ?? name);
  return words.length ? `Used: ${words.join(", ")}.` : "Set by hand.";
}

/** What the form shows: what the user said, else what the photo says. */
export function formValues(facts: Facts, given: Given): Given {
  if (!given.exif) return given;
  return {
    ...given,
    time: given.time || facts.time || "",
    utc_offset: given.utc_offset || facts.offset || "",
    lat: given.lat || numberWords(facts.latitude),
    lon: given.lon || numberWords(facts.longitude),
    heading: given.heading || numberWords(facts.heading),
  };
}

/** What the user says by a form: what differs from the photo's own facts. */
export function givenBy(form: Given, facts: Facts): Given {
  const own = formValues(facts, { ...form, time: "", utc_offset: "", lat: "", lon: "", heading: "", fov: "" });
  const unless = (name: "time" | "utc_offset" | "lat" | "lon" | "heading"): string =>
    form.exif && form[name] === own[name] ? "" : form[name];
  const time = unless("time");
  const utc_offset = time ? form.utc_offset : unless("utc_offset"); // a time replaces the photo's offset too
  const given = { ...form, time, utc_offset, heading: unless("heading") };
  const [lat, lon] = [unless("lat"), unless("lon")];
  return lat || lon ? { ...given, lat: form.lat, lon: form.lon } : { ...given, lat: "", lon: "" };
}

const numberWords = (value: number | undefined): string =>
  value === undefined ? "" : String(Number(value.toFixed(5)));

/** Numbers and answers as text, as `lighting preview` writes them, and light in the words of people who set lights. */

import { radians, wrapAzimuth } from "../geometry/angles";
import { rgbLuminance, type Triple } from "../geometry/color";
import type { Irradiances, Lighting, LightParameters } from "../types";

export interface NamedValue {
  name: string;
  value: string;
  note?: string;
  medianError?: string; // of the model card
}

/** 54 is "54° right". */
export function formatLateral(azimuth: number): string {
  const size = Math.round(Math.abs(azimuth));
  if (size === 0) return "straight ahead";
  if (size === 180) return "straight behind";
  return `${size}° ${azimuth < 0 ? "left" : "right"}`;
}

/** 54 is "54° right", 120 "120° right (behind)". */
export const formatAzimuth = (azimuth: number): string => {
  const size = Math.round(Math.abs(azimuth));
  return `${formatLateral(azimuth)}${size > 90 && size < 180 ? " (behind)" : ""}`;
};

/** One decimal below 10, none above. */
export const formatShort = (value: number): string => (value < 9.95 ? value.toFixed(1) : value.toFixed(0));

export const formatPercent = (share: number): string => {
  const value = 100 * share;
  return value > 0 && value < 0.95
    ? value < 0.1
      ? "<\u00a00.1\u00a0%"
      : `${value.toFixed(1)}\u00a0%`
    : `${value.toFixed(0)}\u00a0%`;
};

/** Three significant digits, never as a power of ten. */
export const formatFactor = (value: number): string => String(Number(value.toPrecision(3)));

export const isSunny = (lighting: Lighting): boolean => lighting.sun.visibility >= 0.5;

/** The numbers of a record; `medianErrors` are those of the model card, where it states them. */
export function estimateRows({ sun, sky, camera }: Lighting, medianErrors: Record<string, number> = {}): NamedValue[] {
  const error = (name: string, unit: string): { medianError: string } | undefined => {
    const value = medianErrors[`${name}_median`];
    return value === undefined ? undefined : { medianError: `± ${value}${unit}` };
  };
  return [
    { name: "Sun azimuth", value: formatLateral(sun.azimuth), ...error("sun_azimuth", "°") },
    { name: "Sun elevation", value: `${sun.elevation.toFixed(1)}°`, ...error("sun_elevation", "°") },
    {
      name: "Sun, 50\u00a0% within",
      value: `${formatShort(sun.radius_50)}°`,
      note: `90\u00a0%: ${formatShort(sun.radius_90)}°`,
    },
    { name: "Direct sun", value: formatPercent(sun.visibility) },
    { name: "Turbidity", value: sky.turbidity.toFixed(1), ...error("turbidity", "") },
    { name: "Exposure", value: formatFactor(sky.exposure), ...error("exposure", " stops") },
    {
      name: "Camera elevation",
      value: `${Math.abs(camera.elevation).toFixed(1)}° ${camera.elevation > -0.05 ? "up" : "down"}`,
      ...error("camera_elevation", "°"),
    },
    {
      name: "Camera roll",
      value: `${(Math.round(camera.roll * 10) / 10 + 0).toFixed(1)}°`,
      ...error("camera_roll", "°"),
    },
    { name: "Vertical field of view", value: `${camera.vertical_fov.toFixed(1)}°`, ...error("vertical_fov", "°") },
  ];
}

/** Why a photo's own radius and the usual error differ; empty where the service states no errors. */
export function explainAccuracy({ sun }: Lighting, medianErrors: Record<string, number>): string {
  const usual = medianErrors.sun_azimuth_median;
  if (usual === undefined) return "";
  const surer = sun.radius_50 < usual ? "surer than most" : "no surer than most";
  return (
    `± is the median error over all test photos. The ${formatShort(sun.radius_50)}° are for this photo. ` +
    `The sun is within them as often as not, so the network is ${surer} here.`
  );
}

const [SURE_RADIUS, VAGUE_RADIUS, LOST_RADIUS] = [8, 20, 45]; // degrees around the sun that hold half of the probability
const MIN_SUITABLE = 0.5;
const MAX_NO_SUN = 0.25; // probability of direct sunlight from which on its absence is not certain

interface Headline {
  title: string;
  text: string;
  kind: "sunny" | "grey" | "unsuitable";
}

const isSuitable = ({ suitable }: Lighting): boolean => suitable === undefined || suitable >= MIN_SUITABLE;

export function buildHeadline(lighting: Lighting): Headline {
  const { azimuth, elevation, radius_50 } = lighting.sun;
  const position = `${formatAzimuth(azimuth)}, ${elevation.toFixed(0)}° high`;
  if (!isSuitable(lighting)) {
    const text = "Do not trust the answer below. Choose an outdoor photo, taken by day.";
    return { title: "This does not look like an outdoor daylight photo", text, kind: "unsuitable" };
  }
  if (elevation < 0) {
    const text = `Twilight: the sun is ${formatSide(azimuth)}, ${(-elevation).toFixed(0)}° below the horizon.`;
    return { title: "No direct sun", text, kind: "grey" };
  }
  if (!isSunny(lighting)) {
    const text = `An overcast or shaded scene is ${formatPercent(1 - lighting.sun.visibility)} likely. If the sun shone, it would ${
      radius_50 > LOST_RADIUS ? "be anywhere" : `be ${formatSide(azimuth)}, ${formatHeight(elevation)}`
    }.`;
    const title = lighting.sun.visibility < MAX_NO_SUN ? "No direct sun" : "Probably no direct sun";
    return { title, text, kind: "grey" };
  }
  if (radius_50 <= SURE_RADIUS) return { title: `Sun ${position}`, text: "", kind: "sunny" };
  if (radius_50 <= VAGUE_RADIUS) return { title: `Sun about ${position}`, text: "", kind: "sunny" };
  const bestGuess = `Best guess: ${position}.`;
  if (radius_50 <= LOST_RADIUS) return { title: `Sun probably ${formatSide(azimuth)}`, text: bestGuess, kind: "sunny" };
  return { title: "The sun shines, but from where is hard to tell", text: bestGuess, kind: "sunny" };
}

/** The side of the camera. */
export function formatSide(azimuth: number): string {
  const [angle, side] = [Math.abs(azimuth), azimuth < 0 ? "left" : "right"];
  if (angle <= 22.5) return "in front of the camera";
  if (angle <= 67.5) return `ahead, to the ${side}`;
  if (angle <= 112.5) return `${side} of the camera`;
  return angle <= 157.5 ? `behind the camera, to the ${side}` : "behind the camera";
}

/** The word of trust with what helps; empty where the service says none. */
export function trustText({ trust, evidence, sun }: Lighting): string {
  if (trust === "sure") return "Sure";
  if (trust === "no sun") return "No sun: set it by eye if you want one";
  if (trust === undefined) return "";
  const helps = [
    ...(evidence.includes("shadow") ? [] : ["draw a shadow"]),
    ...(evidence.includes("time+place") ? [] : ["give time and place"]),
    ...((sun.candidates?.length ?? 0) > 1 ? ["pick another sun"] : []),
  ];
  const last = helps.pop() ?? "set the sun by eye";
  return `Unsure: ${helps.join(", ")}${helps.length ? " or " : ""}${last}`;
}

function formatHeight(elevation: number): string {
  return elevation < 15 ? "low" : elevation < 45 ? "at half height" : "high";
}

/** What a service does with several photos beside answering them together, by whether it matches them. */
export const formatMatching = (matching: boolean): string =>
  matching
    ? ", and what they show in common tells how they are turned"
    : ". Compasses or light tell how they are turned: this service does not compare their pixels";

/** The service's warnings that a photo's rotation is a guess; empty where it is none. */
const rotationWarning = ({ warnings, warning_codes = [] }: Lighting): string =>
  warnings.filter((_, i) => warning_codes[i] === "turn-inferred").join(" ");

/** "32° right of photo 1"; empty for the first photo, and where the user states headings. */
export function formatRotation(lighting: Lighting, index: number, digits = 0): string {
  const rotation = lighting.camera.relative_heading;
  if (index === 0 || rotation === undefined) return "";
  const size = Math.abs(wrapAzimuth(rotation)).toFixed(digits);
  const text =
    Number(size) === 0 ? "as photo 1" : `${size}° ${wrapAzimuth(rotation) < 0 ? "left" : "right"} of photo 1`;
  return hasMatches(lighting) ? text : `perhaps ${text}`;
}

/** The sentence on the rotation of one photo among others; empty where none was looked for. */
export function describeRotation(lighting: Lighting, index: number): string {
  if (!hasMatches(lighting)) return rotationWarning(lighting);
  const text = formatRotation(lighting, index, 1);
  return `How the photos are turned follows from what they show in common${text && `: this one ${text}`}.`;
}

const hasMatches = (lighting: Lighting): boolean => lighting.evidence.includes("turns") && !rotationWarning(lighting);

/** A word for a value, and the value with its unit. */
export interface Wording {
  text: string;
  hint: string;
}

/** Words for ranges of a value, each up to its limit; the last one has none. */
type Scale = readonly (readonly [limit: number, text: string])[];

const wordFor = (scale: Scale, value: number): string =>
  (scale.find(([limit]) => value < limit) ?? scale.at(-1))?.[1] ?? "";

const HEIGHTS: Scale = [[0, "below the horizon"], [6, "on the horizon"], [15, "low"], [35, "medium"], [60, "high"], [91, "overhead"]]; // biome-ignore format: a table
const HAZES: Scale = [[2.2, "crystal clear"], [3.5, "clear"], [5, "slight haze"], [7.5, "hazy"], [99, "thick haze"]]; // biome-ignore format: a table
const COLORS: Scale = [[2800, "deep orange"], [3800, "golden"], [5200, "warm"], [7200, "neutral"], [9000, "cool"], [1e9, "blue"]]; // biome-ignore format: a table
const SHADOWS: Scale = [[0.15, "none"], [0.6, "very soft"], [1.2, "soft"], [2, "clear"], [99, "hard"]]; // biome-ignore format: a table, of stops

export const describeHeight = (elevation: number): Wording => ({
  text: wordFor(HEIGHTS, elevation),
  hint: `${elevation.toFixed(1)}°`,
});

export const describeHaze = (turbidity: number): Wording => ({
  text: wordFor(HAZES, turbidity),
  hint: "", // its number is for the model alone
});

/** Exposure against the estimate's. */
export function describeExposure(exposure: number, estimated: number): Wording {
  const stops = Math.log2(exposure / estimated);
  const rounded = Math.abs(stops) < 0.05 ? 0 : stops;
  const text = rounded === 0 ? "as shot" : rounded > 0 ? "brighter" : "darker";
  return { text, hint: `${rounded > 0 ? "+" : ""}${rounded.toFixed(1).replace("-", "−")} EV` };
}

/** The color of the sun that shines, or of the sky where it does not. */
export function describeColor({ sun, sky }: Irradiances): Wording {
  const shines = Math.max(...sun) > 0;
  const kelvin = colorTemperature(shines ? sun : sky);
  const hint = kelvin === undefined ? "" : `${Math.round(kelvin / 100) * 100}\u00a0K`;
  const text = kelvin === undefined ? "saturated" : wordFor(COLORS, kelvin);
  return { text: shines ? text : `sky light: ${text}`, hint };
}

/** How much darker a shadow on level ground is than the ground beside it. */
export function describeShadows({ sun, sky }: Irradiances, { sun_elevation }: LightParameters): Wording {
  const direct = rgbLuminance(sun) * Math.max(Math.sin(radians(sun_elevation)), 0);
  const stops = Math.log2(1 + direct / Math.max(rgbLuminance(sky), 1e-9));
  return { text: wordFor(SHADOWS, stops), hint: `${stops.toFixed(1)} stops darker` };
}

/**
 * Correlated color temperature [K] of linear Rec.709, 1,500 to 25,000; undefined for colors far from it.
 *
 * C. S. McCamy, Correlated color temperature as an explicit function of chromaticity coordinates, 1992.
 */
export function colorTemperature([r, g, b]: Triple): number | undefined {
  const [x, y, z] = [
    0.4124 * r + 0.3576 * g + 0.1805 * b,
    0.2126 * r + 0.7152 * g + 0.0722 * b,
    0.0193 * r + 0.1192 * g + 0.9505 * b,
  ];
  const sum = x + y + z;
  if (!(sum > 0)) return undefined;
  const n = (x / sum - 0.332) / (0.1858 - y / sum);
  const kelvin = 449 * n ** 3 + 3525 * n ** 2 + 6823.3 * n + 5520.33;
  return kelvin >= 1500 && kelvin <= 25000 ? kelvin : undefined;
}

/** Numbers in words, as `lighting preview` writes them. */

import type { Lighting } from "../api";

export interface Named {
  name: string;
  value: string;
  note?: string;
}

/** 54 is "54° right", 120 "120° right (behind)". */
export function azimuthWords(azimuth: number): string {
  const size = Math.round(Math.abs(azimuth));
  if (size === 0) return "straight ahead";
  if (size === 180) return "straight behind";
  return `${size}° ${azimuth < 0 ? "left" : "right"}${size > 90 ? " (behind)" : ""}`;
}

/** One decimal below 10, none above. */
export const short = (value: number): string => (value < 9.95 ? value.toFixed(1) : value.toFixed(0));

export const percent = (share: number): string => {
  const value = 100 * share;
  return value > 0 && value < 0.95
    ? value < 0.1
      ? "<\u00a00.1\u00a0%"
      : `${value.toFixed(1)}\u00a0%`
    : `${value.toFixed(0)}\u00a0%`;
};

/** Three significant digits, never as a power of ten. */
export const factor = (value: number): string => String(Number(value.toPrecision(3)));

export const isSunny = (lighting: Lighting): boolean => lighting.sun.visibility >= 0.5;

export function headline(lighting: Lighting): { title: string; text: string } {
  const { azimuth, elevation, radius_50, radius_90 } = lighting.sun;
  const where = `${azimuthWords(azimuth)}, ${elevation.toFixed(0)}° high`;
  if (!isSunny(lighting)) {
    return { title: "No direct sun", text: `An overcast or shaded scene; if the sun shone, it would stand ${where}.` };
  }
  const spread = `Half of the probability lies within ${short(radius_50)}°, 90\u00a0% within ${short(radius_90)}°.`;
  return { title: `Sun ${where}`, text: spread };
}

/** The numbers of a record; `errors` are the median errors of the model card, where it states them. */
export function numbers({ sun, sky, camera }: Lighting, errors: Record<string, number> = {}): Named[] {
  const note = (name: string, unit: string): { note: string } | undefined => {
    const error = errors[`${name}_median`];
    return error === undefined ? undefined : { note: `± ${error}${unit}` };
  };
  return [
    { name: "Sun azimuth", value: azimuthWords(sun.azimuth).replace(" (behind)", ""), ...note("sun_azimuth", "°") },
    { name: "Sun elevation", value: `${sun.elevation.toFixed(1)}°`, ...note("sun_elevation", "°") },
    { name: "50\u00a0% / 90\u00a0% within", value: `${short(sun.radius_50)}° / ${short(sun.radius_90)}°` },
    { name: "Direct sun", value: percent(sun.visibility) },
    { name: "Turbidity", value: sky.turbidity.toFixed(1), ...note("turbidity", "") },
    { name: "Exposure", value: factor(sky.exposure), ...note("exposure", " stops") },
    {
      name: "Camera elevation",
      value: `${Math.abs(camera.elevation).toFixed(1)}° ${camera.elevation < 0 ? "down" : "up"}`,
      ...note("camera_elevation", "°"),
    },
    {
      name: "Camera roll",
      value: `${(Math.round(camera.roll * 10) / 10 + 0).toFixed(1)}°`,
      ...note("camera_roll", "°"),
    },
    { name: "Vertical field of view", value: `${camera.vertical_fov.toFixed(1)}°`, ...note("vertical_fov", "°") },
  ];
}

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

/** The numbers of a record; `errors` are the median errors of the model card, where it states them. */
export function numbers({ sun, sky, camera }: Lighting, errors: Record<string, number> = {}): Named[] {
  const note = (name: string, unit: string): { note: string } | undefined => {
    const error = errors[`${name}_median`];
    return error === undefined ? undefined : { note: `± ${error}${unit}` };
  };
  return [
    { name: "Sun azimuth", value: azimuthWords(sun.azimuth).replace(" (behind)", ""), ...note("sun_azimuth", "°") },
    { name: "Sun elevation", value: `${sun.elevation.toFixed(1)}°`, ...note("sun_elevation", "°") },
    {
      name: "Sun, 50\u00a0% within",
      value: `${short(sun.radius_50)}°`,
      note: `90\u00a0%: ${short(sun.radius_90)}°`,
    },
    { name: "Direct sun", value: percent(sun.visibility) },
    { name: "Turbidity", value: sky.turbidity.toFixed(1), ...note("turbidity", "") },
    { name: "Exposure", value: factor(sky.exposure), ...note("exposure", " stops") },
    {
      name: "Camera elevation",
      value: `${Math.abs(camera.elevation).toFixed(1)}° ${camera.elevation > -0.05 ? "up" : "down"}`,
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

/** Why a photo's own radius and the usual error differ; empty where the service states no errors. */
export function explained({ sun }: Lighting, errors: Record<string, number>): string {
  const usual = errors.sun_azimuth_median;
  if (usual === undefined) return "";
  const surer = sun.radius_50 < usual ? "surer than most" : "no surer than most";
  return (
    `± is the median error over all test photos, easy and hard. The ${short(sun.radius_50)}° are of this photo alone: ` +
    `half of the sun's probability lies within them, so the network is ${surer} here. Half of such suns lie outside.`
  );
}

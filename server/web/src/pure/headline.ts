/** What the page says first, as sure as the estimate is. */

import type { Lighting } from "../api";
import { azimuthWords, isSunny, percent, short } from "./words";

const [SURE, VAGUE, LOST] = [8, 20, 45]; // degrees around the sun that hold half of the probability
const UNSUITABLE = 0.5;
const DOUBTED = 0.25; // probability of direct sunlight from which on its absence is not certain

export interface Headline {
  title: string;
  text: string;
  kind: "sunny" | "grey" | "unsuitable";
}

export const isSuitable = ({ suitable }: Lighting): boolean => suitable === undefined || suitable >= UNSUITABLE;

export function headline(lighting: Lighting): Headline {
  const { azimuth, elevation, radius_50, radius_90 } = lighting.sun;
  const where = `${azimuthWords(azimuth)}, ${elevation.toFixed(0)}° high`;
  if (!isSuitable(lighting)) {
    const text = "The answer below is what an outdoor photo with these pixels would mean; do not rely on it.";
    return { title: "This does not look like an outdoor daylight photo", text, kind: "unsuitable" };
  }
  if (!isSunny(lighting)) {
    const text = `An overcast or shaded scene is ${percent(1 - lighting.sun.visibility)} likely. If the sun shone, it would ${
      radius_50 > LOST ? "be anywhere" : `stand ${sideOf(azimuth)}, ${heightOf(elevation)}`
    }.`;
    const title = lighting.sun.visibility < DOUBTED ? "No direct sun" : "Probably no direct sun";
    return { title, text, kind: "grey" };
  }
  const spread = `Half of the probability lies within ${short(radius_50)}°, 90\u00a0% within ${short(radius_90)}°.`;
  if (radius_50 <= SURE) return { title: `Sun ${where}`, text: spread, kind: "sunny" };
  if (radius_50 <= VAGUE) return { title: `Sun about ${where}`, text: spread, kind: "sunny" };
  const best = `Best guess: ${where}. ${spread}`;
  if (radius_50 <= LOST) return { title: `Sun probably ${sideOf(azimuth)}`, text: best, kind: "sunny" };
  return { title: "The sun shines, but from where is hard to tell", text: best, kind: "sunny" };
}

/** The side of the camera, in words. */
export function sideOf(azimuth: number): string {
  const [size, side] = [Math.abs(azimuth), azimuth < 0 ? "left" : "right"];
  if (size <= 22.5) return "in front of the camera";
  if (size <= 67.5) return `ahead, to the ${side}`;
  if (size <= 112.5) return `${side} of the camera`;
  return size <= 157.5 ? `behind the camera, to the ${side}` : "behind the camera";
}

function heightOf(elevation: number): string {
  return elevation < 15 ? "low" : elevation < 45 ? "at half height" : "high";
}

/** How several photos are turned against each other, in words. */

import type { Lighting } from "../api";
import { wrapAzimuth } from "./angles";

const INFERRED = /how (it is|they are) turned/i; // the service's words where nothing in common says it

/** What a service does with several photos beside answering them together, by whether it matches them. */
export const matchingWords = (matching: boolean): string =>
  matching
    ? ", and turned by what they show in common"
    : "; how they are turned is inferred from compasses or light, for this service does not compare their pixels";

/** Why the turn of a photo is a guess, in the service's words; empty where it is none. */
export const doubt = ({ warnings }: Lighting): string => warnings.filter((text) => INFERRED.test(text)).join(" ");

/** "32° right of photo 1"; empty for the first photo, and where the headings were given. */
export function turnWords(lighting: Lighting, index: number, digits = 0): string {
  const turn = lighting.camera.relative_heading;
  if (index === 0 || turn === undefined) return "";
  const size = Math.abs(wrapAzimuth(turn)).toFixed(digits);
  const words = Number(size) === 0 ? "as photo 1" : `${size}° ${wrapAzimuth(turn) < 0 ? "left" : "right"} of photo 1`;
  return isFound(lighting) ? words : `perhaps ${words}`;
}

/** The sentence on the turn of one photo among others; empty where nothing was looked for. */
export function turnSentence(lighting: Lighting, index: number): string {
  if (!isFound(lighting)) return doubt(lighting);
  const words = turnWords(lighting, index, 1);
  return `How the photos are turned was found in what they show in common${words && `: this one ${words}`}.`;
}

const isFound = (lighting: Lighting): boolean => lighting.evidence.includes("turns") && !doubt(lighting);

/** A photo as the page shows it. */

import { uprightPhoto } from "./api";
import { readFacts } from "./exif";
import type { Pixels } from "./picture/pixels";
import type { Facts } from "./pure/metadata";

export interface Photo {
  file: File;
  url: string;
  picture: HTMLCanvasElement; // upright, for the stage
  pixels: Pixels; // the same, small, to look for ground and shade
  facts: Facts;
  byService: boolean; // whether the service decoded it
}

const LONGEST = 2048; // pixels of the stage's backdrop
const SMALL = 256; // pixels of the picture that is looked at

/**
 * Decodes a file here, or by the service where this browser cannot, as most cannot with HEIC, or where it may show it
 * another way up, as a WebP with an orientation.
 */
export async function openPhoto(file: File, signal: AbortSignal): Promise<Photo> {
  const facts = await readFacts(file);
  const own = facts.turned ? null : await decoded(file);
  const image = own ?? (await decoded(await uprightPhoto(file, signal)));
  if (!image) throw new Error(`${file.name} cannot be shown.`);
  const picture = pictureOf(image, LONGEST);
  return { file, url: image.src, picture, pixels: pixelsOf(image), facts, byService: !own };
}

export const aspectOf = ({ picture }: Photo): number => picture.width / picture.height;

async function decoded(file: Blob): Promise<HTMLImageElement | null> {
  const image = new Image();
  image.src = URL.createObjectURL(file);
  try {
    await image.decode();
    return image;
  } catch {
    URL.revokeObjectURL(image.src);
    return null;
  }
}

function pictureOf(image: HTMLImageElement, longest: number): HTMLCanvasElement {
  const { naturalWidth: width, naturalHeight: height } = image;
  const scale = Math.min(1, longest / Math.max(width, height));
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
  return canvas;
}

function pixelsOf(image: HTMLImageElement): Pixels {
  const small = pictureOf(image, SMALL);
  const context = small.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("This browser draws no pictures.");
  return context.getImageData(0, 0, small.width, small.height);
}

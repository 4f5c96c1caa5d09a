/** The photos: where they come from, decoded, the way up that the service reads them, and without their border. */

import { type Estimate, fetchExample, fetchGroundMask, fetchUprightPhoto, type PhotoCrop } from "./api";
import type { Pixels } from "./geometry/color";
import { type GroundMask, groundMaskFromPixels, SUNLIT } from "./geometry/placement";
import type { UserInput } from "./text/metadata";

/** A photo before it is read. */
export interface PhotoSource {
  name: string;
  load: (signal: AbortSignal) => Promise<File>;
}

const MAX_IN_MEMORY = 256e6; // bytes that are kept; the service takes fewer

/** A file that the user chose. */
export const sourceFromFile = (file: File): PhotoSource => ({ name: file.name, load: () => readIntoMemory(file) });

/** A photo that the page has already. */
export const sourceInMemory = (file: File): PhotoSource => ({ name: file.name, load: () => Promise.resolve(file) });

/** One of the page's own photos, which the service holds. */
export const sourceFromExample = (name: string, url: string): PhotoSource => ({
  name,
  load: async (signal) => new File([await fetchExample(url, signal)], name, { type: "image/jpeg" }),
});

/** The same file in memory: a browser sends no file that was changed or moved on its disk after it was chosen. */
async function readIntoMemory(file: File): Promise<File> {
  if (file.size > MAX_IN_MEMORY) return file;
  try {
    return new File([await file.arrayBuffer()], file.name, { type: file.type });
  } catch {
    throw new Error(`${file.name} cannot be read: it is a folder, or was changed. Choose it again.`);
  }
}

export interface Photo {
  file: File;
  url: string;
  picture: HTMLCanvasElement; // upright, for the stage
  area: ImagePart | undefined; // of the upright picture, in its pixels; unknown where the service decoded it
  byService: boolean; // whether the service decoded it
}

/** A decoded file, with its border if it has one. */
export interface DecodedPhoto {
  file: File;
  image: HTMLImageElement; // upright
  byService: boolean; // whether the service decoded it, and then cut its border off
}

/** A part of an image in its pixels. */
export interface ImagePart {
  left: number;
  top: number;
  width: number;
  height: number;
}

const MAX_BACKDROP = 2048; // pixels of the stage's backdrop
const PICTURE_QUALITY = 0.92; // of the JPEG of a part, 0 to 1

/** Decodes a file here, or by the service where this browser cannot, as most cannot with HEIC. */
export async function decodePhoto(file: File, signal: AbortSignal): Promise<DecodedPhoto> {
  const image = await decodeImage(file);
  return image ? { file, image, byService: false } : decodeByService(file, signal);
}

/** The photo that an estimate is of: the way up that the service reads it, and what lies inside its border. */
export async function preparePhoto(
  decoded: DecodedPhoto,
  { crop, photo_metadata }: Estimate,
  signal: AbortSignal,
): Promise<Photo> {
  return cropPhoto(await turnUpright(decoded, photo_metadata?.orientation, signal), crop);
}

/** Browsers turn a JPEG as its metadata say; what they do with another format, as with a WebP, differs. */
async function turnUpright(photo: DecodedPhoto, orientation = 1, signal: AbortSignal): Promise<DecodedPhoto> {
  if (orientation === 1 || photo.byService || (await isJpeg(photo.file))) return photo;
  URL.revokeObjectURL(photo.image.src);
  return decodeByService(photo.file, signal);
}

async function decodeByService(file: File, signal: AbortSignal): Promise<DecodedPhoto> {
  const image = await decodeImage(await fetchUprightPhoto(file, signal));
  if (!image) throw new Error(`${file.name} cannot be shown.`);
  return { file, image, byService: true };
}

async function isJpeg(file: Blob): Promise<boolean> {
  const [first, second] = new Uint8Array(await file.slice(0, 2).arrayBuffer());
  return first === 0xff && second === 0xd8;
}

async function cropPhoto(decoded: DecodedPhoto, crop: PhotoCrop | undefined): Promise<Photo> {
  const { image, ...rest } = decoded;
  const cropped = decoded.byService ? undefined : crop;
  const part = imagePart(cropped, image.naturalWidth, image.naturalHeight);
  const area = cropped ? imagePart(cropped, cropped.picture_width, cropped.picture_height) : part;
  const picture = drawScaled(image, part, MAX_BACKDROP);
  const url = cropped ? await pictureUrl(picture, image) : image.src;
  return { ...rest, url, picture, area: decoded.byService ? undefined : area };
}

/** The part of an image that a crop of the picture leaves, also where the image has another size than the picture. */
export function imagePart(crop: PhotoCrop | undefined, width: number, height: number): ImagePart {
  if (!crop) return { left: 0, top: 0, width, height };
  const [x, y] = [width / crop.picture_width, height / crop.picture_height];
  return { left: crop.left * x, top: crop.top * y, width: crop.width * x, height: crop.height * y };
}

/** The address of a picture, which takes the place of the image's. */
async function pictureUrl(picture: HTMLCanvasElement, image: HTMLImageElement): Promise<string> {
  const blob = await new Promise<Blob | null>((resolve) => picture.toBlob(resolve, "image/jpeg", PICTURE_QUALITY));
  if (!blob) throw new Error("This browser draws no pictures.");
  URL.revokeObjectURL(image.src);
  return URL.createObjectURL(blob);
}

/** What the service says of a photo's ground; in the sun everywhere where it does not say. */
export async function loadGroundMask(file: File, userInput: UserInput, signal: AbortSignal): Promise<GroundMask> {
  const mask = await fetchGroundMask(file, userInput, signal).catch(() => null);
  const image = mask && (await decodeImage(mask));
  if (!image) return SUNLIT;
  URL.revokeObjectURL(image.src);
  return groundMaskFromPixels(readPixels(image));
}

export const aspectRatio = ({ picture }: Photo): number => picture.width / picture.height;

async function decodeImage(file: Blob): Promise<HTMLImageElement | null> {
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

function drawScaled(image: HTMLImageElement, part: ImagePart, maxSide: number): HTMLCanvasElement {
  const { left, top, width, height } = part;
  const scale = Math.min(1, maxSide / Math.max(width, height));
  const canvas = document.createElement("canvas");
  canvas.width = Math.max(1, Math.round(width * scale));
  canvas.height = Math.max(1, Math.round(height * scale));
  canvas.getContext("2d")?.drawImage(image, left, top, width, height, 0, 0, canvas.width, canvas.height);
  return canvas;
}

function readPixels(image: HTMLImageElement): Pixels {
  const { naturalWidth: width, naturalHeight: height } = image;
  const canvas = drawScaled(image, imagePart(undefined, width, height), Math.max(width, height));
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) throw new Error("This browser draws no pictures.");
  return context.getImageData(0, 0, width, height);
}

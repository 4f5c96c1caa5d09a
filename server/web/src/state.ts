/** What the page holds: photos and their sources, estimates, and what the user has done to light and object. */

import {
  type EditedLighting,
  type Estimate,
  fetchExample,
  fetchGroundMask,
  fetchUprightPhoto,
  type Irradiances,
  type Lighting,
  type LightOverrides,
  type LightParameters,
  type PhotoCrop,
} from "./api";
import { direction } from "./geometry/angles";
import type { Pixels } from "./geometry/color";
import { initialPlacement, type Placement } from "./geometry/placement";
import { type GroundMask, groundMaskFromPixels, SUNLIT } from "./scene/groundMask";
import { coverOf, type SkyRequest } from "./sky/lighting";
import type { ExportedLight } from "./sky/worker";
import { isSunny } from "./text/format";
import { NO_USER_INPUT, type UserInput } from "./text/metadata";
import { History } from "./ui/history";

/** What can be changed, and undone. */
export interface EditState {
  parameters: LightParameters;
  placement: Placement;
  shape: Shape;
  finish: Finish;
  inSun: boolean; // whether the object is put into the sun, wherever it stands
}

/** One photo with its answer. */
export interface PhotoView {
  photo: Photo;
  userInput: UserInput; // of its estimate
  estimate: Estimate;
  history: History<EditState>;
  irradiances: Irradiances; // of the light on show
  groundMask: GroundMask; // of all ground in the sun until the service has said more
  exported?: ExportedMap; // the latest one
}

/** A map as the service exports it. */
export interface ExportedMap {
  key: string; // of the light that it shows
  light?: ExportedLight; // for the object
  picture?: ImageBitmap; // for people
}

/** Photos that were estimated together, one of them on show. */
export interface Session {
  views: PhotoView[];
  index: number;
  userInput: UserInput;
}

export function createView(photo: Photo, estimate: Estimate, userInput: UserInput = NO_USER_INPUT): PhotoView {
  const { camera, ground } = estimate;
  const placement = initialPlacement(camera, aspectRatio(photo), ground?.spot?.direction ?? null);
  const initial: EditState = {
    parameters: parametersFromRecord(estimate),
    placement,
    shape: "sphere",
    finish: "mirror",
    inSun: false,
  };
  return {
    ...{ photo, estimate, history: new History(initial), irradiances: { sun: [0, 0, 0], sky: [0, 0, 0] } },
    groundMask: SUNLIT,
    userInput,
  };
}

export const photoFiles = ({ views }: Session): File[] => views.map(({ photo }) => photo.file);
export const currentState = ({ history }: PhotoView): EditState => history.state;

/** What the sky's worker renders for a view. */
export function skyRequest(view: PhotoView): SkyRequest {
  const { sun, sky, ground } = view.estimate;
  return {
    parameters: currentState(view).parameters,
    estimated: parametersFromRecord(view.estimate),
    stated: {
      ...(sun.irradiance ? { sun: sun.irradiance } : {}),
      ...(sky.irradiance ? { sky: sky.irradiance } : {}),
      ...(sky.cover === undefined ? {} : { cover: sky.cover }),
      ...(ground?.color ? { groundColor: ground.color } : {}),
    },
    painted: mapSky(view.estimate),
  };
}

/** What paints the sky of a record's maps. */
const mapSky = ({ sky }: Lighting): string =>
  sky.model === "hosek-wilkie" && sky.painted !== undefined ? sky.painted : sky.model;

export function parametersFromRecord({ sun, sky, ...rest }: Lighting): LightParameters {
  return {
    sun_azimuth: sun.azimuth,
    sun_elevation: sun.elevation,
    turbidity: sky.turbidity,
    exposure: sky.exposure,
    ground_albedo: sky.ground_albedo,
    sun: isSunny({ sun, sky, ...rest }),
    warmth: 0,
    softness: 0,
  };
}

export function sameParameters(a: LightParameters, b: LightParameters): boolean {
  return JSON.stringify(a) === JSON.stringify(b);
}

/** A light by the names that the service has for one that replaces a photo's. */
export function overridesFromParameters({ exposure, ...rest }: LightParameters): LightOverrides {
  return { ...rest, sky_exposure: exposure };
}

/** The light on show with all that its record states of it; `irradiances` are its own where it is not the estimate's. */
export function statedOverrides(
  estimate: Lighting,
  parameters: LightParameters,
  irradiances: Irradiances,
): LightOverrides {
  const { sun, sky, ground } = estimate;
  const unchanged = sameParameters(parametersFromRecord(estimate), parameters);
  const stated =
    sun.irradiance && sky.irradiance && unchanged ? { sun: sun.irradiance, sky: sky.irradiance } : irradiances;
  const hasIrradiances = (sun.irradiance && sky.irradiance) || isToned(parameters);
  return {
    ...{ ...overridesFromParameters(parameters), photo_exposure: sky.exposure },
    ...(hasIrradiances ? { sun_irradiance: stated.sun, sky_irradiance: stated.sky } : {}),
    ...(sky.cover === undefined && !isToned(parameters) ? {} : { sky_cover: coverOf(sky.cover, parameters) }),
    ...(ground?.color ? { ground_color: ground.color } : {}),
  };
}

/** Whether a light has a warmth or a softness of its own, which the service knows as irradiances alone. */
export const isToned = ({ warmth, softness }: LightParameters): boolean => warmth !== 0 || softness !== 0;

/** The camera that a record states, in the names of the service. */
export function cameraOverrides({ camera }: Lighting): Partial<LightOverrides> {
  return { camera_elevation: camera.elevation, camera_roll: camera.roll, camera_vertical_fov: camera.vertical_fov };
}

/**
 * The record as a file: the estimate's own, or an edited one without what no longer follows from it. `irradiances` are
 * those of the light on show; they replace the ones that the estimate states.
 */
export function buildRecord(
  estimate: Estimate,
  parameters: LightParameters,
  irradiances: Irradiances,
): Lighting | EditedLighting {
  const { links: _, crop: __, probability: ___, photo_metadata: ____, warning_codes: _____, ...record } = estimate;
  if (sameParameters(parametersFromRecord(record), parameters)) return record;
  const { light_probe: ______, ...rest } = record;
  const { azimuth, elevation } = { azimuth: parameters.sun_azimuth, elevation: parameters.sun_elevation };
  const hasIrradiances = record.sky.irradiance !== undefined || isToned(parameters);
  const cover =
    record.sky.cover === undefined && !isToned(parameters) ? undefined : coverOf(record.sky.cover, parameters);
  return {
    ...rest,
    evidence: [],
    warnings: [],
    sun: {
      ...{ azimuth, elevation, direction: [...direction(azimuth, elevation)] },
      visibility: Number(parameters.sun && elevation >= 0),
      ...(hasIrradiances ? { irradiance: irradiances.sun } : {}),
    },
    sky: {
      model: record.sky.model,
      ...(record.sky.painted === undefined ? {} : { painted: record.sky.painted }),
      turbidity: parameters.turbidity,
      ground_albedo: parameters.ground_albedo,
      exposure: parameters.exposure,
      ...(cover === undefined ? {} : { cover }),
      ...(hasIrradiances ? { irradiance: irradiances.sky } : {}),
    },
  };
}

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

/**
 * A photo the way up that the service reads it. Browsers turn a JPEG as its metadata say; what they do with another
 * format, as with a WebP, differs.
 */
export async function turnUpright(photo: DecodedPhoto, orientation = 1, signal: AbortSignal): Promise<DecodedPhoto> {
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

/** The photo that an answer is of: what lies inside the border. */
export async function cropPhoto(decoded: DecodedPhoto, crop: PhotoCrop | undefined): Promise<Photo> {
  const { image, ...rest } = decoded;
  const cropped = decoded.byService ? undefined : crop;
  const part = imagePart(cropped, image.naturalWidth, image.naturalHeight);
  const picture = drawScaled(image, part, MAX_BACKDROP);
  const url = cropped ? await pictureUrl(picture, image) : image.src;
  return { ...rest, url, picture };
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

export const SHAPES = ["sphere", "teapot", "knot", "box", "own"] as const; // own: the user's file
export const FINISHES = ["mirror", "glossy", "matte", "original"] as const; // original: of the user's file

export type Shape = (typeof SHAPES)[number];
export type Finish = (typeof FINISHES)[number];

/** What the page holds: photos with their estimates, what the user has done to light and object, and the record of that. */

import type { EditedLighting, Estimate, Irradiances, Lighting, LightOverrides, LightParameters } from "./api";
import { direction } from "./geometry/angles";
import type { Camera } from "./geometry/camera";
import {
  footPoint,
  type GroundMask,
  initialPlacement,
  movePlacement,
  type Placement,
  SUNLIT,
} from "./geometry/placement";
import { History } from "./history";
import { aspectRatio, type Photo } from "./photo";
import { coverOf, type SkyRequest } from "./sky/lighting";
import type { ExportedLight } from "./sky/worker";
import { isSunny } from "./text/format";
import type { UserInput } from "./text/metadata";

export const SHAPES = ["sphere", "teapot", "knot", "box", "own"] as const; // own: the user's file
export const FINISHES = ["mirror", "glossy", "matte", "original"] as const; // original: of the user's file

export type Shape = (typeof SHAPES)[number];
export type Finish = (typeof FINISHES)[number];

/** What can be changed, and undone. */
export interface EditState {
  parameters: LightParameters;
  placement: Placement;
  shape: Shape;
  finish: Finish;
  inSun: boolean; // whether the object is put into the sun, wherever it stands
}

/** What a gesture shows before the service has answered what it states. */
export interface Live {
  camera?: Camera;
  parameters?: Partial<LightParameters>;
}

/** One photo with its answer. */
export interface PhotoView {
  photo: Photo;
  userInput: UserInput; // of its estimate
  together: boolean; // whether it was estimated together with others
  estimate: Estimate;
  pixelCamera: Camera; // without the lines that the user drew, if an answer without them was on show
  history: History<EditState>;
  live?: Live; // of the gesture under way, or of the one that the service is asked about
  irradiances: Irradiances; // of the light on show
  groundMask: GroundMask; // of all ground in the sun until the service has said more
  exported?: ExportedMap; // the latest one
}

/** A map as the service exports it. */
interface ExportedMap {
  key: string; // of the light that it shows
  light?: ExportedLight; // for the object
  picture?: ImageBitmap; // for people
}

/** Photos that were estimated together, one of them on show. */
export interface Session {
  views: PhotoView[];
  index: number;
}

const UNTOUCHED = { shape: "sphere", finish: "mirror", inSun: false } as const;

/** A photo with its answer; what was done to the object stays from `before`, an earlier answer about the photo. */
export function createView(
  photo: Photo,
  estimate: Estimate,
  userInput: UserInput,
  together: boolean,
  before?: PhotoView,
): PhotoView {
  const initial: EditState = {
    ...(before ? currentState(before) : UNTOUCHED),
    parameters:
      before && saysCameraAlone(before.userInput, userInput)
        ? keptLight(before, estimate)
        : parametersFromRecord(estimate),
    placement: (before && keptPlacement(before, estimate, userInput)) ?? placementOf(estimate, photo),
  };
  const isDrawn = Boolean(userInput.horizon || userInput.vertical);
  return {
    ...{ photo, userInput, together, estimate, history: new History(initial) },
    pixelCamera: (isDrawn && before?.pixelCamera) || estimate.camera,
    irradiances: { sun: [0, 0, 0], sky: [0, 0, 0] },
    groundMask: SUNLIT,
  };
}

const OF_CAMERA: (keyof UserInput)[] = ["horizon", "vertical", "reference", "vertical_fov", "camera_height"];

const saysCameraAlone = (before: UserInput, after: UserInput): boolean =>
  (Object.keys(after) as (keyof UserInput)[]).every((name) => before[name] === after[name] || OF_CAMERA.includes(name));

/** The light of an estimate with what the user has changed of an earlier one. */
function keptLight(before: PhotoView, estimate: Estimate): LightParameters {
  const [was, now] = [parametersFromRecord(before.estimate), parametersFromRecord(estimate)];
  const edited = before.history.state.parameters;
  const changed = Object.entries(edited).filter(([name, value]) => value !== was[name as keyof LightParameters]);
  const isMoved = edited.sun_azimuth !== was.sun_azimuth || edited.sun_elevation !== was.sun_elevation;
  return {
    ...{ ...now, ...Object.fromEntries(changed) },
    ...(isMoved ? { sun_azimuth: edited.sun_azimuth, sun_elevation: edited.sun_elevation } : {}),
    exposure: (now.exposure * edited.exposure) / was.exposure, // in stops against the estimate
  };
}

const placementOf = ({ camera, ground }: Estimate, photo: Photo): Placement =>
  initialPlacement(camera, aspectRatio(photo), ground?.spot?.direction ?? null);

/**
 * The object where the user put it in the photo, seen by another camera; null where it was left, or has no ground there.
 * Where a size was said it keeps its own in meters.
 */
function keptPlacement(before: PhotoView, { camera }: Estimate, { reference }: UserInput): Placement | null {
  const { placement } = currentState(before);
  const isSized = reference !== before.userInput.reference;
  if (!isSized && JSON.stringify(placement) === JSON.stringify(placementOf(before.estimate, before.photo))) return null;
  return keepFoot(placement, before.estimate.camera, camera, aspectRatio(before.photo));
}

/** The object at the same spot of the photo, seen by another camera; null where that sees no ground there. */
function keepFoot(placement: Placement, before: Camera, camera: Camera, aspect: number): Placement | null {
  const foot = footPoint(placement, before, aspect);
  return foot && movePlacement(placement, camera, aspect, foot);
}

export const photoFiles = ({ views }: Session): File[] => views.map(({ photo }) => photo.file);

/** What is on show: what was done to light and object, and what a gesture changes of that. */
export function currentState({ history, live, estimate, photo }: PhotoView): EditState {
  const { state } = history;
  if (!live) return state;
  const moved = live.camera && keepFoot(state.placement, estimate.camera, live.camera, aspectRatio(photo));
  const parameters = { ...state.parameters, ...live.parameters };
  return { ...state, parameters, placement: moved ?? state.placement };
}

/** The camera on show. */
export const cameraOf = ({ live, estimate }: PhotoView): Camera => live?.camera ?? estimate.camera;

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

export const sameParameters = (a: LightParameters, b: LightParameters): boolean =>
  JSON.stringify(a) === JSON.stringify(b);

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
    ...(sky.cover === undefined && !isToned(parameters)
      ? {}
      : { sky_cover: coverOf(sky.cover, isSunny(estimate), parameters) }),
    ...(ground?.color ? { ground_color: ground.color } : {}),
  };
}

/** Whether the light on show is another than the service gives for this photo alone. */
export const isChanged = (view: PhotoView): boolean =>
  !sameParameters(currentState(view).parameters, parametersFromRecord(view.estimate));

/**
 * The light on show where the service would not give the same for this photo alone; of photos estimated together it
 * knows neither sun nor sky nor camera. Its irradiances are those of a settled sky.
 */
export function lightOverrides(view: PhotoView): LightOverrides | undefined {
  const { parameters } = currentState(view);
  if (view.together)
    return { ...statedOverrides(view.estimate, parameters, view.irradiances), ...cameraOverrides(view.estimate) };
  if (isToned(parameters)) return statedOverrides(view.estimate, parameters, view.irradiances);
  return isChanged(view) ? overridesFromParameters(parameters) : undefined;
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
  const { light_probe: ______, trust: _______, ...rest } = record;
  const { azimuth, elevation } = { azimuth: parameters.sun_azimuth, elevation: parameters.sun_elevation };
  const hasIrradiances = record.sky.irradiance !== undefined || isToned(parameters);
  const cover =
    record.sky.cover === undefined && !isToned(parameters)
      ? undefined
      : coverOf(record.sky.cover, isSunny(record), parameters);
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

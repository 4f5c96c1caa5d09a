/** The records of the service, and what the page sends: types alone. */

import type { Camera } from "./geometry/camera";
import type { Triple } from "./geometry/color";
import type { Distribution } from "./geometry/distribution";

/** The record of a photo's light, as the service answers it; what may be missing is newer than some networks. */
export interface Lighting {
  model: { name: string; version: string };
  suitable?: number; // probability that this is an outdoor daylight photo
  sun: {
    azimuth: number;
    elevation: number;
    direction: [number, number, number];
    visibility: number;
    irradiance?: Triple; // of a plane that faces it
    radius_50: number;
    radius_90: number;
    candidates?: Candidate[]; // the answer first
  };
  sky: {
    model: string; // that of turbidity, exposure and coefficients
    painted?: string; // what paints the sky of maps, where it is another
    turbidity: number;
    ground_albedo: number;
    exposure: number;
    cover?: number; // 0 clear to 1 overcast
    irradiance?: Triple; // of level ground
    coefficients?: unknown;
  };
  ground?: { color?: Triple; visible?: number; spot?: GroundSpot | null }; // null: it shows no ground for an object
  camera: Camera & { height?: number; heading?: number; heading_radius_50?: number; relative_heading?: number };
  time?: { utc?: string; utc_offset?: number; source?: string }; // when the photo was taken, as the answer believes
  light_probe?: unknown; // of this light
  trust?: "sure" | "unsure" | "no sun";
  evidence: string[];
  warnings: string[];
  warning_codes?: string[]; // in answers: what each warning is about
}

/** One of the suns that an answer thinks possible. */
export interface Candidate {
  azimuth: number;
  elevation: number;
  probability: number; // that lies nearer to it than to the others
}

/** What a photo's file says, as the service reads it; what it does not say, or what cannot be true, is absent. */
export interface PhotoMetadata {
  time?: string; // local, as 2024-06-01T14:30:05
  utc_offset?: number; // hours
  gps_time?: string; // in UTC
  latitude?: number;
  longitude?: number;
  heading?: number;
  heading_reference?: "true" | "magnetic"; // the north that the heading counts from
  focal_length?: number; // mm of a 35 mm camera
  vertical_fov?: number;
  camera_elevation?: number;
  camera_roll?: number;
  camera_height?: number; // m above the ground
  orientation?: number; // 1 to 8, how the pixels lie in the file
}

/** Where an object may stand in a photo. */
interface GroundSpot {
  pixel: [number, number]; // of the upright photo
  direction: Triple; // unit vector from the camera
}

/** The record of a light that was changed by hand, without what only the estimate can state. */
export type EditedLighting = Omit<Lighting, "sun"> & { sun: Omit<Lighting["sun"], "radius_50" | "radius_90"> };

/** The photo inside a border, in pixels of the upright picture. */
export interface PhotoCrop {
  left: number;
  top: number;
  width: number; // of the photo
  height: number;
  picture_width: number; // of the whole picture
  picture_height: number;
}

export interface Estimate extends Lighting {
  links: { envmap: string };
  crop?: PhotoCrop; // where the photo lies inside a border: what the answer is of
  probability: Distribution;
  photo_metadata?: PhotoMetadata;
}

/** The strength of a light, in the photo's linear values. */
export interface Irradiances {
  sun: Triple; // irradiance of a plane that faces the sun
  sky: Triple; // irradiance of level ground
}

/** What an environment map is rendered from. */
export interface LightParameters {
  sun_azimuth: number;
  sun_elevation: number;
  turbidity: number;
  exposure: number;
  ground_albedo: number;
  sun: boolean; // whether the disc is painted
  warmth: number; // -1 to 1, of the sun against the estimate: 1 is a stop less blue
  softness: number; // 0 to 1, the share of the sun's light that clouds take
}

/**
 * A light, and perhaps a camera, instead of the estimated ones, by the names of the service. Irradiances that it leaves
 * out follow the other parameters.
 */
export interface LightOverrides extends Omit<LightParameters, "exposure"> {
  sky_exposure: number;
  sun_irradiance?: Triple;
  sky_irradiance?: Triple;
  sky_cover?: number;
  ground_color?: Triple;
  photo_exposure?: number; // at which the photo is as it is
  camera_elevation?: number;
  camera_roll?: number;
  camera_vertical_fov?: number;
}

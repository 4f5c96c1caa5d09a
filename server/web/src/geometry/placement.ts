/** Where an object stands: meters, the camera at the origin, level ground below it; and whether the sun reaches it there. */

import { clamp, combine, dot, radians, type Vector } from "./angles";
import { type Camera, cameraAxes, type Point, pixelRay, project } from "./camera";
import type { Pixels } from "./color";

/** Of an object in the photo. */
export interface Placement {
  position: Vector; // of the point where it touches the ground, or of its foot where no ground is in view
  radius: number; // meters
  rotation: number; // degrees about the vertical, to the right as its front is seen
  grounded: boolean;
}

const EYE_HEIGHT = 1.6; // meters, of a camera whose record does not state it
const DEFAULT_SHARE = 0.14; // of half the photo's height, the object's radius
const MAX_DEFAULT_RADIUS = 1; // meters
const MAX_HEIGHT_SHARE = 0.4; // of the camera's height
const MIN_DEPRESSION = 1; // degrees below the horizon: 92 m away
const FLOATING_DISTANCE = 4; // meters, of an object without ground
const MIN_RADIUS = 0.02; // meters, the radius
const MAX_RADIUS = 20;
const MIN_DISTANCE = 2; // radii that the camera keeps away from the object's middle, which then takes at most 60 degrees

/** A placement in the direction of the record's spot, as large as looks well there; afloat where it states none. */
export function initialPlacement(camera: Camera, aspect: number, spot: Vector | null): Placement {
  const onGround = spot && combine([cameraHeight(camera) / -spot[1], spot]);
  const position = onGround ?? floatingPoint(camera, aspect, [0.5, 0.66]);
  return resizePlacement(
    { position, radius: 0, rotation: 0, grounded: onGround !== null },
    defaultRadius(camera, position),
  );
}

/** Meters of a camera above the ground. */
export const cameraHeight = ({ height = EYE_HEIGHT }: Camera): number => height;

/** The point of the ground that a spot of the photo shows; null at and above the horizon. */
export function groundPoint(camera: Camera, aspect: number, [x, y]: Point): Vector | null {
  const ray = pixelRay([x * aspect, y], camera, { width: aspect, height: 1 });
  if (-ray[1] < Math.hypot(...ray) * Math.sin(radians(MIN_DEPRESSION))) return null;
  return combine([cameraHeight(camera) / -ray[1], ray]);
}

/**
 * Moved to a spot of the photo: over the ground, onto which one that floats comes down, or, as long as it floats, at its
 * distance. Null where there is no ground.
 */
export function movePlacement(placement: Placement, camera: Camera, aspect: number, spot: Point): Placement | null {
  const onGround = groundPoint(camera, aspect, spot);
  if (placement.grounded) return onGround && resizePlacement({ ...placement, position: onGround }, placement.radius);
  const position = onGround ?? floatingPoint(camera, aspect, spot);
  const radius = onGround ? defaultRadius(camera, position) : placement.radius;
  return resizePlacement({ ...placement, position, grounded: onGround !== null }, radius);
}

/** Moved by meters to the right and away from the camera, kept on ground in front of it. */
export function shiftPlacement(placement: Placement, right: number, forward: number): Placement {
  const [x, y, z] = placement.position;
  const position: Vector = [clamp(x + right, -90, 90), y, clamp(z - forward, -90, -0.3)];
  return resizePlacement({ ...placement, position }, placement.radius);
}

/** Of another radius, as far as the object then stays off the camera. */
export function resizePlacement(placement: Placement, radius: number): Placement {
  return { ...placement, radius: clamp(radius, MIN_RADIUS, maxRadius(placement)) };
}

/** The largest radius there: the object's middle, a radius above its foot, is that many radii away. */
export function maxRadius({ position }: Placement): number {
  const factor = MIN_DISTANCE ** 2 - 1;
  const root = Math.sqrt(position[1] ** 2 + factor * dot(position, position));
  return clamp((position[1] + root) / factor, MIN_RADIUS, MAX_RADIUS);
}

export function rotatePlacement(placement: Placement, by: number): Placement {
  return { ...placement, rotation: ((((placement.rotation + by + 180) % 360) + 360) % 360) - 180 };
}

/** Meters from the camera, along the ground. */
export const groundDistance = ({ position: [x, , z] }: Placement): number => Math.hypot(x, z);

/** Where in the photo the object's foot is, in shares of width and height; null behind the camera. */
export function footPoint(placement: Placement, camera: Camera, aspect: number): Point | null {
  const point = project(placement.position, camera, { width: aspect, height: 1 });
  return point && [point[0] / aspect, point[1]];
}

function floatingPoint(camera: Camera, aspect: number, [x, y]: Point): Vector {
  const ray = pixelRay([x * aspect, y], camera, { width: aspect, height: 1 });
  return combine([FLOATING_DISTANCE / Math.hypot(...ray), ray]);
}

/** The radius [m] that takes its share of the photo's height there; no giant, and not above the horizon. */
function defaultRadius(camera: Camera, position: Vector): number {
  const depth = dot(position, cameraAxes(camera).forward);
  const share = DEFAULT_SHARE * depth * Math.tan(radians(camera.vertical_fov) / 2);
  return Math.min(share, MAX_DEFAULT_RADIUS, MAX_HEIGHT_SHARE * cameraHeight(camera));
}

/** Values of 0 to 255, rows from the top. */
export interface GroundMask {
  width: number;
  height: number;
  lit: Uint8Array; // how far the sun reaches the ground
  sunny: Uint8Array; // 255 where an object stands in the sun, 0 where in shade
}

/** Ground that lies in the sun everywhere: of a photo whose mask is not known. */
export const SUNLIT: GroundMask = { width: 1, height: 1, lit: Uint8Array.of(255), sunny: Uint8Array.of(255) };

/** The mask in a picture of the service: its green and its blue. */
export function groundMaskFromPixels({ width, height, data }: Pixels): GroundMask {
  const channel = (c: number): Uint8Array =>
    Uint8Array.from({ length: width * height }, (_, i) => data[4 * i + c] as number);
  return { width, height, lit: channel(1), sunny: channel(2) };
}

/**
 * Whether an object whose foot is at a point of the photo, in shares of its width and height, stands in the sun. Outside of
 * the photo the nearest cell counts.
 */
export function isInSun({ width, height, sunny }: GroundMask, [x, y]: Point): boolean {
  const cell = (share: number, count: number): number => Math.min(Math.max(Math.floor(share * count), 0), count - 1);
  return sunny[cell(y, height) * width + cell(x, width)] === 255;
}

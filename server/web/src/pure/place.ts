/** Where an object stands: metres, the camera at the origin, level ground below it. */

import { clamp, combine, dot, radians, type Vector } from "./angles";
import { type Camera, cameraAxes, type Point, project, rayThrough } from "./camera";

/** Of an object in the photo. */
export interface Place {
  position: Vector; // of the point where it touches the ground, or of its foot where no ground is in view
  radius: number; // metres
  turn: number; // degrees about the vertical, to the right as its front is seen
  grounded: boolean;
}

export const EYE_HEIGHT = 1.6; // metres, as the service has it; the photo itself does not tell the scale
const SHARE_OF_FRAME = 0.14; // of half the photo's height, the object's radius
const LEAST_DEPRESSION = 1; // degrees below the horizon: 92 m away
const AFLOAT = 4; // metres, of an object without ground
const SMALLEST = 0.02; // metres, the radius
const LARGEST = 20;
const NEAREST = 2; // radii that the camera keeps away from the object's middle, which then takes at most 60 degrees

/** A place at a spot of the photo, in shares of its width and height, as large as looks well there. */
export function placeFor(camera: Camera, aspect: number, spot: Point | null): Place {
  const found = spot && onGround(camera, aspect, spot);
  const position = found ?? along(camera, aspect, spot ?? [0.5, 0.66]);
  return sized({ position, radius: 0, turn: 0, grounded: found !== null }, fitting(camera, position));
}

/** The point of the ground that a spot of the photo shows; null at and above the horizon. */
export function onGround(camera: Camera, aspect: number, [x, y]: Point): Vector | null {
  const ray = rayThrough([x * aspect, y], camera, { width: aspect, height: 1 });
  if (-ray[1] < Math.hypot(...ray) * Math.sin(radians(LEAST_DEPRESSION))) return null;
  return combine([EYE_HEIGHT / -ray[1], ray]);
}

/** Moved to a spot of the photo: over the ground, or at its distance where it floats. Null where there is no ground. */
export function moved(place: Place, camera: Camera, aspect: number, spot: Point): Place | null {
  const position = place.grounded ? onGround(camera, aspect, spot) : along(camera, aspect, spot);
  return position && sized({ ...place, position }, place.radius);
}

/** Moved by metres to the right and away from the camera, kept on ground in front of it. */
export function shifted(place: Place, right: number, away: number): Place {
  const [x, y, z] = place.position;
  const position: Vector = [clamp(x + right, -90, 90), y, clamp(z - away, -90, -0.3)];
  return sized({ ...place, position }, place.radius);
}

/** Of another radius, as far as the object then stays off the camera. */
export function sized(place: Place, radius: number): Place {
  return { ...place, radius: clamp(radius, SMALLEST, largest(place)) };
}

/** The largest radius there: the object's middle, a radius above its foot, is that many radii away. */
export function largest({ position }: Place): number {
  const more = NEAREST ** 2 - 1;
  const root = Math.sqrt(position[1] ** 2 + more * dot(position, position));
  return clamp((position[1] + root) / more, SMALLEST, LARGEST);
}

export function turned(place: Place, by: number): Place {
  return { ...place, turn: ((((place.turn + by + 180) % 360) + 360) % 360) - 180 };
}

/** Metres from the camera, along the ground. */
export const distance = ({ position: [x, , z] }: Place): number => Math.hypot(x, z);

/** Where in the photo the object's foot is, in shares of width and height; null behind the camera. */
export function footOf(place: Place, camera: Camera, aspect: number): Point | null {
  const at = project(place.position, camera, { width: aspect, height: 1 });
  return at && [at[0] / aspect, at[1]];
}

function along(camera: Camera, aspect: number, [x, y]: Point): Vector {
  const ray = rayThrough([x * aspect, y], camera, { width: aspect, height: 1 });
  return combine([AFLOAT / Math.hypot(...ray), ray]);
}

/** The radius [m] that takes its share of the photo's height there. */
function fitting(camera: Camera, position: Vector): number {
  const depth = dot(position, cameraAxes(camera).forward);
  return SHARE_OF_FRAME * depth * Math.tan(radians(camera.vertical_fov) / 2);
}

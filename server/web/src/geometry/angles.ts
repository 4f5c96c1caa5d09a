/**
 * Directions in the frame of `lighting/geometry.py`: right-handed, +Y up, the camera looks along -Z at azimuth 0 and +X
 * is to its right. Angles in degrees; azimuth grows to the right, elevation upwards from the horizon.
 */

export type Vector = readonly [x: number, y: number, z: number];

export interface Angles {
  azimuth: number;
  elevation: number;
}

export const radians = (degrees: number): number => (degrees * Math.PI) / 180;
export const degrees = (radians: number): number => (radians * 180) / Math.PI;
export const clamp = (value: number, low: number, high: number): number => Math.min(Math.max(value, low), high);

export function direction(azimuth: number, elevation: number): Vector {
  const [az, el] = [radians(azimuth), radians(elevation)];
  return [Math.sin(az) * Math.cos(el), Math.sin(el), -Math.cos(az) * Math.cos(el)];
}

export function angles([x, y, z]: Vector): Angles {
  return { azimuth: wrapAzimuth(degrees(Math.atan2(x, -z))), elevation: degrees(Math.atan2(y, Math.hypot(x, z))) };
}

/** The same azimuth in (-180, 180]. */
export function wrapAzimuth(azimuth: number): number {
  const wrapped = (180 - azimuth) % 360;
  return 180 - (wrapped < 0 ? wrapped + 360 : wrapped);
}

export const dot = (a: Vector, b: Vector): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

/** Degrees between two unit vectors. */
export const angleBetween = (a: Vector, b: Vector): number => degrees(Math.acos(clamp(dot(a, b), -1, 1)));

export const cross = (a: Vector, b: Vector): Vector => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** The sum of vectors times their weights. */
export function combine(...terms: [weight: number, vector: Vector][]): Vector {
  const component = (axis: 0 | 1 | 2): number =>
    terms.reduce((sum, [weight, vector]) => sum + weight * vector[axis], 0);
  return [component(0), component(1), component(2)];
}

/**
 * A sky as a lat-long map in the layout of `lighting/envmap` (row 0 the zenith, the center column azimuth 0): painted, as
 * people look at it, and as the service exported it.
 */

import type { LightParameters } from "../api";
import { angleBetween, clamp, degrees, direction, radians } from "../geometry/angles";
import { CHANNELS, linearToSrgb, rgbLuminance, type Triple } from "../geometry/color";
import { toMap } from "../geometry/sphere";
import { gradation, type HosekWilkieSky, lobe, type PragueSky, pragueRow } from "./models";

/** Four floats a pixel: red, green, blue and one unused. */
export interface Latlong {
  width: number;
  height: number;
  data: Float32Array;
}

/** A light as a renderer needs it. */
export interface SceneLight {
  map: Latlong; // the sky without the sun's disc above the ground
  sky: Triple; // irradiance of level ground by the sky alone
  sun: Triple; // irradiance of a plane that faces the sun; zero where it does not shine
  ground: Triple; // radiance of the ground
}

export const LIGHT_ROWS = 128; // of maps that light the object: finer ones take phones too long to prefilter
const LOBE_STEPS = 4096; // of the table over the angle to the sun

/** How a Hosek-Wilkie sky is painted. */
interface SkyOptions {
  azimuth: number; // of the sun, degrees
  elevation: number;
  gain: Triple; // exposure, and what takes the model to the irradiance of the record
  cover: number; // 0 clear to 1 overcast
}

/** Radiance of one channel along a row of a map, by the angle to the sun in radians. */
type RowRadiance = (sunAngle: number) => number;

/** A map whose upper half is the sky without the sun's disc; the lower half is black. */
export function renderHosekWilkieSky(height: number, sky: HosekWilkieSky, options: SkyOptions): Latlong {
  const { azimuth, elevation, gain, cover } = options;
  const lobes = CHANNELS.map((c) =>
    Float32Array.from({ length: LOBE_STEPS + 1 }, (_, i) => lobe(sky.coefficients[c], (Math.PI * i) / LOBE_STEPS)),
  );
  const map = renderSky(height, azimuth, elevation, (rowElevation, c) => {
    const [factor, offset] = gradation(sky.coefficients[c], Math.sin(rowElevation));
    return (sunAngle) => {
      const lobeValue = interpolate(lobes[c] as Float32Array, (sunAngle / Math.PI) * LOBE_STEPS);
      return Math.max((lobeValue + offset) * factor * sky.radiance[c], 0) * gain[c];
    };
  });
  if (cover > 0) mixOvercast(map, cover);
  return map;
}

/** The same by the Prague model, at any scale. */
export function renderPragueSky(height: number, sky: PragueSky, sunAzimuth: number, sunElevation: number): Latlong {
  return renderSky(height, sunAzimuth, sunElevation, (rowElevation, c) => {
    const radiance = pragueRow(sky, 90 - degrees(rowElevation), c);
    return (sunAngle) => radiance(degrees(sunAngle));
  });
}

/** A map whose upper half is a sky; `rowRadiance` is of a row's elevation in radians and of a channel. */
function renderSky(
  height: number,
  sunAzimuth: number,
  sunElevation: number,
  rowRadiance: (rowElevation: number, channel: 0 | 1 | 2) => RowRadiance,
): Latlong {
  const width = 2 * height;
  const data = new Float32Array(4 * width * height);
  const sun = radians(sunElevation);
  const columns = Float64Array.from({ length: width }, (_, x) => {
    const azimuth = ((x + 0.5) / width) * 360 - 180;
    return Math.sin(radians(azimuth - sunAzimuth) / 2) ** 2;
  });
  for (let y = 0; y < height / 2; y++) {
    const elevation = Math.PI / 2 - ((y + 0.5) * Math.PI) / height;
    const vertical = Math.sin((elevation - sun) / 2) ** 2;
    const horizontal = Math.cos(elevation) * Math.cos(sun);
    const row = CHANNELS.map((c) => rowRadiance(elevation, c));
    for (let x = 0; x < width; x++) {
      const sunAngle = 2 * Math.asin(Math.sqrt(Math.min(vertical + horizontal * (columns[x] as number), 1)));
      const at = 4 * (y * width + x);
      for (const c of CHANNELS) data[at + c] = (row[c] as RowRadiance)(sunAngle);
      data[at + 3] = 1;
    }
  }
  return { width, height, data };
}

function interpolate(table: Float32Array, step: number): number {
  const low = Math.min(Math.floor(step), table.length - 2);
  const share = step - low;
  return (table[low] as number) * (1 - share) + (table[low + 1] as number) * share;
}

/** Irradiance of open level ground by the upper half of a map. */
export function horizontalIrradiance({ width, height, data }: Latlong): Triple {
  const sum: Triple = [0, 0, 0];
  const edge = (row: number): number => Math.cos((Math.PI * row) / height) ** 2;
  for (let y = 0; y < height / 2; y++) {
    const share = ((edge(y) - edge(y + 1)) * Math.PI) / width;
    for (let i = y * width * 4; i < (y + 1) * width * 4; i += 4) {
      for (const c of CHANNELS) sum[c] += share * (data[i + c] as number);
    }
  }
  return sum;
}

/** Brings a share of the standard overcast sky (CIE, Moon and Spencer) into a map, its irradiance kept. */
function mixOvercast(map: Latlong, cover: number): void {
  const irradiance = horizontalIrradiance(map);
  const grey = rgbLuminance(irradiance);
  const zenith = grey / ((7 * Math.PI) / 9);
  for (let y = 0; y < map.height / 2; y++) {
    const value = (zenith * (1 + 2 * Math.cos(((y + 0.5) * Math.PI) / map.height))) / 3; // (1 + 2 sin elevation) / 3
    for (let i = y * map.width * 4; i < (y + 1) * map.width * 4; i += 4) {
      for (const c of CHANNELS) map.data[i + c] = (map.data[i + c] as number) * (1 - cover) + cover * value;
    }
  }
}

/** Adds a standard overcast sky of an irradiance of level ground. */
export function addOvercast(map: Latlong, irradiance: Triple): void {
  for (let y = 0; y < map.height / 2; y++) {
    const share = (1 + 2 * Math.cos(((y + 0.5) * Math.PI) / map.height)) / ((7 * Math.PI) / 3);
    for (let i = y * map.width * 4; i < (y + 1) * map.width * 4; i += 4) {
      for (const c of CHANNELS) map.data[i + c] = (map.data[i + c] as number) + share * irradiance[c];
    }
  }
}

/** Fills the lower half with one radiance. */
export function fillGround({ width, height, data }: Latlong, radiance: Triple): void {
  for (let i = (height / 2) * width * 4; i < data.length; i += 4) {
    data.set(radiance, i);
    data[i + 3] = 1;
  }
}

export interface MapPicture {
  width: number;
  height: number;
  data: Uint8ClampedArray<ArrayBuffer>;
}

const CURVE_STEPS = 4096; // of the table of the curve
const CURVE_MAX = 8; // linear value beyond which all is white
const TONE_CURVE = Uint8ClampedArray.from(
  { length: CURVE_STEPS + 1 },
  (_, i) => 255 * linearToSrgb(compressHighlights((i / CURVE_STEPS) * CURVE_MAX)),
);

/** As `lighting preview`: values up to 0.6 stay as they are, brighter ones bend towards white. */
function compressHighlights(value: number): number {
  return Math.min(value, 0.6) + 0.4 * (1 - Math.exp(-Math.max(value - 0.6, 0) / 0.4));
}

export function toneMap({ map, sun }: SceneLight, parameters: LightParameters): MapPicture {
  const { width, height } = map;
  const values = map.data.slice();
  const [x, y] = toMap(direction(parameters.sun_azimuth, parameters.sun_elevation));
  const row = Math.min(Math.floor(y * height), height / 2 - 1);
  const at = 4 * (row * width + (Math.floor((x * width) / 2) % width));
  const solidAngle =
    (Math.PI / height) * ((2 * Math.PI) / width) * Math.cos(radians(90 - ((row + 0.5) * 180) / height));
  for (const c of CHANNELS) values[at + c] = (values[at + c] as number) + sun[c] / Math.max(solidAngle, 1e-6);
  const data = new Uint8ClampedArray(values.length);
  for (let i = 0; i < values.length; i++) {
    data[i] =
      i % 4 === 3
        ? 255
        : (TONE_CURVE[Math.round((Math.min(values[i] as number, CURVE_MAX) / CURVE_MAX) * CURVE_STEPS)] as number);
  }
  return { width, height, data };
}

/** A map of half the rows and columns. */
export function halveMap({ width, height, data }: Latlong): Latlong {
  const half = { width: width / 2, height: height / 2, data: new Float32Array(data.length / 4) };
  for (let i = 0; i < half.data.length; i++) {
    const [row, column] = [Math.floor(i / 4 / half.width), Math.floor(i / 4) % half.width];
    const at = 4 * (2 * row * width + 2 * column) + (i % 4);
    const sum = [0, 4, 4 * width, 4 * width + 4].reduce((total, step) => total + (data[at + step] as number), 0);
    half.data[i] = sum / 4;
  }
  return half;
}

const DISC = 3; // degrees around the sun that hold its disc in a coarse map
const RING = 7; // degrees around it whose sky takes the disc's place
const FADING: [number, number] = [0.05, 20]; // how far a pixel follows a light that has changed since the export
const EPSILON = 1e-9;

/** Directions of a map's pixels, row by row. */
const pixelDirection = ({ width, height }: Latlong, pixel: number): readonly [number, number, number] =>
  direction((((pixel % width) + 0.5) / width) * 360 - 180, 90 - ((Math.floor(pixel / width) + 0.5) / height) * 180);

/** A map whose sun's disc is replaced by the sky around it. */
export function removeDisc(map: Latlong, { sun_azimuth, sun_elevation, sun }: LightParameters): Latlong {
  if (!sun || sun_elevation < 0) return map;
  const towards = direction(sun_azimuth, sun_elevation);
  const data = map.data.slice();
  const inside: number[] = [];
  const around = [0, 0, 0];
  let count = 0;
  for (let pixel = 0; pixel < map.width * map.height; pixel++) {
    const angle = angleBetween(pixelDirection(map, pixel), towards);
    if (angle < DISC) inside.push(pixel);
    else if (angle < RING) {
      for (const c of CHANNELS) (around[c] as number) += map.data[4 * pixel + c] as number;
      count++;
    }
  }
  for (const pixel of inside) {
    for (const c of CHANNELS) {
      data[4 * pixel + c] = Math.min(data[4 * pixel + c] as number, (around[c] as number) / Math.max(count, 1));
    }
  }
  return { ...map, data };
}

/** Bare maps of two lights, by the same sky model. */
interface BareMaps {
  before: Latlong; // of the light that was exported
  now: Latlong; // of the light on show
}

/** An exported map in another light, until the service has exported that one: each pixel changes as the bare map does. */
export function followLight(exported: Latlong, { before, now }: BareMaps): Latlong {
  const data = exported.data.slice();
  for (let i = 0; i < data.length; i++) {
    if (i % 4 === 3) continue;
    const change = Math.max(now.data[i] as number, EPSILON) / Math.max(before.data[i] as number, EPSILON);
    data[i] = (data[i] as number) * clamp(change, ...FADING);
  }
  return { ...exported, data };
}

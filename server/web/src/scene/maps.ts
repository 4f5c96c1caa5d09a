/** The light of a scene, from two small maps of the service: with the sun's disc and without. */

import { FloatType } from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import { envmapUrl, file, type Parameters } from "../api";
import { type Latlong, type SceneLight, splitLight } from "../pure/light";

const HEIGHT = 128; // rows; finer ones take phones too long to prefilter

export async function fetchLight(parameters: Parameters, signal: AbortSignal): Promise<SceneLight> {
  const withoutSun = fetchMap({ ...parameters, sun: false }, signal);
  if (!parameters.sun) return withoutSun.then((map) => splitLight(map, map));
  const [lit, unlit] = await Promise.all([fetchMap(parameters, signal), withoutSun]);
  return splitLight(lit, unlit);
}

async function fetchMap(parameters: Parameters, signal: AbortSignal): Promise<Latlong> {
  return decode(await (await file(envmapUrl(parameters, "hdr", HEIGHT), signal)).arrayBuffer());
}

function decode(bytes: ArrayBuffer): Latlong {
  const { width, height, data } = new HDRLoader().setDataType(FloatType).parse(bytes);
  if (!(data instanceof Float32Array) || !width || !height) throw new TypeError("HDRLoader gave no floats.");
  return { width, height, data };
}

/** The light of a scene, from two small maps of the service: with the sun's disc and without. */

import { FloatType } from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import { envmap, type Parameters } from "../api";
import { type Latlong, type SceneLight, splitLight } from "../pure/light";

const HEIGHT = 256; // rows

export async function fetchLight(parameters: Parameters, signal: AbortSignal): Promise<SceneLight> {
  const withoutSun = envmap({ ...parameters, sun: false }, HEIGHT, signal).then(decode);
  if (!parameters.sun) return withoutSun.then((map) => splitLight(map, map));
  const withSun = envmap(parameters, HEIGHT, signal).then(decode);
  return splitLight(await withSun, await withoutSun);
}

function decode(file: ArrayBuffer): Latlong {
  const { width, height, data } = new HDRLoader().setDataType(FloatType).parse(file);
  if (!(data instanceof Float32Array) || !width || !height) throw new TypeError("HDRLoader gave no floats.");
  return { width, height, data };
}

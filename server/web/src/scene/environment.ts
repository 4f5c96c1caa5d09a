/** A map as three.js takes it for reflections. */

import { DataTexture, DataUtils, EquirectangularReflectionMapping, HalfFloatType, LinearFilter } from "three";
import type { Latlong } from "../sky/paint";

const MOST = 65000; // the largest value that half floats hold

export function environment({ width, height, data }: Latlong): DataTexture {
  const half = Uint16Array.from(data, (value) => DataUtils.toHalfFloat(Math.min(value, MOST)));
  const texture = new DataTexture(half, width, height);
  texture.type = HalfFloatType;
  texture.mapping = EquirectangularReflectionMapping;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.flipY = true;
  texture.needsUpdate = true;
  return texture;
}

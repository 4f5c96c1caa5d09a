/** Radiance HDR files, by three.js. */

import { FloatType } from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import type { Latlong } from "../sky/render";

/** The linear values of a file. */
export async function decodeHdr(file: Blob): Promise<Latlong> {
  const { width, height, data } = new HDRLoader().setDataType(FloatType).parse(await file.arrayBuffer());
  return { width, height, data } as Latlong;
}

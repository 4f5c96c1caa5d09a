/** How much room an object takes. */

import { Box3, type Object3D } from "three";

/** The box around every vertex of an object that is in no scene. */
export function boxOf(object: Object3D): Box3 {
  object.updateMatrixWorld(true); // of bones too, which move vertices
  return new Box3().setFromObject(object, true);
}

/** How high an object reaches above the origin. */
export const heightOf = (object: Object3D): number => boxOf(object).max.y;

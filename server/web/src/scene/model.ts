/** The user's own object: a GLB file, brought to radius 1 and to stand on y = 0. It stays in the browser. */

import { type Box3, Group, type Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
import { boundingBox } from "./objects";

const MAX_MODEL_BYTES = 100e6;

/** Reads a .glb; throws an Error with one sentence for what cannot be used. */
export async function readModel(file: File): Promise<Object3D> {
  if (file.size > MAX_MODEL_BYTES) throw new Error(`${file.name} is larger than ${MAX_MODEL_BYTES / 1e6} MB.`);
  const model = await parseGlb(file);
  const box = boundingBox(model);
  if (box.isEmpty()) throw new Error(`${file.name} holds no surfaces.`);
  return normalizeModel(model, box);
}

async function parseGlb(file: File): Promise<Object3D> {
  try {
    return (await new GLTFLoader().parseAsync(await file.arrayBuffer(), "")).scene;
  } catch {
    throw new Error(`${file.name} cannot be read. Use one binary glTF file (.glb) without Draco or KTX2.`);
  }
}

function normalizeModel(model: Object3D, box: Box3): Object3D {
  const size = box.getSize(new Vector3());
  const middle = box.getCenter(new Vector3());
  const scale = 2 / Math.max(size.x, size.y, size.z, 1e-9);
  model.position.sub(new Vector3(middle.x, box.min.y, middle.z));
  const group = new Group();
  group.add(model);
  group.scale.setScalar(scale);
  const outer = new Group();
  outer.add(group);
  return outer;
}

/** What one can put into the photo: shapes of radius about 1 that stand on y = 0, materials, and the user's own object. */

import {
  Box3,
  type BufferGeometry,
  Color,
  Float32BufferAttribute,
  Group,
  Mesh,
  MeshPhysicalMaterial,
  MeshStandardMaterial,
  type Object3D,
  SphereGeometry,
  TorusKnotGeometry,
  Vector3,
} from "three";
import { RoundedBoxGeometry } from "three/addons/geometries/RoundedBoxGeometry.js";
import { TeapotGeometry } from "three/addons/geometries/TeapotGeometry.js";
import type { Finish, Shape } from "../state";

const GEOMETRIES: Record<Exclude<Shape, "own">, () => BufferGeometry> = {
  sphere: () => new SphereGeometry(1, 96, 64),
  teapot: () => new TeapotGeometry(0.85, 20),
  knot: () => new TorusKnotGeometry(0.68, 0.24, 240, 32, 2, 3),
  box: () => new RoundedBoxGeometry(1.4, 1.4, 1.4, 12, 0.08).rotateY(Math.PI / 5),
};

const MATERIALS: Record<Finish, () => MeshStandardMaterial> = {
  mirror: () => new MeshStandardMaterial({ metalness: 1, roughness: 0.03, color: new Color(0.92, 0.92, 0.92) }),
  glossy: () => new MeshPhysicalMaterial({ roughness: 0.45, color: 0xb3262e, clearcoat: 1, clearcoatRoughness: 0.06 }),
  matte: () => new MeshStandardMaterial({ roughness: 1, color: new Color(0.6, 0.6, 0.6) }),
  original: () => new MeshStandardMaterial({ roughness: 0.7, color: new Color(0.6, 0.6, 0.6) }),
};

/** A shape standing on the origin. */
export function createShape(shape: Exclude<Shape, "own">): Mesh {
  const geometry = GEOMETRIES[shape]();
  geometry.computeBoundingBox();
  geometry.translate(0, -(geometry.boundingBox?.min.y ?? 0), 0);
  darkenTowardGround(geometry);
  return new Mesh(geometry);
}

/** A material; with `shaded`, it takes the darkening that a geometry carries as vertex colors. */
export function createFinish(finish: Finish, shaded: boolean): MeshStandardMaterial {
  const material = MATERIALS[finish]();
  material.vertexColors = shaded;
  return material;
}

/** Vertex colors for the ground's light that an object takes from itself: none where it touches, all of it high up. */
function darkenTowardGround(geometry: BufferGeometry): void {
  const { position, normal } = geometry.attributes;
  if (!position || !normal) return;
  const colors = new Float32Array(3 * position.count);
  for (let i = 0; i < position.count; i++) {
    const facing = (1 - normal.getY(i)) / 2;
    const height = Math.max(position.getY(i), 0);
    colors.fill(1 - facing / (1 + height), 3 * i, 3 * i + 3);
  }
  geometry.setAttribute("color", new Float32BufferAttribute(colors, 3));
}

/** The box around every vertex of an object that is in no scene. */
function boundingBox(object: Object3D): Box3 {
  object.updateMatrixWorld(true); // of bones too, which move vertices
  return new Box3().setFromObject(object, true);
}

/** How high an object reaches above the origin. */
export const heightAboveOrigin = (object: Object3D): number => boundingBox(object).max.y;

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
  const { GLTFLoader } = await import("three/addons/loaders/GLTFLoader.js"); // for few: not with the stage
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

/** The photo with an object in it, in three.js. Its world is the frame of `geometry/angles`, the camera at the origin, meters. */

import {
  CanvasTexture,
  CustomToneMapping,
  DataTexture,
  DataUtils,
  DirectionalLight,
  EquirectangularReflectionMapping,
  FloatType,
  Group,
  HalfFloatType,
  LinearFilter,
  Matrix4,
  Mesh,
  type Object3D,
  PCFShadowMap,
  PerspectiveCamera,
  Scene,
  ShaderChunk,
  SRGBColorSpace,
  Texture,
  Vector2,
  Vector3,
  WebGLRenderer,
} from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
import type { LightParameters } from "../api";
import { direction, radians, type Vector } from "../geometry/angles";
import { type Camera, cameraAxes } from "../geometry/camera";
import type { GroundMask, Placement } from "../geometry/placement";
import type { SceneLight } from "../sky/lighting";
import type { Latlong } from "../sky/render";
import type { Finish, Shape } from "../state";
import { ShadowGround } from "./ground";
import { createFinish, createShape, heightAboveOrigin } from "./objects";
import { animateWebp } from "./webp";

// The shoulder of `lighting preview`: values up to 0.6 stay as they are, brighter ones bend towards white.
ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(
  "vec3 CustomToneMapping( vec3 color ) { return color; }",
  `vec3 CustomToneMapping( vec3 color ) {
    vec3 linear = toneMappingExposure * color;
    return min(linear, 0.6) + 0.4 * (1.0 - exp(-max(linear - 0.6, 0.0) / 0.4));
  }`,
);

const TURNTABLE = { frames: 36, milliseconds: 80, width: 640 };

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera();
  private readonly sun = new DirectionalLight();
  private readonly ground = new ShadowGround();
  private readonly object = new Group();
  private ownModel: Object3D | undefined;
  private appearance = ""; // the shape and finish that the object has
  private height = 0; // of the object at radius 1
  private sunDirection = new Vector3(0, 1, 0);
  private groundMask: GroundMask | undefined;
  private size = ""; // of the canvas, in the pixels of that screen
  private scheduled = false;

  /** Throws where the browser has no WebGL. */
  constructor(canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.toneMapping = CustomToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.scene.environmentRotation.y = Math.PI / 2; // three.js has +X at a map's center, here it is -Z
    this.scene.add(this.ground, this.object, this.sun, this.sun.target);
    this.handleContextLoss(canvas);
  }

  /** A browser may take the canvas's memory, as phones do in the background: the photo behind it shows until it is back. */
  private handleContextLoss(canvas: HTMLCanvasElement): void {
    canvas.addEventListener("webglcontextlost", () => {
      canvas.style.visibility = "hidden";
    });
    canvas.addEventListener("webglcontextrestored", () => {
      canvas.style.visibility = "";
      this.draw();
    });
  }

  /** How high the object stands, meters. */
  get objectHeight(): number {
    return this.height * this.object.scale.x;
  }

  /** The photo as the backdrop. */
  setPhoto(photo: HTMLCanvasElement): void {
    if (this.scene.background instanceof Texture) this.scene.background.dispose();
    const texture = new CanvasTexture(photo);
    texture.colorSpace = SRGBColorSpace;
    this.scene.background = texture;
    this.camera.aspect = photo.width / photo.height;
  }

  /** The camera that took it. */
  setCamera(camera: Camera): void {
    this.camera.fov = camera.vertical_fov;
    this.camera.near = 0.02;
    this.camera.updateProjectionMatrix();
    const { right, up, forward } = cameraAxes(camera);
    const basis = new Matrix4().makeBasis(vector(right), vector(up), vector(forward).negate());
    this.camera.quaternion.setFromRotationMatrix(basis);
    this.draw();
  }

  /** Where the photo's ground lies in the sun. */
  setGroundMask(mask: GroundMask): void {
    if (mask === this.groundMask) return;
    this.groundMask = mask;
    this.ground.setMask(mask);
    this.draw();
  }

  /** Where the object stands, its size and its rotation, and whether it stands in the sun. */
  setPlacement({ position, radius, rotation, grounded }: Placement, inSun: boolean): void {
    this.object.position.copy(vector(position));
    this.object.scale.setScalar(radius);
    this.object.rotation.y = radians(rotation);
    this.ground.visible = grounded;
    this.ground.setObject(this.object.position, radius);
    this.sun.intensity = Number(inSun);
    this.ground.setInSun(inSun);
    this.aimSun();
    this.draw();
  }

  /** The user's own object, shown as the shape `own`. */
  setOwnModel(model: Object3D): void {
    this.ownModel = model;
    this.appearance = "";
  }

  setAppearance(shape: Shape, finish: Finish): void {
    const next = `${shape} ${finish}`;
    if (next === this.appearance) return;
    this.appearance = next;
    const model = shape === "own" ? this.ownModel : createShape(shape);
    if (!model) return;
    this.removeObject();
    this.height = heightAboveOrigin(model);
    this.object.add(shape === "own" ? model.clone() : model);
    const keep = shape === "own" && finish === "original";
    const material = keep ? null : createFinish(finish, shape !== "own");
    this.object.traverse((part) => {
      if (!(part instanceof Mesh)) return;
      part.castShadow = true;
      part.receiveShadow = true;
      if (material) part.material = material;
    });
    this.draw();
  }

  /** Takes the object away; the user's own is kept for later. */
  private removeObject(): void {
    for (const part of this.object.children) if (part instanceof Mesh) part.geometry.dispose();
    this.object.clear();
  }

  setLight(light: SceneLight, parameters: LightParameters): void {
    this.scene.environment?.dispose();
    this.scene.environment = environmentTexture(light.map);
    this.sunDirection = vector(direction(parameters.sun_azimuth, parameters.sun_elevation));
    this.aimSun();
    this.sun.color.setRGB(...light.sun);
    this.sun.visible = Math.max(...light.sun) > 0;
    const [r, g, b] = light.sun;
    this.ground.setIrradiance(light.sky, [r * this.sunDirection.y, g * this.sunDirection.y, b * this.sunDirection.y]);
    this.draw();
  }

  setSize(width: number, height: number): void {
    const size = `${width} ${height} ${window.devicePixelRatio}`;
    if (size === this.size) return; // else the canvas begins anew
    this.size = size;
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.ground.setSize(this.renderer.getDrawingBufferSize(new Vector2()));
    this.draw();
  }

  /** The object turned once around, as an animated WebP, or as a GIF where the browser writes no WebP. */
  async drawTurntable(): Promise<Blob> {
    const drawn = this.renderer.domElement;
    const width = Math.min(drawn.width, TURNTABLE.width);
    const height = Math.round((width * drawn.height) / drawn.width);
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const context = canvas.getContext("2d", { alpha: false });
    if (!context) throw new Error("This browser draws no pictures.");
    const start = this.object.rotation.y;
    const frames: (ArrayBuffer | ImageData)[] = [];
    for (let i = 0; i < TURNTABLE.frames; i++) {
      this.object.rotation.y = start + (2 * Math.PI * i) / TURNTABLE.frames;
      this.renderer.render(this.scene, this.camera);
      context.drawImage(drawn, 0, 0, width, height);
      this.object.rotation.y = start; // whatever else is drawn meanwhile
      const frame = await new Promise<Blob | null>((resolve) => canvas.toBlob(resolve, "image/webp", 0.82));
      const isWebp = frame?.type === "image/webp"; // else it is a PNG
      frames.push(isWebp ? await frame.arrayBuffer() : context.getImageData(0, 0, width, height));
    }
    this.draw();
    return writeTurntable(frames, width, height);
  }

  /** The light's box follows the object alone: what it shades lies along the beam, however long the shadow. */
  private aimSun(): void {
    const radius = this.object.scale.x;
    const reach = 2.2 * radius;
    const middle = this.object.position.clone().setY(this.object.position.y + radius);
    this.sun.target.position.copy(middle);
    this.sun.position.copy(middle).addScaledVector(this.sunDirection, 2 * reach);
    const box = { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * reach, far: 80 * reach };
    Object.assign(this.sun.shadow.camera, box).updateProjectionMatrix();
    this.sun.shadow.normalBias = 0.01 * radius;
  }

  /** One frame, however many calls come before the next. */
  private draw(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.renderer.render(this.scene, this.camera);
    });
  }
}

async function writeTurntable(
  frames: readonly (ArrayBuffer | ImageData)[],
  width: number,
  height: number,
): Promise<Blob> {
  const webps = frames.filter((frame) => frame instanceof ArrayBuffer);
  if (webps.length === frames.length)
    return new Blob([animateWebp(webps, width, height, TURNTABLE.milliseconds)], { type: "image/webp" });
  const { animateGif } = await import("./gif");
  const pictures = frames.filter((frame) => frame instanceof ImageData);
  return new Blob([animateGif(pictures, TURNTABLE.milliseconds)], { type: "image/gif" });
}

const vector = ([x, y, z]: Vector): Vector3 => new Vector3(x, y, z);

const MAX_HALF_FLOAT = 65000; // the largest value that half floats hold

function environmentTexture({ width, height, data }: Latlong): DataTexture {
  const half = new Uint16Array(data.length);
  for (let i = 0; i < data.length; i++) half[i] = DataUtils.toHalfFloat(Math.min(data[i] as number, MAX_HALF_FLOAT));
  const texture = new DataTexture(half, width, height);
  texture.type = HalfFloatType;
  texture.mapping = EquirectangularReflectionMapping;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.flipY = true;
  texture.needsUpdate = true;
  return texture;
}

/** The linear values of a file. */
export async function decodeHdr(file: Blob): Promise<Latlong> {
  const { width, height, data } = new HDRLoader().setDataType(FloatType).parse(await file.arrayBuffer());
  return { width, height, data } as Latlong;
}

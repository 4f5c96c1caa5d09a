/** The photo with an object in it, in three.js. Its world is the frame of `pure/angles`, the camera at the origin, metres. */

import {
  BufferGeometry,
  CanvasTexture,
  CustomToneMapping,
  DataTexture,
  DataUtils,
  DirectionalLight,
  EquirectangularReflectionMapping,
  HalfFloatType,
  LinearFilter,
  Matrix4,
  Mesh,
  PCFShadowMap,
  PerspectiveCamera,
  Scene,
  ShaderChunk,
  SRGBColorSpace,
  Texture,
  Vector3,
  WebGLRenderer,
} from "three";
import type { Parameters } from "../api";
import { direction, radians, type Vector } from "../pure/angles";
import { type Camera, cameraAxes, placeFor } from "../pure/camera";
import type { Latlong, SceneLight } from "../pure/light";
import type { Finish, Shape } from "../pure/objects";
import { Ground } from "./ground";
import { geometryOf, materialOf } from "./objects";

// The shoulder of `lighting preview`: values up to 0.6 stay as they are, brighter ones bend towards white.
ShaderChunk.tonemapping_pars_fragment = ShaderChunk.tonemapping_pars_fragment.replace(
  "vec3 CustomToneMapping( vec3 color ) { return color; }",
  `vec3 CustomToneMapping( vec3 color ) {
    vec3 linear = toneMappingExposure * color;
    return min(linear, 0.6) + 0.4 * (1.0 - exp(-max(linear - 0.6, 0.0) / 0.4));
  }`,
);

export class Stage {
  private readonly renderer: WebGLRenderer;
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera();
  private readonly sun = new DirectionalLight();
  private readonly ground = new Ground();
  private readonly object = new Mesh(new BufferGeometry(), materialOf("chrome"));
  private radius = 1;
  private shape: Shape = "sphere";
  private scheduled = false;

  /** Throws where the browser has no WebGL. */
  constructor(canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.toneMapping = CustomToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFShadowMap;
    this.object.castShadow = true;
    this.object.receiveShadow = true;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.scene.environmentRotation.y = Math.PI / 2; // three.js has +X at a map's centre, here it is -Z
    this.scene.add(this.ground, this.object, this.sun, this.sun.target);
  }

  /** The photo as the backdrop, seen by its own camera, with the object in its lower middle. */
  setPhoto(photo: HTMLCanvasElement, camera: Camera): void {
    this.replaceBackground(photo);
    this.camera.fov = camera.vertical_fov;
    this.camera.aspect = photo.width / photo.height;
    this.camera.near = 0.05;
    this.camera.updateProjectionMatrix();
    const { right, up, forward } = cameraAxes(camera);
    const basis = new Matrix4().makeBasis(vector(right), vector(up), vector(forward).negate());
    this.camera.quaternion.setFromRotationMatrix(basis);
    const place = placeFor(camera);
    this.radius = place.radius;
    this.ground.visible = place.grounded;
    this.object.position.copy(vector(place.position));
    this.object.rotation.y = 0;
    this.ground.carry(this.object.position, place.radius);
    this.setShape(this.shape);
  }

  setShape(shape: Shape): void {
    this.shape = shape;
    this.object.geometry.dispose();
    this.object.geometry = geometryOf(shape, this.radius);
    this.draw();
  }

  setFinish(finish: Finish): void {
    this.object.material.dispose();
    this.object.material = materialOf(finish);
    this.draw();
  }

  /** Turns the object about its vertical axis, to the right as its front is seen. */
  turn(degrees: number): void {
    this.object.rotation.y += radians(degrees);
    this.draw();
  }

  setLight(light: SceneLight, parameters: Parameters): void {
    this.scene.environment?.dispose();
    this.scene.environment = environment(light.map);
    const towards = vector(direction(parameters.sun_azimuth, parameters.sun_elevation));
    this.aimSun(towards);
    this.sun.color.setRGB(...light.sun);
    this.sun.visible = Math.max(...light.sun) > 0;
    const [r, g, b] = light.sun;
    this.ground.light(light.sky, [r * towards.y, g * towards.y, b * towards.y]);
    this.draw();
  }

  setSize(width: number, height: number): void {
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.draw();
  }

  /** The light's box follows the object alone: what it shades lies along the beam, however long the shadow. */
  private aimSun(towards: Vector3): void {
    const reach = 2.2 * this.radius;
    const middle = this.object.position.clone().setY(this.object.position.y + this.radius);
    this.sun.target.position.copy(middle);
    this.sun.position.copy(middle).addScaledVector(towards, 2 * reach);
    const { camera, ...shadow } = this.sun.shadow;
    Object.assign(camera, {
      left: -reach,
      right: reach,
      top: reach,
      bottom: -reach,
      near: 0.1 * reach,
      far: 80 * reach,
    });
    camera.updateProjectionMatrix();
    shadow.normalBias = 0.01 * this.radius;
  }

  private replaceBackground(photo: HTMLCanvasElement): void {
    if (this.scene.background instanceof Texture) this.scene.background.dispose();
    const texture = new CanvasTexture(photo);
    texture.colorSpace = SRGBColorSpace;
    this.scene.background = texture;
  }

  /** One frame, however often it is asked for before the next. */
  private draw(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => {
      this.scheduled = false;
      this.renderer.render(this.scene, this.camera);
    });
  }
}

const vector = ([x, y, z]: Vector): Vector3 => new Vector3(x, y, z);

function environment({ width, height, data }: Latlong): DataTexture {
  const half = Uint16Array.from(data, (value) => DataUtils.toHalfFloat(Math.min(value, 65000)));
  const texture = new DataTexture(half, width, height);
  texture.type = HalfFloatType;
  texture.mapping = EquirectangularReflectionMapping;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.flipY = true;
  texture.needsUpdate = true;
  return texture;
}

/** The ground that a photo shows: it has no color of its own and multiplies the photo by the light left to it. */

import {
  CustomBlending,
  DataTexture,
  LinearFilter,
  Mesh,
  PlaneGeometry,
  RedFormat,
  ShaderMaterial,
  SrcColorFactor,
  UniformsLib,
  UniformsUtils,
  Vector2,
  Vector3,
  ZeroFactor,
} from "three";
import type { Triple } from "../geometry/color";
import type { GroundMask } from "../geometry/placement";

const VERTEX = /* glsl */ `
#include <common>
#include <shadowmap_pars_vertex>
varying vec3 spot;
void main() {
  #include <beginnormal_vertex>
  #include <defaultnormal_vertex>
  #include <begin_vertex>
  #include <project_vertex>
  #include <worldpos_vertex>
  #include <shadowmap_vertex>
  spot = (modelMatrix * vec4(transformed, 1.0)).xyz;
}`;

// The share of a uniform sky that a sphere hides from level ground is height x radius^2 / distance^3. The sun that the
// object takes away is only what the picture's ground has there: none in shade, and none if it stands in shade itself.
const FRAGMENT = /* glsl */ `
#include <common>
#include <packing>
#include <lights_pars_begin>
#include <shadowmap_pars_fragment>
#include <shadowmask_pars_fragment>
uniform vec3 sky;
uniform vec3 sun;
uniform vec3 object;
uniform float radius;
uniform sampler2D lit;
uniform float share;
uniform vec2 canvas;
varying vec3 spot;
void main() {
  float gap = distance(spot, object + vec3(0.0, radius, 0.0));
  float open = 1.0 - min(pow(radius / gap, 3.0), 1.0);
  vec2 at = gl_FragCoord.xy / canvas;
  vec3 here = sun * texture2D(lit, vec2(at.x, 1.0 - at.y)).r;
  gl_FragColor = vec4((sky * open + here * mix(1.0, getShadowMask(), share)) / max(sky + here, vec3(1e-6)), 1.0);
  #include <colorspace_fragment>
}`;

export class ShadowGround extends Mesh<PlaneGeometry, ShaderMaterial> {
  constructor() {
    super(new PlaneGeometry(400, 400).rotateX(-Math.PI / 2), createMaterial());
    this.receiveShadow = true;
  }

  /** Irradiance of the level ground by the sky and by the sun. */
  setIrradiance(sky: Triple, sun: Triple): void {
    Object.assign(this.material.uniforms, { sky: { value: new Vector3(...sky) }, sun: { value: new Vector3(...sun) } });
  }

  /** The object on it: where it touches and how large it is. */
  setObject(position: Vector3, radius: number): void {
    this.position.copy(position);
    Object.assign(this.material.uniforms, { object: { value: position.clone() }, radius: { value: radius } });
  }

  /** Where the picture's ground lies in the sun. */
  setMask({ width, height, lit }: GroundMask): void {
    this.material.uniforms.lit?.value?.dispose();
    Object.assign(this.material.uniforms, { lit: { value: maskTexture(lit, width, height) } });
  }

  /** Whether the object stands in the sun, which it then takes from the ground. */
  setInSun(inSun: boolean): void {
    Object.assign(this.material.uniforms, { share: { value: Number(inSun) } });
  }

  /** The size of what is drawn on, pixels. */
  setSize(canvas: Vector2): void {
    Object.assign(this.material.uniforms, { canvas: { value: canvas } });
  }
}

function maskTexture(data: Uint8Array, width: number, height: number): DataTexture {
  const texture = new DataTexture(new Uint8Array(data), width, height, RedFormat);
  texture.unpackAlignment = 1;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}

function createMaterial(): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: VERTEX,
    fragmentShader: FRAGMENT,
    uniforms: UniformsUtils.merge([
      UniformsLib.lights,
      {
        sky: { value: new Vector3() },
        sun: { value: new Vector3() },
        object: { value: new Vector3() },
        radius: { value: 1 },
        share: { value: 1 },
        canvas: { value: new Vector2(1, 1) },
        lit: { value: maskTexture(Uint8Array.of(255), 1, 1) },
      },
    ]),
    lights: true,
    depthWrite: false,
    blending: CustomBlending, // the picture x this, both as encoded for display
    blendSrc: ZeroFactor,
    blendDst: SrcColorFactor,
    transparent: true,
  });
}

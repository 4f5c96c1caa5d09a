/** The ground that a photo shows: it has no colour of its own and multiplies the photo by the light left to it. */

import {
  CustomBlending,
  Mesh,
  PlaneGeometry,
  ShaderMaterial,
  SrcColorFactor,
  UniformsLib,
  UniformsUtils,
  Vector3,
  ZeroFactor,
} from "three";
import type { Rgb } from "../pure/colour";

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

// The share of a uniform sky that a sphere hides from level ground is height x radius^2 / distance^3.
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
varying vec3 spot;
void main() {
  float gap = distance(spot, object + vec3(0.0, radius, 0.0));
  float open = 1.0 - min(pow(radius / gap, 3.0), 1.0);
  gl_FragColor = vec4((sky * open + sun * getShadowMask()) / max(sky + sun, vec3(1e-6)), 1.0);
  #include <colorspace_fragment>
}`;

export class Ground extends Mesh<PlaneGeometry, ShaderMaterial> {
  constructor() {
    super(new PlaneGeometry(400, 400).rotateX(-Math.PI / 2), groundMaterial());
    this.receiveShadow = true;
  }

  /** Irradiance of the level ground by the sky and by the sun. */
  light(sky: Rgb, sun: Rgb): void {
    Object.assign(this.material.uniforms, { sky: { value: new Vector3(...sky) }, sun: { value: new Vector3(...sun) } });
  }

  /** The object on it: where it touches and how large it is. */
  carry(position: Vector3, radius: number): void {
    this.position.copy(position);
    Object.assign(this.material.uniforms, { object: { value: position.clone() }, radius: { value: radius } });
  }
}

function groundMaterial(): ShaderMaterial {
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

#!/usr/bin/env bash
# Makes three.min.js beside this script: the parts of three.js that viewer.js uses, as the global THREE. Needs npm.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
npm init --yes >/dev/null
npm install --silent --no-audit --no-fund three@0.187.0 esbuild@0.28.2
cat >entry.js <<'END'
export {
  Box3, CircleGeometry, Color, CylinderGeometry, DataTexture, DataUtils, DirectionalLight, EquirectangularReflectionMapping,
  Group, HalfFloatType, LinearFilter, LinearSRGBColorSpace, Matrix4, Mesh, MeshPhysicalMaterial, MeshStandardMaterial, NoToneMapping,
  PCFShadowMap, PerspectiveCamera, Raycaster, Scene, ShadowMaterial, Sphere, SphereGeometry, SRGBColorSpace, TextureLoader, Vector2,
  Vector3, WebGLRenderer,
} from "three";
export { HDRLoader } from "three/addons/loaders/HDRLoader.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
export { TeapotGeometry } from "three/addons/geometries/TeapotGeometry.js";
END
node_modules/.bin/esbuild entry.js --bundle --minify --format=iife --global-name=THREE --target=es2020 \
  --legal-comments=inline --log-level=warning --outfile="$here/three.min.js"
ls -l "$here/three.min.js"

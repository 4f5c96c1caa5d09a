#!/usr/bin/env bash
# three.js' USDLoader makes a turned DistantLight a sun that lights nothing.
#
# Seen on 2026-11-28 with three 0.187.0 of npm (Node 20, Linux x86-64).
# Guessed before: the light shines along its -Z axis, as USD has it.
# Seen: a DirectionalLight of three.js shines from its position to its target's. The loader turns it, but moves neither,
# so both are the origin, and the direction has no length. The intensity arrives; angle and exposure are not read.
#
# Usage: findings/three_usd_sun.sh. It ends with 1 where the loader does otherwise now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.mjs <<'JS'
import { USDLoader } from "three/addons/loaders/USDLoader.js";
import { Vector3 } from "three";

const scene = new USDLoader().parse(`#usda 1.0
def DistantLight "Sun"
{
    float inputs:intensity = 6.85
    float inputs:angle = 0.53
    float3 xformOp:rotateXYZ = (-40, 30, 0)
    uniform token[] xformOpOrder = ["xformOp:rotateXYZ"]
}
`);
scene.updateMatrixWorld(true);
const lights = [];
scene.traverse((object) => object.isDirectionalLight && lights.push(object));
const [sun] = lights;
const to = new Vector3().setFromMatrixPosition(sun.target.matrixWorld);
const length = to.sub(new Vector3().setFromMatrixPosition(sun.matrixWorld)).length();
console.log(`${lights.length} sun of intensity ${sun.intensity}, turned by ${sun.rotation.x.toFixed(2)} rad, direction of length ${length}`);
process.exit(lights.length === 1 && sun.intensity === 6.85 && sun.rotation.x !== 0 && length === 0 ? 0 : 1);
JS
npm install --silent --no-audit --no-fund three@0.187.0
node check.mjs

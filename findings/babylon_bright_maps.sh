#!/usr/bin/env bash
# Babylon.js loses most of a small sun in an HDR map, and fetches a decoder to open most EXR files.
#
# Seen on 2026-11-28 with @babylonjs/core 9.35.0 of npm (Node 20, Linux x86-64).
# Guessed before: the diffuse light is that of the whole map, whatever the size of its cube.
# Seen: each pixel of the cube takes the nearest of the map, so a sun of few pixels counts as too much or too little, and
# diffuse light counts no pixel over 4096. Of a sky with a sun, two fifths of the light are left (printed by size of the cube).
# EXR: without compression, RLE and PIZ are read as they are. ZIPS, ZIP and PXR24 first load fflate from unpkg.com.
#
# Usage: findings/babylon_bright_maps.sh. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.mjs <<'JS'
import { CubeMapToSphericalPolynomialTools } from "@babylonjs/core/Misc/HighDynamicRange/cubemapToSphericalPolynomial.js";
import { PanoramaToCubeMapTools } from "@babylonjs/core/Misc/HighDynamicRange/panoramaToCubemap.js";
import { CreateDecoderAsync } from "@babylonjs/core/Materials/Textures/Loaders/EXR/exrLoader.decoder.js";
import { Tools } from "@babylonjs/core/Misc/tools.js";

const [width, height] = [1024, 512];
const map = new Float32Array(3 * width * height);
const sun = [0.35 * width, 0.3 * height]; // pixels
for (let y = 0; y < height; y++)
  for (let x = 0; x < width; x++) {
    const inSun = Math.abs(x + 0.5 - sun[0]) < 1 && Math.abs(y + 0.5 - sun[1]) < 1;
    map.fill(y >= height / 2 ? 0.1 : inSun ? 50000 : 0.5, 3 * (y * width + x), 3 * (y * width + x) + 3);
  }

function diffuse(size, supersample, limit) {
  CubeMapToSphericalPolynomialTools.MAX_HDRI_VALUE = limit;
  const cube = PanoramaToCubeMapTools.ConvertPanoramaToCubemap(map, width, height, size, supersample);
  const { yy, y, zz, xx } = CubeMapToSphericalPolynomialTools.ConvertCubeMapToSphericalPolynomial(cube);
  return yy.x + y.x; // on a level plane
}

const whole = diffuse(1024, false, Infinity);
const shares = [64, 128, 256, 512].map((size) => diffuse(size, false, 4096) / whole);
console.log(`shares of the light by cubes of 64 to 512 pixels: ${shares.map((share) => share.toFixed(2)).join(", ")}`);

const fetched = [];
Tools.LoadScriptAsync = async (url) => void fetched.push(url);
const names = ["NONE", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24"];
const fetching = [];
for (let compression = 0; compression < names.length; compression++) {
  const before = fetched.length;
  const channels = ["R", "G", "B"].map((name) => ({ name, pixelType: 1, pLinear: 0, xSampling: 1, ySampling: 1 }));
  const box = { xMin: 0, yMin: 0, xMax: 3, yMax: 3 };
  const header = { compression, channels, dataWindow: box, displayWindow: box };
  await CreateDecoderAsync(header, new DataView(new ArrayBuffer(256)), { value: 0 }, 1).catch(() => {});
  if (fetched.length > before) fetching.push(names[compression]);
}
console.log(`fetched for ${fetching.join(", ")}: ${[...new Set(fetched)].join(", ")}`);
process.exit(shares.every((share) => share > 0.05 && share < 0.6) && fetching.join() === "ZIPS,ZIP,PXR24" ? 0 : 1);
JS
npm install --silent --no-audit --no-fund @babylonjs/core@9.35.0
node check.mjs

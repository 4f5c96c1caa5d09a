#!/usr/bin/env bash
# An EXR whose `chromaticities` are ACEScg's: who converts it to Rec.709.
#
# Seen on 2026-11-28 with Mitsuba 3.9.1, OpenCV 4.13.0.90, OpenEXR 3.5.3 and bpy 4.5.4 of PyPI, three 0.187.0 of npm
# (Python 3.11, Node 20, Linux x86-64).
# Guessed before: Blender and Mitsuba convert, with white kept white; OpenCV and three.js leave the values.
# Seen: of white, (1, 1, 1), Mitsuba makes (1.047, 0.995, 0.915), for it does not adapt ACES' white to D65. Blender calls
# it Linear Rec.709 and leaves the values, as OpenCV and three.js do.
#
# Usage: findings/acescg_readers.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import os
import subprocess
import sys

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2
import mitsuba
import numpy as np
import OpenEXR

mitsuba.set_variant("scalar_rgb")
ap1 = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "chromaticities": ap1}
with OpenEXR.File(header, {"RGB": np.ones((16, 32, 3), np.float32)}) as file:
    file.write("white.exr")


def run(*command):
    output = subprocess.check_output(command, text=True)
    return [float(value) for value in output.strip().splitlines()[-1].split()]


bitmap = mitsuba.Bitmap("white.exr").convert(mitsuba.Bitmap.PixelFormat.RGB, mitsuba.Struct.Type.Float32, False)
seen = {
    "Blender": run("blender/bin/python", "blender.py"),
    "Mitsuba": np.array(bitmap)[8, 8],
    "OpenCV": cv2.imread("white.exr", cv2.IMREAD_UNCHANGED)[8, 8, ::-1],
    "three.js": run("node", "read.mjs"),
}
for name, color in seen.items():
    print(name, np.round(color, 3))
right = {"Blender": (1, 1, 1), "Mitsuba": (1.047, 0.995, 0.915), "OpenCV": (1, 1, 1), "three.js": (1, 1, 1)}
ok = all(np.allclose(seen[name], right[name], atol=0.002) for name in right)
sys.exit(not ok)
PY
cat > blender.py <<'PY'
import os

import bpy

image = bpy.data.images.load(os.path.abspath("white.exr"))
assert image.colorspace_settings.name == "Linear Rec.709"
print(*image.pixels[:3])
PY
cat > read.mjs <<'JS'
import { readFileSync } from "node:fs";
import { FloatType } from "three";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
const data = readFileSync("white.exr");
const loader = new EXRLoader().setDataType(FloatType);
const image = loader.parse(data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength));
console.log(...image.data.slice(0, 3));
JS
npm install --silent --no-audit --no-fund three@0.187.0
"${PYTHON:-python3.11}" -m venv venv
"${PYTHON:-python3.11}" -m venv blender
venv/bin/pip install --quiet OpenEXR==3.5.3 mitsuba==3.9.1 opencv-python-headless==4.13.0.90
blender/bin/pip install --quiet bpy==4.5.4
venv/bin/python check.py

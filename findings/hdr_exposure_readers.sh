#!/usr/bin/env bash
# A Radiance .hdr whose header says EXPOSURE=4: pixels are four times what was seen. Who divides by it.
#
# Seen on 2026-11-29 with OpenImageIO 3.2.2, Mitsuba 3.9.1, OpenCV 4.13.0.90 and bpy 4.5.4 of PyPI, three 0.187.0 of npm
# (Python 3.11, Node 20, Linux x86-64).
# Guessed before: OpenImageIO divides, and so does Blender, which reads by it; Mitsuba, OpenCV and three.js leave the
# values.
# Seen: nobody divides. Four read 4, and three.js 4.016, for it divides mantissas by 255 where they divide by 256.
#
# Usage: findings/hdr_exposure_readers.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import subprocess
import sys
from pathlib import Path

import cv2
import mitsuba
import numpy as np
import OpenImageIO

header = b"#?RADIANCE\nEXPOSURE=4\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n"
Path("four.hdr").write_bytes(header + bytes((128, 128, 128, 131)) * (8 * 16))  # 4 in each pixel; 1 was seen


def run(*command):
    output = subprocess.check_output(command, text=True)
    return float(output.strip().splitlines()[-1])


mitsuba.set_variant("scalar_rgb")
seen = {
    "Blender": run("blender/bin/python", "blender.py"),
    "Mitsuba": float(np.array(mitsuba.Bitmap("four.hdr"))[4, 8, 0]),
    "OpenCV": float(cv2.imread("four.hdr", cv2.IMREAD_UNCHANGED)[4, 8, 0]),
    "OpenImageIO": float(OpenImageIO.ImageBuf("four.hdr").getpixel(8, 4)[0]),
    "three.js": run("node", "read.mjs"),
}
print(seen)
right = dict.fromkeys(seen, 4.0) | {"three.js": 128 / 255 * 8}
sys.exit(not all(abs(seen[name] - right[name]) < 1e-4 for name in seen))
PY
cat > blender.py <<'PY'
import os

import bpy

print(bpy.data.images.load(os.path.abspath("four.hdr")).pixels[0])
PY
cat > read.mjs <<'JS'
import { readFileSync } from "node:fs";
import { FloatType } from "three";
import { HDRLoader } from "three/addons/loaders/HDRLoader.js";
const data = readFileSync("four.hdr");
const bytes = data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength);
const image = new HDRLoader().setDataType(FloatType).parse(bytes);
console.log(image.data[0]);
JS
npm install --silent --no-audit --no-fund three@0.187.0
"${PYTHON:-python3.11}" -m venv venv
"${PYTHON:-python3.11}" -m venv blender
venv/bin/pip install --quiet OpenImageIO==3.2.2.0 mitsuba==3.9.1 opencv-python-headless==4.13.0.90
blender/bin/pip install --quiet bpy==4.5.4
venv/bin/python check.py

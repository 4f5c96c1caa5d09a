#!/usr/bin/env bash
# OpenEXR 3.5's codecs LJ2K and ZSTD, and 3.4's HTJ2K, open in few programs; ZIP opens in all of these.
#
# Seen on 2026-11-28 with OpenEXR 3.5.3, OpenImageIO 3.2.2.0, Mitsuba 3.9.1 and OpenCV 4.13.0.90 of PyPI, three 0.187.0 of
# npm (Python 3.11, Node 20, Linux x86-64).
# Guessed before: what links OpenEXR opens them, what has a reader of its own does not.
# Seen: OpenImageIO opens all. Mitsuba and OpenCV, which hold an older OpenEXR, and three.js refuse them.
#
# Usage: findings/openexr_new_codecs.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
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
import OpenImageIO

mitsuba.set_variant("scalar_rgb")
rgb = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)


def opens(read, name):
    try:
        pixels = read(name)
    except Exception:
        return False
    return pixels is not None and np.shape(pixels)[:2] == (64, 128)


def by_three(name):
    result = subprocess.run(["node", "read.mjs", name], capture_output=True, text=True)
    return rgb if result.stdout.strip() == "128 64" else None


readers = {
    "OpenImageIO": lambda name: OpenImageIO.ImageBuf(name).get_pixels(),
    "Mitsuba": lambda name: np.array(mitsuba.Bitmap(name)),
    "OpenCV": lambda name: cv2.imread(name, cv2.IMREAD_UNCHANGED),
    "three.js": by_three,
}
seen = {}
for codec in ("ZIP", "HTJ2K32", "LJ2K", "ZSTD"):
    header = {"compression": getattr(OpenEXR, f"{codec}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"RGB": rgb}) as file:
        file.write(f"{codec}.exr")
    seen[codec] = [name for name, read in readers.items() if opens(read, f"{codec}.exr")]
    print(f"{codec}: {', '.join(seen[codec])}")
new = ["OpenImageIO"]
sys.exit(seen != {"ZIP": list(readers), "HTJ2K32": new, "LJ2K": new, "ZSTD": new})
PY
cat > read.mjs <<'JS'
import { readFileSync } from "node:fs";
import { EXRLoader } from "three/addons/loaders/EXRLoader.js";
const data = readFileSync(process.argv[2]);
const image = new EXRLoader().parse(data.buffer.slice(data.byteOffset, data.byteOffset + data.byteLength));
console.log(image.width, image.height);
JS
npm install --silent --no-audit --no-fund three@0.187.0
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet OpenEXR==3.5.3 OpenImageIO==3.2.2.0 mitsuba==3.9.1 opencv-python-headless==4.13.0.90
venv/bin/python check.py

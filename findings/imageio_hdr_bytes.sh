#!/usr/bin/env bash
# imageio reads a Radiance .hdr as bytes, clipped at 1, where OpenCV is installed; the sun is then as bright as the sky.
#
# Seen on 2026-11-30 with imageio 2.38.1, Pillow 12.0.0, OpenCV 4.13.0.90 and 5.0.0.93 of PyPI (NumPy 2.4.6, Python 3.11,
# Linux x86-64).
# Guessed before: it refuses, and asks for another plugin.
# Seen: imageio.v3.imread and imageio.v2.imread give uint8. 0.5 is 128, so the values stay linear, and a sun of 300 is
# 255. Nothing is said. With flags=cv2.IMREAD_UNCHANGED they give 32-bit floats, in the order red, green, blue.
#
# Usage: findings/imageio_hdr_bytes.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys
from pathlib import Path

import cv2
import imageio.v2
import imageio.v3
import numpy as np

gray, sun = bytes((128, 128, 128, 128)), bytes((150, 100, 50, 137))  # 0.5; 300, 200, 100
header = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n"
Path("sky.hdr").write_bytes(header + gray * 5 + sun + gray * (8 * 16 - 6))
third, second = imageio.v3.imread("sky.hdr"), imageio.v2.imread("sky.hdr")
floats = imageio.v3.imread("sky.hdr", flags=cv2.IMREAD_UNCHANGED)
for name, pixels in (("v3", third), ("v2", second), ("unchanged", floats)):
    print(name, pixels.dtype, pixels[0, 0], pixels[0, 5])
as_bytes = all(
    pixels.dtype == np.uint8 and pixels[0, 0, 0] == 128 and pixels[0, 5].tolist() == [255, 255, 255]
    for pixels in (third, second)
)
sys.exit(not (as_bytes and floats.dtype == np.float32 and np.allclose(floats[0, 5], [300, 200, 100], rtol=0.02)))
PY
for opencv in 4.13.0.90 5.0.0.93; do
  "${PYTHON:-python3.11}" -m venv "venv-$opencv"
  "venv-$opencv/bin/pip" install --quiet imageio==2.38.1 pillow==12.0.0 numpy==2.4.6 "opencv-python-headless==$opencv"
  echo "OpenCV $opencv"
  "venv-$opencv/bin/python" check.py
done

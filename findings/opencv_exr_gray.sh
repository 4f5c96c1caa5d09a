#!/usr/bin/env bash
# OpenCV reads an EXR as gray with x coordinates for weights, so white is 1.09; OpenCV 5's wheels read no EXR at all.
#
# Seen on 2026-11-29 with OpenCV 4.13.0.90 and 5.0.0.93, and OpenEXR 3.5.3, of PyPI (NumPy 2.4.6, Python 3.11, Linux
# x86-64).
# Guessed before: by default 0.5 becomes 127, as of a .hdr; gray is luminance by the weights of Rec.709 or of cvtColor,
# which are 1 together. OpenCV 5 reads as OpenCV 4 does.
# Seen: with IMREAD_ANYDEPTH red counts 0.64, green 0.30, blue 0.15: the x of the primaries' chromaticities, where their
# luminances belong. So a depth, or any map of equal channels, comes 9 % too large. With ACEScg's chromaticities in the
# header red counts 0.713, green 0.165, blue 0.128. The same pixels as .hdr, and an EXR of one channel, Y, come right.
# By default, 0.5 becomes 0: an EXR's values are cut to whole numbers, where a .hdr's are multiplied by 255.
# OpenCV 5: imread gives None for each EXR, whatever OPENCV_IO_ENABLE_OPENEXR says: the wheel is built without OpenEXR.
# Read with IMREAD_UNCHANGED, or by OpenEXR's own module.
#
# Usage: findings/opencv_exr_gray.sh; PYTHON names a Python of 3.11 to 3.14. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import os
import sys

os.environ["OPENCV_IO_ENABLE_OPENEXR"] = "1"
import cv2
import numpy as np
import OpenEXR

ACESCG = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
COLORS = {"white": (1, 1, 1), "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "gray": (0.5, 0.5, 0.5)}


def write_exr(pixels, chromaticities=None):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    if chromaticities:
        header["chromaticities"] = chromaticities
    with OpenEXR.File(header, {"RGB" if pixels.ndim == 3 else "Y": pixels}) as file:
        file.write("pixels.exr")


def read(name, flags):
    pixels = cv2.imread(name, flags)
    return None if pixels is None else np.round(pixels[4, 8].astype(float), 3).tolist()


print(f"OpenCV {cv2.__version__}")
seen = {}
for name, color in COLORS.items():
    pixels = np.tile(np.array(color, np.float32), (8, 16, 1))
    write_exr(pixels, ACESCG)
    acescg = read("pixels.exr", cv2.IMREAD_ANYDEPTH)
    write_exr(pixels)
    cv2.imwrite("pixels.hdr", np.ascontiguousarray(pixels[..., ::-1]))
    exr = [read("pixels.exr", flags) for flags in (cv2.IMREAD_ANYDEPTH, cv2.IMREAD_UNCHANGED, cv2.IMREAD_COLOR)]
    hdr = [read("pixels.hdr", flags) for flags in (cv2.IMREAD_ANYDEPTH, cv2.IMREAD_COLOR)]
    seen[name] = [acescg, *exr, *hdr]
    print(f"{name}: EXR as gray {exr[0]}, by ACEScg {acescg}, as it is {exr[1]}, by default {exr[2]}")
    print(f"  .hdr as gray {hdr[0]}, by default {hdr[1]}")
write_exr(np.full((8, 16), 0.5, np.float32))
seen["Y"] = [read("pixels.exr", cv2.IMREAD_ANYDEPTH)]
print(f"Y of 0.5: {seen['Y'][0]}")

if cv2.__version__.startswith("5"):
    sys.exit(any(value is not None for values in seen.values() for value in values[:4]))
gray = {"white": (1.006, 1.09, 1), "red": (0.713, 0.64, 0.299)}  # by ACEScg, EXR, .hdr
gray |= {"green": (0.165, 0.3, 0.587), "blue": (0.128, 0.15, 0.114)}
ok = all(np.allclose([seen[name][0], seen[name][1], seen[name][4]], right, atol=2e-3) for name, right in gray.items())
ok &= seen["gray"][2:4] + seen["gray"][5:] == [[0.5] * 3, [0] * 3, [128] * 3] and seen["Y"] == [0.5]
sys.exit(not ok)
PY
"${PYTHON:-python3}" -m venv venv
for version in 4.13.0.90 5.0.0.93; do
  venv/bin/pip install --quiet "opencv-python-headless==$version" OpenEXR==3.5.3 numpy==2.4.6
  venv/bin/python check.py
done

#!/usr/bin/env bash
# A color outside Rec.709 has a negative channel. Four writers of Radiance .hdr make it a bright one: green turns pink.
#
# Seen on 2026-11-29 with OpenCV 4.13.0.90 and 5.0.0.93, OpenImageIO 3.2.2.0, Mitsuba 3.9.1 and imagecodecs 2026.3.6 of
# PyPI (NumPy 2.4.6, Python 3.11, Linux x86-64).
# Guessed before: what RGBE cannot hold becomes 0, so the color is clipped to (0, 1.04, 0).
# Seen: the greenest of Display P3, (-0.22, 1.04, -0.08), is written as the bytes 228, 133, 246, 129 by all, which are
# (1.78, 1.04, 1.92), and nothing is said. A negative mantissa is cast to a byte, which C
# leaves open and x86-64 wraps: -28 becomes 228. Write np.maximum(pixels, 0).
#
# Usage: findings/hdr_negative_writers.sh; PYTHON names a Python 3.11. It ends with 1 where a writer does otherwise now.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys
from pathlib import Path

import cv2
import imagecodecs
import mitsuba
import numpy as np
import OpenImageIO

mitsuba.set_variant("scalar_rgb")
P3_TO_REC709 = np.array([[1.2249, -0.2249, 0.0], [-0.0420, 1.0420, 0.0], [-0.0197, -0.0786, 1.0983]])
green = P3_TO_REC709 @ (0, 1, 0)
rgb = np.tile(green, (4, 4, 1)).astype(np.float32)  # narrower than 8, so the rows are not packed
writers = {
    f"OpenCV {cv2.__version__}": lambda name, pixels: cv2.imwrite(name, np.ascontiguousarray(pixels[..., ::-1])),
    "OpenImageIO": lambda name, pixels: OpenImageIO.ImageBuf(pixels).write(name),
    "Mitsuba": lambda name, pixels: mitsuba.Bitmap(pixels).write(name),
    "imagecodecs": lambda name, pixels: Path(name).write_bytes(imagecodecs.rgbe_encode(pixels)),
}


def written(write, pixels):
    """The bytes of the last pixel: three mantissas and the exponent that they share."""
    write("pixels.hdr", pixels)
    return tuple(Path("pixels.hdr").read_bytes()[-4:])


ok = True
for name, write in writers.items():
    clipped, wrapped = written(write, np.maximum(rgb, 0)), written(write, rgb)
    values = np.ldexp(np.array(wrapped[:3], float), wrapped[3] - 136)
    print(f"{name}: {np.round(green, 2)} comes as {np.round(values, 2)}, bytes {wrapped}; clipped before, {clipped}")
    ok &= wrapped == (228, 133, 246, 129) and clipped == (0, 133, 0, 129)
sys.exit(not ok)
PY
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet OpenImageIO==3.2.2.0 mitsuba==3.9.1 imagecodecs==2026.3.6 numpy==2.4.6
for version in 4.13.0.90 5.0.0.93; do
  venv/bin/pip install --quiet "opencv-python-headless==$version"
  venv/bin/python check.py
done

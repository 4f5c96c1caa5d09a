#!/usr/bin/env bash
# OpenCV's HDR merges make a sun that every exposure clips darker than the sky around it: Robertson's makes it black.
#
# Seen on 2026-11-29 with OpenCV 4.13.0.90 and 5.0.0.93 of PyPI (NumPy 2.4.6, Python 3.11, Linux x86-64).
# Guessed before: a clipped pixel counts for nothing, or the shortest exposure bounds it from below. So the sun, 255 in
# all, comes out as the brightest of the map.
# Seen: Robertson weighs 255 by zero in each exposure, and what has no weight is 0. Debevec weighs it by one in each, so
# the sun is the geometric mean of 255 / time. With times of 1/256, 1/16, 1 and 4 s and a sky of 44000 beside it, it is
# 65280 by the first alone, 16320 by two, 4080 by three and 1442 by all four: each longer exposure makes it darker,
# though it shows nothing of it. With CalibrateDebevec's response it is 13 beside a sky of 380.
# Give pixels that are 255 in the shortest exposure at least the value of the brightest that is not.
#
# Usage: findings/opencv_hdr_merges.sh; PYTHON names a Python of 3.11 to 3.14. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys

import cv2
import numpy as np

sky = np.geomspace(0.1, 250, 64 * 64).reshape(64, 64)  # row by row; the shortest exposure clips over 255
light = sky.copy()
light[60:62, 60:62] = 1e5  # the sun
times = np.array([1 / 256, 1 / 16, 1, 4], np.float32)
photos = [np.repeat(np.clip(np.round(256 * light * time), 0, 255).astype(np.uint8)[..., None], 3, 2) for time in times]
assert all((photo[60, 60] == 255).all() for photo in photos)


def sun_and_sky(merge, count, calibrate=None):
    """The merged values of the sun and of the pixel two beside it."""
    chosen = photos[:count], times[:count]
    merged = merge.process(*chosen, *([calibrate.process(*chosen)] if calibrate else []))
    return float(merged[60, 60, 1]), float(merged[60, 58, 1])


print(f"OpenCV {cv2.__version__}: sun and the sky beside it")
debevec = [sun_and_sky(cv2.createMergeDebevec(), count) for count in (1, 2, 3, 4)]
robertson = [sun_and_sky(cv2.createMergeRobertson(), count) for count in (1, 2, 3, 4)]
print("Debevec, 1 to 4 exposures:", *(f"{sun:.0f} and {beside:.0f};" for sun, beside in debevec))
print("Robertson, 1 to 4 exposures:", *(f"{sun:.0f} and {beside:.0f};" for sun, beside in robertson))
merges = (cv2.createMergeDebevec(), cv2.createMergeRobertson())
calibrated = [sun_and_sky(merge, 4, cv2.createCalibrateDebevec()) for merge in merges]
print("both, 4 exposures, by CalibrateDebevec:", *(f"{sun:.0f} and {beside:.0f};" for sun, beside in calibrated))
ok = np.allclose([sun for sun, _ in debevec], [65280, 16320, 4080, 1442.5], rtol=1e-3)
ok &= np.allclose([beside for _, beside in debevec], 44032, rtol=1e-3)
ok &= all(sun == 0 and beside > 300 for sun, beside in robertson)
ok &= calibrated[0][0] < 0.1 * calibrated[0][1] and calibrated[1][0] == 0
sys.exit(not ok)
PY
"${PYTHON:-python3}" -m venv venv
for version in 4.13.0.90 5.0.0.93; do
  venv/bin/pip install --quiet "opencv-python-headless==$version" numpy==2.4.6
  venv/bin/python check.py
done

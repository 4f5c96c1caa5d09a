#!/usr/bin/env bash
# OpenEXR's Python module writes other pixels than those of an array that is a view: a channel, a crop, a transpose.
#
# Seen on 2026-11-28 with OpenEXR 3.5.3 and NumPy 2.4.6 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: a view is copied, or refused with an error.
# Seen: the file holds the memory from the view's first pixel on, as if it were contiguous, and nothing is said.
# rgb[..., 0] as channel R becomes red, green, blue, red ... of the first third of the image.
# Give np.ascontiguousarray(pixels) to OpenEXR.File.
#
# Usage: findings/openexr_array_views.sh; PYTHON names a Python of 3.11 to 3.14. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys

import numpy as np
import OpenEXR

rgb = np.arange(4 * 6 * 3, dtype=np.float32).reshape(4, 6, 3)


def stored_right(name, pixels):
    with OpenEXR.File({"compression": OpenEXR.NO_COMPRESSION}, {name: pixels}) as file:
        file.write("pixels.exr")
    with OpenEXR.File("pixels.exr") as file:
        return bool(np.array_equal(file.channels()[name].pixels, pixels))


seen = {
    "an array of its own": stored_right("RGB", rgb),
    "one channel of it": stored_right("R", rgb[..., 0]),
    "the same, copied": stored_right("R", np.ascontiguousarray(rgb[..., 0])),
    "a crop of it": stored_right("RGB", rgb[:2, :3]),
    "its transpose": stored_right("RGB", rgb.transpose(1, 0, 2)),
}
for name, right in seen.items():
    print(f"OpenEXR {OpenEXR.__version__}: {name}: {'right' if right else 'other pixels'}")
sys.exit(list(seen.values()) != [True, False, True, False, False])
PY
"${PYTHON:-python3}" -m venv venv
venv/bin/pip install --quiet OpenEXR==3.5.3 numpy==2.4.6
venv/bin/python check.py

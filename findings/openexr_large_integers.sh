#!/usr/bin/env bash
# OpenEXR's Python module stores an integer attribute's last 32 bits, and says nothing of the others.
#
# Seen on 2026-11-28 with OpenEXR 3.5.3 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: an OverflowError, as struct and NumPy give.
# Seen: 2**40 is read back as 0, 2**31 as -2**31, a time in nanoseconds as an unrelated number. Write such numbers as text
# or as floats, whose attribute is of 32 bits as well: 16777217.0 is read back as 16777216.0.
#
# Usage: findings/openexr_large_integers.sh; PYTHON names a Python of 3.11 to 3.14. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys

import numpy as np
import OpenEXR


def stored(value):
    with OpenEXR.File({"number": value}, {"Y": np.zeros((2, 2), np.float32)}) as file:
        file.write("number.exr")
    with OpenEXR.File("number.exr") as file:
        return file.header()["number"]


numbers = (7, 2**40, 2**31, 1_700_000_000_000_000_000, 16777217.0)
seen = [stored(number) for number in numbers]
for number, found in zip(numbers, seen):
    print(f"OpenEXR {OpenEXR.__version__}: {number} is read back as {found}")
right = [7, 0, -(2**31), 908722176, 16777216.0]
sys.exit(seen != right)
PY
"${PYTHON:-python3}" -m venv venv
venv/bin/pip install --quiet OpenEXR==3.5.3 numpy==2.4.6
venv/bin/python check.py

#!/usr/bin/env bash
# SunCalc 2 answers in degrees, counts azimuth from north and lifts the sun by refraction; SunCalc 1 did none of these.
#
# Seen on 2026-11-30 with suncalc 1.9.0 and 2.0.2 of npm and pvlib 0.16.1 of PyPI (Node 20, Python 3.11, Linux x86-64).
# Guessed before: as in 1.9, radians, azimuth from south and positive to the west, no refraction.
# Seen: getPosition has the same fields, azimuth and altitude, and nothing is said. Over Cape Town's horizon 1.9.0 gives
# (-2.080, 0.0124) and 2.0.2 (60.80, 1.13), where pvlib has azimuth 60.79 and altitude 0.74, or 1.13 with refraction.
# What was converted before, degrees(azimuth) + 180, now points the sun anywhere. npm installs 2 since June 2026.
#
# Usage: findings/suncalc_degrees.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > positions.mjs <<'JS'
import * as one from "one";
import * as two from "two";
const time = new Date("2026-06-21T06:00:00Z");
for (const library of [one, two]) {
  const { azimuth, altitude } = (library.default ?? library).getPosition(time, -33.9, 18.4);
  console.log(azimuth, altitude);
}
JS
cat > check.py <<'PY'
import math
import subprocess
import sys

import pandas
import pvlib

old, new = (tuple(map(float, line.split())) for line in subprocess.check_output(["node", "positions.mjs"]).splitlines())
time = pandas.DatetimeIndex(["2026-06-21T06:00:00Z"])
sun = pvlib.solarposition.get_solarposition(time, -33.9, 18.4).iloc[0]
print("SunCalc 1:", old, "SunCalc 2:", new)
print("pvlib:", sun["azimuth"], sun["elevation"], "with refraction", sun["apparent_elevation"])
radians_from_south = math.degrees(old[0]) + 180 - sun["azimuth"], math.degrees(old[1]) - sun["elevation"]
degrees_from_north = new[0] - sun["azimuth"], new[1] - sun["apparent_elevation"]
sys.exit(bool(max(map(abs, radians_from_south + degrees_from_north)) > 0.1))
PY
npm install --silent --no-audit --no-fund one@npm:suncalc@1.9.0 two@npm:suncalc@2.0.2
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet pvlib==0.16.1
venv/bin/python check.py

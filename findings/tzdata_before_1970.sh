#!/usr/bin/env bash
# PyPI's tzdata has forgotten what clocks of many cities showed before 1970, so an old photo's hour depends on the machine.
#
# Seen on 2026-11-28 with tzdata 2022.1, 2022.2 and 2026.3 of PyPI (Python's zoneinfo, no system files).
# Guessed before: every release has all of history, and a newer one has more of it.
# Seen: in July 1960 Oslo kept summer time, UTC+2. 2022.1 says so; since 2022.2 it says UTC+1, for Europe/Oslo became a
# link to Europe/Berlin. In July 1945 Stockholm, which kept UTC+1, has Berlin's UTC+3. After 1970 nothing changed.
# The wheel is built without the time zone database's file "backzone"; Debian's package tzdata is built with it.
# So zoneinfo gives one answer where the system has zone files, and another where it falls back on PyPI's.
#
# Usage: findings/tzdata_before_1970.sh; PYTHON names a Python of 3.9 or newer. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys
import zoneinfo
from datetime import datetime

import tzdata

zoneinfo.reset_tzpath(to=[])  # PyPI's files alone
DATES = {"Europe/Oslo": (1960, 1975), "Europe/Stockholm": (1945, 1975)}
hours = [
    zoneinfo.ZoneInfo(zone).utcoffset(datetime(year, 7, 1, 12)).total_seconds() / 3600
    for zone, years in DATES.items()
    for year in years
]
print(f"tzdata {tzdata.IANA_VERSION}: Oslo 1960 and 1975, Stockholm 1945 and 1975: UTC+", hours)
sys.exit(hours != [float(hour) for hour in sys.argv[1:]])
PY
"${PYTHON:-python3}" -m venv venv
for row in "2022.1 2 1 1 1" "2022.2 1 1 3 1" "2026.3 1 1 3 1"; do
  read -r version hours <<< "$row"
  venv/bin/pip install --quiet "tzdata==$version"
  # shellcheck disable=SC2086
  venv/bin/python check.py $hours
done

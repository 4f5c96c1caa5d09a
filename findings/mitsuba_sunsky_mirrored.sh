#!/usr/bin/env bash
# Mitsuba's sun by place and time goes round the wrong way: no turn about the vertical makes it fit a map.
#
# Seen on 2026-11-29 with Mitsuba 3.9.1 and pvlib 0.16.1 of PyPI (Python 3.11, Linux x86-64).
# Guessed before: +Z is up, and the ground's axes are a map's, such as +X east and +Y north; at worst turned.
# Seen: elevations are pvlib's within 0.02 deg. The azimuth, which a compass counts clockwise, is counted the other way
# about +Z: atan2(y, x) is pvlib's azimuth less 180 deg. South is +X, and west is +Y, where east must be. From above,
# the sun goes counterclockwise in Paris and Tokyo, and clockwise in Cape Town. About a house modelled by a map, morning
# and afternoon change sides. Only the sun at solar noon stands right.
# Give `sun_direction` in place of place and time.
#
# Usage: findings/mitsuba_sunsky_mirrored.sh; PYTHON names a Python 3.11. It ends with 1 where this changes.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"

cat > check.py <<'PY'
import sys

import mitsuba
import numpy as np
import pandas
import pvlib

mitsuba.set_variant("scalar_rgb")
PLACES = {"Paris": (48.86, 2.35, 2), "Tokyo": (35.68, 139.69, 9), "Cape Town": (-33.92, 18.42, 2)}  # deg, deg, hours


def sun_of_mitsuba(latitude, longitude, timezone, hour):
    """Azimuth about +Z from +X, counterclockwise, and elevation of the sun's disc (deg)."""
    when = {"year": 2026, "month": 6, "day": 21, "hour": float(hour), "minute": 0.0, "second": 0.0}
    where = {"latitude": latitude, "longitude": longitude, "timezone": float(timezone)}
    emitter = mitsuba.load_dict({"type": "sunsky", "sky_scale": 0.0, **when, **where})
    x, y, z = to_sun = np.array(mitsuba.traverse(emitter)["sun_direction"], float)
    assert radiance(emitter, to_sun) > 0  # the light does come from there,
    assert radiance(emitter, (x, -y, z)) == 0  # and not from the mirrored side
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arcsin(z))


def radiance(emitter, direction):
    point = mitsuba.SurfaceInteraction3f()
    point.wi = mitsuba.Vector3f(*(-float(value) for value in direction))
    return float(np.array(emitter.eval(point)).max())


def sun_of_pvlib(latitude, longitude, timezone, hour):
    """Azimuth from north, clockwise, and elevation (deg)."""
    time = pandas.Timestamp(2026, 6, 21, hour, tz="UTC") - pandas.Timedelta(hours=timezone)
    sun = pvlib.solarposition.get_solarposition(pandas.DatetimeIndex([time]), latitude, longitude).iloc[0]
    return sun.azimuth, sun.elevation


def wrapped(angle):
    return (angle + 180) % 360 - 180


ok = True
for city, place in PLACES.items():
    for hour in (9, 12, 16):
        (angle, elevation), (azimuth, right) = sun_of_mitsuba(*place, hour), sun_of_pvlib(*place, hour)
        print(f"{city}, {hour} h: {angle:.1f} deg from +X to +Y, {elevation:.2f} up; pvlib {azimuth:.1f}, {right:.2f}")
        ok &= abs(elevation - right) < 0.05 and abs(wrapped(angle - azimuth + 180)) < 0.1
sys.exit(not ok)
PY
"${PYTHON:-python3.11}" -m venv venv
venv/bin/pip install --quiet mitsuba==3.9.1 pvlib==0.16.1 numpy==2.4.6
venv/bin/python check.py

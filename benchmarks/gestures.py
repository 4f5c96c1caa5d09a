"""How soon the page follows a gesture, and how long a hand takes to put right a sun that is 60 deg wrong.

    python -m benchmarks.gestures

Chromium gets a photo with a wrong answer at three widths. It draws a shadow, picks another sun, or drags the sun on the
photo, on the map or on the compass. It also drags a horizon that is 8 deg wrong, or draws two upright edges.

The first column is the gesture's length in seconds, with the hand's own 1.5 s of each drag, and the service's answer.
The second is the error left after it: of the sun's azimuth, or of the camera's elevation. The last two are milliseconds
from a move until the page shows its light, or its horizon: half and nine tenths of the moves take no longer. What a
graphics card draws is not in it. Other work on the machine changes all of them, so its load stands beside them.

Needs what the tests in the browser need.
"""

import os
import platform
import sys

import numpy as np

from benchmarks.common import ROOT
from benchmarks.load import started
from tests.helpers.requirements import REQUIREMENTS, find
from tests.helpers.visits import visit_feature


def main() -> None:
    """Measure and print."""
    for name in ("node", "chromium", "server/web"):
        if find(name) is None:
            sys.exit(f"{REQUIREMENTS[name].title} is missing: {REQUIREMENTS[name].line}")
    load = os.getloadavg()[0]
    print(f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}, load {load:.1f} before")
    print(f"{'':32}{'seconds':>10}{'error':>10}{'50 %, ms':>10}{'90 %, ms':>10}")
    with started([sys.executable, "-m", "server"], "/readyz") as (port, _):
        street = ROOT / "examples" / "brick_street.jpg"
        for way in visit_feature(f"http://127.0.0.1:{port}/", "gestures", {"street": str(street)})["ways"]:
            name = f"{way['width']} px, {way['name']}"
            half, most = np.percentile(way["moves"], [50, 90])
            print(f"{name:32}{way['seconds']:10.2f}{way['error']:9.1f}°{half:10.0f}{most:10.0f}")
    print(f"load {os.getloadavg()[0]:.1f} after")


if __name__ == "__main__":
    main()

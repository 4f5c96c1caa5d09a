"""How soon the page follows a gesture, and how long a hand takes to put a sun right that is 60 deg wrong.

    python -m benchmarks.gestures

Chromium gets a photo with a wrong answer at three widths. It draws a shadow, picks another sun, or drags the sun. The
first column is the gesture's length in seconds, with the hand's own 1.5 s of each drag. The second is the sun's error
after it, and the last the median milliseconds from a move until its light is on the page. What a graphics card draws is
not in it. Other work on the machine changes all of them.

Needs what the tests in the browser need.
"""

import os
import platform
import sys
from statistics import median

from benchmarks.common import ROOT
from benchmarks.load import started
from tests.helpers.requirements import REQUIREMENTS, find
from tests.helpers.visits import visit_feature


def main() -> None:
    """Measure and print."""
    for name in ("node", "chromium", "server/web"):
        if find(name) is None:
            sys.exit(f"{REQUIREMENTS[name].title} is missing: {REQUIREMENTS[name].line}")
    print(f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}")
    print(f"{'':24}{'seconds':>10}{'error':>10}{'move, ms':>10}")
    with started([sys.executable, "-m", "server"], "/readyz") as (port, _):
        street = ROOT / "examples" / "brick_street.jpg"
        for way in visit_feature(f"http://127.0.0.1:{port}/", "gestures", {"street": str(street)})["ways"]:
            name = f"{way['width']} px, {way['name']}"
            print(f"{name:24}{way['seconds']:10.2f}{way['error']:9.1f}°{median(way['moves']):10.0f}")


if __name__ == "__main__":
    main()

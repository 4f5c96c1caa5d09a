"""How long a visitor of the page waits for the first answer, and what of it is the service's.

    python -m benchmarks.first_answer [--rounds 5]

Chromium loads the page anew each time, and is given an example or a photo of 12 megapixels. Printed are the first visit
of each kind, and medians of the others. The headline is there after so many seconds, and the service's answer before.
The browser's processor seconds are those until the headline, without what draws in place of a graphics card. The last
column is the processor time that the service alone needs for such an answer. Other work changes it least. What the
page sends before there is a photo is counted as it is compressed.

Needs what the tests in the browser need.
"""

import argparse
import os
import platform
import sys
import tempfile
import time
import urllib.request
from pathlib import Path
from statistics import median

from benchmarks.common import ROOT, make_photo
from benchmarks.load import processor_time, started
from tests.helpers.requirements import REQUIREMENTS, find
from tests.helpers.visits import visit_feature

_EXAMPLE = ROOT / "examples" / "brick_street.jpg"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="visits of each kind")
    rounds = parser.parse_args().rounds
    for name in ("node", "chromium", "server/web"):
        if find(name) is None:
            sys.exit(f"{REQUIREMENTS[name].title} is missing: {REQUIREMENTS[name].line}")
    print(f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}")
    print(f"{'':36}{'headline':>10}{'answer':>10}{'browser CPU':>14}{'service CPU':>14}")
    with (
        tempfile.TemporaryDirectory() as folder,
        started([sys.executable, "-m", "server"], "/readyz") as (port, service),
    ):
        url = f"http://127.0.0.1:{port}/"
        photo = make_photo(Path(folder, "photo.jpg"))
        seen = visit_feature(url, "first_answer", {"rounds": rounds, "photo": str(photo)})
        print(f"the page, its styles and its scripts before a photo: {seen['firstView'] / 1e3:.1f} kB")
        waits = seen["waits"]
        for name, file in (("an example", _EXAMPLE), ("a photo of 12 megapixels", photo)):
            first, *others = [wait for wait in waits if wait["name"] == name]
            print(f"{name + ', the first':36}{first['clock']:10.2f}{first['answer']:10.2f}{first['processor']:14.2f}")
            clock, answer, browser = (
                median(wait[kind] for wait in others) for kind in ("clock", "answer", "processor")
            )
            seconds = median(_service_seconds(url, file, service.pid) for _ in range(rounds))
            print(f"{name:36}{clock:10.2f}{answer:10.2f}{browser:14.2f}{seconds:14.2f}")


def _service_seconds(url: str, photo: Path, group: int) -> float:
    """Processor seconds of the service's processes for one answer."""
    before = processor_time(group)
    request = urllib.request.Request(f"{url}v1/lighting?probability=true&photo_metadata=true", photo.read_bytes())
    request.add_header("Content-Type", "image/jpeg")
    urllib.request.urlopen(request).close()
    time.sleep(0.05)  # for what is done after the answer
    return processor_time(group) - before


if __name__ == "__main__":
    main()

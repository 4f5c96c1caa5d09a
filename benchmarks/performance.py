"""Print how cost grows with photos, map height and clients: tables of docs/lab/performance.md.

    python -m benchmarks.performance [photos] [heights] [clients] [--photos 100 1000 10000] [--seconds 4]

Clients need the service (extra `server`).
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clients import Job
from benchmarks.common import describe_machine, make_photo, make_photo_folder, measure_milliseconds, run_lighting
from benchmarks.load import RECORD, run, started
from lighting.envmap.render import render
from lighting.files.exr import write_exr
from lighting.records import Lighting

SIZE = (1600, 1200)  # of the photos, pixels
HEIGHTS = (128, 256, 512, 1024, 2048, 4096)
CLIENTS = (1, 2, 4, 8, 16, 32, 64)
LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.021)


def photos_table(counts: list[int]) -> Iterator[str]:
    """Seconds of a whole batch by its number of photos; seconds to start and milliseconds a photo; bytes of a line."""
    yield "| photos | seconds | photos per second |\n| ---: | ---: | ---: |"
    took = {}
    with tempfile.TemporaryDirectory() as out:
        for count in sorted(counts):
            with make_photo_folder(count, SIZE) as photos:
                took[count] = run_lighting("batch", photos, f"{out}/{count}")
            yield f"| {count:,} | {took[count]:.1f} | {count / took[count]:.1f} |"
        line = (Path(out) / str(counts[0]) / "lighting.jsonl").stat().st_size / counts[0]
    start, each = line_through(took)
    yield f"\n{1000 * each:.1f} ms a photo, {start:.1f} s to start; a line has {line:.0f} bytes."


def line_through(seconds: dict[int, float]) -> tuple[float, float]:
    """Seconds to start and seconds a photo: the line through the least and the greatest batch."""
    low, high = min(seconds), max(seconds)
    each = (seconds[high] - seconds[low]) / max(high - low, 1)
    return max(seconds[low] - each * low, 0.0), each


def heights_table(runs: int) -> Iterator[str]:
    """Milliseconds to render and to write a map by its height, the system's share of rendering, and the file's size."""
    names = "height | render, ms | ns per pixel | system time | write EXR, ms | ns per pixel | EXR, MB"
    yield f"| {names} |\n|{' ---: |' * 7}"
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "sky.exr"
        for height in HEIGHTS:
            image, pixels = render(LIGHT, height), 2 * height * height
            work = {"render": lambda h=height: render(LIGHT, h), "write": lambda i=image: write_exr(target, i, LIGHT)}
            took = measure_milliseconds(work, max(5, min(runs, runs * 512 // height)))
            system = system_share(work["render"], max(5, runs * 512 // height))
            rendered, written = (f"{took[name]:.1f} | {1e6 * took[name] / pixels:.1f}" for name in work)
            yield f"| {height} | {rendered} | {100 * system:.0f} % | {written} | {target.stat().st_size / 1e6:.2f} |"


def system_share(work: Callable[[], Any], runs: int) -> float:
    """The part (0 to 1) of the processor time that the operating system takes, as for fresh memory."""
    before = os.times()
    for _ in range(runs):
        work()
    after = os.times()
    user, system = after.user - before.user, after.system - before.system
    return system / (user + system)


def clients_table(seconds: float) -> Iterator[str]:
    """Answers per second, latency [ms] and share of 503 answers of the service, by number of clients."""
    yield f"| clients | answers per second | median, ms | 95 %, ms | turned away |\n|{' ---: |' * 5}"
    with tempfile.TemporaryDirectory() as folder, started([sys.executable, "-m", "server"], "/readyz") as (port, _):
        photo = make_photo(Path(folder) / "photo.jpg", SIZE).read_bytes()
        job = Job(port, "/v1/lighting", photo, RECORD)
        run(job, 1, 1.0)
        for count in CLIENTS:
            outcome = run(job, count, seconds)
            took, refused = 1000 * np.array(outcome.latencies), outcome.counts["503"] / outcome.counts.total()
            rate, late = len(took) / outcome.seconds, np.percentile(took, 95)
            yield f"| {count} | {rate:.1f} | {np.median(took):.0f} | {late:.0f} | {100 * refused:.0f} % |"


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("parts", nargs="*", help="photos, heights or clients; all by default")
    parser.add_argument("--photos", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=4.0, help="for each number of clients")
    options = parser.parse_args()
    tables = {
        "photos": lambda: photos_table(options.photos),
        "heights": lambda: heights_table(options.runs),
        "clients": lambda: clients_table(options.seconds),
    }
    if unknown := set(options.parts) - set(tables):
        parser.error(f"there is no part {min(unknown)}: choose of {', '.join(tables)}")
    for part in options.parts or tables:
        print(f"## {part}, {describe_machine()}\n", *tables[part](), sep="\n", flush=True)


if __name__ == "__main__":
    main()

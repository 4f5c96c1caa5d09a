"""Measure how cost grows with photos, map height and clients; writes docs/growth.md and its plot.

    python -m benchmarks.performance [--photos 100 1000 10000] [--seconds 4] [--only photos|heights|clients]

Figures are kept in docs/growth.json, so that one part can be measured again without the others. Clients need the
service (extra `server`); without it their part stays as it was, or says that it is not measured.
"""

import argparse
import importlib.util
import json
import os
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clients import Job, Outcome
from benchmarks.common import ROOT, machine, make_photo, many_photos, milliseconds, remember, run_lighting
from benchmarks.load import RECORD, run, started
from benchmarks.performance_page import SIZE, page
from lighting.cpus import available_cpus
from lighting.envmap import render
from lighting.files import write_exr
from lighting.records import Lighting

DOCS = ROOT / "docs"
FIGURES, PAGE, PLOT = DOCS / "growth.json", DOCS / "growth.md", DOCS / "growth.png"

HEIGHTS = (128, 256, 512, 1024, 2048, 4096)
CLIENTS = (1, 2, 4, 8, 16, 32, 64)
LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.021)


def measure_photos(counts: list[int]) -> dict[str, Any]:
    """Seconds of a whole batch by its number of photos, and the bytes a line takes."""
    took = {}
    with tempfile.TemporaryDirectory() as out:
        for count in counts:
            with many_photos(count, SIZE) as photos:
                took[str(count)] = run_lighting("batch", photos, f"{out}/{count}")
        line = (Path(out) / str(counts[0]) / "lighting.jsonl").stat().st_size / counts[0]
    return {"seconds": took, "line": line, "cpus": available_cpus(), "machine": machine()}


def measure_heights(runs: int) -> dict[str, Any]:
    """Milliseconds to render and to write a map by its height, the system's share of rendering, and the file's size."""
    rendered, written, system, size = {}, {}, {}, {}
    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "sky.exr"
        for height in HEIGHTS:
            image = render(LIGHT, height)
            work = {"render": lambda h=height: render(LIGHT, h), "write": lambda i=image: write_exr(target, i, LIGHT)}
            took = milliseconds(work, max(5, min(runs, runs * 512 // height)))
            rendered[str(height)], written[str(height)] = took["render"], took["write"]
            system[str(height)] = system_share(work["render"], max(5, runs * 512 // height))
            size[str(height)] = target.stat().st_size
    return {"render": rendered, "write": written, "system": system, "size": size, "machine": machine()}


def system_share(work: Callable[[], Any], runs: int) -> float:
    """The part (0 to 1) of the processor time that the operating system takes, as for fresh memory."""
    before = os.times()
    for _ in range(runs):
        work()
    after = os.times()
    user, system = after.user - before.user, after.system - before.system
    return system / (user + system)


def measure_clients(seconds: float) -> dict[str, Any]:
    """Answers per second, latency [ms] and share of 503 answers of the service, by number of clients."""
    with tempfile.TemporaryDirectory() as folder, started([sys.executable, "-m", "server"], "/readyz") as (port, _):
        photo = make_photo(Path(folder) / "photo.jpg", SIZE).read_bytes()
        job = Job(port, "/v1/lighting", photo, RECORD)
        run(job, 1, 1.0)
        return {"load": {str(n): _summary(run(job, n, seconds)) for n in CLIENTS}, "machine": machine()}


def _summary(outcome: Outcome) -> dict[str, float]:
    took = 1000 * np.array(outcome.latencies)
    return {
        "rate": len(took) / outcome.seconds,
        "median": float(np.median(took)),
        "p95": float(np.percentile(took, 95)),
        "refused": outcome.counts["503"] / outcome.counts.total(),
    }


def plot(figures: dict[str, Any]) -> None:
    """Three log-log curves, each with the straight line that linear growth would be."""
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullLocator

    _, axes = plt.subplots(1, 3, figsize=(13, 3.8), layout="constrained")
    curves: list[tuple[str, str, str, Callable[[Any], Any]]] = [
        ("photos", "photos", "s", lambda f: {"lighting batch": f["seconds"]}),
        ("heights", "map height", "ms", lambda f: {"render": f["render"], "write EXR": f["write"]}),
        ("clients", "clients", "answers/s", lambda f: {"service": {n: v["rate"] for n, v in f["load"].items()}}),
    ]
    for axis, (key, across, up, series) in zip(axes, curves, strict=True):
        axis.set(xlabel=across, ylabel=up, xscale="log", yscale="log")
        for name, points in series(figures[key]).items() if key in figures else ():
            x, y = np.array(sorted((int(n), value) for n, value in points.items())).T
            (line,) = axis.plot(x, y, "o-", label=name)
            power = 2 if key == "heights" else 1
            anchor = 0 if key == "clients" else -1
            axis.plot(x, y[anchor] * (x / x[anchor]) ** power, ":", color=line.get_color(), linewidth=1)
            axis.set_xticks(x, [f"{int(value):,}" for value in x])
            axis.xaxis.set_minor_locator(NullLocator())
            axis.legend(frameon=False)
        axis.grid(alpha=0.25)
    plt.savefig(PLOT, dpi=100)


def main() -> None:
    """Measure what is asked for, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--photos", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=4.0, help="For each number of clients.")
    parser.add_argument("--only", choices=["photos", "heights", "clients"])
    options = parser.parse_args()
    parts = [options.only] if options.only else ["photos", "heights", "clients"]
    if "photos" in parts:
        remember(FIGURES, "photos", measure_photos(options.photos))
    if "heights" in parts:
        remember(FIGURES, "heights", measure_heights(options.runs))
    if "clients" in parts and importlib.util.find_spec("server"):
        remember(FIGURES, "clients", measure_clients(options.seconds))
    figures = json.loads(FIGURES.read_text())
    PAGE.write_text(page(figures))
    plot(figures)
    print(PAGE.read_text())


if __name__ == "__main__":
    main()

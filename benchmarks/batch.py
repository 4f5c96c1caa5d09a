"""Batches beside a plain loop of Pillow and onnxruntime, their memory, and Ray's rate.

    python -m benchmarks.batch [--photos 300] [--workers 2] [--against FOLDER] [--memory-photos 10000] [--no-ray]

The photos differ. The loop decodes at reduced scale and runs the same graph, in as many processes of one thread as
there are workers. Loop, batch, and batch of another checkout take turns; shares are medians over the turns.
"""

import argparse
import importlib.util
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.common import (
    ROOT,
    TWELVE_MEGAPIXELS,
    ProcessCost,
    describe_machine,
    make_different_photos,
    make_photo_folder,
    median_ratio,
    run_lighting,
    run_python,
)

SMALL = (640, 480)

_PLAIN_LOOP = """
import sys
from pathlib import Path
import numpy as np
from PIL import Image
from lighting.model import Model, fit_size, pad_to_input
folder, part, parts = Path(sys.argv[1]), *map(int, sys.argv[2:])
model = Model.load(threads=1)
for path in sorted(folder.iterdir())[part::parts]:
    image = Image.open(path)
    image.draft("RGB", (448, 448))
    image = image.convert("RGB")
    small = image.resize(fit_size(*image.size, model.spec), Image.Resampling.BILINEAR)
    model.session.run(None, {"photo": pad_to_input(np.asarray(small), model.spec)[None]})
"""


def run_plain_loop(photos: Path, workers: int) -> ProcessCost:
    """What Pillow and onnxruntime alone take of the photos, in so many processes of one thread."""
    with ThreadPoolExecutor(workers) as pool:
        costs = list(pool.map(lambda part: run_python("-c", _PLAIN_LOOP, photos, part, workers), range(workers)))
    busy = sum(cost.processor_seconds for cost in costs)
    return ProcessCost(max(cost.seconds for cost in costs), busy, sum(cost.peak for cost in costs))


def run_batch(photos: Path, workers: int, package: Path) -> ProcessCost:
    """What `lighting batch` takes of the photos."""
    with tempfile.TemporaryDirectory() as out:
        return run_lighting("batch", photos, out, "-q", "--workers", workers, package=package)


def memory_by_photo(photos: Path, count: int) -> Iterator[tuple[int, float]]:
    """Finished photos and resident memory [MB] of all processes together, at every tenth of a run."""
    with tempfile.TemporaryDirectory() as out:
        running = subprocess.Popen([sys.executable, "-m", "lighting", "batch", str(photos), out])
        journal, due = Path(out) / "lighting.jsonl", count // 10
        while running.poll() is None:
            completed = journal.read_bytes().count(b"\n") if journal.exists() else 0
            if completed >= due:
                yield completed, sum(map(_resident, [running.pid, *_children(running.pid)]))
                due += count // 10
            time.sleep(0.2)


def _children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def _resident(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith("VmRSS")), 0.0)


def ray_rate(photos: Path, count: int) -> dict[str, Any]:
    """Photos per second of Ray including its start, and on a running cluster with a warm actor."""
    with tempfile.TemporaryDirectory() as out:
        whole = count / run_lighting("batch", photos, out, "--engine", "ray", "-q").seconds
    with tempfile.TemporaryDirectory() as out:
        completed = subprocess.run(
            [sys.executable, "-c", _RAY, str(photos), out], capture_output=True, text=True, check=True
        )
    return {"whole": whole, "cluster up": count / float(completed.stdout.split()[-1])}


_RAY = """
import sys, time
import ray
from lighting.batch.job import BatchJob
from lighting.batch.ray import find_photos_at, run_ray
ray.init(logging_level="error")
source, names = find_photos_at(sys.argv[1])
options = dict(address=None, workers=None, overwrite=True, progress=False)
run_ray(BatchJob(source, sys.argv[2], engine="ray"), names[:8], **options)
started = time.perf_counter()
run_ray(BatchJob(source, sys.argv[2], engine="ray"), names, **options)
print(time.perf_counter() - started)
"""


def print_rates(size: tuple[int, int], count: int, workers: int, packages: Sequence[Path], runs: int) -> None:
    """Rates and processor time of the plain loop and of batches, by turns, and the share of the loop's rate."""
    with make_different_photos(count, size) as photos:
        names = ["plain loop", "batch", *(f"batch of {package}" for package in packages[1:])]
        works = [partial(run_plain_loop, photos, workers), *(partial(run_batch, photos, workers, p) for p in packages)]
        with make_different_photos(workers, size) as few:  # which compiles the modules
            for package in packages:
                run_batch(few, workers, package)
        turns = zip(*([work() for work in works] for _ in range(runs)), strict=True)
        print(f"\n{count} JPEGs of {size[0]} x {size[1]} that differ, {workers} workers, start included")
        print(f"{'':<30}{'a second':>9}{'share':>7}{'CPU ms':>8}{'share':>7}")
        loop: list[list[float]] = []
        for name, costs in zip(names, turns, strict=True):
            figures = [[cost.seconds for cost in costs], [cost.processor_seconds for cost in costs]]
            loop = loop or figures
            wall, busy = map(median_ratio, loop, figures)
            rate, each = count / median(figures[0]), 1000 * median(figures[1]) / count
            print(f"{name[-30:]:<30}{rate:9.1f}{wall:7.2f}{each:8.1f}{busy:7.2f}", flush=True)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--photos", type=int, default=300)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="A checkout of another version.")
    parser.add_argument("--memory-photos", type=int, default=10_000)
    parser.add_argument("--no-ray", action="store_true")
    options = parser.parse_args()
    print(describe_machine())
    packages = [ROOT, *([options.against.resolve()] if options.against else [])]
    print_rates(SMALL, options.photos, options.workers, packages, options.runs)
    if importlib.util.find_spec("ray") and not options.no_ray:
        print_ray(options.photos)
    else:
        print("\nRay: not measured" + ("" if options.no_ray else "; it is not installed"))
    if options.memory_photos:
        with make_photo_folder(options.memory_photos, SMALL) as photos:
            print(f"\nMemory over {options.memory_photos} photos, MB of all processes")
            print(
                *(f"{count}: {memory:.0f}" for count, memory in memory_by_photo(photos, options.memory_photos)),
                sep=", ",
            )


def print_ray(count: int) -> None:
    """The pool and Ray on the same photos."""
    with make_photo_folder(count, TWELVE_MEGAPIXELS) as photos:
        pool = count / run_batch(photos, 2, ROOT).seconds
        ray = ray_rate(photos, count)
    print(f"\nThe same {count} photos: pool of 2 {pool:.1f} a second, Ray {json.dumps(ray)}")


if __name__ == "__main__":
    main()

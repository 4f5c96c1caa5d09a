"""Batches: the pool's rate by number of workers compared with its floors, its memory, and Ray's rate.

    python -m benchmarks.batch [--photos 200] [--memory-photos 10000] [--no-ray]

The photos are one JPEG under many names. A floor is what one process of one thread needs for Pillow's decoding at
reduced scale and for onnxruntime's run of the same graph, in as many processes as there are workers. The pool's rate
without its start is that of the photos by which a larger folder exceeds a smaller one.
"""

import argparse
import importlib.util
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.common import TWELVE_MEGAPIXELS, describe_machine, make_photo_folder, run_lighting

SMALL = (640, 480)
ROUNDS = 5  # floors and pool in turn; the medians count

_FLOOR = """
import sys, time
from pathlib import Path
from statistics import median
from PIL import Image
from lighting.model import Model, preprocess
from lighting.photo.reader import TARGET, read_photo
path, count = Path(sys.argv[1]), int(sys.argv[2])
model = Model.load(threads=1)
tensor = preprocess(read_photo(path), model.spec)
started = time.perf_counter()
for _ in range(count):
    image = Image.open(path)
    image.draft(None, (TARGET, TARGET * image.height // image.width))
    image.load()
    model.session.run(None, {"photo": tensor})
print(count / (time.perf_counter() - started))
"""


def floor_rate(photo: Path, workers: int, count: int) -> float:
    """Photos per second of the bare libraries in `workers` processes."""
    command = [sys.executable, "-c", _FLOOR, str(photo), str(count)]
    running = [subprocess.Popen(command, stdout=subprocess.PIPE, text=True) for _ in range(workers)]
    return sum(float(process.communicate()[0]) for process in running)


def pool_rates(few: Path, many: Path, workers: int) -> tuple[float, float]:
    """Photos per second of the larger folder with the start, and without it, by the difference to the smaller."""
    counts = [sum(1 for _ in photos.iterdir()) for photos in (few, many)]
    took = [pool_seconds(photos, workers) for photos in (few, many)]
    return counts[1] / took[1], (counts[1] - counts[0]) / (took[1] - took[0])


def pool_seconds(photos: Path, workers: int) -> float:
    """Seconds of a whole run."""
    with tempfile.TemporaryDirectory() as out:
        return run_lighting("batch", photos, out, "--workers", workers)


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
        whole = count / run_lighting("batch", photos, out, "--engine", "ray", "-q")
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


def print_workers(size: tuple[int, int], count: int) -> dict[str, Any]:
    """The table by workers of photos of one size; returns its figures."""
    figures: dict[str, Any] = {}
    with make_photo_folder(count // 4, size) as few, make_photo_folder(count, size) as many:
        print(f"\n{count} JPEGs of {size[0]} x {size[1]}; photos per second")
        print(f"{'workers':>8}{'whole':>9}{'running':>9}{'floors':>9}{'share':>8}")
        for workers in (1, 2):
            rounds = [
                (floor_rate(many / "000000.jpg", workers, count // workers), *pool_rates(few, many, workers))
                for _ in range(ROUNDS)
            ]
            floor, whole, steady = map(median, zip(*rounds, strict=True))
            figures[str(workers)] = {"whole": whole, "running": steady, "floors": floor}
            print(f"{workers:>8}{whole:9.1f}{steady:9.1f}{floor:9.1f}{steady / floor:8.2f}")
    print(f"2 workers are {figures['2']['running'] / figures['1']['running']:.2f} times 1")
    return figures


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--photos", type=int, default=200)
    parser.add_argument("--memory-photos", type=int, default=10_000)
    parser.add_argument("--no-ray", action="store_true")
    options = parser.parse_args()
    print(describe_machine())
    print_workers(TWELVE_MEGAPIXELS, options.photos)
    print_workers(SMALL, 5 * options.photos)
    if importlib.util.find_spec("ray") and not options.no_ray:
        print_ray(5 * options.photos)
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
        pool = count / pool_seconds(photos, 2)
        ray = ray_rate(photos, count)
    print(f"\nThe same {count} photos: pool of 2 {pool:.1f} a second, Ray {json.dumps(ray)}")


if __name__ == "__main__":
    main()

"""Print how cost grows, and what packings cost: the tables of docs/lab/performance.md.

    python -m benchmarks.performance [photos] [megapixels] [heights] [films] [clients] [packings]

It grows with photos, their size, map height, seconds of a clip (PyAV) and clients.

Packings are those of EXR files of example photos, by one thread, beside OpenImageIO where that is installed.
"""

import argparse
import io
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from statistics import median

import numpy as np
from numpy.typing import NDArray

from benchmarks.clients import Job
from benchmarks.common import (
    EXAMPLE,
    describe_machine,
    make_photo,
    make_photo_folder,
    measure_milliseconds,
    run_apart,
    run_lighting,
)
from benchmarks.load import RECORD, processor_time, run, started
from benchmarks.video import make_clip
from lighting import estimate
from lighting.files import FileOptions, encode_envmap
from lighting.files.exr import COMPRESSIONS, read_exr, set_compression_threads
from lighting.map_options import MapOptions

SIZE = (1600, 1200)  # of the photos, pixels
HEIGHTS = (256, 512, 1024, 2048, 4096, 8192)  # of maps, rows
_MAPS = 4  # of example photos
CLIENTS = (1, 2, 4, 8, 16, 32, 64)


def photos_table(counts: list[int]) -> Iterator[str]:
    """Processor time of a whole batch by its number of photos; seconds to start, ms a photo; bytes of a line."""
    yield "| photos | CPU s | CPU ms a photo |\n| ---: | ---: | ---: |"
    took = {}
    with tempfile.TemporaryDirectory() as out:
        for count in sorted(counts):
            with make_photo_folder(count, SIZE) as photos:
                took[count] = run_lighting("batch", photos, f"{out}/{count}").processor_seconds
            yield f"| {count:,} | {took[count]:.1f} | {1000 * took[count] / count:.0f} |"
        line = (Path(out) / str(counts[0]) / "lighting.jsonl").stat().st_size / counts[0]
    start, each = line_through(took)
    yield f"\n{1000 * each:.1f} ms a photo, {start:.1f} s to start; a line has {line:.0f} bytes."


def line_through(seconds: dict[int, float]) -> tuple[float, float]:
    """Seconds to start and seconds a photo: the line through the least and the greatest batch."""
    low, high = min(seconds), max(seconds)
    each = (seconds[high] - seconds[low]) / max(high - low, 1)
    return max(seconds[low] - each * low, 0.0), each


def megapixels_table(sizes: list[float]) -> Iterator[str]:
    """Processor time and peak memory of a map and of a scene by the photo's megapixels."""
    yield f"| megapixels | envmap, CPU s | MB | scene, CPU s | MB |\n|{' ---: |' * 5}"
    with tempfile.TemporaryDirectory() as name:
        photo, out = Path(name, "photo.jpg"), Path(name, "out.exr")
        for size in sizes:
            height = round((size * 1e6 * 3 / 4) ** 0.5)
            run_apart(make_photo, photo, (height * 4 // 3, height))
            envmap = run_lighting("envmap", photo, "-o", out, "--overwrite", "-q")
            scene = run_lighting("scene", photo, "--for", "blender", "-o", f"{name}/scene", "--overwrite", "-q")
            costs = (f"{cost.processor_seconds:.2f} | {cost.peak:.0f}" for cost in (envmap, scene))
            yield f"| {size:g} | {' | '.join(costs)} |"


def films_table(lengths: list[float]) -> Iterator[str]:
    """Processor time and peak memory of `lighting video` by the seconds of the clip."""
    yield f"| seconds of a clip | CPU s | MB |\n|{' ---: |' * 3}"
    with tempfile.TemporaryDirectory() as name:
        for length in lengths:
            run_apart(make_clip, clip := Path(name, "clip.mp4"), length)
            cost = run_lighting("video", clip, "-o", f"{name}/out", "--overwrite", "-q")
            yield f"| {length:g} | {cost.processor_seconds:.1f} | {cost.peak:.0f} |"


def heights_table() -> Iterator[str]:
    """Processor time and peak memory of `lighting envmap` by the rows of the map, and the file's size."""
    yield f"| rows | CPU s | MB | EXR, MB |\n|{' ---: |' * 4}"
    with tempfile.TemporaryDirectory() as name:
        run_apart(make_photo, photo := Path(name, "photo.jpg"))
        for height in HEIGHTS:
            target = Path(name, f"{height}.exr")
            cost = run_lighting("envmap", photo, "-o", target, "--height", height, "-q")
            yield f"| {height} | {cost.processor_seconds:.2f} | {cost.peak:.0f} | {target.stat().st_size / 1e6:.2f} |"


def clients_table(seconds: float) -> Iterator[str]:
    """Answers per second, processor time of one and latency [ms], and share of 503 answers, by number of clients."""
    yield f"| clients | answers per second | CPU ms | median, ms | 95 %, ms | turned away |\n|{' ---: |' * 6}"
    service = started([sys.executable, "-m", "server"], "/readyz")
    with tempfile.TemporaryDirectory() as folder, service as (port, process):
        photo = make_photo(Path(folder) / "photo.jpg", SIZE).read_bytes()
        job = Job(port, "/v1/lighting", photo, RECORD)
        run(job, 1, 1.0)
        for count in CLIENTS:
            before = processor_time(process.pid)
            outcome = run(job, count, seconds)
            busy = 1000 * (processor_time(process.pid) - before) / max(1, len(outcome.latencies))
            took, refused = 1000 * np.array(outcome.latencies), outcome.counts["503"] / outcome.counts.total()
            rate, late = len(took) / outcome.seconds, np.percentile(took, 95)
            yield f"| {count} | {rate:.1f} | {busy:.0f} | {np.median(took):.0f} | {late:.0f} | {100 * refused:.0f} % |"


def packings_table(runs: int) -> Iterator[str]:
    """Processor time to write a map by its packing, size of the file, and how much values and the light change."""
    set_compression_threads(1)
    images = [estimate(photo).render(MapOptions(512)).image for photo in sorted(EXAMPLE.parent.glob("*.jpg"))[:_MAPS]]
    work: dict[str, Callable[[NDArray[np.float32]], bytes]] = {
        name: lambda image, name=name: encode_envmap(image, options=FileOptions(compression=name))  # type: ignore[misc]
        for name in COMPRESSIONS
    }
    if find_spec("OpenImageIO"):
        work["OpenImageIO, half, zip:1"] = encode_by_openimageio
    yield f"| {len(images)} maps of 1024 x 512 | CPU ms | x time | MB | largest error of a value | of the light |"
    yield f"|{' --- |' * 6}"
    turns = [{name: partial(pack, image) for name, pack in work.items()} for image in images]
    took = [measure_milliseconds(turn, max(3, runs // 3), time.process_time) for turn in turns]
    last = list(work)[-1]
    for name, pack in work.items():
        files = [pack(image) for image in images]
        read = [read_exr(io.BytesIO(data))[0] for data in files]
        pairs = list(zip(read, images, strict=True))
        error = max(float((np.abs(back - image) / np.maximum(image, 1e-3)).max()) for back, image in pairs)
        light = max(abs(float(back.sum(dtype=np.float64) / image.sum(dtype=np.float64)) - 1) for back, image in pairs)
        share, least = median(one[name] / one[last] for one in took), median(one[name] for one in took)
        size = np.mean([len(data) for data in files]) / 1e6
        yield f"| {name} | {least:.0f} | {share:.2f} | {size:.2f} | {error:.1e} | {light:.1e} |"


def encode_by_openimageio(image: NDArray[np.float32]) -> bytes:
    """The bytes of an EXR of half floats by OpenImageIO's ZIP of least effort."""
    import OpenImageIO

    height, width = image.shape[:2]
    spec = OpenImageIO.ImageSpec(width, height, 3, "half")
    spec["compression"] = "zip:1"
    with tempfile.TemporaryDirectory() as folder:
        target = str(Path(folder) / "map.exr")
        output = OpenImageIO.ImageOutput.create(target)
        assert output is not None, OpenImageIO.geterror()
        output.open(target, spec)
        output.write_image(image)
        output.close()
        return Path(target).read_bytes()


def main() -> None:
    """Print the parts that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("parts", nargs="*", help="as above; all by default")
    parser.add_argument("--photos", type=int, nargs="+", default=[100, 1000, 10_000])
    parser.add_argument("--megapixels", type=float, nargs="+", default=[1, 12, 48, 108])
    parser.add_argument("--films", type=float, nargs="+", default=[1, 10, 60], help="seconds")
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=4.0, help="for each number of clients")
    options = parser.parse_args()
    tables: dict[str, Callable[[], Iterator[str]]] = {
        "photos": lambda: photos_table(options.photos),
        "megapixels": lambda: megapixels_table(options.megapixels),
        "heights": heights_table,
        "films": lambda: films_table(options.films),
        "clients": lambda: clients_table(options.seconds),
        "packings": lambda: packings_table(options.runs),
    }
    if unknown := set(options.parts) - set(tables):
        parser.error(f"there is no part {min(unknown)}: choose of {', '.join(tables)}")
    for part in options.parts or tables:
        print(f"## {part}, {describe_machine()}\n", *tables[part](), sep="\n", flush=True)


if __name__ == "__main__":
    main()

"""Shared by the benchmarks: generated photos, fair timing, and a description of the machine."""

import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
from PIL import Image

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "examples" / "wide_street.jpg"
TWELVE_MEGAPIXELS = (4032, 3024)  # a phone's photo


def make_photo(path: Path, size: tuple[int, int] = TWELVE_MEGAPIXELS) -> Path:
    """An example photo at another size, with the noise of a sensor so that it compresses like a real photo."""
    picture = np.asarray(Image.open(EXAMPLE).convert("RGB").resize(size, Image.Resampling.BICUBIC), dtype=np.float32)
    noisy = picture + np.random.default_rng(0).normal(0, 4, picture.shape).astype(np.float32)
    Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8)).save(path, "JPEG", quality=92)
    return path


def register_heif_writer() -> None:
    """Have Pillow write HEIC by pillow-heif, which reads none here: the library does so by pi-heif."""
    Image.register_save("HEIF", _write_heif)


def _write_heif(image: Image.Image, file: IO[bytes], _name: str | bytes) -> None:
    import pillow_heif

    pillow_heif.from_pillow(image).save(file, **image.encoderinfo)


@contextmanager
def make_photo_folder(count: int, size: tuple[int, int] = (1024, 768)) -> Iterator[Path]:
    """A folder of `count` photos, which are one file under many names."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "photos"
        folder.mkdir()
        first = make_photo(folder / "000000.jpg", size)
        for number in range(1, count):
            os.link(first, folder / f"{number:06}.jpg")
        yield folder


def measure_milliseconds(
    parts: Mapping[str, Callable[[], Any]], runs: int, clock: Callable[[], float] = time.perf_counter
) -> dict[str, float]:
    """The least time of each part, which is disturbed least by other work on the machine; the parts take turns."""
    times: dict[str, list[float]] = {name: [] for name in parts}
    for run in range(runs + 1):
        for name, work in parts.items():
            started = clock()
            work()
            if run:  # the first is to warm up
                times[name].append(clock() - started)
    return {name: 1000 * min(seconds) for name, seconds in times.items()}


def run_lighting(*arguments: object) -> float:
    """Seconds that a `lighting` command takes in a process of its own; SystemExit where it fails.

    Of a batch single photos may fail.
    """
    command = [sys.executable, "-m", "lighting", *map(str, arguments)]
    started = time.perf_counter()
    result = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
    if result.returncode not in ((0, 1) if arguments[0] == "batch" else (0,)):
        raise SystemExit(f"{' '.join(command)} ended with status {result.returncode}.")
    return time.perf_counter() - started


def measure_cpu_seconds(*arguments: object) -> float:
    """Processor time [s] of all threads of a `lighting` command in a process of its own, for a busy machine."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run_lighting(*arguments)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


_PRINT_PEAK = """
import atexit, re, sys
status = lambda: re.search("VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]
atexit.register(lambda: print(status(), file=sys.stderr))
from lighting.__main__ import run_command
run_command()
"""


def measure_peak_memory(*arguments: object) -> float:
    """Peak memory [MB] of a `lighting` command, read inside its process, since a child inherits its parent's peak."""
    command = [sys.executable, "-c", _PRINT_PEAK, *map(str, arguments)]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(result.stderr.split()[-1]) / 1024


def describe_machine() -> str:
    """One line that describes machine and versions."""
    from lighting.runtime import available_cpus

    return (
        f"{time.strftime('%Y-%m-%d')}, {_processor_name()}, {available_cpus()} CPUs, {platform.system()}, "
        f"Python {platform.python_version()}"
    )


def _processor_name() -> str:
    information = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in information.read_text().splitlines() if "model name" in line]
    return names[0] if names else platform.machine()

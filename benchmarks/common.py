"""Shared by the benchmarks: generated photos, fair timing, and a description of the machine."""

import os
import platform
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import median
from typing import IO, Any

import numpy as np
from PIL import Image

from lighting.runtime import ONE_THREAD

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


@contextmanager
def make_different_photos(count: int, size: tuple[int, int]) -> Iterator[Path]:
    """A folder of `count` photos of one size: parts of the examples, each with a noise of its own."""
    rng = np.random.default_rng(0)
    pictures = [Image.open(path).convert("RGB") for path in sorted(EXAMPLE.parent.glob("*.jpg"))]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "photos"
        folder.mkdir()
        for number in range(count):
            picture = pictures[number % len(pictures)]
            share = rng.uniform(0.6, 1.0)
            left, top = (rng.uniform(0, side * (1 - share)) for side in picture.size)
            box = (left, top, left + share * picture.width, top + share * picture.height)
            part = np.asarray(picture.resize(size, Image.Resampling.BICUBIC, box), dtype=np.float32)
            noisy = part + rng.normal(0, 3, part.shape)
            Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8)).save(folder / f"{number:06}.jpg", quality=92)
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


@dataclass(frozen=True)
class ProcessCost:
    """What one process took, with those that it started."""

    seconds: float
    processor_seconds: float  # of all threads
    peak: float  # MB, of the largest one


def run_python(*arguments: object, package: Path = ROOT, folder: Path | None = None) -> ProcessCost:
    """Run Python in a process of its own, which has to be larger than this one for its peak; SystemExit if it fails.

    Modules are kept compiled, as an installed wheel has them: the first run of a package takes longer.

    Args:
        arguments: of Python.
        package: folder of the `lighting` that it imports: a checkout, or an installed wheel.
        folder: in which it runs; None: the package's.
    """
    command = [sys.executable, *map(str, arguments)]
    environment = {**os.environ, "PYTHONPATH": str(package)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    environment.setdefault("PYTHONPYCACHEPREFIX", str(Path(tempfile.gettempdir(), "benchmarks-bytecode")))
    started = time.perf_counter()
    process = subprocess.Popen(command, cwd=folder or package, env=environment, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    seconds = time.perf_counter() - started
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode not in ((0, 1) if "batch" in arguments else (0,)):  # of a batch single photos may fail
        raise SystemExit(f"{' '.join(command)} ended with status {process.returncode}.")
    return ProcessCost(seconds, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


def run_lighting(*arguments: object, package: Path = ROOT, folder: Path | None = None) -> ProcessCost:
    """Run a `lighting` command as `run_python` does."""
    return run_python("-m", "lighting", *arguments, package=package, folder=folder)


def run_apart(work: Callable[..., Any], *arguments: object) -> None:
    """Call a function in a process of its own: those that this one starts later inherit its peak memory.

    Args:
        work: of a module.
        arguments: its own.
    """
    process = get_context("spawn").Process(target=work, args=arguments)
    process.start()
    process.join()
    if process.exitcode:
        raise SystemExit(f"{work.__name__} ended with status {process.exitcode}.")


def take_turns(works: Sequence[Callable[[], float]], runs: int) -> list[list[float]]:
    """What each work returns in each run; they take turns, so that a busy machine is as busy for all."""
    return [list(column) for column in zip(*([work() for work in works] for _ in range(runs)), strict=True)]


def median_ratio(ours: Sequence[float], others: Sequence[float]) -> float:
    """The median over pairs of runs."""
    return median(one / other for one, other in zip(ours, others, strict=True))


@contextmanager
def warm_worker(package: Path, code: str, *arguments: object) -> Iterator[Callable[[], float]]:
    """A function that has a process run `job()` once more, and returns its processor time [ms].

    Args:
        package: folder of the `lighting` that it imports.
        code: of the process; it defines `job`.
        arguments: of the process.
    """
    loop = """
import sys, time
job(), job()
for _ in sys.stdin:
    before = time.process_time()
    job()
    print(1000 * (time.process_time() - before), flush=True)
"""
    environment = {**os.environ, **ONE_THREAD, "PYTHONPATH": str(package)}
    command = [sys.executable, "-c", code + loop, *map(str, arguments)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, cwd=package, env=environment, text=True, **pipes) as process:  # type: ignore[call-overload]

        def run() -> float:
            process.stdin.write("\n")
            process.stdin.flush()
            return float(process.stdout.readline())

        yield run


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

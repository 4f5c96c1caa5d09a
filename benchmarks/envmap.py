"""How long a 12-megapixel JPEG takes to become an environment map, and its parts.

    python benchmarks/envmap.py [--runs 7]

Prints medians in milliseconds, measured in this process after one warm-up, and the whole command as a
process of its own.
"""

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from lighting.envmap import render
from lighting.exr import write_exr
from lighting.model import Model
from lighting.parameters import lighting_from
from lighting.photo import read_photo, to_tensor

EXAMPLE = Path(__file__).parent.parent / "examples" / "wide_street.jpg"
SIZE = (4032, 3024)  # pixels, a 12-megapixel phone photo


def twelve_megapixels(path: Path) -> None:
    """An example photo enlarged, with the noise of a sensor so that it compresses like a real photo."""
    picture = np.asarray(Image.open(EXAMPLE).convert("RGB").resize(SIZE, Image.Resampling.BICUBIC), dtype=np.float32)
    noisy = picture + np.random.default_rng(0).normal(0, 4, picture.shape).astype(np.float32)
    Image.fromarray(np.clip(noisy, 0, 255).astype(np.uint8)).save(path, "JPEG", quality=92)


def milliseconds(work: Callable[[], Any], runs: int) -> float:
    """Median wall time of `work` after one warm-up."""
    work()
    times = []
    for _ in range(runs):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1000 * statistics.median(times)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--height", type=int, default=512)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        jpeg, exr = Path(folder) / "photo.jpg", Path(folder) / "sky.exr"
        twelve_megapixels(jpeg)
        model = Model.load()
        photo = read_photo(jpeg)
        tensor = to_tensor(photo, model.spec)
        light = lighting_from(model.predict(tensor)[0])
        image = render(light, options.height, sun=True)
        command = [
            sys.executable,
            "-m",
            "lighting",
            "envmap",
            str(jpeg),
            "-o",
            str(exr),
            "--height",
            str(options.height),
        ]
        parts: dict[str, Callable[[], Any]] = {
            "read JPEG, reduced": lambda: read_photo(jpeg),
            "photo to tensor": lambda: to_tensor(photo, model.spec),
            "network": lambda: model.predict(tensor),
            "decode the sun": lambda: lighting_from(model.predict(tensor)[0]),
            "sky, sun and ground": lambda: render(light, options.height, sun=True),
            "write EXR": lambda: write_exr(exr, image, light),
        }
        took = {name: milliseconds(work, options.runs) for name, work in parts.items()}
        took["decode the sun"] -= took["network"]
        size = f"{SIZE[0]}x{SIZE[1]} ({jpeg.stat().st_size / 1e6:.1f} MB)"
        print(f"JPEG of {size} to a map of {2 * options.height}x{options.height}, median of {options.runs} runs")
        print(f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}\n")
        for name, value in took.items():
            print(f"{name:<28}{value:8.1f} ms")
        print(f"{'sum':<28}{sum(took.values()):8.1f} ms")
        print(f"{'load the network, once':<28}{milliseconds(Model.load, options.runs):8.1f} ms")
        whole = milliseconds(lambda: subprocess.run(command, check=True, stdout=subprocess.DEVNULL), options.runs)
        print(f"{'lighting envmap, a process':<28}{whole:8.1f} ms")


if __name__ == "__main__":
    main()

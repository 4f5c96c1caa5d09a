"""What each packing of an EXR costs, what it does to the values, and which programs open it.

    python -m benchmarks.compressions [--beside PYTHON ...] [--node FOLDER] [--runs 15] [--cpu]

A 1024 x 512 map with its sun is packed every way that OpenEXR knows. The readers that this Python, the others and node
(a FOLDER with node_modules) can import are tried: OpenEXR, OpenImageIO, Mitsuba, bpy, SimpleImageIO (which is tinyexr);
three.js, parse-exr, exrs. A file is opened only if its values are those that OpenEXR itself reads.
"""

import argparse
import io
import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from benchmarks.common import machine, milliseconds
from lighting.envmap import render
from lighting.files.compression import packed_with, rounded
from lighting.geometry import latlong_solid_angle
from lighting.records import Lighting

LIGHT = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=5.0)
WAYS = ("NO", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "DWAA", "HTJ2K256", "ZSTD")
HERE = Path(__file__).parent


def packed(image: NDArray[np.float32], way: str) -> bytes:
    """The file; "ZIP rounded" is this project's `zip`."""
    name, _, rounding = way.partition(" ")
    header = {"compression": getattr(OpenEXR, f"{name}_COMPRESSION"), "type": OpenEXR.scanlineimage}
    stream = io.BytesIO()
    OpenEXR.File(header, {"RGB": rounded(image) if rounding else image}).write(stream)
    return stream.getvalue()


def figures(image: NDArray[np.float32], data: bytes) -> str:
    """Size, largest relative error, and the change of the sun's energy."""
    back = OpenEXR.File(io.BytesIO(data)).channels()["RGB"].pixels
    disc = image.max(axis=-1) > 0.01 * image.max()
    weight = np.broadcast_to(latlong_solid_angle(len(image))[:, None], disc.shape)[disc][:, None]
    sun = (weight * back[disc]).sum(dtype=np.float64) / (weight * image[disc]).sum(dtype=np.float64) - 1
    return f"{len(data) / 1e6:8.2f}{np.max(np.abs(back - image) / image):10.1e}{sun:10.1e}"


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--beside", metavar="PYTHON", nargs="*", default=[])
    parser.add_argument("--node", metavar="FOLDER", type=Path)
    parser.add_argument("--runs", type=int, default=15)
    parser.add_argument("--cpu", action="store_true", help="Processor time of all threads, for a busy machine.")
    options = parser.parse_args()
    clock = time.process_time if options.cpu else time.perf_counter
    image, ways = render(LIGHT, 512, sun=True), [*WAYS, "ZIP rounded"]
    packed_with(image, "zip")  # from here on ZIP takes as little effort as this project's files
    print(f"{'processor' if options.cpu else 'wall'} time, {machine()}, OpenEXR {OpenEXR.__version__}")
    took = {}
    for threads in (0, 2):
        OpenEXR.set_global_thread_count(threads)
        took[threads] = milliseconds({way: partial(packed, image, way) for way in ways}, options.runs, clock)
    print(f"{'':<14}{'ms':>8}{'2 threads':>11}{'MB':>8}{'error':>10}{'sun':>10}")
    with tempfile.TemporaryDirectory() as folder:
        for way in ways:
            data = packed(image, way)
            (Path(folder) / f"{way}.exr").write_bytes(data)
            print(f"{way:<14}{took[0][way]:8.1f}{took[2][way]:11.1f}{figures(image, data)}")
        for python in [sys.executable, *options.beside]:
            subprocess.run([python, HERE / "exr_readers.py", folder], check=False)
        if options.node:
            script = (HERE / "exr_readers.mjs").read_text()
            command = ["node", "--input-type=module", "-", folder]
            subprocess.run(command, input=script, text=True, cwd=options.node, check=False)


if __name__ == "__main__":
    main()

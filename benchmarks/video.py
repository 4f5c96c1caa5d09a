"""A clip's light: time, processor time and peak memory of `lighting video`, beside another checkout's.

    python -m benchmarks.video [--seconds 10] [--runs 1] [--against FOLDER]

The clip is a camera that moves over an example photo, 1920 x 1080, 30 frames a second. With `--against`, the records of
both have to be the same bytes.
"""

import argparse
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from PIL import Image

from benchmarks.common import EXAMPLE, ROOT, describe_machine, median_ratio, run_apart, run_lighting

SIZE = (1920, 1080)
_RATE = 30  # frames a second
_REACH = 1.6  # times the width of a frame, over which the camera moves in ten seconds and back


def make_clip(path: Path, seconds: float) -> None:
    """Write a clip of a camera that moves to and fro over an example photo."""
    import av

    width, height = SIZE
    wide = Image.open(EXAMPLE).convert("RGB").resize((int(_REACH * width), height), Image.Resampling.BICUBIC)
    pixels = np.asarray(wide)
    with av.open(str(path), "w") as film:
        stream: Any = film.add_stream("libx264", rate=_RATE, options={"crf": "18", "preset": "ultrafast"})
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        for number in range(round(seconds * _RATE)):
            share = 0.5 - 0.5 * np.cos(2 * np.pi * number / (20 * _RATE))
            left = round(share * (pixels.shape[1] - width))
            picture = np.ascontiguousarray(pixels[:, left : left + width])
            film.mux(stream.encode(av.VideoFrame.from_ndarray(picture, format="rgb24")))
        film.mux(stream.encode())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=10.0, help="of the clip")
    parser.add_argument("--runs", type=int, default=1)
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="A checkout of another version.")
    options = parser.parse_args()
    packages = [ROOT, *([options.against.resolve()] if options.against else [])]
    with tempfile.TemporaryDirectory() as name:
        run_apart(make_clip, clip := Path(name, "clip.mp4"), options.seconds)
        outs = [Path(name, str(number)) for number in range(2)]
        turns = [
            [
                run_lighting("video", clip, "-o", out, "--overwrite", "-q", package=package)
                for package, out in zip(packages, outs, strict=False)
            ]
            for _ in range(options.runs)
        ]
        ours, *others = zip(*turns, strict=True)
        print(f"{options.seconds:g} s of {SIZE[0]} x {SIZE[1]}, medians of {options.runs}; {describe_machine()}")
        print(
            f"{median(c.seconds for c in ours):.1f} s, {median(c.processor_seconds for c in ours):.1f} CPU s", end=", "
        )
        print(f"{max(c.peak for c in ours):.0f} MB")
        for theirs in others:
            busy = median_ratio(*([c.processor_seconds for c in costs] for costs in (ours, theirs)))
            same = len({(out / "lighting.jsonl").read_bytes() for out in outs}) == 1
            print(f"{busy:.2f} times the CPU time of {packages[1]}; {'the same' if same else 'OTHER'} records")


if __name__ == "__main__":
    main()

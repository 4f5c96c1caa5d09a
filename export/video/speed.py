"""How long a 1080p clip takes."""

import os
import tempfile
import time as clock
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from export.data import Panorama
from export.video.sequences import displayed, look
from lighting.cpus import available_cpus
from lighting.model import Model
from lighting.video import Job, process

SECONDS, RATE, SIZE, FOV = 30, 30, (1920, 1080), 45.0


def speed_report(panorama: Panorama, model: Model) -> str:
    """One sentence."""
    with tempfile.TemporaryDirectory() as name:
        clip = Path(name) / "clip.mp4"
        write_clip(clip, _pictures(panorama))
        start = clock.perf_counter(), clock.process_time()
        process(Job(clip, Path(name) / "out"), model)
        wall, cpu = clock.perf_counter() - start[0], clock.process_time() - start[1]
        size = clip.stat().st_size / 1e6
    return (
        f"## Speed\n\n{SECONDS} s of 1080p at {RATE} frames a second (H.264, {size:.0f} MB), records and map: "
        f"{wall:.1f} s, {cpu:.1f} s of CPU, on {available_cpus()} CPUs under a load of {os.getloadavg()[0]:.1f}."
    )


def _pictures(panorama: Panorama) -> Iterator[NDArray[np.uint8]]:
    import cv2

    picture = displayed(panorama)
    for i in range(SECONDS * RATE):
        time = i / RATE
        turn = (40.0 * float(np.sin(time / 5.0)), 4.0 + 3.0 * float(np.sin(time)), float(np.sin(1.7 * time)))
        small = look(picture, turn, FOV, (SIZE[0] // 3, SIZE[1] // 3))  # as fine as the panorama is
        yield np.asarray(cv2.resize(small, SIZE, interpolation=cv2.INTER_CUBIC))


def write_clip(path: Path, pictures: Iterator[NDArray[np.uint8]]) -> None:
    """Pictures (h, w, 3) as H.264, with the grain that cameras have."""
    import av
    import cv2

    rng = np.random.default_rng(0)
    grain = rng.integers(-3, 4, (8, SIZE[1], SIZE[0], 3), dtype=np.int16)
    with av.open(str(path), "w") as film:
        stream = film.add_stream("libx264", rate=RATE, options={"preset": "veryfast", "crf": "20"})
        stream.width, stream.height, stream.pix_fmt = *SIZE, "yuv420p"
        for i, picture in enumerate(pictures):
            noisy = np.asarray(cv2.add(picture, grain[i % 8], dtype=cv2.CV_8U), dtype=np.uint8)
            film.mux(stream.encode(av.VideoFrame.from_ndarray(noisy, format="rgb24")))
        film.mux(stream.encode())

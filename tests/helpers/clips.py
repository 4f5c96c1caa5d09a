"""Clips of a made-up place: a panorama of blotches under a plain sky, in which a camera is turned exactly."""

from collections.abc import Iterator, Sequence
from fractions import Fraction
from functools import lru_cache
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.geometry import Floats, Pinhole, camera_axes, camera_directions, latlong_pixel
from lighting.video.decode import Frame

SIZE = (320, 180)
FOV = 45.0

Pixels = NDArray[np.uint8]


@lru_cache(maxsize=4)
def panorama(seed: int = 0) -> Pixels:
    """(512, 1024, 3) sRGB: grains of several sizes below, a few faint clouds above."""
    rng = np.random.default_rng(seed)
    image = np.full((512, 1024, 3), 120.0)
    for cell, contrast in ((4, 60.0), (16, 60.0), (64, 40.0)):
        coarse = rng.normal(0, 1, (512 // cell, 1024 // cell, 3)).astype(np.float32)
        image += contrast * cv2.resize(coarse, (1024, 512), interpolation=cv2.INTER_CUBIC)
    image[:150] = 0.3 * image[:150] + [90, 110, 140]
    return np.asarray(np.clip(image, 0, 255), dtype=np.uint8)


def look(azimuth: float, elevation: float = 0.0, roll: float = 0.0, *, seed: int = 0, gain: float = 1.0) -> Pixels:
    """What a camera sees; `gain` multiplies the coded values."""
    shown = seen(panorama(seed), azimuth, elevation, roll)
    return np.asarray(np.clip(np.asarray(shown, dtype=np.float64) * gain, 0, 255), dtype=np.uint8)


def seen(picture: Pixels, azimuth: float, elevation: float = 0.0, roll: float = 0.0, *, fov: float = FOV) -> Pixels:
    """What a camera sees of a panorama (H, 2H, 3)."""
    rays = camera_directions(Pinhole(*SIZE, fov, azimuth, elevation, roll))
    pixel = (latlong_pixel(rays, len(picture)) - 0.5).astype(np.float32)
    shown = cv2.remap(picture, pixel[..., 0], pixel[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return np.asarray(shown, dtype=np.uint8)


def orientation(azimuth: float, elevation: float = 0.0, roll: float = 0.0) -> Floats:
    """The camera's right, up and back as rows (3, 3)."""
    right, up, forward = camera_axes(azimuth, elevation, roll)
    return np.stack([right, up, -forward])


def frames(pictures: Sequence[Pixels], rate: float = 30.0) -> Iterator[Frame]:
    for i, picture in enumerate(pictures):
        yield Frame(i, i / rate, picture)


def pan(count: int = 45, reach: float = 40.0, seed: int = 0) -> list[Pixels]:
    """A camera that turns to the right, and nods."""
    return list(_pan(count, reach, seed))


@lru_cache(maxsize=4)
def _pan(count: int, reach: float, seed: int) -> tuple[Pixels, ...]:
    pictures = [look(reach * s, 3 * np.sin(3 * s), 2 * s, seed=seed) for s in np.linspace(0, 1, count).tolist()]
    for picture in pictures:
        picture.setflags(write=False)
    return tuple(pictures)


def write_clip(
    path: Path,
    pictures: Sequence[Pixels],
    *,
    times: Sequence[float] | None = None,
    rotation: int | None = None,
    mirrored: bool = False,
    metadata: dict[str, str] | None = None,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    colour: tuple[int, int, int] | None = None,
    options: dict[str, str] | None = None,
) -> Path:
    """A clip at 30 frames a second or at given times [s]; `colour` is transfer, primaries and matrix of H.273."""
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"}) as film:
        film.metadata.update(metadata or {})
        stream: Any = film.add_stream(codec, rate=30, options=options or {"crf": "16", "preset": "veryfast"})
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = pix_fmt
        if times is not None:
            stream.codec_context.time_base = Fraction(1, 90000)
        if colour is not None:
            context = stream.codec_context
            context.color_trc, context.color_primaries, context.colorspace = colour
        if rotation is not None:
            if not hasattr(stream, "set_display_rotation"):
                pytest.skip("PyAV 14 to 17 writes no rotation")
            stream.set_display_rotation(rotation, hflip=mirrored)
        for i, picture in enumerate(pictures):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            if times is not None:
                frame.pts, frame.time_base = round(times[i] * 90000), Fraction(1, 90000)
            film.mux(stream.encode(frame))
        film.mux(stream.encode())
    return path

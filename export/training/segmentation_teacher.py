"""Pictures without labels, and what an earlier network of its own said that they show: a head learns from both [1].

That network, segments-1.1.0, took pictures of INPUT_SIZE and answered for 24 x 18 cells.

References: [1] Xie et al., Self-training with Noisy Student improves ImageNet classification, CVPR 2020.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from export.crops.photos import PHOTOS
from export.data.panoramas import read_index, read_picture, read_table
from lighting.geometry import Pinhole, camera_directions, fit_in_box, sample_latlong
from lighting.onnx_session import create_session
from lighting.photo.reader import read_photo
from lighting.prediction import Segments

_INPUT_SIZE = (384, 288)  # pixels of the teacher's input, longer and shorter side
_SIDE = 400  # pixels of a picture's longer side
_VIEWS = 2  # of each photo and of each panorama
_MIN_PART = 0.6  # share of a photo's sides that its second view shows
_ASPECTS, _ASPECT_SHARES = ((400, 300), (300, 400), (400, 266), (400, 225)), (0.4, 0.25, 0.2, 0.15)
_FOV = (35.0, 75.0)  # deg, vertical, of a view of a panorama
_TILT, _TILT_STD, _ROLL_STD = -4.0, 10.0, 3.0  # deg


class _Teacher:
    """The network in a file of segments-1.1.0."""

    def __init__(self, file: Path) -> None:
        """Read the network.

        Args:
            file: the ONNX file.

        Raises:
            ModelError: the file is missing or damaged.
        """
        self._session = create_session(file, threads=1)

    def __call__(self, pixels: NDArray[np.uint8]) -> Segments:
        """Probabilities of what a picture (h, w, 3) sRGB shows, the mean of those of its mirror image and its own."""
        mirrored = self._predict(np.ascontiguousarray(pixels[:, ::-1]))[:, ::-1]
        return np.asarray((self._predict(pixels) + mirrored) / 2)

    def _predict(self, pixels: NDArray[np.uint8]) -> Segments:
        size = _INPUT_SIZE if pixels.shape[1] >= pixels.shape[0] else _INPUT_SIZE[::-1]
        stretched = np.asarray(Image.fromarray(pixels).resize(size, Image.Resampling.BOX, reducing_gap=2.0))
        segments: Segments = self._session.run(None, {"photo": stretched[None]})[0][0]
        return segments


def teach_views(file: Path, folder: Path, seed: int) -> Iterator[tuple[NDArray[np.uint8], Segments]]:
    """Views (h, w, 3) sRGB of pictures without labels, and what the teacher says that they show.

    Args:
        file: the teacher's ONNX file.
        folder: of the data.
        seed: of what the views show.

    Raises:
        DataError: a table is missing, or a picture cannot be read.
        ModelError: the teacher is missing or damaged.
    """
    teacher = _Teacher(file)
    for view in _read_views(folder, seed):
        yield view, teacher(view)


def _read_views(folder: Path, seed: int) -> Iterator[NDArray[np.uint8]]:
    """Views (h, w, 3) sRGB of the photos and of the 8-bit panoramas of `train`."""
    rng = np.random.default_rng(seed)
    for row in read_table(folder / PHOTOS, ("file",)):
        photo = Image.fromarray(read_photo(folder / row["file"]).pixels)
        for number in range(_VIEWS):
            yield _view_photo(photo, rng.uniform(_MIN_PART, 1.0, 2) if number else np.ones(2), rng)
    for panorama in read_index(folder, "train"):
        if panorama.kind == "ldr":
            picture = read_picture(panorama).astype(np.float32)
            for _ in range(_VIEWS):
                directions = camera_directions(_draw_camera(rng)).astype(np.float32)
                yield np.round(sample_latlong(picture, directions)).astype(np.uint8)


def _view_photo(photo: Image.Image, shares: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.uint8]:
    """A part of a photo with these shares of its width and height."""
    first, sides = rng.uniform(0, 1 - shares) * photo.size, shares * photo.size
    size = fit_in_box(max(1, round(sides[0])), max(1, round(sides[1])), _SIDE, _SIDE)
    return np.asarray(photo.resize(size, Image.Resampling.BOX, box=(*first, *(first + sides))))


def _draw_camera(rng: np.random.Generator) -> Pinhole:
    width, height = _ASPECTS[rng.choice(len(_ASPECTS), p=_ASPECT_SHARES)]
    azimuth, elevation, roll = rng.uniform(-180, 180), rng.normal(_TILT, _TILT_STD), rng.normal(0, _ROLL_STD)
    return Pinhole(width, height, rng.uniform(*_FOV), azimuth, elevation, roll)

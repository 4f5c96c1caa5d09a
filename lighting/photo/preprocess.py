"""Padding to the network input; blank and panorama checks.

A network sees neither: a frame without contrast is far from all that it learnt, and crops of panoramas are what it
learnt from.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import Floats, fit_in_box
from lighting.photo.pixels import Pixels
from lighting.photo.reader import Photo
from lighting.records import ModelSpec

_MIN_CONTRAST = 40.0  # gray levels, of 255, between the darkest and the brightest hundredth; photos in fog have more
_SAMPLED_SIDE = 320  # rows or columns of the longer side that are sampled

# A panorama is closed at its sides, and its first row shows one direction.
_ASPECT_TOLERANCE = 0.03  # share by which it may differ from twice as wide as high
_MAX_SEAM_SHARE = 0.6  # of the difference between distant columns, for the first and the last one
_MAX_SEAM_STEPS = 3.0  # times as much as neighbouring columns differ, which count as at least
_MIN_COLUMN_STEP = 2.0  # gray levels
_MAX_POLE_STD = 15.0  # gray levels, along the first row


def is_blank(pixels: Pixels) -> bool:
    """Whether a photo has next to no contrast: a black, blank or blown-out frame.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    step = -(-max(pixels.shape[:2]) // _SAMPLED_SIDE)
    red, green, blue = np.moveaxis(pixels[::step, ::step], 2, 0)
    cumulative = np.bincount((np.add(red, green, dtype=np.uint16) + blue).ravel()).cumsum()  # by red + green + blue
    edge = cumulative[-1] // 100
    darkest, brightest = np.searchsorted(cumulative, (edge, cumulative[-1] - 1 - edge), side="right")
    return bool(brightest - darkest < 3 * _MIN_CONTRAST)


def is_panorama(pixels: Pixels) -> bool:
    """Whether a picture shows all directions: twice as wide as high, closed at the sides, one color on top.

    It finds 90 % of the panoramas that the network was trained on; of other photos cut to that shape, 0.1 %.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    height, width = pixels.shape[:2]
    if abs(width / (2 * height) - 1) > _ASPECT_TOLERANCE or width < 8:
        return False
    step = max(1, width // _SAMPLED_SIDE // 2)
    rows = pixels[::step].astype(np.float64)
    distant = _difference(rows, (0, 0, 0), (width // 4, width // 2, width - width // 4))
    seam, neighbour = _difference(rows, (0,), (-1,)), _difference(rows, (0, -1), (1, -2))
    closed = seam < _MAX_SEAM_SHARE * distant and seam < _MAX_SEAM_STEPS * max(neighbour, _MIN_COLUMN_STEP)
    return closed and float(pixels[0].std(axis=0).mean()) < _MAX_POLE_STD


def _difference(rows: Floats, first: Sequence[int], second: Sequence[int]) -> float:
    """The mean difference between columns of pixels (h, w, 3)."""
    return float(np.abs(rows[:, list(first)] - rows[:, list(second)]).mean())


def fit_size(width: int, height: int, spec: ModelSpec) -> tuple[int, int]:
    """The largest (width, height) of the photo's aspect ratio inside the network's canvas, at least 1 x 1.

    Args:
        width: of the photo, pixels.
        height: of the photo, pixels.
        spec: of the network.
    """
    return fit_in_box(width, height, spec.width, spec.height)


def pad_to_input(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    """Canvas (3, H, W) with the normalised pixels at its centre, and 0, the mean color, beside them.

    An odd margin puts the extra row or column after the photo.

    Args:
        pixels: (h, w, 3) sRGB, no larger than the canvas, else ValueError.
        spec: of the network.
    """
    height, width = pixels.shape[:2]
    if width > spec.width or height > spec.height:
        raise ValueError(f"{width} x {height} pixels do not fit the canvas of {spec.width} x {spec.height}.")
    top, left = (spec.height - height) // 2, (spec.width - width) // 2
    canvas = np.zeros((3, spec.height, spec.width), dtype=np.float32)
    inside = canvas[:, top : top + height, left : left + width]
    mean, std = (np.asarray(value, dtype=np.float32)[:, None, None] for value in (spec.mean, spec.std))
    np.multiply(pixels.transpose(2, 0, 1), 1 / (np.float32(255.0) * std), out=inside)
    inside -= mean / std
    return canvas


def resize_to_input(photo: Photo, spec: ModelSpec) -> NDArray[np.uint8]:
    """The photo's pixels (h, w, 3) sRGB resized without aliasing to `fit_size`.

    Args:
        photo: of any size.
        spec: of the network.
    """
    size = fit_size(photo.width, photo.height, spec)
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.HAMMING, reducing_gap=1.0))


def preprocess(photo: Photo, spec: ModelSpec) -> NDArray[np.float32]:
    """The network's input (1, 3, H, W): the resized photo on its canvas.

    Args:
        photo: of any size.
        spec: of the network.
    """
    return pad_to_input(resize_to_input(photo, spec), spec)[None]

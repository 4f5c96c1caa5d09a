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

# Pictures that are told from a photo by their pixels alone: an empty frame, and a whole panorama.

_EMPTY = 40.0  # grey levels, of 255, between the darkest and the brightest hundredth; photos in fog have more
_TWICE = 0.03  # share by which a panorama may differ from twice as wide as high
_SEAM = 0.6  # of the difference between the first column and those farther round, for the first and the last one
_NEXT = 3.0  # times as much as neighbouring columns differ, which count as at least
_LEAST = 2.0  # grey levels
_POLE = 15.0  # grey levels, standard deviation along the first row, which shows one direction
_SAMPLED = 320  # rows or columns of the longer side that are looked at


def is_blank(pixels: Pixels) -> bool:
    """Whether pixels (h, w, 3) hold next to no contrast: a black, blank or blown-out frame."""
    step = -(-max(pixels.shape[:2]) // _SAMPLED)
    red, green, blue = np.moveaxis(pixels[::step, ::step], 2, 0)
    darker = np.bincount((np.add(red, green, dtype=np.uint16) + blue).ravel()).cumsum()  # pixels up to each sum of them
    edge = darker[-1] // 100
    darkest, brightest = np.searchsorted(darker, (edge, darker[-1] - 1 - edge), side="right")
    return bool(brightest - darkest < 3 * _EMPTY)


def is_panorama(pixels: Pixels) -> bool:
    """Whether pixels (h, w, 3) show all directions: twice as wide as high, closed at the sides, one colour on top.

    It finds 90 % of the panoramas that the network was trained on; of other photos cut to that shape, 0.1 %.
    """
    height, width = pixels.shape[:2]
    if abs(width / (2 * height) - 1) > _TWICE or width < 8:
        return False
    step = max(1, width // _SAMPLED // 2)
    rows = pixels[::step].astype(np.float64)
    far = _difference(rows, (0, 0, 0), (width // 4, width // 2, width - width // 4))
    seam, beside = _difference(rows, (0,), (-1,)), _difference(rows, (0, -1), (1, -2))
    closed = seam < _SEAM * far and seam < _NEXT * max(beside, _LEAST)
    return closed and float(pixels[0].std(axis=0).mean()) < _POLE


def _difference(rows: Floats, first: Sequence[int], second: Sequence[int]) -> float:
    """The mean difference between columns of pixels (h, w, 3)."""
    return float(np.abs(rows[:, list(first)] - rows[:, list(second)]).mean())


# Pixels to the network's input canvas.


def fit_size(width: int, height: int, spec: ModelSpec) -> tuple[int, int]:
    """The largest (width, height) of the photo's aspect ratio inside the network's canvas, at least 1 x 1."""
    return fit_in_box(width, height, spec.width, spec.height)


def pad_to_input(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    """Canvas (3, H, W) with the normalised sRGB pixels (h, w, 3) at its centre and 0, the mean colour, around them.

    Raises ValueError where the pixels do not fit; an odd margin puts the extra row or column after the photo.
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
    """The photo's pixels (h, w, 3) resized without aliasing to `fit_size`."""
    size = fit_size(photo.width, photo.height, spec)
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.HAMMING, reducing_gap=1.0))


def preprocess(photo: Photo, spec: ModelSpec) -> NDArray[np.float32]:
    """The network's input (1, 3, H, W): the fitted photo on its canvas."""
    return pad_to_input(resize_to_input(photo, spec), spec)[None]

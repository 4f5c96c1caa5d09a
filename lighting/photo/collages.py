"""Pictures made of several: stereo pairs, by halves that show the same, and collages, by the seams between photos."""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

_STEREO_CORRELATION = 0.6  # of halves; of 673 photos one has more, whose rows differ in brightness
_STEREO_DIFFERENCE = 12.0  # gray levels between the means of rows
_MAX_CORNER = 28  # gray levels of the corners beside round pictures, which are black
_SEAM_SHARE = 0.55  # of a seam's pixels at which the picture changes more than beside it
_CROSSING_SHARE = 0.6  # the same of two seams that cross each other anywhere
_SEAM_POSITIONS = np.array([1 / 3, 1 / 2, 2 / 3])


def stereo_half(gray: NDArray[np.int16]) -> tuple[int, int] | None:
    """Rows and columns of the left or the upper half of a picture whose halves show the same; None of others.

    Args:
        gray: (h, w) levels, 0 to 255.
    """
    part = gray.astype(np.float32)
    height, width = part.shape
    if min(height, width) < 16 or _has_round_pictures(part):
        return None
    if _are_stereo_pair(part[:, : width // 2], part[:, -(width // 2) :]):
        return height, width // 2
    if _are_stereo_pair(part[: height // 2], part[-(height // 2) :]):
        return height // 2, width
    return None


def _has_round_pictures(gray: Floats) -> bool:
    """Whether the corners of both halves are as dark as about the circles of two fisheyes."""
    height, width = gray.shape
    across = width > height
    halves = np.array_split(gray, 2, axis=1 if across else 0)
    side = max(2, min(height, width) // 20)
    corners = (half[rows, columns] for half in halves for rows in _ends(side) for columns in _ends(side))
    return all(float(corner.max()) <= _MAX_CORNER for corner in corners)


def _ends(side: int) -> tuple[slice, slice]:
    return slice(None, side), slice(-side, None)


def _are_stereo_pair(first: Floats, second: Floats) -> bool:
    """Whether two pictures show the same, in their middle as well, where no perforation of a film does so."""
    middle = slice(len(first) // 4, len(first) - len(first) // 4)
    pairs = (first, second), (first[middle], second[middle])
    return all(_stereo_correlation(*pair) >= _STEREO_CORRELATION for pair in pairs)


def _stereo_correlation(first: Floats, second: Floats) -> float:
    """The correlation (-1 to 1) of two pictures whose rows are as bright, at the best shift along them; else 0.

    Sky above and ground below correlate in any two photos, and so do bars beside them; rows and columns count without
    their means.
    """
    if float(np.abs(first.mean(axis=1) - second.mean(axis=1)).mean()) > _STEREO_DIFFERENCE:
        return 0.0
    width = first.shape[1]
    reach, step = width // 12, max(1, width // 128)
    best = 0.0
    for shift in range(-reach, reach + 1, step):
        a = first[:, max(0, shift) : width + min(0, shift)]
        b = second[:, max(0, -shift) : width + min(0, -shift)]
        a, b = (_without_means(values) for values in (a, b))
        norm = math.sqrt(float((a * a).sum()) * float((b * b).sum()))
        best = max(best, float((a * b).sum()) / norm if norm > 0 else 0.0)
    return best


def _without_means(values: Floats) -> Floats:
    """The values (h, w) less the means of their rows and columns."""
    rows = values - values.mean(axis=1, keepdims=True)
    return np.asarray(rows - rows.mean(axis=0))


def has_seams(gray: NDArray[np.int16]) -> bool:
    """Whether a seam crosses the whole picture where a collage has one, or two cross each other anywhere.

    Args:
        gray: (h, w) levels, 0 to 255.
    """
    seams = _seams(gray), _seams(gray.T)
    if min(max(shares, default=0.0) for shares, _ in seams) >= _CROSSING_SHARE:
        return True
    return max(max(regular, default=0.0) for _, regular in seams) >= _SEAM_SHARE


def _seams(gray: NDArray[np.int16]) -> tuple[list[float], list[float]]:
    """The shares of their rows in which columns part two pictures: of all, and of those at halves and thirds."""
    width = gray.shape[1]
    if width < 32:
        return [], []
    first, last = width // 6, width - width // 6
    steps = np.abs(gray[:, first - 1 : last + 3] - gray[:, first - 3 : last + 1])  # over two columns
    shares = (2 * steps[:, 2:-2] > 12 + 3 * np.maximum(steps[:, :-4], steps[:, 4:])).mean(axis=0)
    position = (np.arange(first, last) + 0.5) / width
    regular = np.abs(position[:, None] - _SEAM_POSITIONS).min(axis=1) * width <= 1.0
    return shares.tolist(), shares[regular].tolist()

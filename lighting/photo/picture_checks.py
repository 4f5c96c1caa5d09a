"""Pictures that are no photo of one view: without contrast, panoramas, thermal cameras' colors, and several in one.

A frame without contrast is far from all that the network learnt, and crops of panoramas are what it learnt from. A
panorama is closed at its sides, and its first row shows one direction. Of several pictures in one, stereo pairs have
halves that show the same, and collages have seams.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats
from lighting.photo.pixels import Pixels

_MIN_CONTRAST = 40.0  # gray levels, of 255, between the darkest and the brightest hundredth; photos in fog have more
_SAMPLED_SIDE = 320  # rows or columns of the longer side that are sampled
_PALETTE_SIDE = 112  # the same for a palette
_PALETTE_PARTS = 48  # of a palette, in which its colors are one
_POSITIONS, _LEAST_RANGE = 65535, 1e-6  # steps in which they lie along it; of positions, none is shorter
_MIN_PALETTE_SPREAD = 25.0  # levels, standard deviation of the colors
_PALETTE_CELL = 0.17  # spreads, side of the cells whose chain is a palette's line
_MIN_CELL_SHARE = 0.97  # of the colors, in the fullest cells
_MAX_PALETTE_RESIDUALS = (  # spreads, and shares of them by which colors are off in all; of 576 photos none has less
    (70.0, 100.0),
    (0.115, 0.3),
)
_ASPECT_TOLERANCE = 0.03  # share by which it may differ from twice as wide as high
_MAX_SEAM_SHARE = 0.6  # of the difference between distant columns, for the first and the last one
_MAX_SEAM_STEPS = 3.0  # times as much as neighboring columns differ, which count as at least
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
    seam, neighbor = _difference(rows, (0,), (-1,)), _difference(rows, (0, -1), (1, -2))
    closed = seam < _MAX_SEAM_SHARE * distant and seam < _MAX_SEAM_STEPS * max(neighbor, _MIN_COLUMN_STEP)
    return closed and float(pixels[0].std(axis=0).mean()) < _MAX_POLE_STD


def _difference(rows: Floats, first: Sequence[int], second: Sequence[int]) -> float:
    """The mean difference between columns of pixels (h, w, 3)."""
    return float(np.abs(rows[:, list(first)] - rows[:, list(second)]).mean())


def is_false_color(pixels: Pixels) -> bool:
    """Whether all colors lie on one line of a palette, as thermal cameras show temperatures.

    Along hue, or along brightness, the colors of each part of a palette are one; and all lie near the longest path
    through their minimum spanning tree. Colors of photos spread less, and branch off.

    Args:
        pixels: (h, w, 3) sRGB.
    """
    step = -(-max(pixels.shape[:2]) // _PALETTE_SIDE)
    height, width = (side // step for side in pixels.shape[:2])
    if height * width < 4 * _PALETTE_PARTS:
        return False
    rows = sum(
        (pixels[i : height * step : step] for i in range(1, step)), pixels[: height * step : step].astype(np.uint16)
    )
    columns = rows[:, : width * step].reshape(-1, step, 3)
    first = columns[:, 0].astype(np.uint32)
    red, green, blue = (
        sum((columns[:, i, channel] for i in range(1, step)), first[:, channel]) / step**2 for channel in range(3)
    )
    gray = 0.3 * red + 0.6 * green + 0.1 * blue
    colors = np.stack([red - green, 0.5 * (red + green) - blue])
    spread = float(np.hypot(*colors.std(axis=1)))
    if spread < _MIN_PALETTE_SPREAD:
        return False
    values, limit = np.stack([gray, *colors]), spread * float(np.interp(spread, *_MAX_PALETTE_RESIDUALS))
    hue = np.arctan2(colors[1], colors[0])
    residual = min(_palette_residual(position, values) for position in (hue, gray))
    return residual < limit and residual + _path_residual(values.T, _PALETTE_CELL * spread) < limit


def _palette_residual(position: Floats, colors: Floats) -> float:
    """How far colors (3, N), in parts by their position (N,) on a palette, lie from the middle one of their part."""
    size = len(position) // _PALETTE_PARTS
    low, high = position.min(), position.max()
    steps = ((position - low) * (_POSITIONS / max(high - low, _LEAST_RANGE))).astype(np.uint16)  # sorted by radix
    chosen = np.argsort(steps, kind="stable")[: size * _PALETTE_PARTS]
    parts = colors.take(chosen, axis=1).reshape(3, _PALETTE_PARTS, size)
    parts -= median_of_rows(parts)[..., None]
    return float(median_of_rows(np.sqrt(np.square(parts).sum(axis=0))).mean())


def _path_residual(colors: Floats, cell: float) -> float:
    """How far colors (N, 3), in cells [levels], lie from the longest path of their minimum spanning tree: the mean."""
    cells, counts = np.unique(np.floor(colors / cell), axis=0, return_counts=True)
    order = np.argsort(-counts, kind="stable")
    kept = order[: int(np.searchsorted(np.cumsum(counts[order]), _MIN_CELL_SHARE * len(colors))) + 1]
    cells, counts = cell * cells[kept], counts[kept]
    distances = np.sqrt(sum(np.square(np.subtract.outer(axis, axis)) for axis in cells.T))
    to_all = _tree_distances(distances)
    first, last = np.unravel_index(int(to_all.argmax()), to_all.shape)
    on_path = to_all[first] + to_all[last] <= to_all[first, last] + 1e-6
    return float(np.average(distances[:, on_path].min(axis=1), weights=counts))


def _tree_distances(distances: Floats) -> Floats:
    """The distances (N, N) along the minimum spanning tree of points by those between them, by Prim's algorithm."""
    count = len(distances)
    nearest, parents = distances[0].copy(), np.zeros(count, dtype=np.intp)  # the place of each in `order`
    to_free = distances.copy()  # infinite to those in the tree
    along, order = np.zeros_like(distances), np.zeros(count, dtype=np.intp)
    nearest[0] = to_free[:, 0] = np.inf
    for size in range(1, count):
        new = int(nearest.argmin())
        parent = parents[new]
        along[size, :size] = along[:size, size] = along[parent, :size] + distances[new, order[parent]]
        order[size] = new
        nearest[new] = to_free[:, new] = np.inf
        closer = to_free[new] < nearest
        nearest[closer], parents[closer] = to_free[new, closer], size
    place = np.empty_like(order)
    place[order] = np.arange(count)
    return np.asarray(along[np.ix_(place, place)])


def median_of_rows(values: NDArray[np.number]) -> Floats:
    """The median (...) along the last axis, for which NumPy's own function would import masked arrays.

    Args:
        values: (..., N).
    """
    size = values.shape[-1]
    ordered = np.sort(values, axis=-1)
    return np.asarray((ordered[..., (size - 1) // 2] + ordered[..., size // 2]) / 2)


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
    middle = (max(height, width) + 1) // 2
    halves = (gray[:, :middle], gray[:, middle:]) if across else (gray[:middle], gray[middle:])
    side = max(2, min(height, width) // 20)
    ends = slice(None, side), slice(-side, None)
    corners = (half[rows, columns] for half in halves for rows in ends for columns in ends)
    return all(float(corner.max()) <= _MAX_CORNER for corner in corners)


def _are_stereo_pair(first: Floats, second: Floats) -> bool:
    """Whether two pictures show the same, in their middle as well, where no perforation of a film does so."""
    middle = slice(len(first) // 4, len(first) - len(first) // 4)
    pairs = (first[middle], second[middle]), (first, second)  # the smaller first, at which most end
    return all(_stereo_correlation(*pair) >= _STEREO_CORRELATION for pair in pairs)


def _stereo_correlation(first: Floats, second: Floats) -> float:
    """The correlation (-1 to 1) of two pictures whose rows are as bright, at the best shift along them; else 0.

    Sky above and ground below correlate in any two photos, and so do bars beside them; rows and columns count without
    their means.
    """
    width = first.shape[1]
    if float(np.abs(_row_means(first) - _row_means(second)).mean()) > _STEREO_DIFFERENCE:
        return 0.0
    reach, step = width // 12, max(1, width // 128)
    best = 0.0
    for shift in range(-reach, reach + 1, step):
        a = first[:, max(0, shift) : width + min(0, shift)]
        b = second[:, max(0, -shift) : width + min(0, -shift)]
        a, b = (_without_means(values) for values in (a, b))
        norm = math.sqrt(_sum_product(a, a) * _sum_product(b, b))
        best = max(best, _sum_product(a, b) / norm if norm > 0 else 0.0)
    return best


def _without_means(values: Floats) -> Floats:
    """The values (h, w) less the means of their rows and columns."""
    rows = values - _row_means(values)[:, None]
    rows -= np.einsum("rc->c", rows) / np.float32(len(rows))
    return np.asarray(rows)


def _sum_product(a: Floats, b: Floats) -> float:
    """The sum of products (h, w); not by BLAS, whose own memory the limit of a decoder does not provide for."""
    return float(np.einsum("rc,rc->", a, b))


def _row_means(values: Floats) -> Floats:
    """The means (h,) of the rows of gray levels (h, w), whose sums are exact: a plain area keeps its level."""
    return np.asarray(np.einsum("rc->r", values) / np.float32(values.shape[1]))


def true_share(values: NDArray[np.bool_], axis: int) -> Floats:
    """The mean of truth values along an axis, for which NumPy's own function takes four times as long.

    Args:
        values: (h, w), up to 65,535 each way.
        axis: 0 or 1.
    """
    return np.asarray(np.add.reduce(values, axis=axis, dtype=np.uint16) / values.shape[axis])


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
    shares = true_share(2 * steps[:, 2:-2] > 12 + 3 * np.maximum(steps[:, :-4], steps[:, 4:]), 0)
    position = (np.arange(first, last) + 0.5) / width
    regular = np.abs(position[:, None] - _SEAM_POSITIONS).min(axis=1) * width <= 1.0
    return shares.tolist(), shares[regular].tolist()

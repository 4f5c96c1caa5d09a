"""The camera by the line where water meets the sky: that is the horizon, seen more exactly than a network says.

The segments say roughly where the line is. The line sought near by is that along which brightness falls most from the
sky to the water, column for column. It counts only where it is long, dark enough in most columns, and sharp.
"""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats, focal_length
from lighting.prediction import Prediction, Segments, SurfaceClass, class_planes

_CELLS = 18  # of the segments along a picture's height; the line lies within two of where they see it
_COARSE = (96, 72)  # columns and rows of the segments in which the line is sought first
_MIN_WATER = 0.3  # probability of it somewhere
_MIN_SKY = 0.6  # probability of it above the line
_LAND = [kind for kind in SurfaceClass if kind not in (SurfaceClass.SKY, SurfaceClass.WATER)]
_BAND = 4  # rows above and below a line, whose brightness differs
_SEARCH = (2.0, 0.5, 0.125)  # rows between lines that are tried, each about the best of those before
_LINES_AT_ONCE = 32  # of these, few enough for the processor's cache
_MIN_STEP = 3.0  # gray levels by which it does
_MIN_SHARE = 0.7  # of the largest step near by in a column
_MIN_SHARPNESS = 0.71  # of that difference in half as many rows: 1 at a line, half in haze
_MAX_STEP = 8.0  # gray levels up to which columns count the more, so that dark headlands weigh no more than the sea
_MIN_ON_LINE = 0.65  # share of the columns in which it does
_MIN_LENGTH = 0.35  # of the picture's columns, that show water below sky
_ROUNDED = 0.999  # of a probability, which a mean of others may exceed them by
_MAX_CHANGE = 7.0  # deg from the camera that is known without it, of elevation and roll


def may_show_sea(canvas: NDArray[np.float32]) -> bool:
    """Whether what the network's canvas shows has so much water that the photo's segments, means of it, may have it.

    Args:
        canvas: (R, C, classes) probabilities, as `Prediction.segments` has them.
    """
    return float(canvas[..., SurfaceClass.WATER].max()) > _MIN_WATER * _ROUNDED


def level_by_sea(
    prediction: Prediction,
    gray: NDArray[np.uint8],
    segments: Segments | None,
    vertical_fov: float,
    size: tuple[int, int],
) -> Prediction:
    """The prediction with a camera whose horizon is the line where water meets the sky, if the photo shows one.

    Args:
        prediction: with the camera as it is known without.
        gray: (h, w) levels of the photo, by `calibration.shrink_to_gray`.
        segments: of the photo; None: unknown, and the prediction stays.
        vertical_fov: deg, of the camera's lens.
        size: width and height of the photo, pixels.
    """
    line = None if segments is None else find_sea_horizon(gray, segments)
    if line is None:
        return prediction
    left, right = line
    width, height = size
    focal = focal_length(height, vertical_fov)
    across = np.array([width, (left - right) * height, 0.0])
    middle = np.array([0.0, (0.5 - (left + right) / 2) * height, focal])
    up = np.cross(middle, across)
    up /= np.linalg.norm(up)
    elevation, roll = math.degrees(math.asin(up[2])), math.degrees(math.atan2(-up[0], up[1]))
    change = max(abs(elevation - prediction.camera_elevation), abs(roll - prediction.camera_roll))
    return prediction if change > _MAX_CHANGE else prediction.with_camera(elevation, roll)


def find_sea_horizon(gray: NDArray[np.uint8], segments: Segments) -> tuple[float, float] | None:
    """Where the line between water and sky meets the picture's left and right edge; None where it shows none.

    Args:
        gray: (h, w) levels of the photo, by `calibration.shrink_to_gray`.
        segments: of the photo.

    Returns:
        Shares of the picture's height, from its top.
    """
    start = _coarse_line(segments)
    if start is None:
        return None
    line, x = start
    height, width = gray.shape
    if height < 6 * _BAND:
        return None
    finer = np.add.outer(x, np.linspace(-0.5, 0.5, 4, endpoint=False) / _COARSE[0])
    column = np.flatnonzero(np.bincount(np.clip(finer * width, 0, width - 1).astype(np.intp).ravel()))
    total = _totals(gray[:, column])
    falls, narrow = (_falls(total, band) for band in (_BAND, _BAND // 2))
    x, reach = (column + 0.5) / width, 2 * height / _CELLS
    line = line * height
    falls[np.abs(np.arange(height + 1)[:, None] - line[0] - (line[1] - line[0]) * x) > reach] = 0
    even = np.clip(falls / np.maximum(falls.max(axis=0), _MAX_STEP), 0, 1) ** 2
    for step in _SEARCH:
        line = _best_line(even, x, line, reach if step == _SEARCH[0] else 2, step)
    along, sharp = (_along(values, x, line[None]) for values in (falls, narrow))
    on_line = along > np.maximum(_MIN_STEP, _MIN_SHARE * falls.max(axis=0))
    if on_line.mean() < _MIN_ON_LINE or sharp[on_line].sum() < _MIN_SHARPNESS * along[on_line].sum():
        return None
    return float(line[0] / height), float(line[1] / height)


def _falls(total: Floats, band: int) -> Floats:
    """By how much a picture is brighter in a band of rows above each edge between rows (h + 1, N) than below.

    `total` (h + 1, N) is of whole numbers, by `_totals`.
    """
    falls = np.zeros_like(total)
    inner = total[band:-band]
    falls[band:-band] = (inner - total[: -2 * band] - (total[2 * band :] - inner)) / band
    return falls


def _coarse_line(segments: Segments) -> tuple[Floats, Floats] | None:
    """The line (2,) as far as segments tell, by its heights at the two edges, and columns (N,) where water meets sky.

    Both are shares of the picture's height and width. None where too few columns show water below sky.
    """
    if float(segments[..., SurfaceClass.WATER].max()) < _MIN_WATER:
        return None
    width, height = _COARSE
    reach = height // _CELLS
    total = _totals(class_planes(segments, width, height))
    sky = total[SurfaceClass.SKY]
    edges, at_column = sky[reach : height - 3 * reach], np.arange(width)
    above = edges - sky[: len(edges)]
    best = np.argmax(above - (sky[2 * reach :][: len(edges)] - edges), axis=0)
    row = best + reach
    below = total[:, row + 3 * reach, at_column] - total[:, row, at_column]
    is_water = below[SurfaceClass.WATER] >= below[_LAND].max(axis=0)
    is_shore = (above[best, at_column] >= _MIN_SKY * reach) & is_water
    column = np.flatnonzero(is_shore)
    if len(column) < _MIN_LENGTH * width:
        return None
    x = (column + 0.5) / width
    slope, start = np.polyfit(x, row[column] / height, 1)
    return np.array([start, start + slope]), x


def _best_line(falls: Floats, x: Floats, line: Floats, reach: float, step: float) -> Floats:
    """The line near another along which brightness (h, N) falls most, by its heights (2,) at the two edges.

    Args:
        falls: 0 or more, by how much it is brighter above each row than below it, in the columns at `x` (N,).
        x: 0 to 1 of the picture's width.
        line: its heights at 0 and 1, rows.
        reach: rows by which either may change.
        step: rows from one that is tried to the next.
    """
    change = np.arange(-reach, reach + step / 2, step)
    lines = line + np.stack(np.meshgrid(change, change), axis=-1).reshape(-1, 2)
    parts = (lines[start : start + _LINES_AT_ONCE] for start in range(0, len(lines), _LINES_AT_ONCE))
    means = np.concatenate([_along(falls, x, part).mean(axis=1) for part in parts])
    return np.asarray(lines[means.argmax()])


def _along(values: Floats, x: Floats, lines: Floats) -> Floats:
    """Values (h, N) along lines (L, 2): (L, N)."""
    return _at(values, _heights(lines, x))


def _heights(lines: Floats, x: Floats) -> Floats:
    """The rows (L, N) where lines (L, 2) meet columns at `x` (N,) of the width."""
    return np.asarray(lines[:, :1] + (lines[:, 1:] - lines[:, :1]) * x)


def _at(values: Floats, y: Floats) -> Floats:
    """Values (h, N), linear between rows, at rows (L, N)."""
    low = np.floor(y)
    np.clip(low, 0, len(values) - 2, out=low)
    share = np.clip(y - low, 0, 1)
    above = low.astype(np.intp) * values.shape[1] + np.arange(values.shape[1])
    return np.asarray((1 - share) * values.take(above) + share * values.take(above + values.shape[1]))


def _totals(values: NDArray[np.number]) -> Floats:
    """The sums (..., h + 1, w) of the rows of values (..., h, w) above each edge between rows."""
    *planes, rows, columns = values.shape
    total = np.zeros((*planes, rows + 1, columns))
    np.cumsum(values, axis=-2, out=total[..., 1:, :], dtype=np.float64)
    return total

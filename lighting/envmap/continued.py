"""Beside a photo goes on what it shows at its edges: trees, walls, and the colours of its sky and its ground."""

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.maps import Image, brightest, f32
from lighting.envmap.photo_view import CLIPPED, sampled
from lighting.geometry import angles, latlong_angles, wrap_azimuth
from lighting.records import Lighting

RATIO = (0.05, 4.0)  # how far a cell of the bare map may be dimmed or lit

_FEWEST = 8  # sampled pixels of the photo by which a cell is known
_NEAR = 5.0  # deg within which the photo's cells count alike; with
_UPRIGHT = 3.0  # how much farther off a cell is above another than beside it, and
_FALL = 2.5  # the power of the squared distance by which they count less, tried on panoramas of `train`
_FADES = 60.0  # deg from the photo at which a third of its difference is left, tried there as well
_DARKEST = 1e-9  # radiance that stands for none


def continued(cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float = 1.0) -> Image:
    """Factors (R, 2R, 3) on the cells of a coarse map (R, 2R, 3) that continue a photo (h, w, 3, sRGB) beside its view.

    A cell that the photo shows becomes the mean of its pixels there. Others follow the nearest of these on their side
    of the horizon, by their ratio, those at the same height first, and the less the farther off they are.
    """
    ratio, known = _ratios(cells, pixels, lighting, gain)
    factors = np.ones_like(cells)
    half = len(cells) // 2
    for part in (slice(0, half), slice(half, None)):
        if known[part].any():
            factors[part] = np.exp(_spread(np.log(ratio[part]), known[part], len(cells), part))
    return factors


def _ratios(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float
) -> tuple[Image, NDArray[np.bool_]]:
    """The photo, times its gain, over the map in each cell (R, 2R, 3), and which cells it shows (R, 2R).

    Where the photo is clipped and the map is brighter, the map stands.
    """
    photo, directions = sampled(pixels, lighting)
    azimuth, elevation = angles(directions.reshape(-1, 3))
    rows, columns = cells.shape[:2]
    row = np.minimum((90.0 - elevation) / 180.0 * rows, rows - 1).astype(np.intp)
    cell = row * columns + np.minimum((azimuth + 180.0) / 360.0 * columns, columns - 1).astype(np.intp)
    seen, there = photo.reshape(-1, 3), cells.reshape(-1, 3)
    clipped = brightest(seen) > CLIPPED
    seen = seen * np.float32(gain)
    seen = np.where(clipped[:, None], np.maximum(seen, there[cell]), seen)
    count = np.bincount(cell, minlength=rows * columns)
    total = np.stack([np.bincount(cell, channel, rows * columns) for channel in seen.T], axis=-1)
    mean = total / np.maximum(count, 1)[:, None]
    ratio = np.clip(mean / np.maximum(there, _DARKEST), *RATIO).astype(np.float32)
    return ratio.reshape(cells.shape), (count >= _FEWEST).reshape(rows, columns)


def _spread(values: Image, known: NDArray[np.bool_], rows: int, part: slice) -> Image:
    """Values (P, 2R, 3) of a part of a map's rows, drawn from the cells (P, 2R) where they are known to all others."""
    azimuth, elevation = (f32(angle) for angle in latlong_angles(rows))
    row, column = np.nonzero(known)
    level = np.cos(np.radians(elevation[part]))[:, None, None]
    beside2 = (level * f32(wrap_azimuth(azimuth[:, None] - azimuth[column]))) ** 2  # (P, 2R, K)
    above2 = (elevation[part][:, None, None] - elevation[part][row]) ** 2
    weight = (np.float32(_NEAR**2) + beside2 + np.float32(_UPRIGHT**2) * above2) ** np.float32(-_FALL)
    mean = weight @ values[known] / weight.sum(axis=2, keepdims=True)
    fading = np.exp(-np.sqrt((beside2 + 4 * above2).min(axis=2)) / np.float32(_FADES))
    return np.where(known[..., None], values, fading[..., None] * mean).astype(np.float32)

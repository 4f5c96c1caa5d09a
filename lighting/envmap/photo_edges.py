"""How a photo's edges go on beside it: trees, walls, hills and sky, in cells of a coarse map."""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from lighting.envmap.latlong import EPSILON_IRRADIANCE, Image
from lighting.envmap.projection import CLIPPED, sample_cells
from lighting.geometry import latlong_angles, wrap_azimuth
from lighting.prediction import PASSING_THINGS, Segments, pixel_share
from lighting.records import Lighting

CELL_RATIO_RANGE = (0.05, 4.0)  # by which a cell of the bare map may be dimmed or lit

# The last three were tried on panoramas of `train`.
_MIN_SAMPLES = 8  # sampled pixels of the photo by which a cell counts as visible
_MAX_PASSING = 0.5  # probability of PASSING_THINGS at a pixel that counts
_NEAR_DEG = 5.0  # within which the photo's cells count alike
_VERTICAL_STRETCH = 3.0  # how much farther off a cell is above another than beside it
_DISTANCE_POWER = 2.5  # of the squared distance, by which cells count less
_FADE_DEG = 60.0  # from the photo, at which a third of its difference is left


def extrapolate_edges(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float = 1.0, segments: Segments | None = None
) -> Image:
    """Factors (R, 2R, 3) on the cells of a coarse map (R, 2R, 3) that continue a photo (h, w, 3, sRGB) beside its view.

    A cell that the photo shows becomes the mean of its pixels in it. Others follow the nearest of these on their side
    of the horizon, by their ratio, those at the same height first, and the less the farther off they are. People,
    vehicles and other things, of which the segments tell, do not go on.

    Args:
        cells: linear.
        pixels: of the photo.
        lighting: with the photo's camera.
        gain: from the photo's linear values to the map's, over 0.
        segments: of the photo; None: all of it goes on.
    """
    ratio, visible = _photo_ratios(cells, pixels, lighting, gain, segments)
    factors = np.ones_like(cells)
    half = len(cells) // 2
    for part in (slice(0, half), slice(half, None)):
        if visible[part].any():
            factors[part] = np.exp(_spread_ratios(np.log(ratio[part]), visible[part], len(cells), part))
    return factors


def _photo_ratios(
    cells: Image, pixels: NDArray[np.uint8], lighting: Lighting, gain: float, segments: Segments | None
) -> tuple[Image, NDArray[np.bool_]]:
    """The photo, times its gain, over the map in each cell (R, 2R, 3), and which cells it shows (R, 2R).

    Where the photo is clipped and the map is brighter, the map counts.
    """
    rows, columns = cells.shape[:2]
    photo, cell = sample_cells(pixels, lighting, rows)
    stays = np.ones(cell.shape, np.bool_)
    if segments is not None:
        stays = pixel_share(segments, cell.shape[1], cell.shape[0], *PASSING_THINGS) < _MAX_PASSING
    cell, colors, map_colors = cell[stays], photo[stays], cells.reshape(-1, 3)
    clipped = colors.max(axis=1) > CLIPPED
    colors = colors * np.float32(gain)
    colors = np.where(clipped[:, None], np.maximum(colors, map_colors[cell]), colors)
    count = np.bincount(cell, minlength=rows * columns)
    total = np.stack([np.bincount(cell, channel, rows * columns) for channel in colors.T], axis=-1)
    mean = total / np.maximum(count, 1)[:, None]
    ratio = np.clip(mean / np.maximum(map_colors, EPSILON_IRRADIANCE), *CELL_RATIO_RANGE).astype(np.float32)
    return ratio.reshape(cells.shape), (count >= _MIN_SAMPLES).reshape(rows, columns)


def _spread_ratios(values: Image, visible: NDArray[np.bool_], rows: int, part: slice) -> Image:
    """Values (P, 2R, 3) of a part of a map's rows, spread from the cells (P, 2R) that the photo shows to all others."""
    row, column = np.nonzero(visible)
    turn = _column_turns(rows).take(column, axis=1)
    elevation = np.asarray(latlong_angles(rows)[1], dtype=np.float32)
    beside2 = (np.cos(np.radians(elevation[part]))[:, None, None] * turn) ** 2  # (P, 2R, K)
    above2 = (elevation[part][:, None, None] - elevation[part][row]) ** 2
    distance2 = np.float32(_NEAR_DEG**2) + beside2 + np.float32(_VERTICAL_STRETCH**2) * above2
    weight = distance2 ** np.float32(-_DISTANCE_POWER)
    mean = weight @ values[visible] / weight.sum(axis=2, keepdims=True)
    fading = np.exp(-np.sqrt((beside2 + 4 * above2).min(axis=2)) / np.float32(_FADE_DEG))
    return np.where(visible[..., None], values, fading[..., None] * mean).astype(np.float32)


@lru_cache(maxsize=1)
def _column_turns(rows: int) -> Image:
    """The turns [deg] (2R, 2R) from each column of a map to each, to be read alone."""
    azimuth = np.asarray(latlong_angles(rows)[0], dtype=np.float32)
    turns = np.asarray(wrap_azimuth(azimuth[:, None] - azimuth), dtype=np.float32)
    turns.setflags(write=False)
    return turns

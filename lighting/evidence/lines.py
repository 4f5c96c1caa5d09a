"""Straight edges of a picture that run about as the verticals of the world would: edges of walls, poles, trunks.

Line support regions (Burns, Hanson and Riseman, PAMI 1986; von Gioi et al., PAMI 2010): neighbours whose gradients
agree make one edge. The camera is known roughly. So gradients need to agree with one direction alone at each pixel,
that in which the world's vertical is expected there, and the regions are found by arrays as a whole.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

LEAST_STEP = 6.0  # grey levels per pixel, of an edge
AROUND = 25.0  # deg about the expected vertical in which gradients are taken for it
LEAST_PIXELS = 10  # of an edge
LEAST_LENGTH = 6.0  # pixels
MOST_WIDTH = 3.0  # pixels; wider regions are shades, or several edges in one


@dataclass(frozen=True, eq=False)
class Lines:
    """Straight edges. Positions are in picture heights from the picture's centre, x to the right and y up."""

    middle: Floats  # (N, 2)
    angle: Floats  # (N,) deg from the picture's vertical, positive leans to the right
    length: Floats  # (N,) pixels

    def longest(self, count: int) -> "Lines":
        """At most `count` of them."""
        if len(self.length) <= count:
            return self
        kept = np.argpartition(self.length, -count)[-count:]
        return Lines(self.middle[kept], self.angle[kept], self.length[kept])


def near_vertical(grey: NDArray[np.uint8], up: Floats, focal: float) -> Lines:
    """The edges of a picture (h, w) within AROUND of verticals.

    `up` (3,) is the world's up as the camera's right, up and forward, roughly; `focal` its focal length [pixels].
    """
    strength, rows, columns = _steps(grey, up, focal)
    chain = _chains(rows, columns, strength > 0, grey.shape[1] - 1)
    chain, kept = _of_size(chain, LEAST_PIXELS)
    height, width = grey.shape
    x, y = columns[kept] + (1 - 0.5 * width), (0.5 * height - 1) - rows[kept]
    return _fitted(chain, np.abs(strength[kept]).astype(np.float64), x, y, height)


def _steps(grey: NDArray[np.uint8], up: Floats, focal: float) -> tuple[Floats, NDArray[np.intp], NDArray[np.intp]]:
    """Steps (P,) of brightness across the expected vertical, positive to the right, with their rows and columns.

    They lie on the corners that four pixels share: the one of row 0 is below the first row of pixels.
    """
    height, width = grey.shape
    levels = grey.astype(np.int16)
    falling, rising = levels[1:, 1:] - levels[:-1, :-1], levels[:-1, 1:] - levels[1:, :-1]
    right, upwards = falling + rising, rising - falling  # twice the gradient
    x, y = np.arange(1, width) - 0.5 * width, 0.5 * height - np.arange(1, height)
    aside = (up[0] - x / focal * up[2]).astype(np.float32)[None, :]
    above = (up[1] - y / focal * up[2]).astype(np.float32)[:, None]
    across, along = right * above - upwards * aside, right * aside + upwards * above
    strong = np.abs(across)
    found = (strong > 2 * LEAST_STEP) & (np.abs(along) <= np.float32(np.tan(np.radians(AROUND))) * strong)
    at = np.flatnonzero(found)
    rows, columns = np.divmod(at, width - 1)
    return across.ravel()[at], rows, columns


def _chains(rows: NDArray[np.intp], columns: NDArray[np.intp], side: NDArray[np.bool_], width: int) -> NDArray[np.intp]:
    """The number (P,) of the chain that each of the ordered pixels belongs to.

    Neighbours in a row with the same side make a run, and each run follows one that touches it in the row above.
    """
    begins = np.ones(len(rows), dtype=bool)
    begins[1:] = (np.diff(rows) != 0) | (np.diff(columns) != 1) | (side[1:] != side[:-1])
    start = np.flatnonzero(begins)
    end = np.append(start, len(rows))[1:] - 1
    run = np.cumsum(begins) - 1
    at = np.full((int(rows[-1]) + 2 if len(rows) else 1, width + 2), -1)  # with a margin on three sides
    at[rows + 1, columns + 1] = run
    row, left, right, own = rows[start], columns[start], columns[end], side[start]
    first = np.arange(len(start))
    free = first.copy()
    for column in ((left + right) // 2, left, right, left - 1, right + 1):
        above = at[row[free], column[free] + 1]
        touches = (above >= 0) & (own[above] == own[free])
        first[free[touches]] = above[touches]
        free = free[~touches]
    while not np.array_equal(further := first[first], first):
        first = further
    return np.asarray(first[run])


def _of_size(chain: NDArray[np.intp], least: int) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Chains of at least `least` pixels numbered from 0, and which pixels are theirs."""
    large = np.bincount(chain, minlength=len(chain)) >= least
    kept = large[chain]
    return (np.cumsum(large) - 1)[chain[kept]], kept


def _fitted(chain: NDArray[np.intp], weight: Floats, x: Floats, y: Floats, height: int) -> Lines:
    """A line through each chain's pixels, by their weighted moments; its length and width are those of a bar."""
    total = np.bincount(chain, weight)
    mx, my = (np.bincount(chain, weight * v) / total for v in (x, y))
    dx, dy = x - mx[chain], y - my[chain]
    xx, yy, xy = (np.bincount(chain, weight * v) / total for v in (dx * dx, dy * dy, dx * dy))
    middle, spread = 0.5 * (xx + yy), 0.5 * np.hypot(xx - yy, 2 * xy)
    length, width = np.sqrt(12 * (middle + spread)), np.sqrt(12 * np.maximum(middle - spread, 0.0))
    thin = (length >= LEAST_LENGTH) & (width <= MOST_WIDTH)
    angle = np.degrees(0.5 * np.arctan2(2 * xy, yy - xx))
    return Lines(np.stack([mx, my], axis=1)[thin] / height, angle[thin], length[thin])

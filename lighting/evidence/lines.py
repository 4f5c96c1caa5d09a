"""Straight edges of a picture, those apart that run about as the verticals of the world would.

Line support regions (Burns, Hanson and Riseman, PAMI 1986; von Gioi et al., PAMI 2010): neighbours whose gradients
agree make one edge. The camera is known roughly, so it is known in which direction the world's vertical is to be
expected at each pixel. The regions are found by arrays as a whole.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

LEAST_STEP = 6.0  # grey levels per pixel, of an edge near vertical
LEAST_OTHER_STEP = 10.0  # of another, of which pictures have more
AROUND = 25.0  # deg about the expected vertical in which gradients are taken for it
LEAST_PIXELS = 10  # of an edge
LEAST_LENGTH = 6.0  # pixels
MOST_WIDTH = 3.0  # pixels; wider regions are shades, or several edges in one
_TURN = 256  # parts, in which the directions of gradients are counted
_ALIKE = round(40.0 / 360.0 * _TURN)  # parts, the most by which the gradients of neighbours of one edge differ


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

    @property
    def across(self) -> Floats:
        """What (3, N) times a direction in the picture is the distance between the two, at a line's middle.

        Directions are those of `in_picture`; the distance is the sine of the angle times the direction's length there.
        """
        sine, cosine = np.sin(np.radians(self.angle)), np.cos(np.radians(self.angle))
        x, y = self.middle.T
        return np.stack([-cosine, sine, cosine * x - sine * y])


def in_picture(direction: Floats, half: Floats | float) -> Floats:
    """A direction (3, ...) in the camera, its last part over the focal length in picture heights.

    `half` is the tangent of half the vertical field of view. At a point (x, y) of the picture, in heights from its
    centre, lines of the world with that direction run along (d[0] - x * d[2], d[1] - y * d[2]).
    """
    return np.stack([direction[0], direction[1], 2 * half * direction[2]])


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a picture by how they run."""

    upright: Lines  # within AROUND of verticals
    other: Lines


def edges_of(grey: NDArray[np.uint8], up: Floats, focal: float) -> Edges:
    """The edges of a picture (h, w).

    `up` (3,) is the world's up as the camera's right, up and forward, roughly; `focal` its focal length [pixels].
    """
    right, upwards = _gradient(grey)
    across, along = _turned(right, upwards, up, focal)
    strong = np.abs(across)
    is_upright = np.abs(along) <= np.float32(np.tan(np.radians(AROUND))) * strong
    upright = np.flatnonzero(is_upright & (strong > 2 * LEAST_STEP))
    step = across.take(upright)
    sides = np.where(step > 0, 0, _TURN // 2).astype(np.uint8)  # they part by which of their sides is brighter
    other = np.flatnonzero(~is_upright & (across * across + along * along > np.float32(4 * LEAST_OTHER_STEP**2)))
    x, y = right.take(other), upwards.take(other)
    towards = (np.arctan2(x, y) * np.float32(_TURN / (2 * np.pi))).astype(np.int16).astype(np.uint8)
    size = np.sqrt(x * x + y * y)
    return Edges(_linked(upright, np.abs(step), sides, grey.shape), _linked(other, size, towards, grey.shape))


def _gradient(grey: NDArray[np.uint8]) -> tuple[Floats, Floats]:
    """Twice the steps (h - 1, w - 1) of brightness to the right and upwards, on the corners that four pixels share."""
    levels = grey.astype(np.int16)
    falling, rising = levels[1:, 1:] - levels[:-1, :-1], levels[:-1, 1:] - levels[1:, :-1]
    return (falling + rising).astype(np.float32), (rising - falling).astype(np.float32)


def _turned(right: Floats, upwards: Floats, up: Floats, focal: float) -> tuple[Floats, Floats]:
    """Gradients (h - 1, w - 1) across the expected vertical, positive to the right, and along it, up to a factor."""
    height, width = right.shape
    x, y = np.arange(1, width + 1) - 0.5 * (width + 1), 0.5 * (height + 1) - np.arange(1, height + 1)
    aside = (up[0] - x / focal * up[2]).astype(np.float32)[None, :]
    above = (up[1] - y / focal * up[2]).astype(np.float32)[:, None]
    return right * above - upwards * aside, right * aside + upwards * above


def _linked(corners: NDArray[np.intp], size: Floats, towards: NDArray[np.uint8], shape: tuple[int, ...]) -> Lines:
    """The edges that neighbouring corners (P,) make, by the sizes (P,) and directions (P,) of their gradients.

    Directions are in parts of a turn, of which there are _TURN.
    """
    height, width = shape
    rows, columns = np.divmod(corners, max(width - 1, 1))
    chain, kept = _of_size(_chains(rows * width + columns, towards, width), LEAST_PIXELS)
    x, y = columns.take(kept) + (1 - 0.5 * width), (0.5 * height - 1) - rows.take(kept)
    return _fitted(chain, size.take(kept).astype(np.float64), x, y, height)


def _chains(corners: NDArray[np.intp], towards: NDArray[np.uint8], width: int) -> NDArray[np.intp]:
    """The number (P,) of the chain that each of the ordered corners belongs to; one row has `width` places for them.

    Neighbours in a row whose directions (P,) agree make a run, and each run follows one above that it touches and
    agrees with. The last place of a row is free, so that neighbouring places are neighbours in the picture.
    """
    begins = np.ones(len(corners), dtype=bool)
    begins[1:] = (np.diff(corners) != 1) | ~_alike(towards[1:], towards[:-1])
    start = np.flatnonzero(begins)
    end = np.append(start, len(corners))[1:] - 1
    run = np.cumsum(begins) - 1
    margin = width + 1  # places before the first one that are looked at
    at = np.full(margin + 1 + int(corners.max(initial=0)), -1, dtype=np.int32)
    at[corners + margin] = np.arange(len(corners), dtype=np.int32)
    first = np.arange(len(start))
    free = first.copy()
    middle = (start + end) // 2
    for own, aside in ((middle, 0), (start, 0), (end, 0), (start, -1), (end, 1)):
        touching = own.take(free)
        above = at.take(corners.take(touching) + (margin - width + aside))
        follows = (above >= 0) & _alike(towards.take(above), towards.take(touching))
        first[free[follows]] = run.take(above[follows])
        free = free[~follows]
    while not np.array_equal(further := first.take(first), first):
        first = further
    return first.take(run)


def _alike(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether directions (P,) in parts of a turn differ by _ALIKE at most; bytes wrap as directions do."""
    return np.asarray(one - other + np.uint8(_ALIKE) <= 2 * _ALIKE)


def _of_size(chain: NDArray[np.intp], least: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Chains of at least `least` pixels numbered from 0, and the indices of the pixels that are theirs."""
    large = np.bincount(chain) >= least
    kept = np.flatnonzero(large.take(chain))
    return (np.cumsum(large) - 1).take(chain.take(kept)), kept


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

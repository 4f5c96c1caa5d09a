"""Camera pose and focal length from line segments and vanishing points.

Line support regions (Burns, Hanson and Riseman, PAMI 1986; von Gioi et al., PAMI 2010): neighbours whose gradients
agree make one edge. The camera is known roughly, so it is known in which direction the world's vertical is to be
expected at each pixel. The regions are found by arrays as a whole.

Verticals and horizontals of the world are likelihoods over a grid of elevation, roll and lens, times a heavy-tailed
prior around the network's answer.

The network knows where the horizon lies in the picture better than it knows the lens, so where the lens is another, so
is the elevation.

Edges of walls, windows and pavements run level in two headings at right angles, which nobody knows beforehand. Those of
one heading meet in the picture on the horizon, so they tell where it lies, and both together tell the lens. The model
is the Manhattan world of Coughlan and Yuille (ICCV 1999): a mixture for each edge, whose mean over the headings counts.

What stands upright in the world converges in the picture where the camera looks up or down, and leans where it is
rolled. Each edge tells the camera a little, and some are no verticals: a mixture for each (Coughlan and Yuille, ICCV
1999).
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.geometry import Floats, focal_length, level_in_camera, shrink_size, up_in_camera
from lighting.records import Prediction

MAX_LENS_RATIO = 1.9  # of focal lengths, over which what is known of the lens is contradicted

# Straight edges of a picture, those apart that run about as the verticals of the world would.

_MIN_UPRIGHT_STEP = 6.0  # grey levels per pixel, of an edge near vertical
_MIN_OTHER_STEP = 10.0  # of another, of which pictures have more
MAX_LEAN = 25.0  # deg about the expected vertical in which gradients are taken for it
_MIN_PIXELS = 10  # of an edge
_MIN_LENGTH = 6.0  # pixels
_MAX_WIDTH = 3.0  # pixels; wider regions are shades, or several edges in one
_DIRECTION_BINS = 256  # parts, in which the directions of gradients are counted
_MAX_BIN_DIFFERENCE = round(
    40.0 / 360.0 * _DIRECTION_BINS
)  # parts, the most by which the gradients of neighbours of one edge differ


@dataclass(frozen=True, eq=False)
class _Lines:
    """Straight edges. Positions are in picture heights from the picture's centre, x to the right and y up."""

    middle: Floats  # (N, 2)
    angle: Floats  # (N,) deg from the picture's vertical, positive leans to the right
    length: Floats  # (N,) pixels

    def longest(self, count: int) -> "_Lines":
        """At most `count` of them."""
        if len(self.length) <= count:
            return self
        kept = np.argpartition(self.length, -count)[-count:]
        return _Lines(self.middle[kept], self.angle[kept], self.length[kept])

    @property
    def across(self) -> Floats:
        """What (3, N) times a direction in the picture is the distance between the two, at a line's middle.

        Directions are those of `in_picture`; the distance is the sine of the angle times the direction's length there.
        """
        sine, cosine = np.sin(np.radians(self.angle)), np.cos(np.radians(self.angle))
        x, y = self.middle.T
        return np.stack([-cosine, sine, cosine * x - sine * y])


def _in_picture(direction: Floats, half: Floats | float) -> Floats:
    """A direction (3, ...) in the camera, its last part over the focal length in picture heights.

    `half` is the tangent of half the vertical field of view. At a point (x, y) of the picture, in heights from its
    centre, lines of the world with that direction run along (d[0] - x * d[2], d[1] - y * d[2]).
    """
    return np.stack([direction[0], direction[1], 2 * half * direction[2]])


@dataclass(frozen=True, eq=False)
class _Edges:
    """The edges of a picture by how they run."""

    upright: _Lines  # within AROUND of verticals
    other: _Lines


def _edges_of(grey: NDArray[np.uint8], up: Floats, focal: float) -> _Edges:
    """The edges of a picture (h, w).

    `up` (3,) is the world's up as the camera's right, up and forward, roughly; `focal` its focal length [pixels].
    """
    right, upwards = _gradient(grey)
    across, along = _turned(right, upwards, up, focal)
    strong = np.abs(across)
    is_upright = np.abs(along) <= np.float32(np.tan(np.radians(MAX_LEAN))) * strong
    upright = np.flatnonzero(is_upright & (strong > 2 * _MIN_UPRIGHT_STEP))
    step = across.take(upright)
    sides = np.where(step > 0, 0, _DIRECTION_BINS // 2).astype(
        np.uint8
    )  # they part by which of their sides is brighter
    other = np.flatnonzero(~is_upright & (across * across + along * along > np.float32(4 * _MIN_OTHER_STEP**2)))
    x, y = right.take(other), upwards.take(other)
    towards = (np.arctan2(x, y) * np.float32(_DIRECTION_BINS / (2 * np.pi))).astype(np.int16).astype(np.uint8)
    size = np.sqrt(x * x + y * y)
    return _Edges(_linked(upright, np.abs(step), sides, grey.shape), _linked(other, size, towards, grey.shape))


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


def _linked(corners: NDArray[np.intp], size: Floats, towards: NDArray[np.uint8], shape: tuple[int, ...]) -> _Lines:
    """The edges that neighbouring corners (P,) make, by the sizes (P,) and directions (P,) of their gradients.

    Directions are in parts of a turn, of which there are _TURN.
    """
    height, width = shape
    rows, columns = np.divmod(corners, max(width - 1, 1))
    chain, kept = _of_size(_chains(rows * width + columns, towards, width), _MIN_PIXELS)
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
    return np.asarray(one - other + np.uint8(_MAX_BIN_DIFFERENCE) <= 2 * _MAX_BIN_DIFFERENCE)


def _of_size(chain: NDArray[np.intp], least: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Chains of at least `least` pixels numbered from 0, and the indices of the pixels that are theirs."""
    large = np.bincount(chain) >= least
    kept = np.flatnonzero(large.take(chain))
    return (np.cumsum(large) - 1).take(chain.take(kept)), kept


def _fitted(chain: NDArray[np.intp], weight: Floats, x: Floats, y: Floats, height: int) -> _Lines:
    """A line through each chain's pixels, by their weighted moments; its length and width are those of a bar."""
    total = np.bincount(chain, weight)
    mx, my = (np.bincount(chain, weight * v) / total for v in (x, y))
    dx, dy = x - mx[chain], y - my[chain]
    xx, yy, xy = (np.bincount(chain, weight * v) / total for v in (dx * dx, dy * dy, dx * dy))
    middle, spread = 0.5 * (xx + yy), 0.5 * np.hypot(xx - yy, 2 * xy)
    length, width = np.sqrt(12 * (middle + spread)), np.sqrt(12 * np.maximum(middle - spread, 0.0))
    thin = (length >= _MIN_LENGTH) & (width <= _MAX_WIDTH)
    angle = np.degrees(0.5 * np.arctan2(2 * xy, yy - xx))
    return _Lines(np.stack([mx, my], axis=1)[thin] / height, angle[thin], length[thin])


# The cameras among which the lines of a picture choose: a grid around what the network says of it.

_ELEVATION_OFFSETS = np.arange(-9.0, 9.1, 1.5)  # deg around the network's answer for each lens
_ROLL_OFFSETS = np.arange(-4.0, 4.1, 0.5)  # deg around it
_LOG_LENS_OFFSETS = np.arange(-0.2, 0.21, 0.1)  # around it, logarithm of the tangent of half the field of view
_ELEVATION_STD, _LOG_LENS_STD = 2.3, 0.1  # of the network's answers, in the same units
_ROLL_STD_RANGE = (0.2, 2.0)  # deg: that of small rolls is their own size, for the network knows level cameras best
_DEGREES_OF_FREEDOM = 4.0  # degrees of freedom of Student's t distribution, which those errors have
_LENS_EXPONENT = (
    0.5  # power of the lens with which the network's elevation, as a tangent, goes; 1 keeps its horizon in place
)


@dataclass(frozen=True, eq=False)
class _Cameras:
    """Every elevation of a lens with every roll."""

    said: Prediction  # of the network
    lens: Floats  # (L,) logarithm of the tangent of half the field of view over that of `said`
    elevation: Floats  # (L, E) deg
    roll: Floats  # (R,) deg

    @property
    def half(self) -> Floats:
        """Tangents (L,) of half the vertical field of view."""
        return np.asarray(_half_of(self.said) * np.exp(self.lens))


def _cameras_around(said: Prediction, lenses: Floats) -> _Cameras:
    """The cameras around a network's answer that have one of the lenses (L,)."""
    ahead = math.tan(math.radians(said.camera_elevation)) * np.exp(_LENS_EXPONENT * lenses)
    elevation = np.degrees(np.arctan(ahead))[:, None] + _ELEVATION_OFFSETS
    return _Cameras(said, lenses, elevation, said.camera_roll + _ROLL_OFFSETS)


def _by_the_network(cameras: _Cameras) -> Floats:
    """Logarithm of the density (L, E, R) of cameras by the network's answer alone, up to a constant."""
    spreads = (_ELEVATION_STD, float(np.clip(abs(cameras.said.camera_roll), *_ROLL_STD_RANGE)), _LOG_LENS_STD)
    elevation, roll, lens = (
        -0.5 * (_DEGREES_OF_FREEDOM + 1) * np.log1p((values / spread) ** 2 / _DEGREES_OF_FREEDOM)
        for values, spread in zip((_ELEVATION_OFFSETS, _ROLL_OFFSETS, cameras.lens), spreads, strict=True)
    )
    return np.asarray(lens[:, None, None] + elevation[:, None] + roll)


def _half_of(said: Prediction) -> float:
    """Tangent of half the vertical field of view."""
    return math.tan(math.radians(said.vertical_fov) / 2)


# How likely a camera is by the horizontals that the picture shows.

_MAX_HORIZONTALS = 60  # the longest, which tell as much as all
_HEADINGS = np.arange(0.0, 180.0, 3.0)  # deg from the camera's own; the second half is at right angles to the first
_HORIZONTAL = 0.35  # share of the edges that run along one of the two headings; the rest has any angle
_HORIZONTAL_STD = 1.0  # deg, standard deviation of horizontals about the true direction
_ENDS = 12.0  # deg x pixels, how uncertain the angle of an edge is by its length
_HORIZONTAL_WEIGHT = 0.5  # of an edge as long as the picture is tall; others count by the root of their length


def _by_horizontals(lines: _Lines, height: int, cameras: _Cameras, roll: float) -> Floats:
    """Logarithm of the likelihood (L, E) of lines in a picture `height` pixels tall, by cameras with a roll [deg]."""
    lines = lines.longest(_MAX_HORIZONTALS)
    level = level_in_camera(_HEADINGS[:, None, None], cameras.elevation, roll)
    bell = _angles_to_directions(lines, _in_picture(level, cameras.half[:, None]).reshape(3, -1))
    spread = np.radians(np.hypot(_HORIZONTAL_STD, _ENDS / lines.length)).astype(np.float32)[:, None]
    bell *= -0.5 / (spread * spread)
    np.exp(bell, out=bell)
    half = bell.shape[1] // 2
    along = (bell[:, :half] + bell[:, half:]) * (0.5 * _HORIZONTAL / (math.sqrt(2 * math.pi) * spread))
    along += np.float32((1 - _HORIZONTAL) / math.pi)
    weight = (_HORIZONTAL_WEIGHT * np.sqrt(lines.length / height)).astype(np.float32)
    by_heading = (weight @ np.log(along)).reshape(-1, *cameras.elevation.shape)
    highest = by_heading.max(axis=0)
    return np.asarray(highest + np.log(np.exp(by_heading - highest).mean(axis=0)))


def _angles_to_directions(lines: _Lines, directions: Floats) -> Floats:
    """Squared sines (N, G) of the angles between lines and directions (3, G) in the picture, at the lines' middles."""
    x, y = lines.middle.T
    right, up, forward = d = directions.astype(np.float32)
    off = lines.across.T.astype(np.float32) @ d
    off *= off
    parts = np.stack([right * right + up * up, forward * right, forward * up, forward * forward])
    by_middle = np.stack([np.ones_like(x), -2 * x, -2 * y, x * x + y * y], axis=1).astype(np.float32)
    off /= np.maximum(by_middle @ parts, np.float32(1e-6))
    return off


# How likely a camera is by the verticals that the picture shows.

_MAX_VERTICALS = 80  # the longest, which tell as much as all
_VERTICAL = 0.3  # share of the edges that are verticals; the rest has any angle within AROUND
_VERTICAL_STD = 0.8  # deg, standard deviation of verticals about the true vertical
_VERTICAL_WEIGHT = 1.5  # of an edge as long as the picture is tall; others count by the root of their length


def _by_verticals(lines: _Lines, height: int, cameras: _Cameras) -> Floats:
    """Logarithm of the likelihood (L, E, R) of cameras by lines near vertical, in a picture `height` pixels tall."""
    lines = lines.longest(_MAX_VERTICALS)
    up = up_in_camera(cameras.elevation[..., None], cameras.roll)
    apart = _angles_to_verticals(lines, _in_picture(up, cameras.half[:, None, None]), cameras)
    spread = np.hypot(_VERTICAL_STD, _ENDS / lines.length).astype(np.float32)[:, None]
    bell = np.exp(-0.5 * (apart / spread) ** 2) * (_VERTICAL / (np.sqrt(2 * np.pi, dtype=np.float32) * spread))
    weight = _VERTICAL_WEIGHT * np.sqrt(lines.length / height)
    log = weight @ np.log(bell + np.float32((1 - _VERTICAL) / MAX_LEAN))
    return np.asarray(log.reshape(up.shape[1:]))


def _angles_to_verticals(lines: _Lines, verticals: Floats, cameras: _Cameras) -> Floats:
    """Angles [deg] (N, G) of the lines from verticals (3, ...) at their middles, where all cameras see them as long.

    As long as the network's camera sees them, that is: G cameras near it differ little in that.
    """
    x, y = lines.middle.T
    said = cameras.said
    right, up, forward = _in_picture(up_in_camera(said.camera_elevation, said.camera_roll), _half_of(said))
    across = lines.across / np.hypot(right - x * forward, up - y * forward)
    return np.asarray(np.degrees(across.T.astype(np.float32) @ verticals.reshape(3, -1).astype(np.float32)))


# The camera by the straight lines that the picture shows, beside what the network says of it.

MAX_SIDE = 448  # pixels along the longer side; more bring no better camera
_MISLED = 0.1  # share of the photos whose lines say nothing: cropped or set upright afterwards, or of a sloping street


def lens_ratio(a: float, b: float) -> float:
    """Ratio (1 or more) of the focal lengths of two vertical fields of view [deg]."""
    ratio = math.tan(math.radians(a) / 2) / math.tan(math.radians(b) / 2)
    return max(ratio, 1.0 / ratio)


def calibrate_from_lines(
    prediction: Prediction, pixels: NDArray[np.uint8], vertical_fov: float | None = None
) -> Prediction:
    """The prediction with the camera by its straight lines too; its sun stays where it is. `pixels` (h, w, 3) are sRGB.

    Where the lens is known (`vertical_fov` [deg]), elevation and roll are those of a camera with it, unless the pixels
    contradict it. The field of view stays what the pixels say, so that the two can be compared.
    """
    grey = _grey(pixels)
    up = up_in_camera(prediction.camera_elevation, prediction.camera_roll)
    edges = _edges_of(grey, up, focal_length(len(grey), prediction.vertical_fov))
    known = _known_lens(prediction, vertical_fov)
    if not (len(edges.upright.length) or len(edges.other.length)) and known is None:
        return prediction
    elevation, roll, lens = _means(_cameras_around(prediction, _LOG_LENS_OFFSETS), edges, len(grey))
    if known is not None:
        elevation, roll, _ = _means(_cameras_around(prediction, known), edges, len(grey))
    return replace(
        prediction,
        camera_elevation=elevation,
        camera_roll=roll,
        vertical_fov=math.degrees(2 * math.atan(_half_of(prediction) * math.exp(lens))),
    )


def _known_lens(prediction: Prediction, vertical_fov: float | None) -> Floats | None:
    """The known lens (1,) around the network's answer as LENSES are, unless the pixels contradict it."""
    if vertical_fov is None or lens_ratio(prediction.vertical_fov, vertical_fov) > MAX_LENS_RATIO:
        return None
    return np.array([math.log(math.tan(math.radians(vertical_fov) / 2) / _half_of(prediction))])


def _grey(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Grey levels (h, w) of pixels (h, w, 3), at most MOST_SIDE along the longer side."""
    grey = Image.fromarray(pixels).convert("L")
    return np.asarray(grey.resize(shrink_size(*grey.size, MAX_SIDE), Image.Resampling.BOX))


def _means(cameras: _Cameras, edges: _Edges, height: int) -> tuple[float, float, float]:
    """Elevation and roll [deg] and lens in the mean of the posterior, the lens as `cameras` has it."""
    log = _by_the_network(cameras)
    if len(edges.upright.length):
        log = log + _perhaps(_by_verticals(edges.upright, height, cameras))
    p = _normal(log)
    if len(edges.other.length):
        roll = float(p.sum(axis=(0, 1)) @ cameras.roll)
        p = _normal(log + _perhaps(_by_horizontals(edges.other, height, cameras, roll)[..., None]))
    return (
        float(np.sum(p.sum(axis=2) * cameras.elevation)),
        float(p.sum(axis=(0, 1)) @ cameras.roll),
        float(p.sum(axis=(1, 2)) @ cameras.lens),
    )


def _normal(log: Floats) -> Floats:
    """Probabilities by their logarithms, up to a constant."""
    p = np.exp(log - log.max())
    return np.asarray(p / p.sum())


def _perhaps(log: Floats) -> Floats:
    """Logarithms of a likelihood (L, E, R) where lines may converge as by any other elevation and lens."""
    likelihood = np.exp(log - log.max())
    mixed = (1 - _MISLED) * likelihood + _MISLED * likelihood.mean(axis=(0, 1))
    return np.asarray(np.log(np.maximum(mixed, 1e-300)))

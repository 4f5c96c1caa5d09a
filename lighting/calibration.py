"""Camera pose and focal length from line segments and vanishing points, about a network's answer.

Segments are line support regions [1, 2]: neighbors whose gradients agree make one edge. The camera is known roughly, so
at each pixel it is known where the world's vertical is to be expected. All regions are found at once, by arrays.

Verticals of the world converge in the picture where the camera looks up or down, and lean where it is rolled. Level
edges run in two headings at right angles that nobody knows beforehand; those of one heading meet on the horizon, and
both together tell the lens. Each edge is a mixture, for some are neither (the Manhattan world of [3]), and the mean
over the headings counts.

Both are likelihoods over a grid of elevation, roll and lens, times a heavy-tailed prior about the network's answer.
Among verticals, a level camera is likelier still. The network knows where the horizon lies in the picture better than
it knows the lens: where the lens is another, so is the elevation.

References:
    [1] Burns, Hanson and Riseman, Extracting Straight Lines, PAMI 1986.
    [2] Grompone von Gioi et al., LSD, PAMI 2010.
    [3] Coughlan and Yuille, Manhattan World, ICCV 1999.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image

from lighting.geometry import Floats, focal_length, shrink_size, turn_to_degrees
from lighting.prediction import Prediction

_Bytes = NDArray[np.uint8]

MAX_LENS_RATIO = 1.9  # of focal lengths, over which what is known of the lens is contradicted
LINES_SIDE = 448  # pixels along the longer side; more bring no better camera
_MAX_LEAN = 25.0  # deg from the expected vertical within which an edge may be a vertical

_MIN_UPRIGHT_STEP = 6.0  # gray levels per pixel, of an edge near vertical
_MIN_OTHER_STEP = 10.0  # gray levels per pixel, of another, of which pictures have more
_MIN_PIXELS = 10  # of an edge
_MIN_LENGTH = 6.0  # pixels
_MAX_WIDTH = 3.0  # pixels; wider regions are shades, or several edges in one
_DIRECTION_BINS = 256  # of the directions of gradients: bytes, which wrap as directions do
_MAX_BIN_DIFFERENCE = round(40.0 / 360.0 * _DIRECTION_BINS)  # between the gradients of neighbors of one edge

_ELEVATION_OFFSETS = np.arange(-9.0, 9.1, 1.5)  # deg from the network's answer for each lens
_ROLL_OFFSETS = np.arange(-4.0, 4.1, 0.5)  # deg from it
_LOG_LENS_OFFSETS = np.arange(-0.3, 0.31, 0.1)  # from it, logarithm of the tangent of half the field of view
_ELEVATION_STD, _LOG_LENS_STD = 2.3, 0.12  # of the network's answers, in the same units
_ROLL_STD_RANGE = (0.2, 2.0)  # deg: that of small rolls is their own size, for the network knows level cameras best
_LEVEL_ODDS = 12.0  # by which a level camera is likelier than a rolled one by people's habit
_LEVEL_STD = 0.3  # deg, of the roll of level cameras
_DEGREES_OF_FREEDOM = 4.0  # of Student's t distribution, which those errors have
_LENS_EXPONENT = 0.5  # power of the lens with which the elevation, as a tangent, goes; 1 keeps its horizon in place

_OUTLIER_RATE = 0.1  # share of photos whose lines tell nothing: cropped or set upright afterwards, or of a slope
_SEGMENT_STD = 12.0  # deg x pixels, of the angle of an edge by its length
_MAX_HORIZONTALS = 60  # the longest, which tell as much as all
_HEADINGS = np.arange(0.0, 180.0, 3.0)  # deg from the camera's; the second half is at right angles to the first
_HORIZONTAL_SHARE = 0.35  # of the edges, that run along one of the two headings; the rest has any angle
_HORIZONTAL_STD = 1.0  # deg, of horizontals about the true direction
_HORIZONTAL_WEIGHT = 0.5  # of an edge as long as the picture is tall; others count by the root of their length
_MAX_VERTICALS = 80  # the longest, which tell as much as all
_VERTICAL_SHARE = 0.3  # of the edges, that are verticals; the rest has any angle within _MAX_LEAN
_VERTICAL_STD = 0.8  # deg, of verticals about the true vertical
_VERTICAL_WEIGHT = 1.5  # of an edge as long as the picture is tall; others count by the root of their length


def lens_ratio(a: float, b: float) -> float:
    """Ratio (1 or more) of the focal lengths of two vertical fields of view.

    Args:
        a: one vertical field of view, deg.
        b: the other, deg.
    """
    ratio = math.tan(math.radians(a) / 2) / math.tan(math.radians(b) / 2)
    return max(ratio, 1.0 / ratio)


def shrink_to_gray(pixels: _Bytes) -> _Bytes:
    """The gray levels (h, w), 0 to 255, in which lines are sought: LINES_SIDE along the longer side at most.

    Args:
        pixels: (H, W, 3) sRGB.
    """
    full_size = Image.fromarray(pixels).convert("L")
    return np.asarray(full_size.resize(shrink_size(*full_size.size, LINES_SIDE), Image.Resampling.BOX))


def calibrate_from_lines(prediction: Prediction, gray: _Bytes, vertical_fov: float | None = None) -> Prediction:
    """The prediction with the camera by the photo's straight lines too; its sun stays where it is.

    With a known lens, elevation and roll are those of a camera with it, unless the pixels contradict it. The field of
    view stays what the pixels tell, so that the two can be compared.

    Args:
        prediction: of the network.
        gray: (h, w) levels of the photo, by `shrink_to_gray`.
        vertical_fov: deg, of the known lens; None where it is unknown.
    """
    focal = focal_length(len(gray), prediction.vertical_fov)
    edges = _edges_of(gray, up_in_camera(prediction.camera_elevation, prediction.camera_roll), focal)
    known_lens = _known_log_lens(prediction, vertical_fov)
    if not (len(edges.upright.length) or len(edges.other.length)) and known_lens is None:
        return prediction
    elevation, roll, log_lens = _posterior_mean(_cameras_near(prediction, _LOG_LENS_OFFSETS), edges, len(gray))
    if known_lens is not None:
        elevation, roll, _ = _posterior_mean(_cameras_near(prediction, known_lens), edges, len(gray))
    fov = math.degrees(2 * math.atan(_tan_half_fov(prediction) * math.exp(log_lens)))
    return prediction.with_camera(elevation, roll, fov)


def _known_log_lens(prediction: Prediction, vertical_fov: float | None) -> Floats | None:
    """The known lens (1,) from the network's answer as _LOG_LENS_OFFSETS are, unless the pixels contradict it."""
    if vertical_fov is None or lens_ratio(prediction.vertical_fov, vertical_fov) > MAX_LENS_RATIO:
        return None
    return np.array([math.log(math.tan(math.radians(vertical_fov) / 2) / _tan_half_fov(prediction))])


# What of the world stands and lies, as cameras see it.


def up_in_camera(elevation: ArrayLike, roll: ArrayLike) -> Floats:
    """The world's up (3, ...) along the right, up and forward of cameras.

    Args:
        elevation: deg (...), positive looks up.
        roll: deg (...), positive turns the camera clockwise.
    """
    el, ro = np.radians(elevation), np.radians(roll)
    level = np.cos(el)
    return np.stack(np.broadcast_arrays(-np.sin(ro) * level, np.cos(ro) * level, np.sin(el)))


def level_in_camera(heading: Floats, elevation: Floats, roll: float) -> Floats:
    """Return level directions (3, ...) along the right, up and forward of cameras.

    Args:
        heading: (...) deg, clockwise from where each camera points.
        elevation: (...) deg, of each camera, positive looks up.
        roll: deg.
    """
    he, el, ro = np.radians(heading), np.radians(elevation), np.radians(roll)
    lateral, ahead = np.sin(he), np.cos(he)
    above = -np.sin(el) * ahead
    c, s = np.cos(ro), np.sin(ro)
    return np.stack(np.broadcast_arrays(c * lateral - s * above, s * lateral + c * above, np.cos(el) * ahead))


# Straight edges of a picture, those separate that run about as the verticals of the world would.


@dataclass(frozen=True, eq=False, repr=False)
class _Lines:
    """Straight edges. Positions are in picture heights from the picture's center, x to the right and y up."""

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

        Directions are those of `_in_picture`; the distance is the sine of the angle times the direction's length there.
        """
        sine, cosine = np.sin(np.radians(self.angle)), np.cos(np.radians(self.angle))
        x, y = self.middle.T
        return np.stack([-cosine, sine, cosine * x - sine * y])


@dataclass(frozen=True, eq=False, repr=False)
class _Edges:
    """The edges of a picture by their direction."""

    upright: _Lines  # within _MAX_LEAN of verticals
    other: _Lines


def _in_picture(direction: Floats, tan_half_fov: Floats | float) -> Floats:
    """A direction (3, ...) in the camera, its last part over the focal length in picture heights.

    Take a point (x, y) of the picture, in heights from its center. Lines of the world with that direction run there
    along (d[0] - x * d[2], d[1] - y * d[2]).
    """
    return np.stack([direction[0], direction[1], 2 * tan_half_fov * direction[2]])


def _edges_of(gray: _Bytes, up: Floats, focal: float) -> _Edges:
    """The edges of a picture (h, w).

    `up` (3,) is the world's up as the camera's right, up and forward, roughly; `focal` its focal length [pixels].
    """
    right, upwards = _gradient(gray)
    across, along = _rotate_to_vertical(right, upwards, up, focal)
    strength = np.abs(across)
    is_upright = np.abs(along) <= np.float32(np.tan(np.radians(_MAX_LEAN))) * strength
    upright = np.flatnonzero(is_upright & (strength > 2 * _MIN_UPRIGHT_STEP))
    step = across.take(upright)
    sides = np.where(step > 0, 0, _DIRECTION_BINS // 2).astype(np.uint8)  # which of their sides is brighter
    other = np.flatnonzero(~is_upright & (across * across + along * along > np.float32(4 * _MIN_OTHER_STEP**2)))
    x, y = right.take(other), upwards.take(other)
    directions = (np.arctan2(x, y) * np.float32(_DIRECTION_BINS / (2 * np.pi))).astype(np.int16).astype(np.uint8)
    size = np.sqrt(x * x + y * y)
    verticals = _link_corners(upright, np.abs(step), sides, gray.shape)
    return _Edges(verticals, _link_corners(other, size, directions, gray.shape))


def _gradient(gray: _Bytes) -> tuple[Floats, Floats]:
    """Twice the steps (h - 1, w) of brightness to the right and upwards, on the corners that four pixels share.

    The last column, which has no corners, is 0.
    """
    levels = gray.astype(np.int16)
    falling, rising = levels[1:, 1:] - levels[:-1, :-1], levels[:-1, 1:] - levels[1:, :-1]
    right, upwards = np.zeros((2, len(gray) - 1, gray.shape[1]), np.float32)
    np.add(falling, rising, out=right[:, :-1])
    np.subtract(rising, falling, out=upwards[:, :-1])
    return right, upwards


def _rotate_to_vertical(right: Floats, upwards: Floats, up: Floats, focal: float) -> tuple[Floats, Floats]:
    """Gradients (h - 1, w) across the expected vertical, positive to the right, and along it, up to a factor."""
    height, width = right.shape
    x, y = np.arange(1, width + 1) - 0.5 * width, 0.5 * (height + 1) - np.arange(1, height + 1)
    vertical_x = (up[0] - x / focal * up[2]).astype(np.float32)[None, :]
    vertical_y = (up[1] - y / focal * up[2]).astype(np.float32)[:, None]
    return right * vertical_y - upwards * vertical_x, right * vertical_x + upwards * vertical_y


def _link_corners(corners: NDArray[np.intp], size: Floats, directions: _Bytes, shape: tuple[int, ...]) -> _Lines:
    """The edges that neighboring corners (P,) make, by the sizes (P,) and direction bins (P,) of their gradients."""
    height, width = shape
    chain = _chains(corners, directions, width)
    large = np.bincount(chain) >= _MIN_PIXELS
    kept = np.flatnonzero(large.take(chain))
    chain = (np.cumsum(large) - 1).take(chain.take(kept))  # those are numbered from 0
    rows, columns = np.divmod(corners.take(kept), width)
    return _fit_lines(
        chain, size.take(kept).astype(np.float64), columns + (1 - 0.5 * width), (0.5 * height - 1) - rows, height
    )


def _chains(corners: NDArray[np.intp], directions: _Bytes, width: int) -> NDArray[np.intp]:
    """The number (P,) of the chain that each of the ordered corners belongs to; a row has `width` cells for them.

    Neighbors in a row whose directions (P,) agree make a run, and each run follows one above that it touches and
    agrees with. The last cell of a row is free, so that neighboring cells are neighbors in the picture.
    """
    begins = np.ones(len(corners), dtype=bool)
    begins[1:] = (np.diff(corners) != 1) | ~_agree(directions[1:], directions[:-1])
    start = np.flatnonzero(begins)
    end = np.append(start, len(corners))[1:] - 1
    steps = end - start
    run = np.cumsum(begins)
    run -= 1
    margin = width + 1  # cells before the first one that are looked at
    at = np.full(margin + 1 + int(corners.max(initial=0)), -1, dtype=np.int32)
    at[margin:][corners] = np.arange(len(corners), dtype=np.int32)
    first = np.arange(len(start))
    free = np.ones(len(start), dtype=bool)
    middle = (start + end) // 2
    for members, shift, least in ((middle, 0, 0), (start, 0, 2), (end, 0, 1), (start, -1, 0), (end, 1, 0)):
        tried = np.flatnonzero(free & (steps >= least))  # of shorter runs the member is one that was tried before
        touching = members.take(tried)
        above = at[margin - width + shift :].take(corners.take(touching))
        found = np.flatnonzero(above >= 0)
        tried, above = tried.take(found), above.take(found)
        follows = np.flatnonzero(_agree(directions.take(above), directions.take(touching.take(found))))
        tried = tried.take(follows)
        first[tried] = run.take(above.take(follows))
        free[tried] = False
    while not np.array_equal(further := first.take(first), first):
        first = further
    return first.take(run)


def _agree(a: _Bytes, b: _Bytes) -> NDArray[np.bool_]:
    """Whether direction bins (P,) differ by _MAX_BIN_DIFFERENCE at most."""
    return np.asarray(a - b + np.uint8(_MAX_BIN_DIFFERENCE) <= 2 * _MAX_BIN_DIFFERENCE)


def _fit_lines(chain: NDArray[np.intp], weight: Floats, x: Floats, y: Floats, height: int) -> _Lines:
    """A line through each chain's pixels, by their weighted moments; its length and width are those of a bar."""
    total = np.bincount(chain, weight)
    mx, my = (np.bincount(chain, weight * v) / total for v in (x, y))
    dx, dy = x - mx[chain], y - my[chain]
    xx, yy, xy = (np.bincount(chain, weight * v) / total for v in (dx * dx, dy * dy, dx * dy))
    mean, half_range = 0.5 * (xx + yy), 0.5 * np.hypot(xx - yy, 2 * xy)  # of the two principal variances
    length, width = np.sqrt(12 * (mean + half_range)), np.sqrt(12 * np.maximum(mean - half_range, 0.0))
    thin = (length >= _MIN_LENGTH) & (width <= _MAX_WIDTH)
    angle = np.degrees(0.5 * np.arctan2(2 * xy, yy - xx))
    return _Lines(np.stack([mx, my], axis=1)[thin] / height, angle[thin], length[thin])


# The posterior over the cameras among which the lines choose: a grid about the network's answer.


@dataclass(frozen=True, eq=False, repr=False)
class _Cameras:
    """Every elevation of a lens with every roll."""

    prediction: Prediction  # of the network
    log_lens: Floats  # (L,) logarithm of the tangent of half the field of view over that of `prediction`
    elevation: Floats  # (L, E) deg
    roll: Floats  # (R,) deg

    @property
    def tan_half_fov(self) -> Floats:
        """Tangents (L,) of half the vertical field of view."""
        return np.asarray(_tan_half_fov(self.prediction) * np.exp(self.log_lens))


def _tan_half_fov(prediction: Prediction) -> float:
    return math.tan(math.radians(prediction.vertical_fov) / 2)


def _cameras_near(prediction: Prediction, log_lens: Floats) -> _Cameras:
    """The cameras about a network's answer that have one of the lenses (L,)."""
    slope = math.tan(math.radians(prediction.camera_elevation)) * np.exp(_LENS_EXPONENT * log_lens)
    elevation = np.degrees(np.arctan(slope))[:, None] + _ELEVATION_OFFSETS
    return _Cameras(prediction, log_lens, elevation, prediction.camera_roll + _ROLL_OFFSETS)


def _posterior_mean(cameras: _Cameras, edges: _Edges, height: int) -> tuple[float, float, float]:
    """Elevation and roll [deg] and lens in the mean of the posterior, the lens as `cameras` has it."""
    log = _log_prior(cameras)
    if len(edges.upright.length):
        verticals = _log_likelihood_of_verticals(edges.upright, height, cameras)
        log = log + _with_outliers(verticals) + _log_level_prior(cameras.roll)
    p = _normalize(log)
    if len(edges.other.length):
        roll = float(p.sum(axis=(0, 1)) @ cameras.roll)
        horizontals = _log_likelihood_of_horizontals(edges.other, height, cameras, roll)
        p = _normalize(log + _with_outliers(horizontals[..., None]))
    elevation = float(np.sum(p.sum(axis=2) * cameras.elevation))
    return elevation, float(p.sum(axis=(0, 1)) @ cameras.roll), float(p.sum(axis=(1, 2)) @ cameras.log_lens)


def _normalize(log: Floats) -> Floats:
    """Probabilities by their logarithms, up to a constant."""
    p = np.exp(log - log.max())
    return np.asarray(p / p.sum())


def _with_outliers(log: Floats) -> Floats:
    """Logarithms of a likelihood (L, E, R) where lines may converge as by any other elevation and lens."""
    likelihood = np.exp(log - log.max())
    mixed = (1 - _OUTLIER_RATE) * likelihood + _OUTLIER_RATE * likelihood.mean(axis=(0, 1))
    return np.asarray(np.log(np.maximum(mixed, 1e-300)))


def _log_prior(cameras: _Cameras) -> Floats:
    """Logarithm of the density (L, E, R) of cameras by the network's answer alone, up to a constant."""
    roll_std = float(np.clip(abs(cameras.prediction.camera_roll), *_ROLL_STD_RANGE))
    standardized = (_ELEVATION_OFFSETS / _ELEVATION_STD, _ROLL_OFFSETS / roll_std, cameras.log_lens / _LOG_LENS_STD)
    freedom = _DEGREES_OF_FREEDOM
    elevation, roll, lens = (-0.5 * (freedom + 1) * np.log1p(z**2 / freedom) for z in standardized)
    return np.asarray(lens[:, None, None] + elevation[:, None] + roll)


def _log_level_prior(roll: Floats) -> Floats:
    """Logarithm of the density (R,) of rolls [deg] by people's habit to hold cameras level, up to a constant."""
    return np.asarray(np.log1p(_LEVEL_ODDS * np.exp(-0.5 * (roll / _LEVEL_STD) ** 2)))


def _log_likelihood_of_horizontals(lines: _Lines, height: int, cameras: _Cameras, roll: float) -> Floats:
    """Logarithm of the likelihood (L, E) of lines in a picture `height` pixels tall, by cameras with a roll [deg]."""
    lines = lines.longest(_MAX_HORIZONTALS)
    level = level_in_camera(_HEADINGS[:, None, None], cameras.elevation, roll)
    bell = _squared_sines(lines, _in_picture(level, cameras.tan_half_fov[:, None]).reshape(3, -1))
    std = np.radians(np.hypot(_HORIZONTAL_STD, _SEGMENT_STD / lines.length)).astype(np.float32)[:, None]
    bell *= -0.5 / (std * std)
    np.exp(bell, out=bell)
    half = bell.shape[1] // 2
    density = bell[:, :half] + bell[:, half:]
    density *= 0.5 * _HORIZONTAL_SHARE / (math.sqrt(2 * math.pi) * std)
    density += np.float32((1 - _HORIZONTAL_SHARE) / math.pi)
    weight = (_HORIZONTAL_WEIGHT * np.sqrt(lines.length / height)).astype(np.float32)
    by_heading = (weight @ np.log(density, out=density)).reshape(-1, *cameras.elevation.shape)
    highest = by_heading.max(axis=0)
    return np.asarray(highest + np.log(np.exp(by_heading - highest).mean(axis=0)))


def _squared_sines(lines: _Lines, directions: Floats) -> Floats:
    """Squared sines (N, G) of the angles between lines and directions (3, G) in the picture, at the lines' middles."""
    x, y = lines.middle.T
    right, up, forward = d = directions.astype(np.float32)
    distance = lines.across.T.astype(np.float32) @ d
    distance *= distance
    parts = np.stack([right * right + up * up, forward * right, forward * up, forward * forward])
    by_middle = np.stack([np.ones_like(x), -2 * x, -2 * y, x * x + y * y], axis=1).astype(np.float32)
    length2 = by_middle @ parts
    distance /= np.maximum(length2, np.float32(1e-6), out=length2)
    return distance


def _log_likelihood_of_verticals(lines: _Lines, height: int, cameras: _Cameras) -> Floats:
    """Logarithm of the likelihood (L, E, R) of cameras by lines near vertical, in a picture `height` pixels tall."""
    lines = lines.longest(_MAX_VERTICALS)
    up = up_in_camera(cameras.elevation[..., None], cameras.roll)
    angle = _angles_to_verticals(lines, _in_picture(up, cameras.tan_half_fov[:, None, None]), cameras.prediction)
    std = np.hypot(_VERTICAL_STD, _SEGMENT_STD / lines.length).astype(np.float32)[:, None]
    angle /= std
    angle *= angle
    angle *= np.float32(-0.5)
    density = np.exp(angle, out=angle)
    density *= _VERTICAL_SHARE / (np.sqrt(2 * np.pi, dtype=np.float32) * std)
    density += np.float32((1 - _VERTICAL_SHARE) / _MAX_LEAN)
    weight = _VERTICAL_WEIGHT * np.sqrt(lines.length / height)
    log = weight @ np.log(density, out=density)
    return np.asarray(log.reshape(up.shape[1:]))


def _angles_to_verticals(lines: _Lines, verticals: Floats, prediction: Prediction) -> Floats:
    """Angles [deg] (N, G) of the lines from verticals (3, ...) at their middles.

    The verticals' lengths are those of the network's camera, from which the G cameras near it differ little.
    """
    x, y = lines.middle.T
    up = up_in_camera(prediction.camera_elevation, prediction.camera_roll)
    right, above, forward = _in_picture(up, _tan_half_fov(prediction))
    across = lines.across / np.hypot(right - x * forward, above - y * forward)
    return turn_to_degrees(across.T.astype(np.float32) @ verticals.reshape(3, -1).astype(np.float32))

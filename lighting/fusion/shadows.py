"""The sun's direction by shadows that a person marks in a photo.

Four marks are read, each a likelihood over the directions of the sun:

- a shadow on level ground, from the foot of what casts it to its tip: the sun's azimuth; with the thing's top, its
  elevation, too;
- the shadow of the camera itself, or of the head beside it: it lies opposite the sun;
- a line of shadow without a foot: the sun's azimuth, or the opposite one;
- a lit and a shaded side of an upright thing: half of all azimuths.

A person's hand and the estimated camera blur each of them to first order. Some marks are coarse: a guessed foot, a
leaning thing, a slope. Others are wrong altogether: another thing's shadow, the wrong end. So a share of each
likelihood is wider, and another one is the same everywhere.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.fusion.drawn_camera import MIN_DESCENT, ground_point
from lighting.fusion.marks import LitSide, OwnShadow, Point, Shadow, ShadowLine, ShadowMark, marked_points
from lighting.geometry import Floats, Pinhole, angles, pixel_ray, wrap_azimuth

# Fitted to the logarithmic loss of 105 marks, doubtful ones among them; 50 and 90 % regions of sure ones hold as much:
# `python -m export report shadows` prints it.
_HAND_STD = 0.0056  # of a marked point, as a share of the photo's longer side
_RATES = (0.2, 0.05)  # shares of marks that are coarse, and that are wrong altogether
_COARSE_STDS = 5.0  # widths of coarse marks by those of the others
_CAMERA_STD = (1.04, 1.12, 0.045)  # of the estimated camera: elevation, roll, deg; the field of view's tangent, a share
_AZIMUTH_STD, _ELEVATION_STD = 2.0, 2.0  # deg, of ground that is not quite level and things not quite upright
_OWN_STD = 2.5  # deg, of the camera's own shadow, whose middle has no mark
_HEAD_STD = 6.0  # deg of azimuth, of a head's shadow, which is not the camera's
_SIDE_STD = 12.0  # deg of azimuth over which a lit side turns to shade
_DOUBTED_RATES = (0.6, 0.2)  # those of doubted shadows
_BORDER_STD = 30.0  # deg of azimuth, by the border of a lit side
_SIDE_OUTLIER_RATE = 0.1  # share of lit sides that are wrong
_STEP = 1e-3  # of the numerical derivatives: deg, and shares


def shadow_likelihood(mark: ShadowMark, camera: Pinhole, directions: Floats) -> Floats:
    """Return how likely a mark is for each direction (N,) of the sun, up to a factor.

    Args:
        mark: in pixels of the camera's picture.
        camera: estimated; its azimuth is 0.
        directions: (N, 3) unit vectors towards the sun.

    Raises:
        ParameterError: a point of the ground lies at or over the horizon, or outside of the picture.
    """
    for x, y in marked_points(mark):
        if not (0 <= x <= camera.width and 0 <= y <= camera.height):
            size = f"{camera.width} x {camera.height}"
            sentence = f"The point {x:.0f},{y:.0f} of a shadow lies outside of the photo, which has {size} pixels."
            raise ParameterError(sentence, "shadows", ErrorCode.OUT_OF_RANGE)
    azimuth, elevation = angles(directions)
    match mark:
        case LitSide():
            return _side_likelihood(mark, camera, azimuth)
        case OwnShadow():
            return _own_likelihood(mark, camera, azimuth, elevation)
        case ShadowLine():
            value, std = _propagate(lambda c, p: _ground_azimuth(c, p[0], p[1]), camera, marked_points(mark))
            there, opposite = (wrap_azimuth(azimuth - value[0] - turn) for turn in (0.0, 180.0))
            variance = std[0, 0]
            return _mix(lambda n: (_gaussian(there, variance * n**2) + _gaussian(opposite, variance * n**2)) / 2, 360.0)
        case Shadow():
            return _shadow_likelihood(mark, camera, azimuth, elevation)


def implied_azimuth(mark: ShadowMark, camera: Pinhole) -> float | None:
    """Return the sun's azimuth [deg, -180 to 180] that a mark states; None where it leaves two or more open.

    Args:
        mark: in pixels of the camera's picture.
        camera: estimated; its azimuth is 0.
    """
    if isinstance(mark, OwnShadow):
        return float(angles(-pixel_ray(camera, mark.point))[0])
    return float(_ground_azimuth(camera, mark.foot, mark.tip)[0]) if isinstance(mark, Shadow) else None


def _shadow_likelihood(mark: Shadow, camera: Pinhole, azimuth: Floats, elevation: Floats) -> Floats:
    """Of a shadow with its foot."""
    rates = _DOUBTED_RATES if mark.is_doubted else _RATES
    points = marked_points(mark)
    if mark.top is None:
        value, covariance = _propagate(lambda c, p: _ground_azimuth(c, p[0], p[1]), camera, points)
        error = wrap_azimuth(azimuth - value[0])
        return _mix(lambda stds: _gaussian(error, covariance[0, 0] * stds**2), 360.0, rates)
    value, covariance = _propagate(lambda c, p: _sun_of_shadow(c, *p), camera, points)
    error = np.stack([wrap_azimuth(azimuth - value[0]), elevation - value[1]], axis=-1)
    squared = np.einsum("ni,ij,nj->n", error, np.linalg.inv(covariance), error)
    scale = 2 * math.pi * math.sqrt(np.linalg.det(covariance))
    return _mix(lambda stds: np.exp(-0.5 * squared / stds**2) / (scale * stds**2), 360.0 * 90.0, rates)


def _own_likelihood(mark: OwnShadow, camera: Pinhole, azimuth: Floats, elevation: Floats) -> Floats:
    """Of the camera's own shadow, which lies opposite the sun."""
    opposite = -pixel_ray(camera, mark.point)
    if opposite[1] < math.sin(math.radians(MIN_DESCENT)):
        raise ParameterError(_HORIZON, "shadows", ErrorCode.OUT_OF_RANGE)
    value, covariance = _propagate(lambda c, p: np.stack(angles(-pixel_ray(c, p[0]))), camera, [mark.point])
    variance = covariance[0, 0] + ((_HEAD_STD if mark.is_head else _OWN_STD) ** 2 - _AZIMUTH_STD**2)

    def by_azimuth(stds: float) -> Floats:
        return _gaussian(wrap_azimuth(azimuth - value[0]), variance * stds**2)

    if mark.is_head:
        return _mix(by_azimuth, 360.0)
    return _mix(lambda stds: by_azimuth(stds) * _gaussian(elevation - value[1], covariance[1, 1] * stds**2), 32400.0)


def _side_likelihood(mark: LitSide, camera: Pinhole, azimuth: Floats) -> Floats:
    """Of a lit side: the sun stands on that side of the line of sight, in depth as the border tells, or wherever."""
    shaded, lit = (angles(pixel_ray(camera, point))[0] for point in (mark.shaded, mark.lit))
    between, side = shaded + wrap_azimuth(lit - shaded) / 2, np.sign(wrap_azimuth(lit - shaded))
    if mark.border is None:
        beside = np.degrees(np.arcsin(np.sin(np.radians(azimuth - between)))) * side
        share = 1.0 / (1.0 + np.exp(-1.7 * beside / _SIDE_STD))
        return np.asarray((1 - _SIDE_OUTLIER_RATE) * share + _SIDE_OUTLIER_RATE / 2)
    across, beyond = np.subtract(mark.shaded, mark.lit), np.subtract(mark.border, mark.lit)
    lit_share = float(np.dot(beyond, across) / np.dot(across, across))
    if not 0 <= lit_share <= 1:
        sentence = "The border of light and shade lies between the two edges of a thing; mark it there."
        raise ParameterError(sentence, "shadows", ErrorCode.CONTRADICTION)
    from_behind = math.degrees(math.acos(2 * lit_share - 1))  # of the camera, as of a moon's phase
    error = wrap_azimuth(azimuth - between - 180.0 + side * from_behind)
    return np.asarray((1 - _SIDE_OUTLIER_RATE) * _gaussian(error, _BORDER_STD**2) + _SIDE_OUTLIER_RATE / 360.0)


_HORIZON = "A point of a shadow lies at the horizon or over it, where no ground is; mark a nearer shadow."


def _propagate(
    function: Callable[[Pinhole, Sequence[Point]], Floats], camera: Pinhole, points: Sequence[Point]
) -> tuple[Floats, Floats]:
    """The values (K,) of a function of camera and points [deg], and their covariance (K, K) [deg2] to first order."""
    hand = _HAND_STD * max(camera.width, camera.height)
    flat = np.array([*np.ravel(points), 0.0, 0.0, 0.0])
    stds = np.array([*(hand,) * (2 * len(points)), *_CAMERA_STD])
    steps = np.array([*(0.1,) * (2 * len(points)), *(_STEP,) * 3])

    def at(values: Floats) -> Floats:
        elevation, roll, log_tangent = values[-3:]
        half = math.atan(math.tan(math.radians(camera.vertical_fov / 2)) * math.exp(log_tangent))
        moved = replace(
            camera,
            vertical_fov=2 * math.degrees(half),
            elevation=camera.elevation + float(elevation),
            roll=camera.roll + float(roll),
        )
        return function(moved, [(float(x), float(y)) for x, y in values[:-3].reshape(-1, 2)])

    value = at(flat)
    columns = [
        wrap_azimuth(at(flat + step * unit) - at(flat - step * unit)) / (2 * step)
        for step, unit in zip(steps, np.eye(len(flat)), strict=True)
    ]
    scaled = np.stack(columns, axis=-1) * stds
    floor = np.diag(np.array([_AZIMUTH_STD, _ELEVATION_STD])[: len(value)] ** 2)
    return value, scaled @ scaled.T + floor


def _ground_azimuth(camera: Pinhole, foot: Point, tip: Point) -> Floats:
    """The azimuth (1,) [deg] from the tip of a shadow to its foot, which is the sun's."""
    base, end = (ground_point(camera, point, "shadows", _HORIZON) for point in (foot, tip))
    return np.atleast_1d(angles(base - end)[0])


def _sun_of_shadow(camera: Pinhole, foot: Point, tip: Point, top: Point) -> Floats:
    """The sun's azimuth and elevation (2,) [deg] of a shadow whose thing's top is seen."""
    base, end = (ground_point(camera, point, "shadows", _HORIZON) for point in (foot, tip))
    ray = pixel_ray(camera, top)
    level = base[0] * ray[0] + base[2] * ray[2]
    height = 1.0 + ray[1] * (base[0] ** 2 + base[2] ** 2) / level  # over the foot, where the ray passes above it
    shadow = math.hypot(end[0] - base[0], end[2] - base[2])
    return np.array([angles(base - end)[0], math.degrees(math.atan2(height, shadow))])


def _gaussian(error: Floats, variance: float) -> Floats:
    return np.asarray(np.exp(-0.5 * error**2 / variance) / math.sqrt(2 * math.pi * variance))


def _mix(density: Callable[[float], Floats], extent: float, rates: tuple[float, float] = _RATES) -> Floats:
    """A density, by how many times its widths, with coarse marks and wrong ones anywhere in the extent [deg, deg2]."""
    coarse_rate, outlier_rate = rates
    fine, coarse = 1 - coarse_rate - outlier_rate, coarse_rate * density(_COARSE_STDS)
    return np.asarray(fine * density(1.0) + coarse + outlier_rate / extent)


def fuse_shadows(
    probability: NDArray[np.float32], marks: Sequence[ShadowMark], camera: Pinhole, cells: Floats
) -> NDArray[np.float32]:
    """Return the sun's probabilities (N,) by the pixels and by what a person marked.

    Args:
        probability: (N,) by the pixels, sums to 1.
        marks: in pixels of the camera's picture.
        camera: estimated; its azimuth is 0.
        cells: (N, 3) unit vectors.

    Raises:
        ParameterError: a mark says nothing, see `shadow_likelihood`.
    """
    fused = np.asarray(probability, dtype=np.float64)
    for mark in marks:
        fused = fused * shadow_likelihood(mark, camera, cells)
    return np.asarray(fused / fused.sum(), dtype=np.float32)

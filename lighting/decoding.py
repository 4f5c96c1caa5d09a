"""Decode the network's answer: one direction with radii from a distribution, and a Lighting from a prediction."""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.circular import MODE_SMOOTHING, MODE_WIDTH, best_angle
from lighting.geometry import Floats, angles, direction, wrap_azimuth
from lighting.ranges import RANGES
from lighting.records import EvidenceKind, Lighting, Prediction, SunEstimate, significant
from lighting.strength import strength_of
from lighting.sun_grid import grid_directions, radii

_LIKELIEST = 64  # the likeliest cells; only they may be the answer, so that it never lies between two modes
_LIKELY = 0.05  # least probability of such a cell, as a share of the likeliest cell's
_WRONG = 60.0  # deg; larger errors count as this one. 45 gave the same accuracy on unseen places
_REFINED = 25.0  # deg around the best cell over which the answer is averaged
_TARGET = 4.0  # deg, spread of the lobes around true suns that networks are trained to say


def sun_of(prediction: Prediction) -> SunEstimate:
    """The sun's direction and radii by the network's distribution alone."""
    grid = prediction.spec.sun_grid
    sun = best_guess(prediction.sun_probability, grid)
    azimuth, elevation = angles(sun)
    radius_50, radius_90 = radii(prediction.sun_probability, grid_directions(grid), sun)
    return SunEstimate(float(azimuth), float(elevation), radius_50, radius_90)


def said_elevation(prediction: Prediction) -> float:
    """The sun's elevation [deg] by the pixels alone."""
    return float(angles(best_guess(prediction.sun_probability, prediction.spec.sun_grid))[1])


def lighting_from(prediction: Prediction, sun: SunEstimate | None = None) -> Lighting:
    """The Lighting of a prediction, with every value clipped to its range.

    `sun` is the sun's direction by all evidence; without it, the direction is that of the network's distribution.
    """
    where = sun or sun_of(prediction)
    strength = strength_of(prediction.light, prediction.sun_visibility) if prediction.light else None
    return Lighting(
        sun_azimuth=_clipped("sun_azimuth", where.azimuth),
        sun_elevation=_clipped("sun_elevation", where.elevation),
        sun_visibility=_clipped("sun_visibility", prediction.sun_visibility),
        radius_50=_clipped("radius_50", where.radius_50),
        radius_90=_clipped("radius_90", where.radius_90),
        turbidity=_clipped("turbidity", prediction.turbidity),
        exposure=_clipped("exposure", prediction.exposure),
        camera_elevation=_clipped("camera_elevation", prediction.camera_elevation),
        camera_roll=_clipped("camera_roll", prediction.camera_roll),
        vertical_fov=_clipped("vertical_fov", prediction.vertical_fov),
        sun_irradiance=strength.sun_irradiance if strength else None,
        sky_irradiance=strength.sky_irradiance if strength else None,
        sky_cover=strength.sky_cover if strength else None,
        suitable=strength.suitable if strength else None,
        model_name=prediction.spec.name,
        model_version=prediction.spec.version,
        evidence=(EvidenceKind.PIXELS,),
    )


def _clipped(name: str, value: float) -> float:
    """The value as records hold it, clipped to its range in RANGES."""
    return significant(float(np.clip(value, *RANGES[name])))


def best_guess(probability: ArrayLike, layout: str) -> Floats:
    """The sun's direction (3,) for probabilities (N,) of a layout's cells.

    Of the likeliest cells it takes the one with the least expected error. Errors over 60 deg count as 60 deg, because
    an unbounded error would pull the answer between two modes, where no sun is likely. The weighted mean of the cells
    within 25 deg of that cell then removes the error of the grid. Near the horizon that mean stands too high.
    """
    p = np.asarray(probability, dtype=np.float64)
    cells = grid_directions(layout)
    likely = np.argpartition(p, -min(_LIKELIEST, len(p)))[-_LIKELIEST:]
    likely = likely[p[likely] >= _LIKELY * p.max()]
    centre = cells[likely[int(np.argmin(_bounded_errors(layout)[likely] @ p.astype(np.float32)))]]
    near = p * (cells @ centre >= np.cos(np.radians(_REFINED)))
    azimuth, elevation = angles(near @ cells)
    return direction(azimuth, np.interp(elevation, *_lifted()))


@lru_cache(maxsize=1)
def _lifted() -> tuple[Floats, Floats]:
    """Mean elevations [deg] of the lobes that networks are trained to say, and the elevations of their suns.

    The horizon cuts the lobes off: the mean of a normal distribution that is cut off so, for a sun on the horizon 3.2.
    """
    sun = np.append(np.arange(0.0, 5.0, 0.25) * _TARGET, 90.0)
    kept = [0.5 * (1.0 + math.erf(math.sqrt(0.5) * e / _TARGET)) for e in sun]
    density = np.exp(-0.5 * (sun / _TARGET) ** 2) / math.sqrt(2.0 * math.pi)
    return sun + _TARGET * density / np.array(kept), sun


@lru_cache(maxsize=8)
def _bounded_errors(layout: str) -> NDArray[np.float32]:
    """Angles [deg] (N, N) between cells, at most _WRONG."""
    cells = grid_directions(layout).astype(np.float32)
    cosine = np.clip(cells @ cells.T, np.float32(-1), np.float32(1))
    return np.asarray(np.minimum(np.degrees(np.arccos(cosine)), np.float32(_WRONG)))


def sun_on_rings(directions: Floats, probability: Floats) -> SunEstimate:
    """The sun's direction and radii by probabilities (N,) of unit vectors (N, 3) that lie on few rings of elevation.

    Azimuth and elevation are averaged separately, because the mean vector of a ring lies above the ring.
    """
    azimuth, elevation = angles(directions)
    best = best_angle(azimuth, probability)
    near = probability * (np.abs(wrap_azimuth(azimuth - best)) <= MODE_WIDTH)
    near = near * (np.abs(elevation - _likeliest_ring(elevation, near)) <= MODE_WIDTH)
    centre_elevation = float(near @ elevation / near.sum())
    centre = direction(best, centre_elevation)
    radius_50, radius_90 = radii(probability, directions, centre)
    return SunEstimate(best, centre_elevation, radius_50, radius_90)


def _likeliest_ring(elevation: Floats, probability: Floats) -> float:
    """The elevation [deg], one of those given (N,), around which most of the probability (N,) lies."""
    rings, member = np.unique(np.round(elevation, 6), return_inverse=True)
    kernel = np.exp(-0.5 * ((rings[:, None] - rings) / MODE_SMOOTHING) ** 2)
    return float(rings[np.argmax(kernel @ np.bincount(member, probability))])

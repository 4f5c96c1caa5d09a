"""The network's answer decoded: one direction and its radii of a distribution, and a Lighting of a prediction."""

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.circular import MODE_SMOOTHING, MODE_WIDTH, best_angle
from lighting.geometry import Floats, angles, direction, wrap_azimuth
from lighting.records import RANGES, Lighting, Prediction, SunEstimate
from lighting.sun_grid import grid_directions, radii

_CANDIDATES = 64  # cells that may be the answer, the likeliest: it is where suns are likely, not between
_LIKELY = 0.05  # of the likeliest cell's probability, the least that a candidate has
_WRONG = 60.0  # deg beyond which errors count alike; on crops of unseen places 45 does as well
_REFINED = 25.0  # deg around the best cell over which the answer is averaged


def sun_of(prediction: Prediction) -> SunEstimate:
    """Where the pixels alone put the sun."""
    grid = prediction.spec.sun_grid
    sun = best_guess(prediction.sun_probability, grid)
    azimuth, elevation = angles(sun)
    radius_50, radius_90 = radii(prediction.sun_probability, grid_directions(grid), sun)
    return SunEstimate(float(azimuth), float(elevation), radius_50, radius_90)


def lighting_from(prediction: Prediction, sun: SunEstimate | None = None) -> Lighting:
    """What the user gets of what the network said: every value inside its range.

    The sun is where the pixels put it, unless `sun` says where all evidence together puts it.
    """
    where = sun or sun_of(prediction)
    values = {
        "sun_azimuth": where.azimuth,
        "sun_elevation": where.elevation,
        "sun_visibility": prediction.sun_visibility,
        "radius_50": where.radius_50,
        "radius_90": where.radius_90,
        "turbidity": prediction.turbidity,
        "exposure": prediction.exposure,
        "camera_elevation": prediction.camera_elevation,
        "camera_roll": prediction.camera_roll,
        "vertical_fov": prediction.vertical_fov,
    }
    inside: dict[str, Any] = {
        name: _significant(float(np.clip(value, *RANGES[name]))) for name, value in values.items()
    }
    spec = prediction.spec
    return Lighting(**inside, model_name=spec.name, model_version=spec.version, evidence=("pixels",))


def _significant(value: float) -> float:
    return float(f"{value:.6g}")


def best_guess(probability: ArrayLike, layout: str) -> Floats:
    """The sun's direction (3,) of probabilities (N,): of the likeliest cells the one expected to err least, refined.

    An error beyond 60 deg counts as 60: a sun far off is wrong however far, or the answer would drift to where no sun
    is likely. The average over 25 deg around the cell removes the grid's own error.
    """
    p = np.asarray(probability, dtype=np.float64)
    cells = grid_directions(layout)
    likely = np.argpartition(p, -min(_CANDIDATES, len(p)))[-_CANDIDATES:]
    likely = likely[p[likely] >= _LIKELY * p.max()]
    centre = cells[likely[int(np.argmin(_bounded_errors(layout)[likely] @ p.astype(np.float32)))]]
    near = p * (cells @ centre >= np.cos(np.radians(_REFINED)))
    mean = near @ cells
    return np.asarray(mean / np.linalg.norm(mean))


@lru_cache(maxsize=8)
def _bounded_errors(layout: str) -> NDArray[np.float32]:
    """Angles [deg] (N, N) between cells, none beyond _WRONG."""
    cells = grid_directions(layout).astype(np.float32)
    cosine = np.clip(cells @ cells.T, np.float32(-1), np.float32(1))
    return np.asarray(np.minimum(np.degrees(np.arccos(cosine)), np.float32(_WRONG)))


def sun_on_rings(directions: Floats, probability: Floats) -> SunEstimate:
    """Where a distribution (N,) over suns (N, 3) of few elevations puts the sun.

    Azimuth and elevation are averaged apart: the mean of the vectors of one ring would lie above the ring.
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

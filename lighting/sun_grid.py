"""The grid of directions over which the network predicts the sun's probability; shared with training.

A layout name identifies a grid; it is stored in the model's metadata:

- ``fibonacci:N``: N directions of equal solid angle over the upper hemisphere, on a golden spiral.
- ``rings:ExA``: E elevations times A azimuths, the bins of Hold-Geoffroy et al. (CVPR 2017) with 5x32.

Cells belong to the upper hemisphere: a sun is at or above the horizon.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ModelError
from lighting.geometry import Floats, angle_between, direction

_GOLDEN_ANGLE = 180.0 * (3.0 - 5.0**0.5)  # degrees
_SMOOTHING = 200.0  # von Mises-Fisher concentration (4 deg) of densities between cells


def grid_directions(layout: str) -> Floats:
    """Unit vectors (N, 3) of the cells of a layout; raises ModelError for an unknown one."""
    return _grid(layout)[0]


def grid_solid_angle(layout: str) -> Floats:
    """Solid angle [sr] of each cell (N,); sums to 2 pi."""
    return _grid(layout)[1]


@lru_cache(maxsize=8)
def _grid(layout: str) -> tuple[Floats, Floats]:
    """Directions and solid angles, which are everybody's and nobody's to change."""
    found = _cells(layout)
    for array in found:
        array.flags.writeable = False
    return found


def _cells(layout: str) -> tuple[Floats, Floats]:
    kind, _, size = layout.partition(":")
    counts = [int(count) if count.isdecimal() else 0 for count in size.split("x")]
    if min(counts) > 0:
        match kind, counts:
            case "fibonacci", [cells]:
                return _fibonacci(cells)
            case "rings", [elevations, azimuths]:
                return _rings(elevations, azimuths)
    raise ModelError(f"The sun grid layout {layout!r} is not known; expected 'fibonacci:N' or 'rings:ExA'.")


def _fibonacci(count: int) -> tuple[Floats, Floats]:
    index = np.arange(count)
    elevation = np.degrees(np.arcsin(1.0 - (index + 0.5) / count))
    return direction(index * _GOLDEN_ANGLE, elevation), np.full(count, 2 * np.pi / count)


def _rings(elevations: int, azimuths: int) -> tuple[Floats, Floats]:
    edges = np.linspace(0.0, 90.0, elevations + 1)
    centres = (edges[1:] + edges[:-1]) / 2
    azimuth = ((np.arange(azimuths) + 0.5) / azimuths - 0.5) * 360.0
    height = np.diff(np.sin(np.radians(edges)))
    cells = direction(azimuth[None, :], centres[:, None]).reshape(-1, 3)
    return cells, np.repeat(height * 2 * np.pi / azimuths, azimuths)


def soft_label(direction: ArrayLike, concentration: ArrayLike, layout: str) -> Floats:
    """Target probabilities (..., N): a von Mises-Fisher lobe around directions (..., 3), normalised over the cells.

    `concentration` (...) is kappa; CVPR 2017 uses 80, about 6.4 deg of standard deviation per axis.
    """
    cosine = np.asarray(direction) @ grid_directions(layout).T
    weight = np.exp(np.asarray(concentration)[..., None] * (cosine - 1.0)) * grid_solid_angle(layout)
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))


def credible_radii(
    probability: ArrayLike, directions: ArrayLike, centre: ArrayLike, shares: Sequence[float] = (0.5, 0.9)
) -> list[float]:
    """Angles [deg] around `centre` (3,) that hold `shares` of the probability (N,) of directions (N, 3)."""
    reach, held = cumulative_by_angle(probability, directions, centre)
    return list(map(float, np.interp(shares, held, reach)))


def cumulative_by_angle(probability: ArrayLike, directions: ArrayLike, centre: ArrayLike) -> tuple[Floats, Floats]:
    """Sorted angles [deg] (N + 1,) around `centre` (3,), from 0, and the share of the probability (N,) within each."""
    p = np.asarray(probability, dtype=np.float64)
    distance = angle_between(directions, centre)
    order = np.argsort(distance)
    held = np.cumsum(p[order]) / p.sum()
    return np.concatenate([[0.0], distance[order]]), np.concatenate([[0.0], held])


def nearest_cell_density(probability: ArrayLike, direction: ArrayLike, layout: str) -> Floats:
    """Probability density [1/sr] at directions (..., 3) of probabilities (..., N): that of the nearest cell."""
    cell = np.argmax(np.asarray(direction) @ grid_directions(layout).T, axis=-1)
    at = np.take_along_axis(np.asarray(probability), cell[..., None], axis=-1)[..., 0]
    return np.asarray(at / grid_solid_angle(layout)[cell])


def splat_to_grid(probability: ArrayLike, directions: ArrayLike, layout: str) -> Floats:
    """Probabilities (N,) of the cells from those (M,) of directions (M, 3), each spread over the cells by 4 deg."""
    if np.array_equal(directions, grid_directions(layout)):
        return np.asarray(probability)
    return np.asarray(np.asarray(probability) @ soft_label(directions, _SMOOTHING, layout))


def smooth_density(probability: ArrayLike, direction: ArrayLike, layout: str) -> Floats:
    """Probability density [1/sr] (...) at directions (..., 3) of probabilities (N,), smooth between the cells.

    The densities of the cells are averaged with von Mises-Fisher weights of 4 deg, so that a uniform sky stays
    exactly uniform down to the horizon.
    """
    cosine = np.asarray(direction, dtype=np.float32) @ grid_directions(layout).T.astype(np.float32)
    kernel = np.exp(np.float32(_SMOOTHING) * (cosine - np.float32(1.0)))
    held, area = np.moveaxis(kernel @ np.stack([probability, grid_solid_angle(layout)], -1).astype(np.float32), -1, 0)
    return np.asarray(held / area, dtype=np.float64)

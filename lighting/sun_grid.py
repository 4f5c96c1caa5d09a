"""The grid of directions over which the network predicts the sun's probability; shared with training.

A layout name identifies a grid; it is stored in the model's metadata:

- ``fibonacci:N``: N directions of equal solid angle over the upper hemisphere, on a golden spiral.
- ``rings:ExA``: E elevations times A azimuths, the bins of [1] with 5x32.

Cells belong to the upper hemisphere: a sun is at or above the horizon.

Circular statistics of azimuths are here, too: von Mises, circular mean and mode, weighted median.

References:
    [1] Hold-Geoffroy et al., Deep Outdoor Illumination Estimation, CVPR 2017.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ModelError
from lighting.geometry import Floats, angle_between, angles, direction, turn_to_degrees, wrap_azimuth

_GOLDEN_ANGLE = 180.0 * (3.0 - 5.0**0.5)  # deg
_SMOOTHING = 200.0  # von Mises-Fisher concentration (4 deg) of densities between cells

_CANDIDATE_CELLS = 64  # the likeliest; only they may be the answer, so that it never lies between two modes
_MIN_CANDIDATE_SHARE = 0.05  # least probability of such a cell, as a share of the likeliest cell's
_MAX_ERROR = 45.0  # deg; larger errors count as this one
_REFINEMENT_ANGLE = 40.0  # deg from the best cell, at which the biweight of the answer's mean has fallen to 0
_HIGH_ELEVATION = 55.0  # deg, over which a broad answer is too high
_NEAR_ANGLE = 25.0  # deg from the best cell; the probability within says how broad the answer is
_CANDIDATE_SUNS = 3
_CANDIDATE_SEPARATION = 40.0  # deg, least angle between two of them
_CANDIDATE_RADIUS = 22.5  # deg about one of them, within which it is right
_BLOCK_ROWS = 128  # of a matrix of directions and cells
_MIN_CANDIDATE_SUN = 0.05  # least share of the probability of the second and third
_TARGET_STD = 4.0  # deg, of the lobes about true suns that networks are trained to predict


def grid_directions(layout: str) -> Floats:
    """Unit vectors (N, 3) of the cells; read-only.

    Args:
        layout: "fibonacci:N" or "rings:ExA".

    Raises:
        ModelError: the layout is unknown.
    """
    return _grid(layout)[0]


def grid_solid_angle(layout: str) -> Floats:
    """Solid angle [sr] of each cell (N,), 2 pi in sum; read-only.

    Args:
        layout: "fibonacci:N" or "rings:ExA".
    """
    return _grid(layout)[1]


@lru_cache(maxsize=8)
def _grid(layout: str) -> tuple[Floats, Floats]:
    """Directions and solid angles, shared by all and therefore read-only."""
    cells = _cells(layout)
    for array in cells:
        array.flags.writeable = False
    return cells


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
    centers = (edges[1:] + edges[:-1]) / 2
    azimuth = ((np.arange(azimuths) + 0.5) / azimuths - 0.5) * 360.0
    height = np.diff(np.sin(np.radians(edges)))
    cells = direction(azimuth[None, :], centers[:, None]).reshape(-1, 3)
    return cells, np.repeat(height * 2 * np.pi / azimuths, azimuths)


def soft_label(direction: ArrayLike, concentration: ArrayLike, layout: str) -> Floats:
    """Target probabilities (..., N): a von Mises-Fisher lobe about a direction, normalized over the cells.

    Args:
        direction: (..., 3) unit vectors.
        concentration: (...) kappa; CVPR 2017 [1] uses 80, about 6.4 deg of standard deviation per axis.
        layout: of the grid.
    """
    cosine = np.asarray(direction) @ grid_directions(layout).T
    weight = np.exp(np.asarray(concentration)[..., None] * (cosine - 1.0)) * grid_solid_angle(layout)
    return np.asarray(weight / weight.sum(axis=-1, keepdims=True))


def temper(probability: NDArray[np.float32], temperature: float) -> NDArray[np.float32]:
    """Return probabilities (N,) whose logarithms are divided by a temperature: over 1 they are wider.

    Args:
        probability: (N,), sums to 1.
        temperature: above 0.
    """
    power = probability.astype(np.float64) ** (1.0 / temperature)
    return np.asarray(power / power.sum(), dtype=np.float32)


def credible_radii(
    probability: ArrayLike, directions: ArrayLike, center: ArrayLike, shares: Sequence[float] = (0.5, 0.9)
) -> list[float]:
    """Angles [deg] from a center that hold shares of the probability.

    Args:
        probability: (N,) of each direction.
        directions: (N, 3) unit vectors.
        center: (3,) unit vector.
        shares: 0 to 1, ascending.
    """
    angle, cumulative = cumulative_by_angle(probability, directions, center)
    return list(map(float, np.interp(shares, cumulative, angle)))


def cumulative_by_angle(probability: ArrayLike, directions: ArrayLike, center: ArrayLike) -> tuple[Floats, Floats]:
    """Sorted angles [deg] (N + 1,) from a center, from 0, and the share of the probability within each.

    Args:
        probability: (N,) of each direction.
        directions: (N, 3) unit vectors.
        center: (3,) unit vector.
    """
    p = np.asarray(probability, dtype=np.float64)
    distance = angle_between(directions, center)
    order = np.argsort(distance)
    cumulative = np.cumsum(p[order]) / p.sum()
    return np.concatenate([[0.0], distance[order]]), np.concatenate([[0.0], cumulative])


def nearest_cell_density(probability: ArrayLike, direction: ArrayLike, layout: str) -> Floats:
    """Probability density [1/sr] (...) at directions: that of the nearest cell.

    Args:
        probability: (..., N) of the cells.
        direction: (..., 3) unit vectors.
        layout: of the grid.
    """
    cell = np.argmax(np.asarray(direction) @ grid_directions(layout).T, axis=-1)
    at_cell = np.take_along_axis(np.asarray(probability), cell[..., None], axis=-1)[..., 0]
    return np.asarray(at_cell / grid_solid_angle(layout)[cell])


def smooth_density(probability: ArrayLike, direction: ArrayLike, layout: str) -> Floats:
    """Probability density [1/sr] (...) at directions, smooth between the cells.

    The densities of the cells are averaged with von Mises-Fisher weights of 4 deg, so that a uniform sky stays
    exactly uniform down to the horizon.

    Args:
        probability: (N,) of the cells.
        direction: (..., 3) unit vectors.
        layout: of the grid.
    """
    cosine = np.asarray(direction, dtype=np.float32) @ grid_directions(layout).T.astype(np.float32)
    cosine -= np.float32(1.0)
    cosine *= np.float32(_SMOOTHING)
    kernel = np.exp(cosine, out=cosine)
    mass, area = np.moveaxis(kernel @ np.stack([probability, grid_solid_angle(layout)], -1).astype(np.float32), -1, 0)
    return np.asarray(mass / area, dtype=np.float64)


def splat_to_grid(probability: ArrayLike, directions: ArrayLike, layout: str) -> Floats:
    """Probabilities (N,) of the cells from those of directions, each spread over the cells by 4 deg.

    Args:
        probability: (M,) of each direction.
        directions: (M, 3) unit vectors.
        layout: of the grid.
    """
    if np.array_equal(directions, grid_directions(layout)):
        return np.asarray(probability)
    return np.asarray(np.asarray(probability) @ soft_label(directions, _SMOOTHING, layout))


# The answer of a distribution: one direction.


def bayes_direction(probability: ArrayLike, layout: str) -> Floats:
    """The sun's direction (3,), a Bayes estimate under bounded errors.

    Of the likeliest cells it takes the one with the least expected error. Errors over 45 deg count as 45 deg, because
    an unbounded error would pull the answer between two modes, where no sun is likely. The mean of the cells about
    that cell, with the biweight [1], then removes the error of the grid. Near the horizon that mean is too high. High
    in the sky it is too high where the distribution is broad. So what it has over 55 deg shrinks to the share of the
    probability near that cell.

    Args:
        probability: (N,) of the cells.
        layout: of the sun grid.

    References:
        [1] Beaton and Tukey, The Fitting of Power Series, Technometrics 1974.
    """
    p = np.asarray(probability, dtype=np.float64)
    cells, lobes = grid_directions(layout), _lobe_elevations()
    candidates = np.argpartition(p, -min(_CANDIDATE_CELLS, len(p)))[-_CANDIDATE_CELLS:]
    candidates = candidates[p[candidates] >= _MIN_CANDIDATE_SHARE * p.max()]
    center = candidates[int(np.argmin(_bounded_errors(cells[candidates], cells) @ p.astype(np.float32)))]
    distance = angle_between(cells, cells[center])
    biweight = np.maximum(1.0 - (distance / _REFINEMENT_ANGLE) ** 2, 0.0) ** 2
    azimuth, elevation = angles((p * biweight) @ cells)
    elevation = np.interp(elevation, *lobes)
    near = p[distance <= _NEAR_ANGLE].sum() / p.sum()
    return direction(azimuth, elevation - (1.0 - near) * max(elevation - _HIGH_ELEVATION, 0.0))


def likeliest_suns(answer: Floats, probability: ArrayLike, directions: Floats, layout: str) -> tuple[Floats, Floats]:
    """Directions (K, 3) of up to three suns, the answer first, and the share (K,) of the probability nearest to each.

    Each further one has the most probability within 22.5 deg, of all directions 40 deg or more from those before it.
    One that is nearest to less than 5 % is left out.

    Args:
        answer: (3,) unit vector.
        probability: (N,) of the cells.
        directions: (M, 3) unit vectors that a sun may have: the cells, or rings of known elevation.
        layout: of the grid of the cells.
    """
    p, cells = np.asarray(probability, dtype=np.float32), grid_directions(layout)
    near = _near_cells(layout) if directions is cells else _are_near(directions, cells)
    mass, suns = np.concatenate([near[part] @ p for part in row_blocks(len(near))]), answer[None]
    while len(suns) < _CANDIDATE_SUNS:
        mass = np.where(directions @ suns[-1] > math.cos(math.radians(_CANDIDATE_SEPARATION)), -1.0, mass)
        more = np.vstack([suns, directions[np.argmax(mass)]])
        if mass.max() <= 0 or _nearest_shares(p, cells, more)[-1] < _MIN_CANDIDATE_SUN:
            break
        suns = more
    return suns, _nearest_shares(p, cells, suns)


def _nearest_shares(probability: NDArray[np.float32], cells: Floats, suns: Floats) -> Floats:
    shares = np.bincount(np.argmax(cells @ suns.T, axis=1), probability, len(suns))
    return np.asarray(shares / shares.sum())


@lru_cache(maxsize=2)
def _near_cells(layout: str) -> NDArray[np.bool_]:
    return _are_near(grid_directions(layout), grid_directions(layout))


def _are_near(directions: Floats, cells: Floats) -> NDArray[np.bool_]:
    """Where a cell (N,) lies within 22.5 deg of a direction (M,)."""
    rows, columns = directions.astype(np.float32), cells.astype(np.float32).T
    near = np.empty((len(rows), len(cells)), dtype=bool)
    for part in row_blocks(len(rows)):
        np.greater_equal(rows[part] @ columns, np.float32(math.cos(math.radians(_CANDIDATE_RADIUS))), out=near[part])
    return near


def row_blocks(rows: int) -> Iterator[slice]:
    """Return parts of a matrix that stay in the processor's cache: fresh memory costs more than the sums.

    Args:
        rows: of the matrix, 0 or more.
    """
    return (slice(start, start + _BLOCK_ROWS) for start in range(0, rows, _BLOCK_ROWS))


@lru_cache(maxsize=1)
def _lobe_elevations() -> tuple[Floats, Floats]:
    """Mean elevations [deg] of the lobes that networks are trained to predict, and the elevations of their suns.

    The horizon cuts the lobes off: the mean of a normal distribution that is cut off so, for a sun on the horizon 3.2.
    """
    sun = np.append(np.arange(0.0, 5.0, 0.25) * _TARGET_STD, 90.0)
    kept = [0.5 * (1.0 + math.erf(math.sqrt(0.5) * e / _TARGET_STD)) for e in sun]
    density = np.exp(-0.5 * (sun / _TARGET_STD) ** 2) / math.sqrt(2.0 * math.pi)
    return sun + _TARGET_STD * density / np.array(kept), sun


def _bounded_errors(directions: Floats, cells: Floats) -> NDArray[np.float32]:
    """Angles [deg] (C, N) between directions (C, 3) and cells (N, 3), at most _MAX_ERROR."""
    cosine = np.clip(directions.astype(np.float32) @ cells.astype(np.float32).T, np.float32(-1), np.float32(1))
    error = turn_to_degrees(np.arccos(cosine, out=cosine))
    return np.asarray(np.minimum(error, np.float32(_MAX_ERROR), out=error))


# Circular statistics.

HEADINGS = np.arange(360.0)  # deg clockwise from true north
MODE_WIDTH = 25.5  # deg about the strongest mode over which the decoding averages: 25 bins to either side
MODE_SMOOTHING = 15.0  # deg, standard deviation of the kernel that finds the strongest mode


@dataclass(frozen=True, eq=False)
class Heading:
    """A camera's heading, deg clockwise."""

    probability: Floats
    """(360,) of the one-degree bins at HEADINGS, sums to 1."""
    best: float
    """Deg, 0 to 360."""
    radius_50: float
    """Deg to either side of `best` that hold 50 % of the probability."""
    radius_90: float
    """Deg, the same of 90 %."""


def von_mises(angle: ArrayLike, std: float) -> Floats:
    """A von Mises curve (...), 1 at angle 0.

    Args:
        angle: (...) deg.
        std: deg, from 0.1; the concentration is its inverse square.
    """
    concentration = math.radians(max(std, 0.1)) ** -2
    return np.asarray(np.exp(concentration * (np.cos(np.radians(angle)) - 1.0)))


def blur_headings(density: Floats, std: float) -> Floats:
    """Densities (..., 360) over HEADINGS after a von Mises error.

    Args:
        density: (..., 360) over HEADINGS.
        std: deg, of the error.
    """
    kernel = von_mises(HEADINGS, std)
    return circular_correlation(density, kernel / kernel.sum())


def circular_correlation(a: Floats, b: Floats) -> Floats:
    """Circular correlation along the last axis: entry d sums a[i + d] b[i]; never below zero.

    Args:
        a: (..., N).
        b: (..., N).
    """
    product = np.fft.rfft(a) * np.conj(np.fft.rfft(b))
    return np.maximum(np.fft.irfft(product, a.shape[-1]), 0.0)


def circular_mean(angle: ArrayLike) -> float:
    """The direction [deg, -180 to 180] of the sum of unit vectors.

    Args:
        angle: (N,) deg.
    """
    vectors = np.exp(1j * np.radians(np.asarray(angle, dtype=np.float64)))
    return float(np.degrees(np.angle(vectors.sum())))


def circular_mode(angle: Floats, probability: Floats) -> float:
    """The strongest mode [deg, -180 to 180] of a distribution: the mean near the peak.

    Args:
        angle: (N,) deg.
        probability: (N,) of each.
    """
    histogram = np.bincount(np.round(angle).astype(int) % 360, probability, 360).astype(np.float64)
    peak = np.argmax(blur_headings(histogram, MODE_SMOOTHING))
    offset = wrap_azimuth(angle - peak)
    near = probability * (np.abs(offset) <= MODE_WIDTH)
    return float(wrap_azimuth(peak + near @ offset / near.sum()))


def heading_from_probability(probability: Floats) -> Heading:
    """The best heading and the credible radii of a distribution.

    Args:
        probability: (360,) over HEADINGS, sums to 1.
    """
    best = circular_mode(HEADINGS, probability) % 360.0
    radius_50, radius_90 = credible_radii(probability, direction(HEADINGS, 0.0), direction(best, 0.0))
    return Heading(probability, best, radius_50, radius_90)


def weighted_median(value: Floats, weight: Floats) -> float:
    """The least of the values up to which half of the weight lies; NaN if there are none.

    Args:
        value: (N,).
        weight: (N,) of each, from 0.
    """
    if not len(value):
        return float("nan")
    order = np.argsort(value)
    share = np.cumsum(weight[order]) / weight.sum()
    return float(value[order][np.searchsorted(share, 0.5)])

"""Distributions rotated, blurred, pooled (logarithmic opinion pool).

The errors of two views correlate by a number FAR where they share nothing and by 1 where they show the same; in
between by the square of the overlap. A view counts by one over the sum of its correlations with all, itself included;
that is the weight of the best linear mean where all correlate alike. In a share of cases, though, one thing misleads
all views, and then they say no more than one does: the answer is a mixture of both products. Without it, a few places
where all views err would have to be paid for by too wide regions everywhere. `export report photo-sets overlap` fits
both numbers of SUN; those of AZIMUTH were chosen by the same loss on rings, on 160 panoramas of the same places.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lighting.circular import HEADINGS, blur_headings
from lighting.geometry import Floats, angle_between, angles, direction
from lighting.records import Prediction
from lighting.sun_grid import grid_directions, grid_solid_angle, smooth_density

# How much each of several views counts: those that overlap see the same evidence, and at times all err alike.

_MAX_OVERLAP_FOVS = 1.25  # vertical fields of view between two optical axes from which views share nothing
SUN_MOTION_SCALE = 30.0  # deg of the sun's motion after which the same view is another witness


@dataclass(frozen=True)
class Correlation:
    """Of the errors of views."""

    without_overlap: float  # of two views that share nothing, 0 to 1
    outlier_rate: float  # share of cases in which all views say no more than one, 0 to 1


SUN_CORRELATION = Correlation(0.05, 0.15)  # of the sun's distribution in one frame
AZIMUTH_CORRELATION = Correlation(0.0, 0.05)  # of its azimuth at a known elevation


def effective_weights(
    ahead: Floats,
    vertical_fov: Floats,
    correlation: Correlation,
    likeness: Floats | float = 1.0,
    present: Floats | None = None,
) -> Floats:
    """How much each of n views counts (n,), 0 to 1, by their optical axes (n, 3) and fields of view (n,) [deg].

    `likeness` (n, n) is how alike their light is, 0 to 1: the same view under another sun is another witness.
    `present` (n,) is how far each is there at all, 0 to 1.
    """
    shared = np.square(_overlap(ahead, vertical_fov)) * likeness
    matrix = correlation.without_overlap + (1.0 - correlation.without_overlap) * shared
    np.fill_diagonal(matrix, 0.0)
    there = np.ones(len(ahead)) if present is None else present
    return np.asarray(there / (1.0 + matrix @ there))


def pooling_exponent(count: int, correlation: float) -> float:
    """Exponent of each of `count` distributions whose errors correlate."""
    return 1.0 / (1.0 + (count - 1) * correlation)


def pool_log_likelihoods(log: Floats, share: Floats, correlation: Correlation, area: Floats | float = 1.0) -> Floats:
    """Probabilities (...), 1 in sum, of cells of some area (...) by log densities (n, ...) of views that count (n,)."""
    apart, alike = (_product(log, exponent, area) for exponent in (share, share / share.sum()))
    return np.asarray((1.0 - correlation.outlier_rate) * apart + correlation.outlier_rate * alike)


def _product(log: Floats, exponent: Floats, area: Floats | float) -> Floats:
    """Probabilities (...), 1 in sum, by the product of densities whose logarithms are (n, ...), to exponents (n,)."""
    total = np.tensordot(exponent, log, axes=1)
    weight = np.exp(total - total.max()) * area
    return np.asarray(weight / weight.sum())


def _overlap(ahead: Floats, vertical_fov: Floats) -> Floats:
    """Shares (n, n) of the pictures' width that two views have in common, 0 to 1."""
    apart = angle_between(ahead[:, None], ahead[None])
    width = _MAX_OVERLAP_FOVS * 0.5 * (vertical_fov[:, None] + vertical_fov[None])
    return np.asarray(np.maximum(0.0, 1.0 - apart / width))


def optical_axes(predictions: Sequence[Prediction], turns: Floats) -> tuple[Floats, Floats]:
    """Optical axes (n, 3) and vertical fields of view (n,) [deg] of views at headings (n,) [deg]."""
    elevation = [p.camera_elevation for p in predictions]
    return direction(turns, elevation), np.array([p.vertical_fov for p in predictions])


# One view's distribution of the sun as a turned camera, an elevation or an uncertain heading has it.

ELEVATION_KERNEL_STD = 4.0  # deg, kernel of an elevation's density: the size of a cell

_BLUR_STEPS = (-1.5, -0.75, 0.0, 0.75, 1.5)  # in spreads, over which a noisy heading is averaged on the grid
_HIDDEN = 1.5  # deg, errors of a heading that do not show beside the 4 deg between cells


def rotate_density(probability: Floats, turn: float, layout: str) -> Floats:
    """The density (N,) at the cells of a camera that is turned by `turn` [deg] clockwise from the probability's."""
    azimuth, elevation = angles(grid_directions(layout))
    return smooth_density(probability, direction(azimuth + turn, elevation), layout)


def density_on_ring(prediction: Prediction, elevation: float, turn: float) -> Floats:
    """The density (360,) along an elevation [deg], by azimuth from 0 to 359, as `seen_from` gives that of the cells."""
    suns = direction(HEADINGS + turn, elevation)
    return smooth_density(prediction.sun_probability, suns, prediction.spec.sun_grid)


def elevation_density(prediction: Prediction, elevation: Floats) -> Floats:
    """Density [1/sr] (N,) at elevations (N,) [deg], averaged over azimuth."""
    layout = prediction.spec.sun_grid
    cells = angles(grid_directions(layout))[1]
    weight = np.exp(-0.5 * ((elevation[:, None] - cells) / ELEVATION_KERNEL_STD) ** 2)
    return np.asarray(weight @ prediction.sun_probability / (weight @ grid_solid_angle(layout)))


def blur_grid_heading(prediction: Prediction, noise: float, useless: float) -> Floats:
    """Probabilities (N,) over the cells after an error of the heading [deg], gross in a `useless` share of cases."""
    if not noise:
        return prediction.sun_probability
    layout = prediction.spec.sun_grid
    anywhere = elevation_density(prediction, angles(grid_directions(layout))[1]) * grid_solid_angle(layout)
    return np.asarray((1 - useless) * _turned_about(prediction, noise) + useless * anywhere)


def _turned_about(prediction: Prediction, noise: float) -> Floats:
    """Probabilities (N,) over the cells, averaged over a normal error of the heading [deg] that cells can show."""
    if noise < _HIDDEN:
        return prediction.sun_probability
    layout, weight = prediction.spec.sun_grid, np.exp(-0.5 * np.square(_BLUR_STEPS))
    seen = [rotate_density(prediction.sun_probability, noise * step, layout) for step in _BLUR_STEPS]
    return np.asarray(weight @ np.array(seen) / weight.sum() * grid_solid_angle(layout))


def blur_ring_heading(density: Floats, noise: float, useless: float) -> Floats:
    """Densities (K, 360) after an error of the heading [deg], gross in a `useless` share of cases."""
    if not noise:
        return density
    anywhere = density.mean(axis=1, keepdims=True)
    return np.asarray((1 - useless) * blur_headings(density, noise) + useless * anywhere)

"""Pooling of several photos' distributions of the sun: how far their errors agree, and how densities turn and blur.

Crops of one scene share its misleading sides, so the errors of the network are alike: n photos count as fewer. The
errors of two views correlate by a constant where they share nothing and by 1 where they show the same; in between by
the square of the overlap. A view counts by one over the sum of its correlations with all, itself included; that is the
weight of the best linear mean where all correlate alike. Views are rotated, blurred and pooled with these weights
(logarithmic opinion pool).

In a share of cases, though, one thing misleads all views, and then they tell no more than one does: the answer is a
mixture of both products. Without it, a few scenes where all views err would cost too wide regions everywhere.
SUN_CORRELATION was fitted; AZIMUTH_CORRELATION was chosen by the same loss on rings, on 160 panoramas of the same
scenes.
"""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats, angle_between, angles, direction
from lighting.prediction import Prediction
from lighting.sun_grid import blur_headings, grid_directions, grid_solid_angle, smooth_density

ELEVATION_KERNEL_STD = 4.0  # deg, kernel of an elevation's density: the size of a cell
MIN_POOLED_DENSITY = 1e-12  # 1/sr, that stands for none where logarithms are taken
_MAX_OVERLAP_FOVS = 1.25  # vertical fields of view between two optical axes from which views share nothing
_BLUR_STEPS = (-1.5, -0.75, 0.0, 0.75, 1.5)  # standard deviations, over which an uncertain heading is averaged
_MIN_BLUR_STD = 1.5  # deg, of a heading; smaller errors vanish beside the 4 deg between cells


@dataclass(frozen=True)
class Correlation:
    """How the errors of views correlate."""

    without_overlap: float
    """Of two views that share nothing, 0 to 1."""
    outlier_rate: float
    """Share of cases in which all views tell no more than one, 0 to 1."""


SUN_CORRELATION = Correlation(0.05, 0.15)  # of the sun's distribution in one frame
AZIMUTH_CORRELATION = Correlation(0.0, 0.05)  # of its azimuth at a known elevation


def effective_weights(
    optical_axes: Floats,
    vertical_fov: Floats,
    correlation: Correlation,
    similarity: Floats | float = 1.0,
    present: Floats | None = None,
) -> Floats:
    """How much each of n views counts (n,), 0 to 1.

    Args:
        optical_axes: (n, 3) unit vectors in one frame.
        vertical_fov: (n,) deg.
        correlation: of the views' errors.
        similarity: (n, n) of their light, 0 to 1: the same view under another sun is another witness.
        present: (n,) how far each view is part of the set, 0 to 1; None: all are.
    """
    shared = np.square(_overlap(optical_axes, vertical_fov)) * similarity
    matrix = correlation.without_overlap + (1.0 - correlation.without_overlap) * shared
    np.fill_diagonal(matrix, 0.0)
    part = np.ones(len(optical_axes)) if present is None else present
    return np.asarray(part / (1.0 + matrix @ part))


def _overlap(optical_axes: Floats, vertical_fov: Floats) -> Floats:
    """Shares (n, n) of the pictures' width that two views have in common, 0 to 1."""
    distance = angle_between(optical_axes[:, None], optical_axes[None])
    width = _MAX_OVERLAP_FOVS * 0.5 * (vertical_fov[:, None] + vertical_fov[None])
    return np.asarray(np.maximum(0.0, 1.0 - distance / width))


def pooling_exponent(count: int, correlation: float) -> float:
    """Exponent of each of several distributions whose errors correlate.

    Args:
        count: 1 or more distributions.
        correlation: of two of them, 0 to 1.
    """
    return 1.0 / (1.0 + (count - 1) * correlation)


def pool_log_likelihoods(
    log_density: Floats, weight: Floats, correlation: Correlation, area: Floats | float = 1.0
) -> Floats:
    """Pool the densities of n views to probabilities (...) of cells, 1 in sum.

    Args:
        log_density: (n, ...) natural logarithms, up to a constant a view.
        weight: (n,) how much each view counts, as `effective_weights` returns it.
        correlation: of the views' errors.
        area: (...) solid angle of the cells, up to a factor.
    """
    independent, alike = (_product(log_density, exponent, area) for exponent in (weight, weight / weight.sum()))
    return np.asarray((1.0 - correlation.outlier_rate) * independent + correlation.outlier_rate * alike)


def _product(log_density: Floats, exponent: Floats, area: Floats | float) -> Floats:
    """Probabilities (...), 1 in sum, by the product of densities whose logarithms are (n, ...), to exponents (n,)."""
    total = np.tensordot(exponent, log_density, axes=1)
    p = np.exp(total - total.max()) * area
    return np.asarray(p / p.sum())


def rotate_density(probability: Floats, rotation: float, layout: str) -> Floats:
    """Density [1/sr] (N,) at the cells of a rotated camera.

    Args:
        probability: (N,) of the cells of the camera that is not rotated.
        rotation: deg clockwise from that camera to the other.
        layout: of the sun grid.
    """
    azimuth, elevation = angles(grid_directions(layout))
    return smooth_density(probability, direction(azimuth + rotation, elevation), layout)


def elevation_density(prediction: Prediction, elevation: Floats) -> Floats:
    """Density [1/sr] (N,) at elevations, averaged over azimuth.

    Args:
        prediction: of the network.
        elevation: (N,) deg above the horizon.
    """
    layout = prediction.spec.sun_grid
    cells = angles(grid_directions(layout))[1]
    weight = np.exp(-0.5 * ((elevation[:, None] - cells) / ELEVATION_KERNEL_STD) ** 2)
    return np.asarray(weight @ prediction.sun_probability / (weight @ grid_solid_angle(layout)))


def blur_grid_heading(prediction: Prediction, heading_std: float, outlier_rate: float) -> Floats:
    """Probabilities (N,) of the cells after an error of the heading.

    Args:
        prediction: of the network.
        heading_std: deg, one standard deviation; 0 changes nothing.
        outlier_rate: share of headings that say nothing, 0 to 1.
    """
    if not heading_std:
        return prediction.sun_probability
    layout = prediction.spec.sun_grid
    anywhere = elevation_density(prediction, angles(grid_directions(layout))[1]) * grid_solid_angle(layout)
    blurred = prediction.sun_probability
    if heading_std >= _MIN_BLUR_STD:
        weight = np.exp(-0.5 * np.square(_BLUR_STEPS))
        rotated = [rotate_density(prediction.sun_probability, heading_std * step, layout) for step in _BLUR_STEPS]
        blurred = np.asarray(weight @ np.array(rotated) / weight.sum() * grid_solid_angle(layout))
    return np.asarray((1 - outlier_rate) * blurred + outlier_rate * anywhere)


def blur_ring_heading(density: Floats, heading_std: float, outlier_rate: float) -> Floats:
    """Densities (K, 360) over headings after an error of the heading.

    Args:
        density: (K, 360) over HEADINGS.
        heading_std: deg, one standard deviation; 0 changes nothing.
        outlier_rate: share of headings that say nothing, 0 to 1.
    """
    if not heading_std:
        return density
    anywhere = density.mean(axis=1, keepdims=True)
    return np.asarray((1 - outlier_rate) * blur_headings(density, heading_std) + outlier_rate * anywhere)

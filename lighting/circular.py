"""Circular statistics: von Mises, circular mean and mode, weighted median."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lighting.geometry import Floats, direction, wrap_azimuth
from lighting.sun_grid import credible_radii

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

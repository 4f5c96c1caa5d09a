"""Circular statistics: von Mises, circular mean and mode, weighted median."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lighting.geometry import Floats, direction, wrap_azimuth
from lighting.sun_grid import credible_radii

# Distributions over headings: their modes, spreads and radii.

HEADINGS = np.arange(360.0)  # deg clockwise from true north

MODE_WIDTH = 25.5  # deg around the strongest mode over which the decoding averages: 25 bins to either side
MODE_SMOOTHING = 15.0  # deg, spread of the kernel that finds the strongest mode


@dataclass(frozen=True, eq=False)
class Heading:
    """Where a camera points, deg clockwise."""

    probability: Floats  # (360,) of the one-degree bins around HEADINGS, sums to 1
    best: float  # 0 to 360
    radius_50: float  # deg to either side of `best` that hold 50 % of the probability
    radius_90: float


def von_mises(angle: ArrayLike, spread: float) -> Floats:
    """A von Mises curve, 1 at `angle` 0 [deg], whose concentration is 1 / `spread` [deg] squared."""
    concentration = math.radians(max(spread, 0.1)) ** -2
    return np.asarray(np.exp(concentration * (np.cos(np.radians(angle)) - 1.0)))


def blur_headings(density: Floats, spread: float) -> Floats:
    """Densities (..., 360) over HEADINGS after an error of von Mises `spread` [deg]."""
    kernel = von_mises(HEADINGS, spread)
    return circular_correlation(density, kernel / kernel.sum())


def circular_correlation(a: Floats, b: Floats) -> Floats:
    """Circular correlation along the last axis (..., N): entry d sums a[i + d] b[i]; never below zero."""
    product = np.fft.rfft(a) * np.conj(np.fft.rfft(b))
    return np.maximum(np.fft.irfft(product, a.shape[-1]), 0.0)


def circular_mean(angle: ArrayLike) -> float:
    """The direction [deg, -180 to 180] of the sum of unit vectors at angles (N,) [deg]."""
    towards = np.exp(1j * np.radians(np.asarray(angle, dtype=np.float64)))
    return float(np.degrees(np.angle(towards.sum())))


def circular_mode(angle: Floats, probability: Floats) -> float:
    """The strongest mode [deg, -180 to 180] of probabilities (N,) of angles (N,): the mean around the peak."""
    histogram = np.bincount(np.round(angle).astype(int) % 360, probability, 360).astype(np.float64)
    peak = np.argmax(blur_headings(histogram, MODE_SMOOTHING))
    offset = wrap_azimuth(angle - peak)
    near = probability * (np.abs(offset) <= MODE_WIDTH)
    return float(wrap_azimuth(peak + near @ offset / near.sum()))


def heading_from_probability(probability: Floats) -> Heading:
    """The best heading and the radii of a distribution (360,) over HEADINGS."""
    best = circular_mode(HEADINGS, probability) % 360.0
    ground = direction(HEADINGS, 0.0)
    radius_50, radius_90 = credible_radii(probability, ground, direction(best, 0.0))
    return Heading(probability, best, radius_50, radius_90)


# The median of values that count differently.


def weighted_median(value: Floats, weight: Floats) -> float:
    """The least of the values (N,) up to which half of the weight (N,) lies; NaN if there are none."""
    if not len(value):
        return float("nan")
    order = np.argsort(value)
    held = np.cumsum(weight[order]) / weight.sum()
    return float(value[order][np.searchsorted(held, 0.5)])

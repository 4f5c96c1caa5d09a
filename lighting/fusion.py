"""What the pixels say times what the metadata knows: one distribution of the sun, and the sun as a compass.

With time and place the ephemeris gives the sun's elevation and compass azimuth, and only the camera's heading is open.
The network's distribution is read along the ring of that elevation, once for each whole degree of heading, and multiplied
with the prior of the compass. Where the zone of the time is unknown there is one ring a candidate.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ParameterError
from lighting.geometry import angles, direction, wrap_azimuth
from lighting.parameters import Prediction, Sun, sun_of
from lighting.sun_grid import grid_directions, radius_around, smooth_density

COMPASS_SPREAD = 25.0  # deg, standard deviation that goes with the median error of 17 deg measured on phones
GROSS_ERRORS = 0.1  # share of headings that say nothing: the prior's uniform floor
CONTRADICTION = 0.01  # tail probability under which pixels and metadata contradict each other

HEADINGS = np.arange(360.0)  # deg clockwise from true north

_MODE_WIDTH = 25.0  # deg around the strongest mode over which the decoding averages, as in sun_grid.py
_MODE_SMOOTHING = 8.0  # deg, standard deviation of the kernel that finds the strongest mode on a ring

Floats = NDArray[np.floating[Any]]


@dataclass(frozen=True)
class Evidence:
    """What is known about one photo beside its pixels."""

    candidates: tuple[tuple[float, float], ...] = ()  # equally likely (sun elevation, sun compass azimuth) [deg]
    heading: float | None = None  # deg clockwise from true north, where the camera points
    heading_spread: float = COMPASS_SPREAD  # deg, one standard deviation of that
    vertical_fov: float | None = None  # deg, of the upright photo


@dataclass(frozen=True, eq=False)
class CameraHeading:
    """Where the camera points, deg clockwise from true north."""

    probability: Floats  # (360,) of the one-degree bins around HEADINGS, sums to 1
    best: float  # 0 to 360
    radius_50: float  # deg to either side of `best` that hold 50 % of the probability
    radius_90: float


@dataclass(frozen=True, eq=False)
class Fused:
    """The light of one photo as far as pixels and metadata know it; `lighting_from(fused.prediction, fused.sun)`."""

    prediction: Prediction  # with the field of view, turbidity and exposure that are best known
    sun: Sun
    directions: Floats  # (M, 3) unit vectors towards the sun, relative to the camera
    probability: Floats  # (M,) of each, sums to 1
    used: tuple[str, ...]  # of "pixels", "time+place", "heading", "focal length", "other photos"
    warnings: tuple[str, ...]  # sentences about what contradicts the pixels
    camera_heading: CameraHeading | None  # where time and place are known


def fuse(prediction: Prediction, evidence: Evidence) -> Fused:
    """The network's answer times the evidence; ParameterError where the sun is below the horizon."""
    lens = replace(prediction, vertical_fov=evidence.vertical_fov or prediction.vertical_fov)
    if not evidence.candidates:
        cells = grid_directions(prediction.spec.sun_grid)
        return Fused(lens, sun_of(prediction), cells, prediction.sun_probability, used(evidence), (), None)
    candidates = daylight(evidence.candidates)
    density = ring_density(prediction, candidates)
    return on_rings(lens, candidates, density * compass_prior(evidence), used(evidence), ())


def used(evidence: Evidence) -> tuple[str, ...]:
    """What the evidence adds to the pixels; a heading says nothing of the sun without time and place."""
    parts = {
        "pixels": True,
        "time+place": bool(evidence.candidates),
        "heading": bool(evidence.candidates) and evidence.heading is not None,
        "focal length": evidence.vertical_fov is not None,
    }
    return tuple(name for name, there in parts.items() if there)


def daylight(candidates: tuple[tuple[float, float], ...]) -> Floats:
    """The candidates (K, 2) with the sun up; ParameterError if there is none."""
    up = [pair for pair in candidates if pair[0] >= 0.0]
    if not up:
        highest = max(elevation for elevation, _ in candidates)
        raise ParameterError(f"At this time and place the sun is {-highest:.1f} deg below the horizon.")
    return np.array(up, dtype=np.float64)


def ring_density(prediction: Prediction, candidates: Floats) -> Floats:
    """Density [1/sr] (K, 360) that the pixels give the sun of each candidate (K, 2) for each of HEADINGS."""
    return smooth_density(prediction.sun_probability, ring_directions(candidates), prediction.spec.sun_grid)


def ring_directions(candidates: Floats) -> Floats:
    """Unit vectors (K, 360, 3) towards each candidate's sun as cameras at each of HEADINGS see it."""
    elevation, compass = candidates[:, :1], candidates[:, 1:]
    return direction(compass - HEADINGS, elevation)


def compass_prior(evidence: Evidence) -> Floats:
    """Probability (360,) of each of HEADINGS before a pixel is seen: von Mises around the compass, on a floor."""
    if evidence.heading is None:
        return np.full(360, 1 / 360)
    bell = von_mises(HEADINGS - evidence.heading, evidence.heading_spread)
    return np.asarray((1 - GROSS_ERRORS) * bell / bell.sum() + GROSS_ERRORS / 360)


def von_mises(angle: ArrayLike, spread: float) -> Floats:
    """A von Mises curve, 1 at `angle` 0 [deg], whose concentration is 1 / `spread` [deg] squared."""
    concentration = math.radians(max(spread, 0.1)) ** -2
    return np.asarray(np.exp(concentration * (np.cos(np.radians(angle)) - 1.0)))


def on_rings(
    prediction: Prediction, candidates: Floats, weight: Floats, used: tuple[str, ...], warnings: tuple[str, ...]
) -> Fused:
    """The answer of unnormalised probabilities (K, 360) for each candidate and each of HEADINGS."""
    p = weight / weight.sum()
    directions = ring_directions(candidates).reshape(-1, 3)
    sun = sun_on_rings(directions, p.ravel())
    return Fused(prediction, sun, directions, p.ravel(), used, warnings, camera_heading(p.sum(axis=0)))


def sun_on_rings(directions: Floats, probability: Floats) -> Sun:
    """Where a distribution on rings puts the sun: means of azimuth and elevation around the strongest mode."""
    azimuth, elevation = angles(directions)
    best = best_angle(azimuth, probability)
    near = probability * (np.abs(wrap_azimuth(azimuth - best)) <= _MODE_WIDTH)
    height = float(near @ elevation / near.sum())
    centre = direction(best, height)
    radius_50, radius_90 = (radius_around(probability, share, directions, centre) for share in (0.5, 0.9))
    return Sun(best, height, radius_50, radius_90)


def camera_heading(probability: Floats) -> CameraHeading:
    """Best value and radii of a distribution (360,) over HEADINGS."""
    best = best_angle(HEADINGS, probability) % 360.0
    ground = direction(HEADINGS, 0.0)
    radius_50, radius_90 = (radius_around(probability, share, ground, direction(best, 0.0)) for share in (0.5, 0.9))
    return CameraHeading(probability, best, radius_50, radius_90)


def best_angle(angle: Floats, probability: Floats) -> float:
    """The strongest mode [deg, -180 to 180] of probabilities (N,) of angles (N,): the mean of what lies around it."""
    bins = np.arange(360.0)
    histogram = np.bincount(np.round(angle).astype(int) % 360, probability, 360)
    kernel = von_mises(bins, _MODE_SMOOTHING)
    peak = np.argmax(np.fft.irfft(np.fft.rfft(histogram) * np.fft.rfft(kernel), 360))
    offset = wrap_azimuth(angle - peak)
    near = probability * (np.abs(offset) <= _MODE_WIDTH)
    return float(wrap_azimuth(peak + near @ offset / near.sum()))

"""The cameras among which the lines of a picture choose: a grid around what the network says of it.

The network knows where the horizon lies in the picture better than it knows the lens, so where the lens is another, so
is the elevation.
"""

import math
from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats
from lighting.records import Prediction

ELEVATIONS = np.arange(-9.0, 9.1, 1.5)  # deg around the network's answer for each lens
ROLLS = np.arange(-4.0, 4.1, 0.5)  # deg around it
LENSES = np.arange(-0.2, 0.21, 0.1)  # around it, logarithm of the tangent of half the field of view
ELEVATION_SPREAD, LENS_SPREAD = 2.3, 0.1  # of the network's answers, in the same units
ROLL_SPREADS = (0.2, 2.0)  # deg: that of small rolls is their own size, for the network knows level cameras best
FREEDOM = 4.0  # degrees of freedom of Student's t distribution, which those errors have
FOLLOWS = 0.5  # power of the lens with which the network's elevation, as a tangent, goes; 1 keeps its horizon in place


@dataclass(frozen=True, eq=False)
class Cameras:
    """Every elevation of a lens with every roll."""

    said: Prediction  # of the network
    lens: Floats  # (L,) logarithm of the tangent of half the field of view over that of `said`
    elevation: Floats  # (L, E) deg
    roll: Floats  # (R,) deg

    @property
    def half(self) -> Floats:
        """Tangents (L,) of half the vertical field of view."""
        return np.asarray(half_of(self.said) * np.exp(self.lens))


def cameras_around(said: Prediction, lenses: Floats) -> Cameras:
    """The cameras around a network's answer that have one of the lenses (L,)."""
    ahead = math.tan(math.radians(said.camera_elevation)) * np.exp(FOLLOWS * lenses)
    elevation = np.degrees(np.arctan(ahead))[:, None] + ELEVATIONS
    return Cameras(said, lenses, elevation, said.camera_roll + ROLLS)


def by_the_network(cameras: Cameras) -> Floats:
    """Logarithm of the density (L, E, R) of cameras by the network's answer alone, up to a constant."""
    spreads = (ELEVATION_SPREAD, float(np.clip(abs(cameras.said.camera_roll), *ROLL_SPREADS)), LENS_SPREAD)
    elevation, roll, lens = (
        -0.5 * (FREEDOM + 1) * np.log1p((values / spread) ** 2 / FREEDOM)
        for values, spread in zip((ELEVATIONS, ROLLS, cameras.lens), spreads, strict=True)
    )
    return np.asarray(lens[:, None, None] + elevation[:, None] + roll)


def half_of(said: Prediction) -> float:
    """Tangent of half the vertical field of view."""
    return math.tan(math.radians(said.vertical_fov) / 2)

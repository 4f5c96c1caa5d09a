"""How much each of several views counts: those that overlap see the same evidence, and even others err alike.

The errors of two views correlate by FAR where they share nothing and by up to NEAR where they show the same. A view
counts by one over the sum of its correlations with all, itself included; that is the weight of the best linear mean
where all correlate alike. `python -m export turns overlap` fits both numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats, angle_between, direction
from lighting.records import Prediction

REACH = 1.25  # vertical fields of view between two optical axes from which views share nothing
UNLIKE = 30.0  # deg of the sun's motion after which the same view is another witness


@dataclass(frozen=True)
class Correlation:
    """Of the errors of two views."""

    far: float  # without overlap
    near: float  # of one and the same view


SUN = Correlation(0.2, 1.0)  # of the sun's distribution in one frame
AZIMUTH = Correlation(0.1, 1.0)  # of its azimuth at a known elevation


def counts(ahead: Floats, vertical_fov: Floats, correlation: Correlation, likeness: Floats | float = 1.0) -> Floats:
    """How much each of n views counts (n,), 0 to 1, by their optical axes (n, 3) and fields of view (n,) [deg].

    `likeness` (n, n) is how alike their light is, 0 to 1: the same view under another sun is another witness.
    """
    shared = overlap(ahead, vertical_fov) * likeness
    matrix = correlation.far + (correlation.near - correlation.far) * shared
    np.fill_diagonal(matrix, 1.0)
    return np.asarray(1.0 / matrix.sum(axis=1))


def overlap(ahead: Floats, vertical_fov: Floats) -> Floats:
    """Shares (n, n) of the pictures' width that two views have in common, 0 to 1."""
    apart = angle_between(ahead[:, None], ahead[None])
    width = REACH * 0.5 * (vertical_fov[:, None] + vertical_fov[None])
    return np.asarray(np.maximum(0.0, 1.0 - apart / width))


def axes(predictions: Sequence[Prediction], turns: Floats) -> tuple[Floats, Floats]:
    """Optical axes (n, 3) and vertical fields of view (n,) [deg] of views at headings (n,) [deg]."""
    elevation = [p.camera_elevation for p in predictions]
    return direction(turns, elevation), np.array([p.vertical_fov for p in predictions])

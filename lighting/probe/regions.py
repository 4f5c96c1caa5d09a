"""Regions of a lat-long picture."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import require_extra
from lighting.geometry import Floats, latlong_solid_angle

Mask = NDArray[np.bool_]

HEIGHT = 128  # rows of the picture in which the sun is sought and to whose sky the model is fitted


def is_clipped(linear: NDArray[np.float32]) -> bool:
    """Whether a linear picture was clipped at white: it has no value above 1."""
    return float(linear.max()) <= 1.0


def ndimage() -> Any:
    """scipy's image filters; MissingExtraError where scipy is not installed."""
    return require_extra("scipy.ndimage", "Measured skies need scipy", "stereo")


def connected(mask: Mask) -> NDArray[np.intp]:
    """The number of the connected region of each pixel (H, 2H) of a mask; 0 outside. Regions cross the seam."""
    labels, count = ndimage().label(mask, np.ones((3, 3)))
    same = np.arange(count + 1)
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right:
            same[same == same[right]] = same[left]
    return np.asarray(same[labels])


def solid_angle(height: int) -> Floats:
    """Solid angle [sr] of each pixel (H, 2H)."""
    return np.repeat(latlong_solid_angle(height)[:, None], 2 * height, axis=1)

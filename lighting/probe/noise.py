"""The noise of a linear value: reading, rounding and the light itself.

As Hasinoff, Durand and Freeman have it (*Noise-optimal capture for high dynamic range photography*, CVPR 2010), for a
camera of common size, since a file does not say how many electrons fill its full scale.
"""

from typing import Any

import numpy as np

READ_NOISE = 2e-4  # of full scale, where rounding is finer than that
LIGHT_NOISE = 5e-5  # variance per value: 20,000 electrons at full scale


def noise_variance(value: Any, step: Any) -> Any:
    """Variance of values (...) of full scale that are rounded to steps (...); numbers for numbers."""
    return READ_NOISE**2 + step**2 / 12 + LIGHT_NOISE * np.maximum(value, 0)


def smooth_below(step: float) -> float:
    """The value under which noise is less than half a step of rounding; negative where it never is."""
    return (step**2 / 4 - READ_NOISE**2) / LIGHT_NOISE

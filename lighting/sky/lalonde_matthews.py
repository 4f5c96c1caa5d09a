"""The sky and sun of Lalonde and Matthews, which covers weather by the colours and widths of two terms.

Source: J.-F. Lalonde, I. Matthews, Lighting Estimation in Outdoor Image Collections, 3DV 2014, section 3: the sky is
the luminance of Preetham's model times one colour, the sun w exp(-beta exp(-kappa / gamma)) with gamma the angle from
it. The ranges of beta, kappa and turbidity are those of their later learning papers (Zhang et al., CVPR 2019). Colours
are linear Rec.709 in any unit; directions are unit vectors in the frame of geometry.py (+Y up).
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angle_between
from lighting.sky.preetham import TURBIDITY, preetham_luminance

BETA, KAPPA = 20.0, 0.1  # of a clear sun: half of its light lies within about two degrees
_RANGES = {"beta": (1.0, 50.0), "kappa": (0.0, 1.0)}


def lalonde_matthews_sky(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Radiance / the zenith's (...) along unit vectors (..., 3), to be multiplied with the sky's colour.

    0 below the horizon. Turbidities outside the range of Preetham's model count as its ends. Raises ParameterError for
    a sun below the horizon.
    """
    return preetham_luminance(direction, sun_direction, float(np.clip(turbidity, *TURBIDITY)))


def lalonde_matthews_sun(
    direction: ArrayLike, sun_direction: ArrayLike, beta: float = BETA, kappa: float = KAPPA
) -> Floats:
    """Radiance / the sun's own (...) along unit vectors (..., 3), times its colour; 0 below the horizon.

    `beta` (1 to 50) narrows the glow around the sun, `kappa` (0 to 1) widens the sun itself. Raises ParameterError out
    of range.
    """
    for name, value in (("beta", beta), ("kappa", kappa)):
        low, high = _RANGES[name]
        if not low <= value <= high:
            sentence = f"The sun's {name} is {value:g}; it must lie in {low:g} to {high:g}."
            raise ParameterError(sentence, name, ErrorCode.OUT_OF_RANGE)
    d = np.asarray(direction, dtype=np.float64)
    away = np.maximum(np.radians(angle_between(d, sun_direction)), 1e-9)
    return np.where(d[..., 1] >= 0, np.exp(-beta * np.exp(-kappa / away)), 0.0)

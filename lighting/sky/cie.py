"""The skies of the CIE: the standard overcast sky and the fifteen types of the general sky.

Luminance is relative to the zenith's; a scale and a color are the caller's. Directions are unit vectors in the frame of
geometry.py (+Y up).

References:
    [1] ISO 15469:2004 / CIE S 011/E:2003, Spatial distribution of daylight - CIE standard general sky.
    [2] Darula and Kittler, CIE general sky standard defining luminance distributions, eSim 2002, has the table too.
    [3] Moon and Spencer, Illumination from a non-uniform sky, 1942: the overcast sky.
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats
from lighting.sky import sky_angles

_GRADATION = {  # a and b of each group
    "I": (4.0, -0.70),
    "II": (1.1, -0.80),
    "III": (0.0, -1.0),
    "IV": (-1.0, -0.55),
    "V": (-1.0, -0.32),
    "VI": (-1.0, -0.15),
}
_INDICATRIX = {  # c, d and e of each group
    1: (0.0, -1.0, 0.0),
    2: (2.0, -1.5, 0.15),
    3: (5.0, -2.5, 0.30),
    4: (10.0, -3.0, 0.45),
    5: (16.0, -3.0, 0.30),
    6: (24.0, -2.8, 0.15),
}
_TYPES = (  # groups of gradation and indicatrix of the types 1 to 15
    *(("I", 1), ("I", 2), ("II", 1), ("II", 2), ("III", 1), ("III", 2), ("III", 3), ("III", 4)),
    *(("IV", 2), ("IV", 3), ("IV", 4), ("V", 4), ("V", 5), ("VI", 5), ("VI", 6)),
)
_MIN_COSINE = 1e-6  # of the zenith angle: at the horizon the exponent ends at minus infinity


def overcast_luminance(direction: ArrayLike) -> Floats:
    """Luminance / zenith's (...) of the standard overcast sky; 0 below the horizon.

    It is (1 + 2 sin elevation) / 3, whose horizontal illuminance is 7 pi / 9 [3].

    Args:
        direction: (..., 3) unit vectors.
    """
    up = np.asarray(direction, dtype=np.float64)[..., 1]
    return np.where(up >= 0, (1 + 2 * up) / 3, 0.0)


def general_luminance(direction: ArrayLike, sun_direction: ArrayLike, kind: int) -> Floats:
    """Luminance / zenith's (...) of the general sky [1]; 0 below the horizon, the sun's disc not included.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        kind: type 1 to 5 overcast, 6 to 10 partly cloudy, 11 to 15 clear; else ParameterError.
    """
    up, sun_angle, sun_zenith = sky_angles(direction, sun_direction, "general sky")
    value = _indicatrix(sun_angle, kind) * _gradation(up, kind)
    zenith = _indicatrix(sun_zenith, kind) * _gradation(np.asarray(1.0), kind)
    return np.asarray(np.where(up >= 0, value / zenith, 0.0))


def _gradation(up: ArrayLike, kind: int) -> Floats:
    """1 + a exp(b / up) (...), which depends on the cosine from the zenith (...) alone; 1 at and below the horizon."""
    a, b = _GRADATION[_groups_of_type(kind)[0]]
    cosine = np.maximum(np.asarray(up, dtype=np.float64), _MIN_COSINE)
    return np.asarray(1 + a * np.exp(b / cosine))


def _indicatrix(sun_angle: ArrayLike, kind: int) -> Floats:
    """1 + c (exp(d x) - exp(d pi / 2)) + e cos^2 x (...), with x the angle from the sun (...) [rad].

    It is 1 at a right angle to the sun.
    """
    c, d, e = _INDICATRIX[_groups_of_type(kind)[1]]
    angle = np.asarray(sun_angle, dtype=np.float64)
    return np.asarray(1 + c * (np.exp(d * angle) - np.exp(d * np.pi / 2)) + e * np.cos(angle) ** 2)


def _groups_of_type(kind: int) -> tuple[str, int]:
    if not 1 <= kind <= len(_TYPES):
        sentence = f"The sky type is {kind}; the CIE general sky has types 1 to {len(_TYPES)}."
        raise ParameterError(sentence, "kind", ErrorCode.UNKNOWN)
    return _TYPES[kind - 1]

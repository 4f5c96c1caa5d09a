"""Preetham sky; Lalonde-Matthews built on it.

Source: A. J. Preetham, P. Shirley, B. Smits, A Practical Analytic Model for Daylight, SIGGRAPH 1999, appendix A.2.
Luminance is absolute, in kcd m^-2. Directions are unit vectors in the frame of geometry.py (+Y up), colours are linear
Rec.709 whose luminance is that of the model.

Source: J.-F. Lalonde, I. Matthews, Lighting Estimation in Outdoor Image Collections, 3DV 2014, section 3: the sky is
the luminance of Preetham's model times one colour, the sun w exp(-beta exp(-kappa / gamma)) with gamma the angle from
it. The ranges of beta, kappa and turbidity are those of their later learning papers (Zhang et al., CVPR 2019). Colours
are linear Rec.709 in any unit; directions are unit vectors in the frame of geometry.py (+Y up).
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angle_between

# The clear sky of Preetham, Shirley and Smits: luminance and chromaticity by turbidity.

TURBIDITY = (1.7, 10.0)  # the authors fitted 2 to 6; below 1.7 the luminance of a high sun's zenith turns negative

_LOWEST = 0.01  # cosine of the zenith angle that stands for the horizon, where some exponents end at infinity
_DISTRIBUTION = np.array(  # for luminance, x and y: slope and offset in turbidity of each of A to E
    [
        [[0.1787, -1.4630], [-0.3554, 0.4275], [-0.0227, 5.3251], [0.1206, -2.5771], [-0.0670, 0.3703]],
        [[-0.0193, -0.2592], [-0.0665, 0.0008], [-0.0004, 0.2125], [-0.0641, -0.8989], [-0.0033, 0.0452]],
        [[-0.0167, -0.2608], [-0.0950, 0.0092], [-0.0079, 0.2102], [-0.0441, -1.6537], [-0.0109, 0.0529]],
    ]
)
_ZENITH = np.array(  # for x and y: rows by falling power of turbidity, columns by falling power of the sun's angle
    [
        [
            [0.00166, -0.00375, 0.00209, 0.0],
            [-0.02903, 0.06377, -0.03202, 0.00394],
            [0.11693, -0.21196, 0.06052, 0.25886],
        ],
        [
            [0.00275, -0.00610, 0.00317, 0.0],
            [-0.04214, 0.08970, -0.04153, 0.00516],
            [0.15346, -0.26756, 0.06670, 0.26688],
        ],
    ]
)
_TO_REC709 = np.array(  # from XYZ (IEC 61966-2-1)
    [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
)


def preetham_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Linear Rec.709 (..., 3) in kcd m^-2 along unit vectors (..., 3), without the sun's disc; 0 below the horizon.

    Raises ParameterError for a turbidity outside 1.7 to 10 and for a sun below the horizon.
    """
    d, sun = np.asarray(direction, dtype=np.float64), np.asarray(sun_direction, dtype=np.float64)
    away, from_zenith = np.radians(angle_between(d, sun)), float(np.radians(angle_between(sun, [0.0, 1.0, 0.0])))
    parts = _preetham_distribution(d[..., 1], away, from_zenith, turbidity)
    zenith = _preetham_zenith(from_zenith, turbidity)
    luminance, x, y = (parts[i] * zenith[i] for i in range(3))
    xyz = np.stack([luminance * x / y, luminance, luminance * (1 - x - y) / y], axis=-1)
    return np.asarray(np.where(d[..., 1:2] >= 0, np.maximum(xyz @ _TO_REC709.T, 0.0), 0.0))


def _preetham_luminance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Luminance / zenith's (...) along unit vectors (..., 3); 0 below the horizon. Raises as `preetham_radiance`."""
    d, sun = np.asarray(direction, dtype=np.float64), np.asarray(sun_direction, dtype=np.float64)
    away, from_zenith = np.radians(angle_between(d, sun)), float(np.radians(angle_between(sun, [0.0, 1.0, 0.0])))
    parts = _preetham_distribution(d[..., 1], away, from_zenith, turbidity)
    return np.where(d[..., 1] >= 0, np.maximum(parts[0], 0.0), 0.0)


def _preetham_distribution(up: Floats, away: Floats, sun_zenith: float, turbidity: float) -> Floats:
    """Luminance, x and y (3, ...) by the zenith's, of the cosine from the zenith and the angle from the sun [rad]."""
    _check(turbidity, sun_zenith)
    table = _DISTRIBUTION @ [turbidity, 1.0]

    def part(row: Floats, cosine: Floats, angle: Floats) -> Floats:
        a, b, c, d, e = row
        return np.asarray((1 + a * np.exp(b / cosine)) * (1 + c * np.exp(d * angle) + e * np.cos(angle) ** 2))

    there, one, from_sun = np.maximum(up, _LOWEST), np.asarray(1.0), np.asarray(sun_zenith)
    return np.stack([part(row, there, away) / part(row, one, from_sun) for row in table])


def _preetham_zenith(sun_zenith: float, turbidity: float) -> Floats:
    """The zenith's luminance [kcd m^-2], x and y (3,) by the sun's angle from it [rad]."""
    _check(turbidity, sun_zenith)
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * sun_zenith)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    powers = np.array([turbidity**2, turbidity, 1.0]), np.array([sun_zenith**3, sun_zenith**2, sun_zenith, 1.0])
    return np.array([max(luminance, 0.0), *(powers[0] @ table @ powers[1] for table in _ZENITH)])


def _check(turbidity: float, sun_zenith: float) -> None:
    low, high = TURBIDITY
    if not low <= turbidity <= high:
        raise ParameterError(
            f"The turbidity is {turbidity:g}; the sky of Preetham covers {low:g} to {high:g}.",
            "turbidity",
            ErrorCode.OUT_OF_RANGE,
        )
    if not 0 <= sun_zenith <= np.pi / 2 + 1e-6:
        raise ParameterError(
            "The sun is below the horizon; the sky of Preetham needs it above.", "sun_zenith", ErrorCode.NIGHT
        )


# The sky and sun of Lalonde and Matthews, which covers weather by the colours and widths of two terms.

BETA, KAPPA = 20.0, 0.1  # of a clear sun: half of its light lies within about two degrees
_RANGES = {"beta": (1.0, 50.0), "kappa": (0.0, 1.0)}


def lalonde_matthews_sky(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Radiance / the zenith's (...) along unit vectors (..., 3), to be multiplied with the sky's colour.

    0 below the horizon. Turbidities outside the range of Preetham's model count as its ends. Raises ParameterError for
    a sun below the horizon.
    """
    return _preetham_luminance(direction, sun_direction, float(np.clip(turbidity, *TURBIDITY)))


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

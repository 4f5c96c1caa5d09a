"""The clear sky of Preetham [1], and the sky and sun of Lalonde and Matthews [2] built on it.

Preetham's luminance is absolute, in kcd m^-2; colors are linear Rec.709 of that luminance. Directions are unit vectors
in the frame of geometry.py (+Y up). The sky of Lalonde and Matthews is Preetham's luminance times one color, in any
unit. Their sun is w exp(-beta exp(-kappa / gamma)) with gamma the angle from it; colors and widths cover the weather.

References:
    [1] Preetham, Shirley, Smits, A Practical Analytic Model for Daylight, SIGGRAPH 1999, appendix A.2.
    [2] Lalonde and Matthews, Lighting Estimation in Outdoor Image Collections, 3DV 2014, section 3.
    [3] Zhang et al., All-Weather Deep Outdoor Lighting Estimation, CVPR 2019: ranges of beta, kappa and turbidity.
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angle_between
from lighting.sky import sky_angles

TURBIDITY = (1.7, 10.0)  # the authors fitted 2 to 6; below 1.7 the luminance of a high sun's zenith turns negative

_BETA, _KAPPA = 20.0, 0.1  # of a clear sun: half of its light lies within about two degrees
_GLOW_RANGES = {"beta": (1.0, 50.0), "kappa": (0.0, 1.0)}
_MIN_COSINE = 0.01  # of the zenith angle: at the horizon some exponents end at infinity
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
# From XYZ (IEC 61966-2-1).
_TO_REC709 = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])


def preetham_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Linear Rec.709 (..., 3) in kcd m^-2, without the sun's disc [1]; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        turbidity: 1.7 to 10, else ParameterError.
    """
    up, sun_zenith, parts = _by_zenith(direction, sun_direction, turbidity)
    zenith = _preetham_zenith(sun_zenith, turbidity)
    luminance, x, y = (parts[i] * zenith[i] for i in range(3))
    xyz = np.stack([luminance * x / y, luminance, luminance * (1 - x - y) / y], axis=-1)
    return np.asarray(np.where(up[..., None] >= 0, np.maximum(xyz @ _TO_REC709.T, 0.0), 0.0))


def _preetham_luminance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Luminance / zenith's (...) along unit vectors (..., 3); 0 below the horizon. Raises as `preetham_radiance`."""
    up, _, parts = _by_zenith(direction, sun_direction, turbidity)
    return np.where(up >= 0, np.maximum(parts[0], 0.0), 0.0)


def _by_zenith(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> tuple[Floats, float, Floats]:
    """Sines (...) above the horizon, the sun's zenith angle [rad], luminance, x and y (3, ...) by the zenith's."""
    low, high = TURBIDITY
    if not low <= turbidity <= high:
        sentence = f"The turbidity is {turbidity:g}; the sky of Preetham covers {low:g} to {high:g}."
        raise ParameterError(sentence, "turbidity", ErrorCode.OUT_OF_RANGE)
    up, sun_angle, sun_zenith = sky_angles(direction, sun_direction, "sky of Preetham")
    return up, sun_zenith, _preetham_distribution(up, sun_angle, sun_zenith, turbidity)


def _preetham_distribution(up: Floats, sun_angle: Floats, sun_zenith: float, turbidity: float) -> Floats:
    """Luminance, x and y (3, ...) by the zenith's, of the cosine from the zenith and the angle from the sun [rad]."""
    table = _DISTRIBUTION @ [turbidity, 1.0]

    def part(row: Floats, cosine: Floats, angle: Floats) -> Floats:
        a, b, c, d, e = row
        return np.asarray((1 + a * np.exp(b / cosine)) * (1 + c * np.exp(d * angle) + e * np.cos(angle) ** 2))

    cosine, zenith_cosine, zenith_angle = np.maximum(up, _MIN_COSINE), np.asarray(1.0), np.asarray(sun_zenith)
    return np.stack([part(row, cosine, sun_angle) / part(row, zenith_cosine, zenith_angle) for row in table])


def _preetham_zenith(sun_zenith: float, turbidity: float) -> Floats:
    """The zenith's luminance [kcd m^-2], x and y (3,) by the sun's angle from it [rad]."""
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * sun_zenith)
    luminance = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    powers = np.array([turbidity**2, turbidity, 1.0]), np.array([sun_zenith**3, sun_zenith**2, sun_zenith, 1.0])
    return np.array([max(luminance, 0.0), *(powers[0] @ table @ powers[1] for table in _ZENITH)])


def lalonde_matthews_sky(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Radiance / the zenith's (...) [2], to be multiplied with the sky's color; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        turbidity: values outside 1.7 to 10 count as these ends.
    """
    return _preetham_luminance(direction, sun_direction, float(np.clip(turbidity, *TURBIDITY)))


def lalonde_matthews_sun(
    direction: ArrayLike, sun_direction: ArrayLike, beta: float = _BETA, kappa: float = _KAPPA
) -> Floats:
    """Radiance of the sun (...) [2], to be multiplied with its color; 0 below the horizon. ParameterError out of range.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector.
        beta: narrows the glow around the sun, 1 to 50.
        kappa: widens the sun itself, 0 to 1.
    """
    for name, value in (("beta", beta), ("kappa", kappa)):
        low, high = _GLOW_RANGES[name]
        if not low <= value <= high:
            sentence = f"The sun's {name} is {value:g}; it must lie in {low:g} to {high:g}."
            raise ParameterError(sentence, name, ErrorCode.OUT_OF_RANGE)
    d = np.asarray(direction, dtype=np.float64)
    sun_angle = np.maximum(np.radians(angle_between(d, sun_direction)), 1e-9)
    return np.where(d[..., 1] >= 0, np.exp(-beta * np.exp(-kappa / sun_angle)), 0.0)

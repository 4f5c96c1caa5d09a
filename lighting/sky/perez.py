"""Skies of five coefficients: Perez's all-weather sky, those of the CIE, Preetham's, and that of Lalonde and Matthews.

Directions are unit vectors in the frame of geometry.py (+Y up). Luminance of Perez and of the CIE is relative to the
zenith's; a scale and a color are the caller's. The circumsolar and horizon coefficients of Perez's 1990 paper, which
tilted-plane irradiance programs use, are another table.

Preetham's luminance is absolute, in kcd m^-2; colors are linear Rec.709 of that luminance. The sky of Lalonde and
Matthews is Preetham's luminance times one color, in any unit. Their sun is w exp(-beta exp(-kappa / gamma)) with gamma
the angle from it; colors and widths cover the weather.

References:
    [1] Perez, Seals, Michalsky, All-weather model for sky luminance distribution - preliminary configuration and
        validation, Solar Energy 50(3), 1993, table 1, with the erratum of volume 51, page 423.
    [2] Kasten and Young, Revised optical air mass tables and approximation formula, Applied Optics 28, 1989.
    [3] ISO 15469:2004 / CIE S 011/E:2003, Spatial distribution of daylight - CIE standard general sky.
    [4] Darula and Kittler, CIE general sky standard defining luminance distributions, eSim 2002, has the table too.
    [5] Moon and Spencer, Illumination from a non-uniform sky, 1942: the overcast sky.
    [6] Preetham, Shirley, Smits, A Practical Analytic Model for Daylight, SIGGRAPH 1999, appendix A.2.
    [7] Lalonde and Matthews, Lighting Estimation in Outdoor Image Collections, 3DV 2014, section 3.
    [8] Zhang et al., All-Weather Deep Outdoor Lighting Estimation, CVPR 2019: ranges of beta, kappa and turbidity.
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angle_between, angles
from lighting.sky import Weather

_CLEARNESS_BINS = (1.0, 1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200)  # where each row of the table begins
_BRIGHTNESS_RANGE = (0.01, 0.6)  # that the model covers
_SOLAR_CONSTANT = 1361.0  # W m^-2 at 1 astronomical unit, outside the atmosphere

_MIN_BROKEN_BRIGHTNESS = 0.2  # where 1.065 < clearness < 2.8; as Radiance's gendaylit has it
_MIN_COSINE = 0.01  # of the zenith angle: towards the horizon some rows grow without bound
# Rows by clearness; four numbers x1 to x4 for each of a, b, c, d, e.
_TABLE = np.array(
    [
        *(1.3525, -0.2576, -0.2690, -1.4366, -0.7670, 0.0007, 1.2734, -0.1233, 2.8000, 0.6004, 1.2375, 1.0000),
        *(1.8734, 0.6297, 0.9738, 0.2809, 0.0356, -0.1246, -0.5718, 0.9938),
        *(-1.2219, -0.7730, 1.4148, 1.1016, -0.2054, 0.0367, -3.9128, 0.9156, 6.9750, 0.1774, 6.4477, -0.1239),
        *(-1.5798, -0.5081, -1.7812, 0.1080, 0.2624, 0.0672, -0.2190, -0.4285),
        *(-1.1000, -0.2515, 0.8952, 0.0156, 0.2782, -0.1812, -4.5000, 1.1766, 24.7219, -13.0812, -37.7000, 34.8438),
        *(-5.0000, 1.5218, 3.9229, -2.6204, -0.0156, 0.1597, 0.4199, -0.5562),
        *(-0.5484, -0.6654, -0.2672, 0.7117, 0.7234, -0.6219, -5.6812, 2.6297, 33.3389, -18.3000, -62.2500, 52.0781),
        *(-3.5000, 0.0016, 1.1477, 0.1062, 0.4659, -0.3296, -0.0876, -0.0329),
        *(-0.6000, -0.3566, -2.5000, 2.3250, 0.2937, 0.0496, -5.6812, 1.8415, 21.0000, -4.7656, -21.5906, 7.2492),
        *(-3.5000, -0.1554, 1.4062, 0.3988, 0.0032, 0.0766, -0.0656, -0.1294),
        *(-1.0156, -0.3670, 1.0078, 1.4051, 0.2875, -0.5328, -3.8500, 3.3750, 14.0000, -0.9999, -7.1406, 7.5469),
        *(-3.4000, -0.1078, -1.0750, 1.5702, -0.0672, 0.4016, 0.3017, -0.4844),
        *(-1.0000, 0.0211, 0.5025, -0.5119, -0.3000, 0.1922, 0.7023, -1.6317, 19.0000, -5.0000, 1.2438, -1.9094),
        *(-4.0000, 0.0250, 0.3844, 0.2656, 1.0468, -0.3788, -2.4517, 1.4656),
        *(-1.0500, 0.0289, 0.4260, 0.3590, -0.3250, 0.1156, 0.7781, 0.0025, 31.0625, -14.5000, -46.1148, 55.3750),
        *(-7.2312, 0.4050, 13.3500, 0.6234, 1.5000, -0.6426, 1.8564, 0.5636),
    ]
).reshape(8, 5, 4)


def perez_luminance(direction: ArrayLike, sun_direction: ArrayLike, clearness: float, brightness: float) -> Floats:
    """Luminance / zenith's (...) [1]; 0 below the horizon, the sun's disc not included. ParameterError out of range.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon.
        clearness: 1 under an overcast sky, above 6.2 under a clear one.
        brightness: 0.01 to 0.6.
    """
    up, sun_angle, sun_zenith = sky_angles(direction, sun_direction, "all-weather sky")
    coefficients = _perez_coefficients(clearness, brightness, sun_zenith)
    value = _relative_luminance(coefficients, up, sun_angle, sun_zenith)
    return np.where(up >= 0, np.maximum(value, 0), 0.0)


def sky_angles(direction: ArrayLike, sun_direction: ArrayLike, model: str) -> tuple[Floats, Floats, float]:
    """The sines (...) of directions above the horizon, their angles from the sun (...), and the sun's from the zenith.

    Angles are in rad.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        model: named in the error.
    """
    d, sun = np.asarray(direction, dtype=np.float64), np.asarray(sun_direction, dtype=np.float64)
    sun_zenith = float(np.radians(angle_between(sun, [0.0, 1.0, 0.0])))
    if not sun_zenith <= np.pi / 2 + 1e-6:
        sentence = f"The sun is below the horizon; the {model} needs it above."
        raise ParameterError(sentence, "sun_direction", ErrorCode.NIGHT)
    return d[..., 1], np.radians(angle_between(d, sun)), sun_zenith


def _relative_luminance(
    coefficients: ArrayLike,
    up: Floats,
    sun_angle: Floats,
    sun_zenith: float,
    least_cosine: float = _MIN_COSINE,
    at_right_angle: float = 0.0,
) -> Floats:
    """(1 + a exp(b / cos theta)) (1 + c (exp(d gamma) - g) + e cos^2 gamma) over the same of the zenith (...).

    Args:
        coefficients: a, b, c, d, e (5,).
        up: (...) cos theta, of the angle from the zenith.
        sun_angle: (...) rad, gamma.
        sun_zenith: rad, the zenith's angle from the sun.
        least_cosine: that counts as cos theta.
        at_right_angle: g.
    """
    a, b, c, d, e = np.asarray(coefficients, dtype=np.float64)

    def luminance(cosine: Floats | float, angle: Floats | float) -> Floats:
        gradation = 1 + a * np.exp(b / np.maximum(cosine, least_cosine))
        return np.asarray(gradation * (1 + c * (np.exp(d * angle) - at_right_angle) + e * np.cos(angle) ** 2))

    return np.asarray(luminance(up, sun_angle) / luminance(1.0, sun_zenith))


def perez_weather(weather: Weather, sun_direction: ArrayLike) -> tuple[float, float]:
    """The clearness and brightness that the all-weather model takes, within its range.

    Brightness is the diffuse irradiance x the relative air mass by Kasten and Young [2], over that outside of the air.

    Args:
        weather: of which `beam` and `diffuse` count.
        sun_direction: (3,) unit vector.
    """
    zenith = np.radians(90.0 - max(float(angles(sun_direction)[1]), 0.0))
    cubed = 1.041 * zenith**3
    clearness = (1.0 + weather.beam + cubed) / (1 + cubed)
    degrees = np.degrees(zenith)
    air_mass = 1 / (np.cos(np.radians(degrees)) + 0.50572 * (96.07995 - degrees) ** -1.6364)
    brightness = np.clip(weather.diffuse * air_mass / _SOLAR_CONSTANT, *_BRIGHTNESS_RANGE)
    return float(clearness), float(brightness)


def _perez_coefficients(clearness: float, brightness: float, sun_zenith: float) -> Floats:
    """a, b, c, d, e (5,) of the luminance, by the sun's angle from the zenith [rad]; ParameterError out of range."""
    low, high = _BRIGHTNESS_RANGE
    if not clearness >= 1:
        sentence = f"The sky's clearness is {clearness:g}; it is 1 or more."
        raise ParameterError(sentence, "clearness", ErrorCode.OUT_OF_RANGE)
    if not low <= brightness <= high:
        sentence = f"The sky's brightness is {brightness:g}; the model covers {low:g} to {high:g}."
        raise ParameterError(sentence, "brightness", ErrorCode.OUT_OF_RANGE)
    row = int(np.searchsorted(_CLEARNESS_BINS, clearness, side="right")) - 1
    delta = max(brightness, _MIN_BROKEN_BRIGHTNESS) if 1.065 < clearness < 2.8 else brightness
    x = _TABLE[row]
    coefficients = x[:, 0] + x[:, 1] * sun_zenith + delta * (x[:, 2] + x[:, 3] * sun_zenith)
    if row == 0:
        c, d = x[2], x[3]
        coefficients[2] = np.exp((delta * (c[0] + c[1] * sun_zenith)) ** c[2]) - c[3]
        coefficients[3] = -np.exp(delta * (d[0] + d[1] * sun_zenith)) + d[2] + delta * d[3]
    return np.asarray(coefficients)


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
_MIN_COSINE_CIE = 1e-6  # of the zenith angle: at the horizon the exponent ends at minus infinity


def overcast_luminance(direction: ArrayLike) -> Floats:
    """Luminance / zenith's (...) of the standard overcast sky; 0 below the horizon.

    It is (1 + 2 sin elevation) / 3, whose horizontal illuminance is 7 pi / 9 [5].

    Args:
        direction: (..., 3) unit vectors.
    """
    up = np.asarray(direction, dtype=np.float64)[..., 1]
    return np.where(up >= 0, (1 + 2 * up) / 3, 0.0)


def general_luminance(direction: ArrayLike, sun_direction: ArrayLike, kind: int) -> Floats:
    """Luminance / zenith's (...) of the general sky [3]; 0 below the horizon, the sun's disc not included.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        kind: type 1 to 5 overcast, 6 to 10 partly cloudy, 11 to 15 clear; else ParameterError.
    """
    up, sun_angle, sun_zenith = sky_angles(direction, sun_direction, "general sky")
    if not 1 <= kind <= len(_TYPES):
        sentence = f"The sky type is {kind}; the CIE general sky has types 1 to {len(_TYPES)}."
        raise ParameterError(sentence, "kind", ErrorCode.UNKNOWN)
    gradation, indicatrix = _TYPES[kind - 1]
    coefficients = (*_GRADATION[gradation], *_INDICATRIX[indicatrix])
    at_right_angle = float(np.exp(coefficients[3] * np.pi / 2))  # the indicatrix is 1 there
    value = _relative_luminance(coefficients, up, sun_angle, sun_zenith, _MIN_COSINE_CIE, at_right_angle)
    return np.where(up >= 0, value, 0.0)


TURBIDITIES = (1.7, 10.0)  # the authors fitted 2 to 6; below 1.7 the luminance of a high sun's zenith turns negative

_BETA, _KAPPA = 20.0, 0.1  # of a clear sun: half of its light lies within about two degrees
_GLOW_RANGES = {"beta": (1.0, 50.0), "kappa": (0.0, 1.0)}
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
    """Linear Rec.709 (..., 3) in kcd m^-2, without the sun's disc [6]; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        turbidity: 1.7 to 10, else ParameterError.
    """
    up, sun_zenith, (luminance, x, y) = _by_zenith(direction, sun_direction, turbidity)
    chi = (4 / 9 - turbidity / 120) * (np.pi - 2 * sun_zenith)
    zenith_luminance = (4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192
    powers = np.array([turbidity**2, turbidity, 1.0]), np.array([sun_zenith**3, sun_zenith**2, sun_zenith, 1.0])
    zenith_x, zenith_y = (powers[0] @ table @ powers[1] for table in _ZENITH)
    luminance, x, y = luminance * max(zenith_luminance, 0.0), x * zenith_x, y * zenith_y
    xyz = np.stack([luminance * x / y, luminance, luminance * (1 - x - y) / y], axis=-1)
    return np.asarray(np.where(up[..., None] >= 0, np.maximum(xyz @ _TO_REC709.T, 0.0), 0.0))


def _by_zenith(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> tuple[Floats, float, list[Floats]]:
    """Sines (...) above the horizon, the sun's zenith angle [rad], luminance, x and y (...) by the zenith's."""
    low, high = TURBIDITIES
    if not low <= turbidity <= high:
        sentence = f"The turbidity is {turbidity:g}; the sky of Preetham covers {low:g} to {high:g}."
        raise ParameterError(sentence, "turbidity", ErrorCode.OUT_OF_RANGE)
    up, sun_angle, sun_zenith = sky_angles(direction, sun_direction, "sky of Preetham")
    rows = _DISTRIBUTION @ [turbidity, 1.0]
    return up, sun_zenith, [_relative_luminance(row, up, sun_angle, sun_zenith) for row in rows]


def lalonde_matthews_sky(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Radiance / the zenith's (...) [7], to be multiplied with the sky's color; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) unit vector, not below the horizon, else ParameterError.
        turbidity: values outside 1.7 to 10 count as these ends.
    """
    up, _, (luminance, _, _) = _by_zenith(direction, sun_direction, float(np.clip(turbidity, *TURBIDITIES)))
    return np.where(up >= 0, np.maximum(luminance, 0.0), 0.0)


def lalonde_matthews_sun(
    direction: ArrayLike, sun_direction: ArrayLike, beta: float = _BETA, kappa: float = _KAPPA
) -> Floats:
    """Radiance of the sun (...) [7], to be multiplied with its color; 0 below the horizon. ParameterError out of range.

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

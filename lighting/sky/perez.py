"""The all-weather sky of Perez, Seals and Michalsky: luminance from what an irradiance meter says of the sky.

Luminance is relative to the zenith's; directions are unit vectors in the frame of geometry.py (+Y up). The circumsolar
and horizon coefficients of the 1990 paper, which tilted-plane irradiance programs use, are another table.

References:
    [1] Perez, Seals, Michalsky, All-weather model for sky luminance distribution - preliminary configuration and
        validation, Solar Energy 50(3), 1993, table 1, with the erratum of volume 51, page 423.
    [2] Kasten and Young, Revised optical air mass tables and approximation formula, Applied Optics 28, 1989.
"""

import numpy as np
from numpy.typing import ArrayLike

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angles
from lighting.sky import Weather, sky_angles

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
    value = _relative_luminance(coefficients, up, sun_angle)
    zenith = _relative_luminance(coefficients, np.asarray(1.0), np.asarray(sun_zenith))
    return np.asarray(np.where(up >= 0, np.maximum(value / zenith, 0), 0.0))


def perez_weather(weather: Weather, sun_direction: ArrayLike) -> tuple[float, float]:
    """The clearness and brightness that the all-weather model takes, within its range.

    Args:
        weather: of which `beam` and `diffuse` count.
        sun_direction: (3,) unit vector.
    """
    zenith = np.radians(90.0 - max(float(angles(sun_direction)[1]), 0.0))
    clearness = float(_sky_clearness(1.0, weather.beam, zenith))
    brightness = float(np.clip(_sky_brightness(weather.diffuse, zenith), *_BRIGHTNESS_RANGE))
    return clearness, brightness


def _perez_coefficients(clearness: float, brightness: float, sun_zenith: float) -> Floats:
    """a, b, c, d, e (5,) of luminance = (1 + a exp(b / cos theta)) (1 + c exp(d gamma) + e cos^2 gamma).

    `sun_zenith` [rad] is the sun's angle from the zenith, theta the direction's and gamma its angle from the sun.
    Raises ParameterError out of range.
    """
    _check_weather(clearness, brightness)
    row = int(np.searchsorted(_CLEARNESS_BINS, clearness, side="right")) - 1
    delta = max(brightness, _MIN_BROKEN_BRIGHTNESS) if 1.065 < clearness < 2.8 else brightness
    x = _TABLE[row]
    coefficients = x[:, 0] + x[:, 1] * sun_zenith + delta * (x[:, 2] + x[:, 3] * sun_zenith)
    if row == 0:
        c, d = x[2], x[3]
        coefficients[2] = np.exp((delta * (c[0] + c[1] * sun_zenith)) ** c[2]) - c[3]
        coefficients[3] = -np.exp(delta * (d[0] + d[1] * sun_zenith)) + d[2] + delta * d[3]
    return np.asarray(coefficients)


def _sky_clearness(diffuse: ArrayLike, direct: ArrayLike, sun_zenith: ArrayLike) -> Floats:
    """Clearness (...) from diffuse horizontal and direct normal irradiance (...), in one unit, and the angle [rad]."""
    cubed = 1.041 * np.asarray(sun_zenith, dtype=np.float64) ** 3
    diffuse = np.asarray(diffuse, dtype=np.float64)
    return np.asarray(((diffuse + direct) / diffuse + cubed) / (1 + cubed))


def _sky_brightness(diffuse: ArrayLike, sun_zenith: ArrayLike, extraterrestrial: float = _SOLAR_CONSTANT) -> Floats:
    """Brightness (...): diffuse horizontal irradiance (...) [W m^-2] x relative air mass / that outside the atmosphere.

    The air mass is Kasten and Young's [2].
    """
    zenith = np.degrees(np.asarray(sun_zenith, dtype=np.float64))
    air_mass = 1 / (np.cos(np.radians(zenith)) + 0.50572 * (96.07995 - zenith) ** -1.6364)
    return np.asarray(np.asarray(diffuse, dtype=np.float64) * air_mass / extraterrestrial)


def _relative_luminance(coefficients: Floats, up: Floats, sun_angle: Floats) -> Floats:
    a, b, c, d, e = coefficients
    gradation = 1 + a * np.exp(b / np.maximum(up, _MIN_COSINE))
    return np.asarray(gradation * (1 + c * np.exp(d * sun_angle) + e * np.cos(sun_angle) ** 2))


def _check_weather(clearness: float, brightness: float) -> None:
    low, high = _BRIGHTNESS_RANGE
    if not clearness >= 1:
        sentence = f"The sky's clearness is {clearness:g}; it is 1 or more."
        raise ParameterError(sentence, "clearness", ErrorCode.OUT_OF_RANGE)
    if not low <= brightness <= high:
        sentence = f"The sky's brightness is {brightness:g}; the model covers {low:g} to {high:g}."
        raise ParameterError(sentence, "brightness", ErrorCode.OUT_OF_RANGE)

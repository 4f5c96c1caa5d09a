"""Clear skies in RGB: of Hosek and Wilkie, with their solar radiance function, and of the Prague model.

Directions are unit vectors in the frame of geometry.py (+Y up), colors are linear Rec.709. Radiance is the model's
W m^-2 sr^-1 nm^-1 seen through RGB and divided by CIE_Y_INTEGRAL, which makes the numbers those of Mitsuba 3's
`sunsky`. A radiance is never negative, though the published fits dip slightly below zero in the blue of a setting sun.

The Prague model [3, 4] is for suns from -4.2 to 90 deg, at ground level. The ground's albedo is 1/3, as in the data set
that its table was made from.

References:
    [1] Hosek and Wilkie, An Analytic Model for Full Spectral Sky-Dome Radiance, SIGGRAPH 2012.
    [2] Hosek and Wilkie, Adding a Solar-Radiance Function to the Hosek-Wilkie Skylight Model, IEEE CG&A 2013.
    [3] Wilkie et al., A Fitted Radiance and Attenuation Model for Realistic Atmospheres, SIGGRAPH 2021.
    [4] Vevoda et al., A Wide Spectral Range Sky Radiance Model, Computer Graphics Forum 41(7), 2022.
"""

import math
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.checksum import read_checked
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import SUN_RADIUS, Floats, angles, direction

CIE_Y_INTEGRAL = 106.75  # nm, the integral of the CIE 1931 luminosity curve
LUX = 683.0 * CIE_Y_INTEGRAL  # lm m^-2 of irradiance 1 in the units of Hosek and Wilkie's sky
SUN_RGB_FACTOR = 467.069280386  # nm, what takes the published sun's RGB fit to the sky's units before the division
SUN_SOLID_ANGLE = float(2 * np.pi * (1 - np.cos(np.radians(SUN_RADIUS))))  # sr

_HOSEK_WILKIE_TABLE, _PRAGUE_TABLE = "hosek_wilkie.f32", "prague.f16"
# By export/data/sky_tables.py of commit de718dbf. Of the arrays in the first, one behind the other:
_SHAPES = {"sky": (10, 2, 6, 3, 9), "sky_radiance": (10, 2, 6, 3), "sun": (10, 45, 3, 4, 6)}
_RANGES = {"sun elevation": (0.0, 90.0), "turbidity": (1.0, 10.0), "albedo": (0.0, 1.0)}
_ROUNDING = 1e-3  # how far beyond the ends of its range a value may lie, for angles that went through float32
_BINOMIAL = np.array([1.0, 5.0, 10.0, 10.0, 5.0, 1.0])

# Of the Prague model.
MIN_SUN_ELEVATION = -4.2  # deg
RANK = 12  # of the table's product of factors
VISIBILITIES = np.array([20.0, 27.6, 40.0, 59.4, 90.0, 131.8])  # km
SUN_ELEVATIONS = np.array(  # deg
    [-4.2, -3.5, -2.5, -1.5, -0.5, 1.0, 5.23, 11.25, 18.64, 27.17, 36.71, 47.16, 58.46, 70.53, 83.34, 90.0]
)
SUN_ANGLES = np.concatenate(  # deg from the sun
    [np.arange(0, 12, 0.5), np.arange(12, 30), np.arange(30, 120, 2.5), np.arange(120, 181, 5)]
)
ZENITH_ANGLES = np.concatenate(  # deg
    [[0, 1, 2, 4, 7, 10, 14], np.arange(18, 59, 5), [62, 66], np.arange(70, 84, 2), np.arange(84, 90.1, 0.5)]
)

_CLEAREST, _HAZIEST = 4.0, 10.0  # turbidities of the largest and the least visibility
_ELEVATION_ROUNDING = 1e-3  # deg below the lowest sun, for angles that went through float32


def sky_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float, albedo: float) -> Floats:
    """Sky radiance (..., 3) without the sun's disc [1]; 0 below the horizon. ParameterError out of range.

    Args:
        direction: (..., 3) unit vectors; float32 gives float32, all others float64.
        sun_direction: (3,) vector, not below the horizon.
        turbidity: 1 to 10.
        albedo: of the ground, 0 to 1.
    """
    d, chord, elevation = _chord_from_sun(direction, sun_direction)
    coefficients, radiance = sky_parameters(elevation, turbidity, albedo)
    result, up = np.empty_like(d), d[..., 1]
    for channel in range(3):
        gradation, offset = sky_gradation(coefficients[channel], up)
        value = gradation * (sky_lobe(coefficients[channel], chord) + offset) * d.dtype.type(radiance[channel])
        result[..., channel] = np.where(up >= 0, np.maximum(value, 0), 0)
    return result


def _chord_from_sun(direction: ArrayLike, sun_direction: ArrayLike) -> tuple[Floats, Floats, float]:
    """Unit vectors (..., 3) as floats, their squared distances (...) from the sun's, and its elevation [deg]."""
    d, sun = np.asarray(direction), np.asarray(sun_direction, dtype=np.float64)
    d = d if d.dtype == np.float32 else d.astype(np.float64)
    unit_sun = (sun / np.linalg.norm(sun)).astype(d.dtype)
    return d, np.sum((d - unit_sun) ** 2, axis=-1), float(angles(sun)[1])


@lru_cache(maxsize=8)  # of a photo's sky, that several maps show
def sky_parameters(sun_elevation: float, turbidity: float, albedo: float) -> tuple[Floats, Floats]:
    """Coefficients (3, 9) and mean radiance (3,) of a sky, rows r, g, b, to be read alone. ParameterError out of range.

    Let theta be the angle from the zenith and gamma that from the sun [rad]. A channel's radiance is the product of
    its mean radiance, f and g:

        f = 1 + c0 exp(c1 / (cos theta + 0.01))
        g = c2 + c3 exp(c4 gamma) + c5 cos^2 gamma + c6 chi + c7 sqrt(cos theta)
        chi = (1 + cos^2 gamma) / (1 + c8^2 - 2 c8 cos gamma)^1.5

    Args:
        sun_elevation: deg above the horizon, 0 to 90.
        turbidity: 1 to 10.
        albedo: of the ground, 0 to 1.
    """
    x = (_check_range("sun elevation", sun_elevation) / 90.0) ** (1 / 3)
    share, power, table = _check_range("albedo", albedo), np.arange(6), _load_tables()
    weight = _BINOMIAL * x**power * (1 - x) ** (5 - power)  # of the control points of a quintic Bezier curve

    def mix(name: str) -> Floats:
        dark, bright = _interpolate_turbidity(table[name], turbidity)
        return np.asarray(np.tensordot(weight, dark * (1 - share) + bright * share, axes=1))

    coefficients, radiance = mix("sky"), mix("sky_radiance") / CIE_Y_INTEGRAL
    for values in (coefficients, radiance):
        values.setflags(write=False)
    return coefficients, radiance


def sky_coefficients(sun_elevation: float, turbidity: float, ground_albedo: float) -> dict[str, list[float]]:
    """`sky_parameters` as plain numbers for JSON: r, g, b with nine coefficients each, and radiance with three.

    Args:
        sun_elevation: deg above the horizon, 0 to 90.
        turbidity: 1 to 10.
        ground_albedo: 0 to 1.
    """
    coefficients, radiance = sky_parameters(sun_elevation, turbidity, ground_albedo)
    rows = {"r": coefficients[0], "g": coefficients[1], "b": coefficients[2], "radiance": radiance}
    return {name: [float(f"{value:.7g}") for value in row] for name, row in rows.items()}


def sky_gradation(coefficients: Floats, up: Floats) -> tuple[Floats, Floats]:
    """The two terms (...) that depend on the cosine from the zenith (...) alone: a factor and, inside it, an offset.

    One channel's radiance is its mean radiance x factor x (`sky_lobe` + offset).

    Args:
        coefficients: (9,) of a channel.
        up: (...) cosine of the angle from the zenith, -1 to 1.
    """
    a, b, i = (up.dtype.type(coefficients[index]) for index in (0, 1, 7))
    cosine = np.maximum(up, 0)
    return 1 + a * np.exp(b / (cosine + up.dtype.type(0.01))), i * np.sqrt(cosine)


def sky_lobe(coefficients: Floats, chord: Floats, angle: Floats | None = None) -> Floats:
    """The terms (...) that depend on the angle to the sun alone.

    The chord keeps full precision next to the sun, where the cosine has none left.

    Args:
        coefficients: (9,) of a channel.
        chord: (...) squared distance |a - b|^2 of the unit vectors, 0 to 4.
        angle: (...) rad, 0 to pi; None: computed from the chord.
    """
    c, d, e, f, g, h = (chord.dtype.type(coefficients[index]) for index in (2, 3, 4, 5, 6, 8))
    gamma = 2 * np.arcsin(np.minimum(np.sqrt(chord) / 2, 1)) if angle is None else angle
    cosine2 = np.square(1 - chord / 2)
    distance2 = (1 - h) * (1 - h) + h * chord
    return np.asarray(c + d * np.exp(e * gamma) + f * cosine2 + g * (1 + cosine2) / (distance2 * np.sqrt(distance2)))


def sun_disc_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Radiance (..., 3) of the sun's disc alone, limb darkening included [2]; 0 outside it and below the horizon.

    The air mass is that of each direction, so a low sun is redder at its lower edge. ParameterError out of range.

    Args:
        direction: (..., 3) unit vectors.
        sun_direction: (3,) vector to the disc's center, not below the horizon.
        turbidity: 1 to 10.
    """
    d = np.asarray(direction, dtype=np.float64)
    sun = np.asarray(sun_direction, dtype=np.float64)
    if not sun[1] >= 0:
        _check_range("sun elevation", float(angles(sun)[1]))  # refuses a sun below the horizon
    half = np.sum((d - sun / np.linalg.norm(sun)) ** 2, axis=-1) / 4  # sin^2 of half the angle from the center
    limb = 1 - 4 * half * (1 - half) / np.sin(np.radians(SUN_RADIUS)) ** 2
    inside = (half < 0.5) & (limb >= 0) & (d[..., 1] >= 0)
    result = np.zeros(d.shape)
    result[inside] = _disc_radiance(np.arcsin(np.clip(d[..., 1][inside], 0, 1)), np.sqrt(limb[inside]), turbidity)
    return result


def sun_radiance(sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Mean radiance (3,) over the part of the sun's disc that is above the horizon.

    Args:
        sun_direction: (3,) vector, not below the horizon.
        turbidity: 1 to 10.
    """
    points, weight = sun_disc_points(sun_direction)
    return np.asarray(weight @ sun_disc_radiance(points, sun_direction, turbidity) / weight.sum())


def sun_disc_points(sun_direction: ArrayLike, rings: int = 24, spokes: int = 96) -> tuple[Floats, Floats]:
    """Unit vectors (N, 3) evenly over the sun's disc, and the solid angle [sr] (N,) of each; 0 below the horizon.

    Args:
        sun_direction: (3,) vector to the disc's center.
        rings: of points around the center.
        spokes: points of a ring.
    """
    sun = np.asarray(sun_direction, dtype=np.float64)
    azimuth, elevation = map(float, angles(sun))
    axes = np.stack([direction(azimuth + 90, 0), direction(azimuth, elevation + 90), direction(azimuth, elevation)])
    cosine = 1 - (1 - np.cos(np.radians(SUN_RADIUS))) * (np.arange(rings) + 0.5) / rings
    angle = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
    sine, depth = np.sqrt(1 - cosine**2)[:, None], np.repeat(cosine[:, None], spokes, axis=1)
    points = np.stack([sine * np.cos(angle), sine * np.sin(angle), depth], axis=-1).reshape(-1, 3) @ axes
    return points, np.where(points[:, 1] >= 0, SUN_SOLID_ANGLE / len(points), 0.0)


def _disc_radiance(elevation: Floats, limb: Floats, turbidity: float) -> Floats:
    """Radiance (N, 3) at elevations (N,) [rad] and cosines (N,) of the sun's surface normal to the line of sight."""
    table = _interpolate_turbidity(_load_tables()["sun"], turbidity)
    segments = len(table)
    segment = np.clip((np.cbrt(elevation * 2 / np.pi) * segments).astype(np.intp), 0, segments - 1)
    x = elevation - np.pi / 2 * (segment / segments) ** 3
    value = np.empty((len(x), 3))
    for number in range(segment.min(initial=segments), segment.max(initial=-1) + 1):  # one or two in a disc
        inside = np.flatnonzero(segment == number)
        by_limb = table[number].reshape(-1, table.shape[-1]) @ _powers(limb[inside], table.shape[-1])
        terms = by_limb.reshape(3, table.shape[-2], -1) * _powers(x[inside], table.shape[-2])
        value[inside] = terms.sum(axis=1).T
    return np.asarray(np.maximum(value, 0) * (SUN_RGB_FACTOR / CIE_Y_INTEGRAL))


def _powers(values: Floats, count: int) -> Floats:
    """The powers (count, N) of values (N,), from 0."""
    powers = np.ones((count, len(values)))
    for exponent in range(1, count):
        np.multiply(powers[exponent - 1], values, out=powers[exponent])
    return powers


@lru_cache(maxsize=1)
def _load_tables() -> dict[str, Floats]:
    """The published coefficients."""
    values = np.frombuffer(read_checked(_HOSEK_WILKIE_TABLE), "<f4").astype(np.float64)
    ends = np.cumsum([math.prod(shape) for shape in _SHAPES.values()])
    parts = np.split(values, ends[:-1])
    return {name: part.reshape(shape) for (name, shape), part in zip(_SHAPES.items(), parts, strict=True)}


def _interpolate_turbidity(table: Floats, turbidity: float) -> Floats:
    """The table (10, ...) between whole turbidities."""
    position = _check_range("turbidity", turbidity) - 1
    low = min(int(position), len(table) - 2)
    share = position - low
    return np.asarray(table[low] * (1 - share) + table[low + 1] * share)


def _check_range(name: str, value: float) -> float:
    low, high = _RANGES[name]
    if not low - _ROUNDING <= value <= high + _ROUNDING:
        sentence = f"The {name} is {value:g}; the sky model covers {low:g} to {high:g}."
        raise ParameterError(sentence, name.replace(" ", "_"), ErrorCode.OUT_OF_RANGE)
    return min(max(float(value), low), high)


# The Prague model.


def prague_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Sky radiance (..., 3) without the sun's disc; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors; float32 gives float32, all others float64.
        sun_direction: (3,) vector, not lower than 4.2 deg below the horizon, else ParameterError.
        turbidity: 1 to 10, by `_visibility_from_turbidity`.
    """
    d, chord2, elevation = _chord_from_sun(direction, sun_direction)
    sun_angle = np.degrees(2 * np.arcsin(np.minimum(np.sqrt(chord2) / 2, 1)))
    zenith_angle = np.degrees(np.arccos(np.clip(d[..., 1], 0, 1)))
    (across, share), (down, part) = _cell(SUN_ANGLES, sun_angle), _cell(ZENITH_ANGLES, zenith_angle)
    table, width = _radiance_table(elevation, turbidity).reshape(-1, 3), len(ZENITH_ANGLES)
    corner = across * width + down
    near = table[corner] * (1 - part) + table[corner + 1] * part
    far = table[corner + width] * (1 - part) + table[corner + width + 1] * part
    radiance = near * (1 - share) + far * share
    radiance[d[..., 1] < 0] = 0
    return np.asarray(radiance, dtype=d.dtype)


def prague_by_angles(zenith_angle: Floats, sun_angle: Floats, sun_elevation: float, turbidity: float) -> Floats:
    """Sky radiance (3, R, N) by angles; `prague_radiance` has it by directions.

    Args:
        zenith_angle: (R,) deg, 0 to 90.
        sun_angle: (N,) deg, 0 to 180.
        sun_elevation: deg, -4.2 to 90, else ParameterError.
        turbidity: 1 to 10, by `_visibility_from_turbidity`.
    """
    table = _radiance_table(sun_elevation, turbidity)
    down, part = _cell(ZENITH_ANGLES, zenith_angle)
    rows = table[:, down] * (1 - part) + table[:, down + 1] * part
    across, share = _cell(SUN_ANGLES, sun_angle)
    between = rows.take(across, axis=0) * (1 - share[..., None])  # (N, R, 3), of which whole rows are copied
    between += rows.take(across + 1, axis=0) * share[..., None]
    return np.ascontiguousarray(between.transpose(2, 1, 0))


def _visibility_from_turbidity(turbidity: float) -> float:
    """The visibility [km] whose sky is most like that of Hosek and Wilkie: 131.8 km up to turbidity 4, 20 km at 10.

    Between them its logarithm is linear. At suns from 8 to 60 deg the luminances of the two skies agree best near it.

    Args:
        turbidity: Linke, 1 to 10; beyond 4 and 10 the ends count.
    """
    share = (min(max(turbidity, _CLEAREST), _HAZIEST) - _CLEAREST) / (_HAZIEST - _CLEAREST)
    return float(VISIBILITIES[-1] * (VISIBILITIES[0] / VISIBILITIES[-1]) ** share)


def _cell(nodes: Floats, angle: Floats) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The node (...) below each angle, and how far (..., 1) it lies towards the next."""
    position = np.interp(angle, nodes, np.arange(len(nodes)))
    low = np.minimum(position.astype(np.intp), len(nodes) - 2)
    return low, np.asarray(position - low, dtype=np.float32)[..., None]


@lru_cache(maxsize=4)  # a photo's sky is compared before it is painted
def _radiance_table(elevation: float, turbidity: float) -> NDArray[np.float32]:
    """Radiance (S, Z, 3) at the nodes under one sun [deg]: linear between the skies of the table, as in [3].

    ParameterError under a sun that is too low.
    """
    if elevation < MIN_SUN_ELEVATION - _ELEVATION_ROUNDING:
        sentence = f"The sun is {-elevation:.1f} deg below the horizon; the Prague sky reaches down to 4.2 deg."
        raise ParameterError(sentence, "sun_direction", ErrorCode.NIGHT)
    skies, split = _load_skies(), len(SUN_ANGLES)
    radiance = np.zeros((split, len(ZENITH_ANGLES), 3), dtype=np.float32)
    for v, by_visibility in _neighbors(VISIBILITIES, _visibility_from_turbidity(turbidity)):
        for e, by_sun in _neighbors(SUN_ELEVATIONS, elevation):
            factors = skies[v, e].astype(np.float32)
            stops = factors[:, :split] @ factors[:, split:].transpose(0, 2, 1)
            radiance += np.float32(by_visibility * by_sun) * np.exp2(stops).transpose(1, 2, 0)
    radiance.setflags(write=False)  # since others get it as well
    return radiance


def _neighbors(values: Floats, value: float) -> list[tuple[int, float]]:
    """The two places of sorted values (N,) around one, and their shares."""
    position = float(np.interp(value, values, np.arange(len(values))))
    low = min(int(position), len(values) - 2)
    return [(low, 1 - position + low), (low + 1, position - low)]


@lru_cache(maxsize=1)
def _load_skies() -> NDArray[np.float16]:
    """log2 radiance as factors (V, E, 3, S + Z, RANK), by visibility, sun, channel and angle."""
    shape = len(VISIBILITIES), len(SUN_ELEVATIONS), 3, len(SUN_ANGLES) + len(ZENITH_ANGLES), RANK
    return np.frombuffer(read_checked(_PRAGUE_TABLE), "<f2").reshape(shape)

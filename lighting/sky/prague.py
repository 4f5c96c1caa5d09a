"""The clear sky of the Prague model [1, 2] in RGB, for suns from -4.2 to 90 deg, at ground level.

Directions are unit vectors in the frame of geometry.py (+Y up), colors are linear Rec.709 in the units of
hosek_wilkie.py. The ground's albedo is 1/3, as in the data set that the table was made from.

References:
    [1] Wilkie et al., A Fitted Radiance and Attenuation Model for Realistic Atmospheres, SIGGRAPH 2021.
    [2] Vevoda et al., A Wide Spectral Range Sky Radiance Model, Computer Graphics Forum 41(7), 2022.
"""

from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, angles

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

_DATA = Path(__file__).parent.parent / "data" / "prague.f16"  # export/data/sky_tables.py made it
_CLEAREST, _HAZIEST = 4.0, 10.0  # turbidities of the largest and the least visibility
_ROUNDING = 1e-3  # deg below the lowest sun, for angles that went through float32


def prague_radiance(direction: ArrayLike, sun_direction: ArrayLike, turbidity: float) -> Floats:
    """Sky radiance (..., 3) without the sun's disc; 0 below the horizon.

    Args:
        direction: (..., 3) unit vectors; float32 gives float32, all others float64.
        sun_direction: (3,) vector, not lower than 4.2 deg below the horizon, else ParameterError.
        turbidity: 1 to 10, by `visibility_from_turbidity`.
    """
    d = np.asarray(direction)
    d = d if d.dtype == np.float32 else d.astype(np.float64)
    sun = np.asarray(sun_direction, dtype=np.float64)
    elevation = _checked_elevation(float(angles(sun)[1]))
    unit_sun = (sun / np.linalg.norm(sun)).astype(d.dtype)
    chord = np.sqrt(np.sum((d - unit_sun) ** 2, axis=-1))
    sun_angle = np.degrees(2 * np.arcsin(np.minimum(chord / 2, 1)))
    zenith_angle = np.degrees(np.arccos(np.clip(d[..., 1], 0, 1)))
    radiance = _interpolate(_radiance_table(elevation, turbidity), sun_angle, zenith_angle)
    radiance[d[..., 1] < 0] = 0
    return np.asarray(radiance, dtype=d.dtype)


def prague_by_angles(zenith_angle: Floats, sun_angle: Floats, sun_elevation: float, turbidity: float) -> Floats:
    """Sky radiance (3, R, N) by angles; `prague_radiance` has it by directions.

    Args:
        zenith_angle: (R,) deg, 0 to 90.
        sun_angle: (N,) deg, 0 to 180.
        sun_elevation: deg, -4.2 to 90, else ParameterError.
        turbidity: 1 to 10, by `visibility_from_turbidity`.
    """
    table = _radiance_table(_checked_elevation(sun_elevation), turbidity)
    down, part = _cell(ZENITH_ANGLES, zenith_angle)
    rows = table[:, down] * (1 - part) + table[:, down + 1] * part
    across, share = _cell(SUN_ANGLES, sun_angle)
    by_channel = rows.transpose(2, 1, 0)
    return np.asarray(by_channel[..., across] * (1 - share[:, 0]) + by_channel[..., across + 1] * share[:, 0])


def _visibility_from_turbidity(turbidity: float) -> float:
    """The visibility [km] whose sky is most like that of Hosek and Wilkie: 131.8 km up to turbidity 4, 20 km at 10.

    Between them its logarithm is linear. At suns from 8 to 60 deg the luminances of the two skies agree best near it.

    Args:
        turbidity: Linke, 1 to 10; beyond 4 and 10 the ends count.
    """
    share = (min(max(turbidity, _CLEAREST), _HAZIEST) - _CLEAREST) / (_HAZIEST - _CLEAREST)
    return float(VISIBILITIES[-1] * (VISIBILITIES[0] / VISIBILITIES[-1]) ** share)


def _checked_elevation(elevation: float) -> float:
    if elevation < MIN_SUN_ELEVATION - _ROUNDING:
        sentence = f"The sun is {-elevation:.1f} deg below the horizon; the Prague sky reaches down to 4.2 deg."
        raise ParameterError(sentence, "sun_direction", ErrorCode.NIGHT)
    return elevation


def _interpolate(table: NDArray[np.float32], sun_angle: Floats, zenith_angle: Floats) -> Floats:
    """Radiance (..., 3) between the nodes of a table (S, Z, 3), linear in both angles [deg] (...)."""
    across, share = _cell(SUN_ANGLES, sun_angle)
    down, part = _cell(ZENITH_ANGLES, zenith_angle)
    flat, width = table.reshape(-1, 3), len(ZENITH_ANGLES)
    corner = across * width + down
    near = flat[corner] * (1 - part) + flat[corner + 1] * part
    far = flat[corner + width] * (1 - part) + flat[corner + width + 1] * part
    return np.asarray(near * (1 - share) + far * share)


def _cell(nodes: Floats, angle: Floats) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
    """The node (...) below each angle, and how far (..., 1) it lies towards the next."""
    position = np.interp(angle, nodes, np.arange(len(nodes)))
    low = np.minimum(position.astype(np.intp), len(nodes) - 2)
    return low, np.asarray(position - low, dtype=np.float32)[..., None]


@lru_cache(maxsize=4)  # a photo's sky is compared before it is painted
def _radiance_table(elevation: float, turbidity: float) -> NDArray[np.float32]:
    """Radiance (S, Z, 3) at the nodes under one sun [deg]: linear between the skies of the table, as in [1]."""
    skies, split = _load_skies(), len(SUN_ANGLES)
    radiance = np.zeros((split, len(ZENITH_ANGLES), 3), dtype=np.float32)
    for v, by_visibility in _neighbours(VISIBILITIES, _visibility_from_turbidity(turbidity)):
        for e, by_sun in _neighbours(SUN_ELEVATIONS, elevation):
            factors = skies[v, e].astype(np.float32)
            stops = factors[:, :split] @ factors[:, split:].transpose(0, 2, 1)
            radiance += np.float32(by_visibility * by_sun) * np.exp2(stops).transpose(1, 2, 0)
    radiance.setflags(write=False)  # since others get it as well
    return radiance


def _neighbours(values: Floats, value: float) -> list[tuple[int, float]]:
    """The two places of sorted values (N,) around one, and their shares."""
    position = float(np.interp(value, values, np.arange(len(values))))
    low = min(int(position), len(values) - 2)
    return [(low, 1 - position + low), (low + 1, position - low)]


@lru_cache(maxsize=1)
def _load_skies() -> NDArray[np.float16]:
    """log2 radiance as factors (V, E, 3, S + Z, RANK), by visibility, sun, channel and angle."""
    shape = len(VISIBILITIES), len(SUN_ELEVATIONS), 3, len(SUN_ANGLES) + len(ZENITH_ANGLES), RANK
    return np.fromfile(_DATA, "<f2").reshape(shape)

"""Color: transfer curves, luminance, tone mapping, chromaticities; Rec.709 primaries unless said otherwise.

HDR curves are those of Rec. ITU-R BT.2100: hybrid log-gamma (HLG) and the perceptual quantiser (PQ, also SMPTE ST
2084). Diffuse white, which is 1 in a photo, is where Report ITU-R BT.2408 puts it: 75 % of HLG's signal, 203 cd/m2 of
PQ. What is brighter is clipped, as photos clip it.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import ErrorCode, PhotoError
from lighting.geometry import Floats

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec.709, D65
CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # Rec.709 red, green, blue and D65, as x and y
H273_CHROMATICITIES = {  # the same eight of other primaries, by their numbers in ITU-T H.273
    1: CHROMATICITIES,
    4: (0.67, 0.33, 0.21, 0.71, 0.14, 0.08, 0.310, 0.316),  # BT.470 M
    5: (0.64, 0.33, 0.29, 0.60, 0.15, 0.06, 0.3127, 0.3290),  # BT.470 BG, PAL
    6: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, 0.3127, 0.3290),  # BT.601, NTSC
    7: (0.630, 0.340, 0.310, 0.595, 0.155, 0.070, 0.3127, 0.3290),  # SMPTE 240
    9: (0.708, 0.292, 0.170, 0.797, 0.131, 0.046, 0.3127, 0.3290),  # BT.2020 and BT.2100
    11: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.314, 0.351),  # P3 of cinemas
    12: (0.680, 0.320, 0.265, 0.690, 0.150, 0.060, 0.3127, 0.3290),  # P3 of displays
    22: (0.630, 0.340, 0.295, 0.605, 0.155, 0.077, 0.3127, 0.3290),  # EBU 3213
}
COLOR_SPACES = {  # of map files: the eight numbers, and the name that the Color Interop Forum gives the linear space
    "rec709": (CHROMATICITIES, "lin_rec709_scene"),
    "acescg": ((0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767), "lin_ap1_scene"),
    "linear-p3": (H273_CHROMATICITIES[12], "lin_p3d65_scene"),
}
ADOBE_RGB_CHROMATICITIES = (0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.3290)
ADOBE_RGB_GAMMA = 563 / 256
_REC709_ALPHA, _REC709_BETA = 1.09929682680944, 0.018053968510807  # of the curve of Rec.709
_A = 0.17883277  # a, b and c of HLG
_B, _C = 1.0 - 4.0 * _A, 0.5 - _A * math.log(4.0 * _A)
_M1, _M2 = 2610 / 16384, 2523 / 32  # m1 and m2, c1 to c3 of PQ
_C1, _C2, _C3 = 3424 / 4096, 2413 / 128, 2392 / 128
_PQ_PEAK, _PQ_WHITE = 10000.0, 203.0  # cd/m2, of the largest PQ signal and of diffuse white
_HLG_WHITE = 0.75  # signal of diffuse white
_SRGB_STEPS = 4096  # of the table of sRGB's curve
_SAME = 1e-3  # of x and y, by which names of the same primaries differ
_TEMPERATURE_TERMS = ((6253.80338, 0.92159), (28.70599, 0.20039), (0.00004, 0.07125))  # of Hernández-Andrés, 3000 K on
_MCCAMY_BELOW = 3000.0  # K
_MIN_RISE, _BLUEST = 1e-3, -1.5  # of its slope: bluer lights are over the largest temperature
_MIN_TEMPERATURE, _MAX_TEMPERATURE = 1000.0, 40000.0  # K; a clear north sky has 20000 and more
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])


def srgb_decode(value: ArrayLike) -> Floats:
    """Return linear light of sRGB-encoded values.

    Args:
        value: in [0, 1], of any shape.

    References:
        IEC 61966-2-1.
    """
    v = np.asarray(value)
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0.0) + 0.055) / 1.055) ** 2.4)


SRGB_LINEAR: NDArray[np.float32] = srgb_decode(np.arange(256) / 255.0).astype(np.float32)
"""Linear value (256,) of each 8-bit sRGB value."""
SRGB_LINEAR.flags.writeable = False


def srgb_encode(linear: ArrayLike) -> Floats:
    """Return sRGB-encoded values in [0, 1] of linear light.

    Args:
        linear: of any shape, clipped to [0, 1].

    References:
        IEC 61966-2-1.
    """
    v = np.clip(linear, 0.0, 1.0)
    return np.where(v <= 0.0031308, v * 12.92, 1.055 * v ** (1 / 2.4) - 0.055)


def srgb_bytes(linear: ArrayLike) -> NDArray[np.uint8]:
    """Return the 8-bit sRGB values of linear light, by a table of 4096 steps.

    Args:
        linear: of any shape, clipped to [0, 1].
    """
    steps = np.clip(np.asarray(linear, dtype=np.float32), 0.0, 1.0) * np.float32(_SRGB_STEPS) + np.float32(0.5)
    return _srgb_table().take(steps.astype(np.intp))


@lru_cache(maxsize=1)
def _srgb_table() -> NDArray[np.uint8]:
    return np.round(srgb_encode(np.arange(_SRGB_STEPS + 1) / _SRGB_STEPS) * 255.0).astype(np.uint8)


def _rec709_decode(value: ArrayLike) -> Floats:
    """Return scene light of values coded by the curve of Rec.709, which Rec.601 and Rec.2020 share (inverse OETF).

    Args:
        value: in [0, 1], of any shape.

    References:
        Rec. ITU-R BT.709-6, item 1.2; BT.2020-2, table 4, for the constants in full.
    """
    v = np.asarray(value)
    powers = ((np.maximum(v, 0.0) + _REC709_ALPHA - 1.0) / _REC709_ALPHA) ** (1.0 / 0.45)
    return np.where(v < 4.5 * _REC709_BETA, v / 4.5, powers)


def _hlg_decode(signal: ArrayLike) -> Floats:
    """Return scene light, 1 at diffuse white, of HLG signals (inverse OETF).

    Args:
        signal: in [0, 1], of any shape.

    References:
        Rec. ITU-R BT.2100, table 5.
    """
    return _hlg(np.asarray(signal, dtype=np.float64)) / float(_hlg(np.array(_HLG_WHITE)))


def _hlg(signal: Floats) -> Floats:
    bright = (np.exp((np.maximum(signal, 0.5) - _C) / _A) + _B) / 12.0
    return np.where(signal <= 0.5, np.square(signal) / 3.0, bright)


def _pq_decode(signal: ArrayLike) -> Floats:
    """Return display light, 1 at 203 cd/m2, of PQ signals (EOTF).

    Args:
        signal: in [0, 1], of any shape.

    References:
        Rec. ITU-R BT.2100, table 4.
    """
    root = np.asarray(signal, dtype=np.float64) ** (1.0 / _M2)
    return np.asarray((np.maximum(root - _C1, 0.0) / (_C2 - _C3 * root)) ** (1.0 / _M1) * (_PQ_PEAK / _PQ_WHITE))


Curve = Literal["srgb", "rec709", "pq", "hlg"]
DECODE_CURVES: dict[Curve, Callable[[ArrayLike], Floats]] = {
    "srgb": srgb_decode,
    "rec709": _rec709_decode,
    "pq": _pq_decode,
    "hlg": _hlg_decode,
}
"""From coded values in [0, 1] to linear light, 1 at diffuse white, by the name of the curve."""


def check_pixels(pixels: ArrayLike) -> NDArray[np.uint8]:
    """Return pixels as an array, not copied.

    Args:
        pixels: (h, w, 3), 8-bit sRGB, not empty.

    Raises:
        PhotoError: they are of another shape or type.
    """
    array = np.asarray(pixels)
    if array.dtype != np.uint8:
        raise PhotoError(
            f"The pixels are of type {array.dtype}; they must be 8-bit sRGB, uint8 from 0 to 255.",
            code=ErrorCode.WRONG_TYPE,
        )
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise PhotoError(f"The pixels have the shape {array.shape}; it must be (height, width, 3).")
    return array


def luminance(linear: ArrayLike) -> Floats:
    """Return the relative luminance (...) of linear colors.

    Args:
        linear: (..., 3), Rec.709.
    """
    return np.asarray(np.asarray(linear) @ LUMINANCE_WEIGHTS)


def max_channel(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest channel (...) of colors; numpy's maximum along so short an axis is ten times as slow.

    Args:
        image: (..., 3).
    """
    return np.asarray(np.maximum(np.maximum(image[..., 0], image[..., 1]), image[..., 2]))


def tone_map(image: ArrayLike, exposure: float = 1.0) -> NDArray[np.uint8]:
    """Return the 8-bit display picture of linear radiance: exposure, sRGB transfer, clip.

    Args:
        image: of any shape, linear Rec.709.
        exposure: factor of the radiance.
    """
    scaled = np.asarray(image, dtype=np.float32) * np.float32(exposure)
    return np.asarray(np.round(srgb_encode(scaled) * 255.0), dtype=np.uint8)


def chromaticities_to_rec709(chromaticities: Sequence[float]) -> NDArray[np.float32] | None:
    """Return the matrix (3, 3) from red, green and blue of some primaries to Rec.709's; None where they are the same.

    Args:
        chromaticities: x and y of red, green, blue and white: eight numbers, as an EXR has them.

    Raises:
        ValueError: they span no colors.

    References:
        SMPTE RP 177, from chromaticities to XYZ; whites are adapted by Bradford's matrix, as ICC profiles have it.
    """
    source, target = (np.array(xy, dtype=np.float64).reshape(4, 2) for xy in (chromaticities, CHROMATICITIES))
    if np.allclose(source, target, rtol=0.0, atol=_SAME):
        return None
    if not (np.isfinite(source).all() and (np.abs(source[:, 1]) > _SAME).all()):
        raise ValueError("no chromaticities")
    source_white, target_white = (_BRADFORD @ _xyz(xy[3]) for xy in (source, target))
    adapted = np.linalg.inv(_BRADFORD) @ np.diag(target_white / source_white) @ _BRADFORD
    matrix = np.linalg.inv(_to_xyz(target)) @ adapted @ _to_xyz(source)
    if not np.isfinite(matrix).all():
        raise ValueError("no colors")
    return np.asarray(matrix, dtype=np.float32)


def _to_xyz(xy: Floats) -> Floats:
    """The matrix (3, 3) from red, green and blue to XYZ, of the primaries and the white (4, 2); white has Y = 1."""
    columns = np.stack([_xyz(primary) for primary in xy[:3]], axis=1)
    return np.asarray(columns * np.linalg.solve(columns, _xyz(xy[3])))


def _xyz(xy: Floats) -> Floats:
    """XYZ (3,) of a chromaticity (2,), Y = 1."""
    return np.array([xy[0] / xy[1], 1.0, (1.0 - xy[0] - xy[1]) / xy[1]])


def color_and_intensity(irradiance: Floats) -> tuple[Floats, float]:
    """The color (3,) of a light, its largest channel 1, and its intensity; white and 0 for no light.

    Args:
        irradiance: (3,) linear Rec.709.
    """
    intensity = float(irradiance.max())
    return (irradiance / intensity if intensity > 0 else np.ones(3)), intensity


def color_temperature(linear: ArrayLike) -> float | None:
    """Return the correlated color temperature [K] of a light, 1000 to 40000; None of no light.

    Args:
        linear: (3,), linear Rec.709.

    References:
        Hernández-Andrés, Lee and Romero, Applied Optics 38 (27), 1999, from 3000 K on; McCamy, Color Research and
        Application 17 (2), 1992, below.
    """
    tristimulus = _to_xyz(np.array(CHROMATICITIES).reshape(4, 2)) @ np.asarray(linear, dtype=np.float64)
    if (total := float(tristimulus.sum())) <= 0:
        return None
    x, y = (float(value) / total for value in tristimulus[:2])
    slope = max((x - 0.3366) / max(y - 0.1735, _MIN_RISE), _BLUEST)
    kelvin = -949.86315 + sum(a * math.exp(-slope / t) for a, t in _TEMPERATURE_TERMS)
    if kelvin < _MCCAMY_BELOW:
        slope = (x - 0.3320) / (0.1858 - y)
        kelvin = 449.0 * slope**3 + 3525.0 * slope**2 + 6823.3 * slope + 5520.33
    return min(max(kelvin, _MIN_TEMPERATURE), _MAX_TEMPERATURE)

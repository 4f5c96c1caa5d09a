"""Color: transfer curves, luminance, tone mapping, chromaticities; Rec.709 primaries unless said otherwise.

HDR curves are those of Rec. ITU-R BT.2100: hybrid log-gamma (HLG) and the perceptual quantiser (PQ, also SMPTE ST
2084). Diffuse white, which is 1 in a photo, is where Report ITU-R BT.2408 puts it: 75 % of HLG's signal, 203 cd/m2 of
PQ. What is brighter is clipped, as photos clip it. Cameras' logarithms are decoded to reflectance.
"""

import math
from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import EnvironmentMapError, ErrorCode, PhotoError
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


# Logarithms of cameras, from signals in [0, 1] to reflectance: 1 of a white that reflects all light.


def _dlog_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of D-Log signals.

    Args:
        signal: in [0, 1], of any shape.

    References:
        DJI, White Paper on D-Log and D-Gamut of DJI Cinema Color System, 2017.
    """
    v = np.asarray(signal, dtype=np.float64)
    return np.where(v <= 0.14, (v - 0.0929) / 6.025, (10.0 ** (3.89616 * v - 2.27752) - 0.0108) / 0.9892)


def _slog3_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of S-Log3 signals.

    Args:
        signal: in [0, 1], 10-bit code values divided by 1023, of any shape.

    References:
        Sony, Technical Summary for S-Gamut3.Cine/S-Log3 and S-Gamut3/S-Log3, 2014.
    """
    code, cut = 1023.0 * np.asarray(signal, dtype=np.float64), 171.2102946929
    linear = (code - 95.0) * 0.01125 / (cut - 95.0)
    return np.where(code < cut, linear, 0.19 * 10.0 ** ((code - 420.0) / 261.5) - 0.01)


def _vlog_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of V-Log signals.

    Args:
        signal: in [0, 1], 10-bit code values divided by 1023, of any shape.

    References:
        Panasonic, V-Log/V-Gamut Reference Manual, 2014.
    """
    v = np.asarray(signal, dtype=np.float64)
    return np.where(v < 0.181, (v - 0.125) / 5.6, 10.0 ** ((v - 0.598206) / 0.241514) - 0.00873)


def _clog3_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of Canon Log 3 signals.

    Args:
        signal: in [0, 1], 10-bit code values divided by 1023, of any shape.

    References:
        Canon, Canon Log Gamma Curves: Description of the Canon Log, Canon Log 2 and Canon Log 3 Gamma Curves, 2018.
    """
    v, slope, gain = np.asarray(signal, dtype=np.float64), 0.36726845, 14.98325
    dark = (1.0 - 10.0 ** ((0.12783901 - v) / slope)) / gain
    bright = (10.0 ** ((v - 0.12240537) / slope) - 1.0) / gain
    linear = np.where(v <= 0.15277891, (v - 0.12512219) / 1.9754798, bright)
    return 0.9 * np.where(v < 0.097465473, dark, linear)


def _nlog_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of N-Log signals.

    Args:
        signal: in [0, 1], 10-bit code values divided by 1023, of any shape.

    References:
        Nikon, N-Log Specification Document, 1.0.0, 2018.
    """
    code = 1023.0 * np.asarray(signal, dtype=np.float64)
    return np.where(code < 452.0, (code / 650.0) ** 3 - 0.0075, np.exp((code - 619.0) / 150.0))


def _flog2_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of F-Log2 signals.

    Args:
        signal: in [0, 1], 10-bit code values divided by 1023, of any shape.

    References:
        Fujifilm, F-Log2 Data Sheet, 1.0, 2022.
    """
    v = np.asarray(signal, dtype=np.float64)
    bright = (10.0 ** ((v - 0.384316) / 0.245281) - 0.064829) / 5.555556
    return np.where(v < 0.100686686370811, (v - 0.092864) / 8.799461, bright)


def _apple_log_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of Apple Log signals.

    Args:
        signal: in [0, 1], of any shape.

    References:
        Apple, Apple Log Profile White Paper, 2023.
    """
    v, lowest, gain, cut = np.asarray(signal, dtype=np.float64), -0.05641088, 47.28711236, 0.01
    dark = np.sqrt(np.maximum(v, 0.0) / gain) + lowest
    bright = 2.0 ** ((v - 0.69336945) / 0.08550479) - 0.00964052
    return np.where(v < gain * (cut - lowest) ** 2, dark, bright)


def _logc3_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of ARRI LogC3 signals, of exposure index 800.

    Args:
        signal: in [0, 1], of any shape.

    References:
        ARRI, ALEXA Log C Curve: Usage in VFX, 2017, parameters of LogC3 (SUP 3.x and later).
    """
    v, slope, base = np.asarray(signal, dtype=np.float64), 5.367655, 0.092809
    bright = (10.0 ** ((v - 0.385537) / 0.247190) - 0.052272) / 5.555556
    return np.where(v > slope * 0.010591 + base, bright, (v - base) / slope)


def _logc4_decode(signal: ArrayLike) -> Floats:
    """Return reflectance of ARRI LogC4 signals.

    Args:
        signal: in [0, 1], of any shape.

    References:
        ARRI, LogC4 Logarithmic Color Space: Specification, 2022.
    """
    v, black, scale = np.asarray(signal, dtype=np.float64), 95.0 / 1023.0, (2.0**18 - 16.0) / 117.45
    doublings = 14.0 * (v - black) / (1.0 - black) + 6.0
    slope = 7.0 * math.log(2.0) * 2.0 ** (7.0 - 14.0 * black / (1.0 - black)) / (scale * (1.0 - black))
    lowest = (2.0 ** (6.0 - 14.0 * black / (1.0 - black)) - 64.0) / scale
    return np.where(v >= 0.0, (2.0**doublings - 64.0) / scale, v * slope + lowest)


LogCurve = Literal["d-log", "s-log3", "v-log", "c-log3", "n-log", "f-log2", "apple-log", "logc3", "logc4"]
Curve = Literal["srgb", "rec709", "pq", "hlg"] | LogCurve
DECODE_CURVES: dict[Curve, Callable[[ArrayLike], Floats]] = {
    "srgb": srgb_decode,
    "rec709": _rec709_decode,
    "pq": _pq_decode,
    "hlg": _hlg_decode,
    "d-log": _dlog_decode,
    "s-log3": _slog3_decode,
    "v-log": _vlog_decode,
    "c-log3": _clog3_decode,
    "n-log": _nlog_decode,
    "f-log2": _flog2_decode,
    "apple-log": _apple_log_decode,
    "logc3": _logc3_decode,
    "logc4": _logc4_decode,
}
"""From coded values in [0, 1] to linear light, 1 at diffuse white, by the name of the curve."""
LOG_CHROMATICITIES: dict[Curve, tuple[float, ...]] = {  # by the papers of the curves
    "d-log": (0.71, 0.31, 0.21, 0.88, 0.09, -0.08, 0.3127, 0.3290),  # D-Gamut
    "s-log3": (0.766, 0.275, 0.225, 0.800, 0.089, -0.087, 0.3127, 0.3290),  # S-Gamut3.Cine
    "v-log": (0.730, 0.280, 0.165, 0.840, 0.100, -0.030, 0.3127, 0.3290),  # V-Gamut
    "c-log3": (0.740, 0.270, 0.170, 1.140, 0.080, -0.100, 0.3127, 0.3290),  # Cinema Gamut
    "n-log": H273_CHROMATICITIES[9],
    "f-log2": H273_CHROMATICITIES[9],
    "apple-log": H273_CHROMATICITIES[9],
    "logc3": (0.6840, 0.3130, 0.2210, 0.8480, 0.0861, -0.1020, 0.3127, 0.3290),  # ARRI Wide Gamut 3
    "logc4": (0.7347, 0.2653, 0.1424, 0.8576, 0.0991, -0.0308, 0.3127, 0.3290),  # ARRI Wide Gamut 4
}
"""x and y of red, green, blue and white of the colors that signals under a logarithm are in."""
CODE_VALUE_CURVES: frozenset[Curve] = frozenset({"s-log3", "v-log", "c-log3", "n-log", "f-log2"})
"""Whose signal is the code value itself divided by the largest, in files of limited range too: black is not 0 there."""


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


def check_envmap(image: NDArray[np.floating]) -> NDArray[np.float32]:
    """Return an environment map as contiguous float32.

    Args:
        image: (H, 2H, 3) linear.

    Raises:
        EnvironmentMapError: it has another shape.
    """
    shape = np.shape(image)
    if not shape:
        sentence = f"An environment map is an array of shape (H, 2H, 3), not {type(image).__name__}."
        raise EnvironmentMapError(sentence, code=ErrorCode.WRONG_TYPE)
    if len(shape) != 3 or shape != (shape[0], 2 * shape[0], 3) or shape[0] == 0:
        raise EnvironmentMapError(f"An environment map has the shape (H, 2H, 3), not {shape}.")
    return np.ascontiguousarray(image, dtype=np.float32)


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


def tone_map(image: ArrayLike) -> NDArray[np.uint8]:
    """Return the 8-bit display picture of linear radiance: sRGB transfer, clip.

    Args:
        image: of any shape, linear Rec.709.
    """
    return np.asarray(np.round(srgb_encode(np.asarray(image, dtype=np.float32)) * 255.0), dtype=np.uint8)


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

"""Color: sRGB transfer, luminance, tone mapping, chromaticities; Rec.709 primaries unless said otherwise."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import PhotoError
from lighting.geometry import Floats

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec.709, D65
CHROMATICITIES = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)  # Rec.709 red, green, blue and D65, as x and y
_SAME = 1e-3  # of x and y, by which names of the same primaries differ
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


def check_pixels(pixels: ArrayLike) -> NDArray[np.uint8]:
    """Return pixels as an array, not copied.

    Args:
        pixels: (h, w, 3), 8-bit sRGB, not empty.

    Raises:
        PhotoError: they are of another shape or type.
    """
    array = np.asarray(pixels)
    if array.dtype != np.uint8:
        raise PhotoError(f"The pixels are of type {array.dtype}; they must be 8-bit sRGB, uint8 from 0 to 255.")
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise PhotoError(f"The pixels have the shape {array.shape}; it must be (height, width, 3).")
    return array


def luminance(linear: ArrayLike) -> Floats:
    """Return the relative luminance (...) of linear colors.

    Args:
        linear: (..., 3), Rec.709.
    """
    return np.asarray(np.asarray(linear) @ LUMINANCE_WEIGHTS)


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

"""Pixels, and transfer functions between linear light and display values, Rec.709 primaries throughout."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import PhotoError
from lighting.geometry import Floats

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], dtype=np.float32)  # Rec.709, D65


def srgb_decode(value: ArrayLike) -> Floats:
    """Linear light of sRGB-encoded values, both in [0, 1] (IEC 61966-2-1)."""
    v = np.asarray(value)
    return np.where(v <= 0.04045, v / 12.92, ((np.maximum(v, 0.0) + 0.055) / 1.055) ** 2.4)


SRGB_LINEAR: NDArray[np.float32] = srgb_decode(np.arange(256) / 255.0).astype(np.float32)
"""Linear value (256,) of each 8-bit sRGB value."""
SRGB_LINEAR.flags.writeable = False


def srgb_encode(linear: ArrayLike) -> Floats:
    """sRGB-encoded values in [0, 1] of linear light, clipped to [0, 1] (IEC 61966-2-1)."""
    v = np.clip(linear, 0.0, 1.0)
    return np.where(v <= 0.0031308, v * 12.92, 1.055 * v ** (1 / 2.4) - 0.055)


def checked_pixels(pixels: ArrayLike) -> NDArray[np.uint8]:
    """The array, not copied; PhotoError unless it is of shape (h, w, 3), not empty, and of type uint8."""
    array = np.asarray(pixels)
    if array.dtype != np.uint8:
        raise PhotoError(f"The pixels are of type {array.dtype}; they must be 8-bit sRGB, uint8 from 0 to 255.")
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise PhotoError(f"The pixels have the shape {array.shape}; it must be (height, width, 3).")
    return array


def luminance(linear: ArrayLike) -> Floats:
    """Relative luminance (...) of linear Rec.709 colours (..., 3)."""
    return np.asarray(np.asarray(linear) @ LUMINANCE_WEIGHTS)


def tone_map(image: ArrayLike, exposure: float = 1.0) -> NDArray[np.uint8]:
    """Display picture of linear radiance: exposure, sRGB transfer, clip; any shape, 8 bits."""
    scaled = np.asarray(image, dtype=np.float32) * np.float32(exposure)
    return np.asarray(np.round(srgb_encode(scaled) * 255.0), dtype=np.uint8)

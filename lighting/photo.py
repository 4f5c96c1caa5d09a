"""Bytes to upright sRGB pixels, and pixels to the network's canvas."""

import numpy as np
from numpy.typing import NDArray

from lighting.parameters import ModelSpec


def fit_size(width: int, height: int, spec: ModelSpec) -> tuple[int, int]:
    """The largest (width, height) of the photo's aspect ratio inside the network's canvas, at least 1 x 1."""
    scale = min(spec.width / width, spec.height / height)
    return max(1, round(width * scale)), max(1, round(height * scale))


def place(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    """Canvas (3, H, W) with the normalised sRGB pixels (h, w, 3) at its centre and 0, the mean colour, around them.

    Raises ValueError where the pixels do not fit; an odd margin puts the extra row or column after the photo.
    """
    height, width = pixels.shape[:2]
    if width > spec.width or height > spec.height:
        raise ValueError(f"{width} x {height} pixels do not fit the canvas of {spec.width} x {spec.height}.")
    top, left = (spec.height - height) // 2, (spec.width - width) // 2
    canvas = np.zeros((3, spec.height, spec.width), dtype=np.float32)
    canvas[:, top : top + height, left : left + width] = _normalised(pixels, spec).transpose(2, 0, 1)
    return canvas


def _normalised(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    mean, std = np.asarray(spec.mean, dtype=np.float32), np.asarray(spec.std, dtype=np.float32)
    return (pixels.astype(np.float32) / np.float32(255.0) - mean) / std

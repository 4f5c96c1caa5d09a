"""What all maps share: their type, what their rows light, and arithmetic on their pixels that is quick in numpy."""

import math

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

Image = NDArray[np.float32]


def row_levels(height: int) -> Floats:
    """Irradiance (H,) of level ground, facing up or down, by radiance 1 in each row of a map of that many rows."""
    edges = np.sin(np.linspace(-math.pi / 2, math.pi / 2, height + 1)) ** 2
    return np.abs(np.diff(edges)) * math.pi


def irradiance_of(levels: Floats, rows: Image) -> Floats:
    """Irradiance (3,) by rows (R, W, 3) of a map with these `row_levels` (R,)."""
    count, width = rows.shape[:2]
    columns = np.einsum("r,rx->x", f32(levels), rows.reshape(count, 3 * width))
    return np.asarray(columns.reshape(width, 3).mean(axis=0, dtype=np.float64))


def scale(image: Image, gain: Floats) -> None:
    """Multiply an image (R, W, 3), contiguous in memory, by a colour (3,) in place.

    Whole rows are multiplied, since numpy takes ten times as long with an innermost axis of 3.
    """
    rows = image.reshape(len(image), -1)
    rows *= np.tile(f32(gain), image.shape[1])


def brightest(image: Image) -> Image:
    """The largest channel (...) of colours (..., 3); numpy's maximum along so short an axis is ten times as slow."""
    return np.asarray(np.maximum(np.maximum(image[..., 0], image[..., 1]), image[..., 2]))


def f32(values: Floats) -> Image:
    """The values as float32."""
    return np.asarray(values, dtype=np.float32)

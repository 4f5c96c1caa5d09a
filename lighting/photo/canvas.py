"""Pixels to the network's input canvas."""

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.photo.read import Photo
from lighting.records import ModelSpec
from lighting.sizes import fitting


def fit_size(width: int, height: int, spec: ModelSpec) -> tuple[int, int]:
    """The largest (width, height) of the photo's aspect ratio inside the network's canvas, at least 1 x 1."""
    return fitting(width, height, spec.width, spec.height)


def place(pixels: NDArray[np.uint8], spec: ModelSpec) -> NDArray[np.float32]:
    """Canvas (3, H, W) with the normalised sRGB pixels (h, w, 3) at its centre and 0, the mean colour, around them.

    Raises ValueError where the pixels do not fit; an odd margin puts the extra row or column after the photo.
    """
    height, width = pixels.shape[:2]
    if width > spec.width or height > spec.height:
        raise ValueError(f"{width} x {height} pixels do not fit the canvas of {spec.width} x {spec.height}.")
    top, left = (spec.height - height) // 2, (spec.width - width) // 2
    canvas = np.zeros((3, spec.height, spec.width), dtype=np.float32)
    inside = canvas[:, top : top + height, left : left + width]
    mean, std = (np.asarray(value, dtype=np.float32)[:, None, None] for value in (spec.mean, spec.std))
    np.multiply(pixels.transpose(2, 0, 1), 1 / (np.float32(255.0) * std), out=inside)
    inside -= mean / std
    return canvas


def fitted(photo: Photo, spec: ModelSpec) -> NDArray[np.uint8]:
    """The photo's pixels (h, w, 3) resized without aliasing to `fit_size`."""
    size = fit_size(photo.width, photo.height, spec)
    return np.asarray(Image.fromarray(photo.pixels).resize(size, Image.Resampling.HAMMING, reducing_gap=1.0))


def to_tensor(photo: Photo, spec: ModelSpec) -> NDArray[np.float32]:
    """The network's input (1, 3, H, W): the fitted photo on its canvas."""
    return place(fitted(photo, spec), spec)[None]

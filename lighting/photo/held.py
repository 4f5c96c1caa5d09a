"""Pixels that a program already holds, such as a camera's frame, as a Photo."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lighting.errors import PhotoError
from lighting.photo.exif import PhotoFacts
from lighting.photo.read import MAX_PIXELS, Photo, check_size

KIND = "PIXELS"  # the Photo's `format`


def photo_of(pixels: ArrayLike, facts: PhotoFacts | None = None) -> Photo:
    """The Photo of upright pixels (h, w, 3), 8-bit sRGB in the order red, green, blue.

    An array, a PIL image in RGB or a tensor in the CPU's memory will do; the pixels are copied only where their rows
    are not contiguous. `facts` is what is known of the photo, as its EXIF block would say it.
    Raises PhotoError for another type or shape, and PhotoError or PhotoTooLargeError for a size that `read_photo`
    refuses.
    """
    array = checked_pixels(pixels)
    height, width = array.shape[:2]
    check_size(width, height, MAX_PIXELS, "photo")
    return Photo(np.ascontiguousarray(array), width, height, KIND, facts or PhotoFacts())


def checked_pixels(pixels: ArrayLike) -> NDArray[np.uint8]:
    """The array, not copied; PhotoError unless it is of shape (h, w, 3), not empty, and of type uint8."""
    array = np.asarray(pixels)
    if array.dtype != np.uint8:
        raise PhotoError(f"The pixels are of type {array.dtype}; they must be 8-bit sRGB, uint8 from 0 to 255.")
    if array.ndim != 3 or array.shape[2] != 3 or array.size == 0:
        raise PhotoError(f"The pixels have the shape {array.shape}; it must be (height, width, 3).")
    return array

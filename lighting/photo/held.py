"""Pixels that a program already holds, such as a camera's frame, as a Photo."""

import numpy as np
from numpy.typing import ArrayLike

from lighting.colour import checked_pixels
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

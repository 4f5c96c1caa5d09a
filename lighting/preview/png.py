"""The preview of a photo as a file."""

import numpy as np
from numpy.typing import NDArray

from lighting.envmap import render
from lighting.files import encode_png
from lighting.preview.picture import MAP_HEIGHT, draw_preview
from lighting.records import Estimate


def preview_png(picture: NDArray[np.uint8], estimate: Estimate) -> bytes:
    """What `lighting preview` draws, as PNG; the picture (h, w, 3) is the upright photo, sRGB."""
    where = estimate.distribution
    light = render(estimate.lighting, MAP_HEIGHT)
    return encode_png(draw_preview(picture, estimate.lighting, where.probability, where.grid, light))

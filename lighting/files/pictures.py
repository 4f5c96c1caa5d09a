"""Pixels as the bytes of pictures that everybody opens."""

import io

import numpy as np
from numpy.typing import NDArray


def encode_png(pixels: NDArray[np.uint8], compress_level: int = 6) -> bytes:
    """The bytes of a PNG of pixels (H, W, 3 or 4), or of one channel (H, W)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=compress_level)
    return buffer.getvalue()


def encode_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """The bytes of a JPEG of pixels (H, W, 3), without metadata."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()

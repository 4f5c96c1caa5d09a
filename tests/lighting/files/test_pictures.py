"""Pixels as pictures."""

import io

import numpy as np
import pytest
from PIL import Image

from lighting.files.pictures import encode_jpeg, encode_png


def test_jpeg_keeps_size_and_colour() -> None:
    with Image.open(io.BytesIO(encode_jpeg(np.full((24, 32, 3), (200, 120, 40), dtype=np.uint8), 90))) as picture:
        assert (picture.format, picture.size) == ("JPEG", (32, 24))
        assert np.abs(np.asarray(picture, dtype=int) - [200, 120, 40]).max() <= 4


@pytest.mark.parametrize("shape", [(24, 32), (24, 32, 3), (24, 32, 4)])
def test_png_keeps_every_value(shape: tuple[int, ...]) -> None:
    pixels = np.arange(np.prod(shape), dtype=np.uint8).reshape(shape)
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.asarray(picture), pixels)

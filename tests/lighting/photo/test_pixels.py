"""Decoded pixels: upright, reduced, opaque."""

import numpy as np
import pytest
from PIL import Image, ImageOps

from lighting.errors import PhotoError
from lighting.photo import pixels
from tests.conftest import scene

SCENE = scene(90, 60)


@pytest.mark.parametrize("orientation", [None, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_each_turn_is_the_one_that_pillow_makes(orientation: int | None) -> None:
    image = Image.fromarray(SCENE)
    image.getexif()[0x0112] = orientation or 1
    turned = pixels.upright_pixels(Image.fromarray(SCENE), 90, orientation)
    assert turned.flags["C_CONTIGUOUS"]
    assert np.array_equal(turned, np.asarray(ImageOps.exif_transpose(image)))


@pytest.mark.parametrize(("size", "target", "factor"), [((90, 60), 90, 1), ((90, 60), 45, 2), ((90, 60), 31, 2)])
def test_each_side_is_divided_by_a_whole_number(size: tuple[int, int], target: int, factor: int) -> None:
    kept = pixels.upright_pixels(Image.fromarray(SCENE).resize(size), target, 1)
    assert kept.shape == (60 // factor, 90 // factor, 3)


def test_a_strip_may_be_transparent_if_another_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pixels, "_STRIP_PIXELS", 900)
    image = Image.fromarray(np.dstack([SCENE, np.zeros((60, 90), dtype=np.uint8)]))
    with pytest.raises(PhotoError, match="fully transparent"):
        pixels.upright_pixels(image.copy(), 90, 1)
    image.putpixel((3, 50), (1, 2, 3, 255))
    kept = pixels.upright_pixels(image, 90, 1)
    assert kept[50, 3].tolist() == [1, 2, 3]
    assert (np.delete(kept.reshape(-1, 3), 50 * 90 + 3, axis=0) == 128).all()

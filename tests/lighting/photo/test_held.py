"""Pixels that a program already holds."""

from typing import Any

import numpy as np
import pytest
from PIL import Image

from lighting.errors import PhotoError
from lighting.photo import PhotoFacts, photo_of, read_photo
from tests.conftest import encode, scene

PIXELS = np.asarray(scene(160, 120))


def test_pixels_are_a_photo_as_they_are() -> None:
    photo = photo_of(PIXELS, PhotoFacts(vertical_fov=50.0))
    assert (photo.width, photo.height, photo.format) == (160, 120, "PIXELS")
    assert np.shares_memory(photo.pixels, PIXELS)
    assert np.array_equal(photo.pixels, read_photo(encode(scene(160, 120), "PNG")).pixels)
    assert photo.facts.vertical_fov == 50.0


@pytest.mark.parametrize(
    "same",
    [
        PIXELS[:, ::-1][:, ::-1],
        np.asfortranarray(PIXELS),
        np.dstack([PIXELS, PIXELS])[..., :3],
        scene(160, 120),
    ],
    ids=["turned twice", "by columns", "a part", "PIL"],
)
def test_the_layout_in_memory_does_not_matter(same: Any) -> None:
    photo = photo_of(same)
    assert photo.pixels.flags.c_contiguous
    assert np.array_equal(photo.pixels, PIXELS)


def test_pixels_that_are_read_only_are_taken_and_a_tensor_is() -> None:
    torch = pytest.importorskip("torch")
    frozen = PIXELS.copy()
    frozen.flags.writeable = False
    assert np.array_equal(photo_of(frozen).pixels, PIXELS)
    assert np.array_equal(photo_of(torch.tensor(PIXELS)).pixels, PIXELS)


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (PIXELS / 255.0, "type float64"),
        (PIXELS.astype(np.float32) * np.nan, "type float32"),
        (PIXELS.astype(np.uint16) * 257, "type uint16"),
        (PIXELS > 7, "type bool"),
        (PIXELS[..., 0], r"shape \(120, 160\)"),
        (np.dstack([PIXELS, PIXELS[..., :1]]), r"shape \(120, 160, 4\)"),
        (PIXELS.transpose(2, 0, 1), r"shape \(3, 120, 160\)"),
        (PIXELS[None], r"shape \(1, 120, 160, 3\)"),
        (PIXELS[:0], r"shape \(0, 160, 3\)"),
        (PIXELS[:1, :1], "1 x 1 pixels"),
        (np.zeros((10, 10_000, 3), np.uint8), "10000 x 10 pixels"),
        (np.zeros((40, 400, 3), np.uint8), "400 x 40 pixels"),
        (np.broadcast_to(np.uint8(0), (20_000, 20_000, 3)), "128 million"),
        ("photo.jpg", "type <U9"),
        (None, "type object"),
        (Image.new("L", (99, 99)), r"shape \(99, 99\)"),
    ],
)
def test_other_types_shapes_and_sizes_are_refused_in_one_sentence(pixels: Any, words: str) -> None:
    with pytest.raises(PhotoError, match=words) as caught:
        photo_of(pixels)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_a_photo_is_not_read_twice() -> None:
    with pytest.raises(PhotoError, match=r"^That is a Photo already.*an Estimator takes it\.$"):
        read_photo(photo_of(PIXELS))  # type: ignore[arg-type]

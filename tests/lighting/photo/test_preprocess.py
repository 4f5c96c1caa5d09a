"""Tests of preprocess."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.envmap.render import render
from lighting.photo.preprocess import fit_size, is_blank, is_panorama, pad_to_input, preprocess
from lighting.photo.reader import Photo, read_photo
from lighting.records import Lighting
from tests.conftest import TINY, encode, scene


@given(st.integers(1, 20_000), st.integers(1, 20_000))
def test_the_photo_fills_one_side_of_the_canvas(width: int, height: int) -> None:
    w, h = fit_size(width, height, TINY)
    assert 1 <= w <= TINY.width
    assert 1 <= h <= TINY.height
    assert w == TINY.width or h == TINY.height
    assert abs(w - width * h / height) <= 0.5 * width / height + 0.5 or min(w, h) == 1


@pytest.mark.parametrize(
    ("size", "fitted"), [((96, 64), (48, 32)), ((64, 96), (21, 32)), ((480, 10), (48, 1)), ((3, 2), (48, 32))]
)
def test_fit_size_of_known_shapes(size: tuple[int, int], fitted: tuple[int, int]) -> None:
    assert fit_size(*size, TINY) == fitted


@pytest.mark.parametrize(("width", "height", "left", "top"), [(48, 10, 0, 11), (21, 32, 13, 0), (48, 32, 0, 0)])
def test_place_centres_the_normalised_photo_on_the_mean(width: int, height: int, left: int, top: int) -> None:
    pixels = scene(width, height)
    canvas = pad_to_input(pixels, TINY)
    assert canvas.shape == (3, 32, 48)
    assert canvas.dtype == np.float32
    expected = (pixels / 255.0 - TINY.mean) / TINY.std
    inside = canvas[:, top : top + height, left : left + width].transpose(1, 2, 0)
    assert inside == pytest.approx(expected, abs=1e-5)
    assert np.count_nonzero(canvas) <= 3 * width * height


def test_place_refuses_what_does_not_fit() -> None:
    with pytest.raises(ValueError, match="49 x 10 pixels do not fit the canvas of 48 x 32"):
        pad_to_input(scene(49, 10), TINY)


def test_to_tensor_is_place_of_the_resized_photo() -> None:
    tensor = preprocess(read_photo(encode(scene(480, 320), "PNG")), TINY)
    assert tensor.shape == (1, 3, 32, 48)
    assert np.abs(tensor[0] - pad_to_input(scene(48, 32), TINY)).max() < 0.1


def test_to_tensor_does_not_alias() -> None:
    """A one-pixel chequerboard is grey from afar."""
    board = (np.indices((640, 960)).sum(axis=0) % 2 * 255).astype(np.uint8)
    photo = Photo(np.repeat(board[..., None], 3, axis=-1), 960, 640, "PNG")
    grey = (0.5 - np.array(TINY.mean)) / TINY.std
    assert preprocess(photo, TINY)[0].transpose(1, 2, 0) == pytest.approx(np.broadcast_to(grey, (32, 48, 3)), abs=0.05)


@pytest.mark.parametrize("rotate", [False, True])
def test_the_scale_of_decoding_hardly_changes_the_tensor(rotate: bool) -> None:
    pixels = scene(1500, 2000) if rotate else scene(2000, 1500)
    data = encode(pixels, quality=95)
    whole, reduced = (preprocess(read_photo(data, target=target), TINY) for target in (None, 200))
    assert np.abs(whole - reduced).max() < 0.1


@pytest.mark.parametrize("grey", [0, 3, 128, 255])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_a_frame_without_contrast_is_empty(grey: int, noise: float) -> None:
    pixels = np.random.default_rng(1).normal(grey, noise, (60, 90, 3))
    assert is_blank(np.clip(pixels, 0, 255).astype(np.uint8))
    assert is_blank(np.full((1, 1, 3), grey, np.uint8))


def test_fog_and_a_scene_are_not_empty() -> None:
    fog = np.linspace(150, 200, 90).astype(np.uint8)[None, :, None].repeat(60, axis=0).repeat(3, axis=2)
    assert not is_blank(fog)
    assert not is_blank(scene(90, 60))


def panorama(height: int) -> np.ndarray:
    """A lat-long map with things on the ground, as sRGB bytes."""
    image = render(Lighting(sun_azimuth=30.0, sun_elevation=30.0, turbidity=3.0, exposure=0.02), height, sun=False)
    grey = np.clip(255 * image.mean(axis=2) / image.max(), 0, 255)
    x = np.arange(2 * height) / height * np.pi
    houses = 90 + 40 * np.sin(5 * x)[None] + 40 * np.cos(2 * x)[None]
    below = np.arange(height)[:, None] > 0.45 * height
    return np.asarray(np.where(below, houses, 120 + grey / 3).astype(np.uint8)[..., None].repeat(3, axis=2))


@pytest.mark.parametrize("height", [64, 200, 700])
def test_a_whole_panorama_is_known_by_its_shape_its_seam_and_its_zenith(height: int) -> None:
    whole = panorama(height)
    assert is_panorama(whole)
    assert is_panorama(np.roll(whole, height // 3, axis=1))
    assert not is_panorama(whole[:, : height + height // 2])  # another shape
    assert not is_panorama(np.rot90(whole))
    half = np.repeat(whole[:, : height + 1 - height % 2], 2, axis=1)[:, : 2 * height]
    slope = half * np.linspace(0.4, 1, 2 * height)[:, None]
    assert not is_panorama(slope.astype(np.uint8))  # a photo of that shape: its sides differ
    upside = np.ascontiguousarray(whole[::-1])
    assert not is_panorama(upside)  # the first row shows many directions

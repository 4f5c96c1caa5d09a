"""What is no photo by its pixels alone."""

import numpy as np
import pytest

from lighting.envmap import render
from lighting.photo.no_photo import is_empty, is_panorama
from lighting.records import Lighting
from tests.conftest import scene


@pytest.mark.parametrize("grey", [0, 3, 128, 255])
@pytest.mark.parametrize("noise", [0.0, 6.0])
def test_a_frame_without_contrast_is_empty(grey: int, noise: float) -> None:
    pixels = np.random.default_rng(1).normal(grey, noise, (60, 90, 3))
    assert is_empty(np.clip(pixels, 0, 255).astype(np.uint8))
    assert is_empty(np.full((1, 1, 3), grey, np.uint8))


def test_fog_and_a_scene_are_not_empty() -> None:
    fog = np.linspace(150, 200, 90).astype(np.uint8)[None, :, None].repeat(60, axis=0).repeat(3, axis=2)
    assert not is_empty(fog)
    assert not is_empty(scene(90, 60))


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

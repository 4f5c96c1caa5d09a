"""Integrals over rows of a map, and arithmetic on its pixels."""

import numpy as np
import pytest

from lighting.envmap.maps import brightest, f32, irradiance_of, row_levels, scale


def test_a_white_sky_lights_level_ground_by_pi() -> None:
    levels = row_levels(40)
    assert levels[:20].sum() == pytest.approx(np.pi)
    assert levels == pytest.approx(levels[::-1])
    assert irradiance_of(levels[:20], np.ones((20, 80, 3), np.float32)) == pytest.approx([np.pi] * 3)


def test_the_brightest_channel_is_numpys() -> None:
    image = np.random.default_rng(1).normal(size=(7, 5, 3)).astype(np.float32)
    assert np.array_equal(brightest(image), image.max(axis=-1))


def test_a_map_is_multiplied_by_a_colour_in_place() -> None:
    image = np.random.default_rng(1).random((4, 6, 3)).astype(np.float32)
    expected = image * np.array([0.5, 2.0, 3.0], np.float32)
    scale(image[1:3], np.array([0.5, 2.0, 3.0]))
    assert np.array_equal(image[1:3], expected[1:3])
    assert not np.array_equal(image, expected)
    assert f32(np.ones(2)).dtype == np.float32

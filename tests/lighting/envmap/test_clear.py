"""Integrals over rows of a map."""

import numpy as np
import pytest

from lighting.envmap.clear import brightest, clear_irradiance, f32, irradiance_of, lobe_table, paint_clear, row_levels
from tests.lighting.envmap.test_render import lighting


def test_a_white_sky_lights_level_ground_by_pi() -> None:
    levels = row_levels(40)
    assert levels[:20].sum() == pytest.approx(np.pi)
    assert levels == pytest.approx(levels[::-1])
    assert irradiance_of(levels[:20], np.ones((20, 80, 3), np.float32)) == pytest.approx([np.pi] * 3)


def test_a_painted_sky_has_the_models_irradiance() -> None:
    light = lighting()
    lobe = lobe_table(light)
    upper = np.empty((128, 512, 3), np.float32)
    paint_clear(upper, light, lobe)
    assert irradiance_of(row_levels(256)[:128], upper) == pytest.approx(clear_irradiance(light, lobe), rel=1e-3)
    assert f32(np.ones(2)).dtype == np.float32


def test_a_table_is_that_of_its_own_sky() -> None:
    first, other = lobe_table(lighting()), lobe_table(lighting(turbidity=8.0))
    assert not np.array_equal(first, other)
    assert np.array_equal(lobe_table(lighting()), first)
    with pytest.raises(ValueError, match="read-only"):
        other[0, 0] = 1.0


def test_the_brightest_channel_is_numpys() -> None:
    image = np.random.default_rng(1).normal(size=(7, 5, 3)).astype(np.float32)
    assert np.array_equal(brightest(image), image.max(axis=-1))

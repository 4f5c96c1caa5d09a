"""Modelled skies against the sky they are made of and published ratios."""

import numpy as np
import pytest

from lighting import Lighting
from lighting.envmap import sky_irradiance, sun_irradiance
from lighting.errors import ParameterError
from lighting.geometry import direction
from lighting.stereo.mean_light import illumination
from lighting.stereo.skies import (
    broken_skies,
    clear_skies,
    draw_sunshine,
    horizontal_irradiance,
    overcast_skies,
    suns_at,
)

SUNS = direction([100.0, 180.0, 250.0], [15.0, 55.0, 30.0])


def test_suns_stand_in_the_south_at_noon_and_in_the_east_in_the_morning() -> None:
    noon, morning = suns_at(["2026-03-20T12:07", "2026-03-20T06:30"], 48.0, 0.0)
    np.testing.assert_allclose(noon, direction(180.0, 42.0), atol=0.02)  # south is +Z
    assert morning[0] > 0.98  # east is +X


def test_clear_skies_have_the_irradiances_of_the_environment_map() -> None:
    skies = clear_skies(SUNS)
    for i, (azimuth, elevation) in enumerate(((100.0, 15.0), (180.0, 55.0), (-110.0, 30.0))):
        light = Lighting(sun_azimuth=azimuth, sun_elevation=elevation, turbidity=3.0, exposure=1.0)
        # 64 rows of the sky and 192 points of the disc
        np.testing.assert_allclose(skies.sun_irradiance[i], sun_irradiance(light), rtol=3e-3)
        np.testing.assert_allclose(horizontal_irradiance(skies.radiance[i, :32]), sky_irradiance(light), rtol=3e-3)


def test_level_ground_sees_its_horizontal_irradiance() -> None:
    skies = clear_skies(SUNS)
    bright = np.einsum("tkc,k->tc", illumination(skies, [0, 1, 0]), [0.0, 1, 0])
    level = horizontal_irradiance(skies.radiance[:, :32]) + skies.sun_irradiance * SUNS[:, 1:2]
    np.testing.assert_allclose(bright, level / np.pi, rtol=2e-3)
    np.testing.assert_allclose(skies.radiance[:, -1, 0], 0.3 * bright, rtol=2e-3)  # ground of albedo 0.3, lit by it


def test_overcast_skies_follow_the_cie_and_hold_a_quarter_of_the_light() -> None:
    clear = clear_skies(SUNS)
    dull = overcast_skies(clear)
    assert not dull.sun_irradiance.any()
    zenith, horizon = dull.radiance[:, 0].mean(axis=1), dull.radiance[:, 31].mean(axis=1)
    np.testing.assert_allclose(zenith / horizon, 3.0, rtol=0.06)  # the lowest row's centre is 1.4 deg up
    up = np.array([0.0, 1.0, 0.0])
    bright = [np.einsum("tkc,k->tc", illumination(skies, up), up) for skies in (clear, dull)]
    np.testing.assert_allclose(bright[1], 0.25 * bright[0], rtol=5e-3)


def test_an_overcast_day_turns_no_mean_light_vector() -> None:
    vectors = illumination(overcast_skies(clear_skies(SUNS)), direction(40.0, 30.0))[..., 1]
    unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    np.testing.assert_allclose(unit, unit[:1].repeat(3, axis=0), atol=1e-5)


def test_broken_skies_hide_the_sun_in_some_spells() -> None:
    clear = clear_skies(SUNS)
    skies = broken_skies(clear, [True, False, True])
    np.testing.assert_array_equal(skies.sun_irradiance[1], 0)
    np.testing.assert_array_equal(skies.sun_irradiance[[0, 2]], clear.sun_irradiance[[0, 2]])
    level = horizontal_irradiance(skies.radiance[:, :32]) + skies.sun_irradiance * SUNS[:, 1:2]
    np.testing.assert_allclose(skies.radiance[:, -1, 0], 0.3 / np.pi * level, rtol=1e-5)
    assert draw_sunshine(2000, 10, seed=1, cover=0.3).mean() == pytest.approx(0.7, abs=0.01)


def test_night_is_refused() -> None:
    with pytest.raises(ParameterError, match="below the horizon"):
        clear_skies(direction([0.0], [-5.0]))

"""Skies over rendered places."""

import numpy as np

from export.towns.sky import HEIGHT, random_sky
from tests.export.towns.examples import clear


def test_skies_are_of_every_kind_and_black_below() -> None:
    skies = [random_sky(np.random.default_rng(seed)) for seed in range(40)]
    sunlight = np.array([sky.sunlight for sky in skies])
    assert (sunlight == 0).any()
    assert (sunlight == 1).any()
    assert ((sunlight > 0.03) & (sunlight < 1)).any()
    for sky in skies:
        assert sky.radiance.shape == (HEIGHT, 2 * HEIGHT, 3)
        assert np.isfinite(sky.radiance).all()
        assert (sky.radiance >= 0).all()
        assert (sky.radiance[HEIGHT // 2 :] == 0).all()
        assert sky.radiance[: HEIGHT // 2].min() > 0
        assert sky.is_overcast == (sky.sunlight < 0.03)
        assert 2 <= sky.lighting.sun_elevation <= 80


def test_the_disc_holds_the_sun_s_irradiance() -> None:
    sky, height = clear(sunlight=0.5), 512
    weight = np.pi / height * np.cos(np.radians(90 - (np.arange(height) + 0.5) * 180 / height)) * np.pi / height
    flux = (sky.disc(height) * weight[:, None, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(flux, sky.sun_irradiance, rtol=0.02)

"""Skies between clear and overcast, of every model."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lighting.envmap import render
from lighting.envmap.maps import irradiance_of, row_levels
from lighting.envmap.mixture import add_sun_glow, paint_mixture
from lighting.geometry import direction, latlong_directions, latlong_solid_angle
from lighting.sky import SKY_MODELS, Weather, sky_shape
from lighting.sky.lalonde_matthews import lalonde_matthews_sun
from tests.lighting.envmap.test_render import SKY, given_light, lighting

HEIGHT = 32


def upper(**fields: Any) -> np.ndarray:
    image = np.empty((HEIGHT // 2, 2 * HEIGHT, 3), np.float32)
    paint_mixture(image, replace(given_light(), **fields), np.array(SKY))
    return image


@pytest.mark.parametrize("model", SKY_MODELS)
def test_every_model_gives_the_irradiance_asked_for(model: str) -> None:
    sky = upper(sky_model=model, sky_cover=0.3)
    assert irradiance_of(row_levels(HEIGHT)[: HEIGHT // 2], sky) == pytest.approx(SKY, rel=1e-4)
    assert sky.min() >= 0


def test_an_overcast_sky_is_the_cies_and_knows_no_sun() -> None:
    sky = upper(sky_cover=1.0)
    assert np.ptp(sky, axis=1).max() == 0
    assert sky[0, 0] / sky[-1, 0] == pytest.approx(3.0, rel=0.1)
    np.testing.assert_allclose(sky, upper(sky_model="cie-overcast", sky_cover=0.0), rtol=1e-4)


def test_cover_blends_the_two_skies() -> None:
    np.testing.assert_allclose(upper(sky_cover=0.25), 0.75 * upper() + 0.25 * upper(sky_cover=1.0), rtol=1e-5)


@pytest.mark.parametrize("model", ["hosek-wilkie", "preetham"])
@pytest.mark.parametrize(("elevation", "turbidity"), [(0.0, 1.0), (0.0, 10.0), (2.0, 10.0), (90.0, 1.0), (90.0, 10.0)])
def test_no_model_leaves_a_channel_dark(model: str, elevation: float, turbidity: float) -> None:
    """Each channel keeps the shape that the model gives it, however its irradiance is scaled."""
    weather = Weather(turbidity, ground_albedo=0.0, beam=1.0, diffuse=100.0)
    shape = sky_shape(model, latlong_directions(HEIGHT), direction(0.0, elevation), weather)
    level = irradiance_of(row_levels(HEIGHT)[: HEIGHT // 2], shape[: HEIGHT // 2])
    assert level.min() > 0.2 * level.max()
    sky = upper(sky_model=model, sun_elevation=elevation, turbidity=turbidity)
    assert np.isfinite(sky).all()
    assert sky.max() < 100


@pytest.mark.parametrize("model", ["preetham", "perez", "cie-12"])
def test_without_irradiances_another_model_has_those_of_hosek_and_wilkie(model: str) -> None:
    ours, other = (render(replace(lighting(), sky_model=name), 64, sun=False) for name in ("hosek-wilkie", model))
    level = [irradiance_of(row_levels(64)[:32], image[:32]) for image in (ours, other)]
    assert level[1] == pytest.approx(level[0], rel=5e-3)
    assert not np.allclose(ours, other, rtol=0.05)


def test_the_sun_of_lalonde_and_matthews_is_a_lobe_of_the_power_asked_for() -> None:
    image = np.zeros((64, 256, 3), np.float32)
    glow = lalonde_matthews_sun(latlong_directions(128)[:64], lighting(elevation=40.0).sun_direction)
    add_sun_glow(image, glow, np.array([3.0, 2.0, 1.0]))
    assert image.sum(axis=1).T @ latlong_solid_angle(128)[:64] == pytest.approx([3.0, 2.0, 1.0], rel=1e-4)
    assert np.count_nonzero(image[..., 0] > 0.1 * image.max()) > 4
    light = replace(given_light(), sky_model="lalonde-matthews")
    assert render(light, 64).max() < render(given_light(), 64).max()

"""The light in a panorama whose sun, sky and ground are known."""

import numpy as np
import pytest

from export.crops import Camera, Crop
from export.evaluation.sphere import HEIGHT
from export.evaluation.true_light import TrueLight, levels, mean_map, mirrored_photo, split, true_light
from lighting.envmap import render
from lighting.geometry import angle_between, direction
from lighting.records import Lighting

SUN, SKY, GROUND = (20.0, 15.0, 9.0), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)
LIGHT = Lighting(70.0, 40.0, 3.0, 1.0, sun_irradiance=SUN, sky_irradiance=SKY, ground_color=GROUND)
PANORAMA = render(LIGHT, 256)


def test_sun_sky_and_ground_are_told_apart_in_the_crops_frame_and_exposure() -> None:
    light = true_light(split(PANORAMA, direction(71.0, 41.0)), 30.0, 2.0)
    assert light.sun_direction is not None
    assert angle_between(light.sun_direction, direction(40.0, 40.0)) < 0.6
    assert light.sun_irradiance == pytest.approx(2 * np.array(SUN), rel=0.03)
    assert light.sky_irradiance == pytest.approx(2 * np.array(SKY), rel=0.03)
    level = np.array(SKY) + np.sin(np.radians(40.0)) * np.array(SUN)
    assert light.ground == pytest.approx(2 * np.array(GROUND) / np.pi * level, rel=1e-3)
    assert levels(light.image)[0] == pytest.approx(2 * level, rel=0.02)


def test_without_direct_light_the_whole_sky_is_sky() -> None:
    light = true_light(split(PANORAMA, None), 0.0, 1.0)
    assert light.sun_direction is None
    assert not light.sun_irradiance.any()
    assert light.sky_irradiance == pytest.approx(np.array(SKY) + np.sin(np.radians(40.0)) * np.array(SUN), rel=0.01)


def test_a_mirrored_photo_repeats_itself_all_around() -> None:
    linear = np.zeros((60, 80, 3), np.float32)
    linear[:30], linear[30:] = 0.8, 0.2
    linear[0, 0] = 5.0
    crop = Crop(linear, Camera(0.0, 0.0, 0.0, 50.0, 4 / 3), 0.0, 30.0, 1.0, 1.0, 3.0, 1.0)
    image = mirrored_photo(crop)
    assert image.shape == (HEIGHT, 2 * HEIGHT, 3)
    assert image.max() <= 1
    assert image[HEIGHT // 2 - 2].mean() == pytest.approx(0.8, abs=0.02)
    assert image[HEIGHT // 2 + 2].mean() == pytest.approx(0.2, abs=0.02)


def test_the_mean_map_knows_no_azimuth() -> None:
    ramp = np.broadcast_to(np.linspace(0, 1, 2 * HEIGHT)[None, :, None], (HEIGHT, 2 * HEIGHT, 3))
    light = TrueLight(ramp, None, np.zeros(3), np.ones(3), np.ones(3))
    assert mean_map([light, light]) == pytest.approx(0.5)

"""The ground's colour from a photo's lower part."""

import numpy as np
import pytest

from lighting.colour import luminance, tone_map
from lighting.envmap.ground import _quantiles, brightness_below, photo_ground
from lighting.records import Lighting
from tests.lighting.envmap.test_render import given_light

LEVEL = np.array([0.4, 0.5, 0.8]) + np.sin(np.radians(33.0)) * np.array([1.9, 1.5, 0.9])


def photo(reflectance: list[float], sky: float = 0.8) -> np.ndarray:
    linear = np.full((60, 80, 3), sky, np.float32)
    linear[30:] = np.array(reflectance) * LEVEL / np.pi
    return tone_map(linear)


def test_the_ground_is_what_lies_below_the_horizon_over_its_light() -> None:
    assert photo_ground(photo([0.2, 0.15, 0.1]), given_light()) == pytest.approx([0.2, 0.15, 0.1], rel=0.05)


def test_few_glints_do_not_count() -> None:
    spotted = photo([0.2, 0.2, 0.2])
    spotted[40:43] = 255
    assert photo_ground(spotted, given_light()) == pytest.approx([0.2] * 3, rel=0.1)


def test_a_camera_that_looks_up_sees_no_ground() -> None:
    assert photo_ground(photo([0.2] * 3), given_light(camera_elevation=50.0)) is None


@pytest.mark.parametrize("cover", [0.0, 0.5, 1.0])
def test_the_network_s_ground_counts_for_brightness_the_less_the_cloudier_and_not_for_colour(cover: float) -> None:
    picture, light = photo([0.2, 0.15, 0.1]), given_light(sky_cover=cover)
    shown = photo_ground(picture, light)
    assert shown is not None
    radiance = shown * LEVEL / np.pi
    for stops in (-1.0, 0.0, 1.5):
        around = np.full((12, 24, 3), 9.0, np.float32)  # its sky does not count
        around[6:] = luminance(radiance) * 2.0 ** (stops - 0.2)
        found = photo_ground(picture, light, around)
        assert found == pytest.approx(shown * 2.0 ** (0.6 * (1 - cover) * stops), rel=1e-4)


def test_a_network_without_ground_stays_in_range() -> None:
    assert photo_ground(photo([0.2] * 3), given_light(), np.zeros((12, 24, 3), np.float32)) == pytest.approx([0.02] * 3)


def test_brightness_below_is_that_of_a_level_surface_facing_down() -> None:
    around = np.ones((12, 24, 3), np.float32)
    assert brightness_below(around) == pytest.approx(1.0)
    around[11] = 0.0  # the lowest 15 deg: sin(15 deg) squared of the light
    assert brightness_below(around) == pytest.approx(1 - np.sin(np.radians(15)) ** 2)


def test_without_irradiances_nothing_is_known() -> None:
    assert photo_ground(photo([0.2] * 3), Lighting(0.0, 30.0, 3.0, 1.0)) is None


def test_a_black_or_white_picture_stays_in_range() -> None:
    assert photo_ground(np.zeros((40, 60, 3), np.uint8), given_light()) == pytest.approx([0.02] * 3)
    assert photo_ground(np.full((40, 60, 3), 255, np.uint8), given_light(1.0)) is not None


@pytest.mark.parametrize("count", [1, 2, 3, 50, 999])
def test_quantiles_are_numpys(count: int) -> None:
    values = np.random.default_rng(count).integers(0, 40, count).astype(np.float32) / 7
    assert _quantiles(values, (0.25, 0.75)) == pytest.approx(np.quantile(values, (0.25, 0.75)))

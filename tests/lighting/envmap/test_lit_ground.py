"""Where a picture's ground lies in the sun."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.colour import tone_map
from lighting.envmap import lit_ground
from lighting.records import Lighting
from tests.lighting.envmap.test_render import given_light

LIGHT = given_light(40.0, camera_elevation=-10.0)
SKY, SUN = np.array([0.4, 0.5, 0.8]), np.sin(np.radians(40.0)) * np.array([1.9, 1.5, 0.9])
SUNLIT, SHADED = 0.3 / np.pi * (SKY + SUN), 0.3 / np.pi * SKY


def photo(bright: NDArray[np.float64], dark: NDArray[np.float64], size: int = 1) -> NDArray[np.uint8]:
    """Sky over ground that is dark in its right half."""
    linear = np.full((120 * size, 160 * size, 3), 0.8)
    linear[40 * size :] = bright
    linear[40 * size :, 80 * size :] = dark
    return tone_map(linear)


def test_shade_is_told_from_sunlight() -> None:
    lit = lit_ground(photo(SUNLIT, SHADED), LIGHT)
    assert lit.shape == (120, 160)
    assert lit.dtype == np.float32
    assert lit[50:, :76] == pytest.approx(1.0)
    assert lit[50:, 84:] == pytest.approx(0.0)
    assert lit[:30] == pytest.approx(1.0)


def test_a_large_photo_has_a_small_answer() -> None:
    lit = lit_ground(photo(SUNLIT, SHADED, size=8), LIGHT)
    assert lit.shape == (480, 640)
    assert lit[300, [100, 500]].tolist() == [1.0, 0.0]


def test_the_step_counts_and_not_the_brightness() -> None:
    dim = lit_ground(photo(0.3 * SUNLIT, 0.3 * SHADED), LIGHT)
    assert [dim[50:, :76].min(), dim[50:, 84:].max()] == [1.0, 0.0]


@pytest.mark.parametrize("level", [SUNLIT, SHADED, np.zeros(3), np.full(3, 5.0)])
def test_ground_of_one_kind_counts_as_lit(level: NDArray[np.float64]) -> None:
    assert lit_ground(photo(level, level), LIGHT).min() == 1.0


def test_a_difference_that_the_light_does_not_make_is_the_grounds_own() -> None:
    picture = photo(SUNLIT, 0.45 * SUNLIT)
    assert lit_ground(picture, LIGHT).min() == 0.0
    hard = replace(LIGHT, sun_irradiance=(19.0, 15.0, 9.0))
    assert lit_ground(picture, hard).min() == 1.0


@pytest.mark.parametrize(
    "light",
    [
        replace(LIGHT, sun_irradiance=(0.0, 0.0, 0.0)),
        replace(LIGHT, sun_elevation=0.0),
        Lighting(0.0, 40.0, 3.0, 1.0, sun_visibility=0.1, camera_elevation=-10.0),
        replace(LIGHT, camera_elevation=60.0),
    ],
    ids=["no sun", "sun at the horizon", "hidden sun", "no ground"],
)
def test_without_sun_or_ground_nothing_is_in_shade(light: Lighting) -> None:
    assert lit_ground(photo(SUNLIT, SHADED), light).min() == 1.0


def test_the_caller_may_say_whether_the_sun_shines() -> None:
    assert lit_ground(photo(SUNLIT, SHADED), LIGHT, sun=False).min() == 1.0
    hidden = Lighting(0.0, 40.0, 3.0, 1.0, sun_visibility=0.1, camera_elevation=-10.0)
    assert lit_ground(photo(SUNLIT, SHADED), hidden, sun=True).min() == 0.0


def test_a_picture_of_one_pixel_is_answered() -> None:
    assert lit_ground(np.zeros((1, 1, 3), np.uint8), replace(LIGHT, camera_elevation=-60.0)).tolist() == [[1.0]]

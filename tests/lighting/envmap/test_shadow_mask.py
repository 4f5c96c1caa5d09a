"""Where a picture's ground lies in the sun."""

import base64
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.color import luminance, tone_map
from lighting.envmap.shadow_mask import _mean_sunlit, dappled_sunlight, ground_shadow_mask, read_ground_shade
from lighting.geometry import Pinhole
from lighting.records import Lighting
from tests.helpers.predictions import (
    GROUND_ALBEDO,
    SHADED_GROUND,
    SKY_IRRADIANCE,
    SUN_ON_GROUND,
    SUNLIT_GROUND,
    stated_light,
)

LIGHT = stated_light(40.0, camera_elevation=-10.0)
CASES = Path(__file__).with_name("lit_ground.json")


def photo(bright: NDArray[np.float64], dark: NDArray[np.float64], size: int = 1) -> NDArray[np.uint8]:
    """Sky over ground that is dark in its right half."""
    linear = np.full((120 * size, 160 * size, 3), 0.8)
    linear[40 * size :] = bright
    linear[40 * size :, 80 * size :] = dark
    return tone_map(linear)


def test_shade_is_told_from_sunlight() -> None:
    lit = ground_shadow_mask(photo(SUNLIT_GROUND, SHADED_GROUND), LIGHT)
    assert lit.shape == (120, 160)
    assert lit.dtype == np.float32
    assert lit[50:, :76] == pytest.approx(1.0)
    assert lit[50:, 84:] == pytest.approx(0.0)
    assert lit[:30] == pytest.approx(1.0)


def test_a_large_photo_has_a_small_answer() -> None:
    lit = ground_shadow_mask(photo(SUNLIT_GROUND, SHADED_GROUND, size=8), LIGHT)
    assert lit.shape == (192, 256)
    assert lit[120, [40, 200]].tolist() == [1.0, 0.0]


def test_a_threshold_of_the_pictures_own_counts_near_the_likely_one() -> None:
    """Ground of half the reflectance."""
    dim = ground_shadow_mask(photo(0.5 * SUNLIT_GROUND, 0.5 * SHADED_GROUND), LIGHT)
    assert [dim[50:, :76].min(), dim[50:, 84:].max()] == [1.0, 0.0]


@pytest.mark.parametrize(("albedo", "lit"), [(0.9, 1.0), (0.3, 1.0), (0.1, 1.0), (0.01, 0.0)])
def test_ground_of_one_kind_is_lit_unless_it_is_too_dark_for_that(albedo: float, lit: float) -> None:
    level = albedo / GROUND_ALBEDO * SUNLIT_GROUND
    assert ground_shadow_mask(photo(level, level), LIGHT)[50:] == pytest.approx(lit)


def test_ground_that_is_all_in_shade_is_told_where_the_sun_is_strong() -> None:
    hard = replace(LIGHT, sun_irradiance=tuple(6 * np.array(LIGHT.sun_irradiance)))
    lit = ground_shadow_mask(photo(SHADED_GROUND, SHADED_GROUND), hard)
    assert lit[50:].max() == 0.0
    assert lit[:30].min() == 1.0


def test_doubt_that_the_sun_shines_makes_shade_likelier() -> None:
    level = 0.04 / GROUND_ALBEDO * SUNLIT_GROUND
    there, doubtful = (ground_shadow_mask(photo(level, level), replace(LIGHT, sun_visibility=v)) for v in (1.0, 0.6))
    assert [there[50:].min(), doubtful[50:].max()] == [1.0, 0.0]


def test_a_difference_that_the_light_does_not_make_is_the_grounds_own() -> None:
    """What is dark in itself, and bright things over lit ground."""
    hard = replace(LIGHT, sun_irradiance=(19.0, 15.0, 9.0))
    level = 0.15 / np.pi * (np.array(SKY_IRRADIANCE) + 10 * SUN_ON_GROUND)
    assert ground_shadow_mask(photo(level, 0.45 * level), hard).min() == 1.0
    assert ground_shadow_mask(photo(5 * SUNLIT_GROUND, SUNLIT_GROUND), LIGHT).min() == 1.0


def test_grass_beside_sand_is_no_shade() -> None:
    sand, grass = (np.array(color) * SUNLIT_GROUND / GROUND_ALBEDO for color in ([0.4, 0.34, 0.27], [0.06, 0.09, 0.03]))
    assert ground_shadow_mask(photo(sand, grass), LIGHT).min() == 1.0
    assert read_ground_shade(photo(sand, grass), LIGHT).shaded_light is None


def test_shade_says_how_dark_it_is() -> None:
    assert read_ground_shade(photo(SUNLIT_GROUND, SUNLIT_GROUND), LIGHT).shaded_light is None
    level = float(luminance(SHADED_GROUND) / luminance(SUNLIT_GROUND))
    assert read_ground_shade(photo(SUNLIT_GROUND, SHADED_GROUND), LIGHT).shaded_light == pytest.approx(level, rel=0.1)


def test_masks_of_recorded_photos_stay() -> None:
    for case in json.loads(CASES.read_text())["cases"]:
        sizes = (case["height"], case["width"])
        pixels = np.frombuffer(base64.b64decode(case["pixels"]), np.uint8).reshape(*sizes, 3)
        light = replace(
            LIGHT,
            sun_elevation=case["sun_elevation"],
            sun_visibility=case["visibility"],
            sun_irradiance=tuple(case["sun"]),
            camera_elevation=case["camera_elevation"],
            camera_roll=case["roll"],
            vertical_fov=case["vertical_fov"],
        )
        assert light.sky_irradiance == tuple(case["sky"])
        expected = np.frombuffer(base64.b64decode(case["lit"]), np.uint8).reshape(sizes)
        found = np.round(255 * ground_shadow_mask(pixels, light))
        assert np.abs(found - expected).max() <= 1


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
    assert ground_shadow_mask(photo(SUNLIT_GROUND, SHADED_GROUND), light).min() == 1.0


def test_the_caller_may_say_whether_the_sun_shines() -> None:
    assert ground_shadow_mask(photo(SUNLIT_GROUND, SHADED_GROUND), LIGHT, sun=False).min() == 1.0
    hidden = Lighting(0.0, 40.0, 3.0, 1.0, sun_visibility=0.1, camera_elevation=-10.0)
    assert ground_shadow_mask(photo(SUNLIT_GROUND, SHADED_GROUND), hidden, sun=True).min() == 0.0


def test_a_picture_of_one_pixel_is_answered() -> None:
    assert ground_shadow_mask(np.zeros((1, 1, 3), np.uint8), replace(LIGHT, camera_elevation=-60.0)).tolist() == [[0.0]]


# What stands on it

CAMERA = Pinhole(160, 120, LIGHT.vertical_fov, elevation=-90.0)  # looks straight down, so that meters are pixels


def around(x: float, y: float, reach: float) -> float:
    """By a mask that is in shade in its left half, around the point of the ground that a pixel shows."""
    half = np.repeat(np.array([0.0, 1.0], np.float32), 40)[None].repeat(60, axis=0)
    right, up, forward = CAMERA.axes
    foot = forward + ((x - 80) * right - (y - 60) * up) / CAMERA.focal_length
    return _mean_sunlit(half, CAMERA, foot[None], reach)


def test_what_stands_on_the_ground_is_lit_as_the_ground_around_its_foot() -> None:
    assert around(40.0, 60.0, 8.0) == 0.0
    assert around(120.0, 60.0, 8.0) == 1.0
    assert around(81.0, 60.0, 8.0) == pytest.approx(0.5, abs=0.06)


def test_several_things_are_lit_as_the_ground_from_one_to_the_other() -> None:
    right = CAMERA.axes[0]
    feet = CAMERA.axes[2] + np.array([[-20.0], [20.0]]) / CAMERA.focal_length * right
    half = np.repeat(np.array([0.0, 1.0], np.float32), 40)[None].repeat(60, axis=0)
    assert _mean_sunlit(half, CAMERA, feet, 4.0) == pytest.approx(0.5, abs=0.03)


def test_where_the_picture_does_not_show_the_foot_the_sun_is_whole() -> None:
    assert around(-50.0, 60.0, 8.0) == 1.0
    assert around(40.0, 300.0, 8.0) == 1.0
    assert _mean_sunlit(np.zeros((2, 2), np.float32), CAMERA, -CAMERA.axes[2][None], 8.0) == 1.0


def dappled(patch: int, share: float, step: float) -> NDArray[np.uint8]:
    """Sky over ground with bright patches of some pixels, a share of it, the rest darker by a step of stops."""
    linear = np.full((120, 160, 3), 0.8)
    cells = np.random.default_rng(0).random((80 // patch + 1, 160 // patch + 1)) < share
    bright = np.kron(cells, np.ones((patch, patch)))[:80, :160, None]
    linear[40:] = np.where(bright > 0, 0.4, 0.4 * 2.0**-step)
    return tone_map(linear)


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_patches_of_sun_say_how_much_there_is_of_it(share: float) -> None:
    found = dappled_sunlight(dappled(8, share, 3.0), LIGHT)
    assert found is not None
    assert found[0] == pytest.approx(share, abs=0.06)
    assert found[1] == pytest.approx(3.0, abs=0.2)


@pytest.mark.parametrize(("patch", "share", "step"), [(8, 0.5, 1.5), (80, 0.5, 3.0), (8, 0.05, 3.0), (8, 0.95, 3.0)])
def test_weak_large_and_rare_patches_are_no_dapples(patch: int, share: float, step: float) -> None:
    assert dappled_sunlight(dappled(patch, share, step), LIGHT) is None


def test_without_ground_there_are_no_dapples() -> None:
    assert dappled_sunlight(dappled(8, 0.5, 3.0), replace(LIGHT, camera_elevation=60.0)) is None

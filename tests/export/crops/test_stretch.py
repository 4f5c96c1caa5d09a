"""Stretched worlds: what a panorama shows of them, and where their suns stand."""

import math
from dataclasses import replace

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.crops import is_resolved, take
from export.crops.sources import stretched
from export.crops.stretch import ALONG, NOT_STRETCHED, UPWARDS, Stretch, any_stretch
from export.crops.surroundings import COLUMNS, ROWS, light_around, seen_from
from lighting.geometry import angles, direction
from tests.export.crops.examples import SPEC, SUN, brightest, label, source

TALL = Stretch(upwards=1.5)
LONG = Stretch(upwards=0.7, along=1.2, heading=70.0)


def test_a_taller_world_has_a_higher_sun_whose_shadows_are_as_long() -> None:
    azimuth, elevation = angles(TALL.applied(direction(40.0, 25.0)))
    assert float(azimuth) == pytest.approx(40.0)
    assert math.tan(math.radians(float(elevation))) == pytest.approx(1.5 * math.tan(math.radians(25.0)))


@pytest.mark.parametrize("stretch", [TALL, LONG, Stretch(along=0.8, heading=-20.0)])
def test_the_shadow_of_a_pole_ends_where_the_stretched_sun_s_ray_meets_the_ground(stretch: Stretch) -> None:
    """The top of a stretched pole, the stretched end of its shadow and the stretched sun lie on one line."""
    top, sun = np.array([3.0, 2.0, -5.0]), direction(*SUN)
    end = top - sun * (top[1] + 1.6) / sun[1]  # on the ground, 1.6 below the camera
    ray = stretch.applied(top) - stretch.applied(end)
    assert ray / np.linalg.norm(ray) == pytest.approx(stretch.applied(sun) / np.linalg.norm(stretch.applied(sun)))
    assert stretch.undone(stretch.applied(top)) == pytest.approx(top)


def test_upright_and_level_things_stay_so() -> None:
    assert LONG.applied(np.array([0.0, 1.0, 0.0])) == pytest.approx([0.0, 0.7, 0.0])
    assert LONG.applied(direction(np.array([0.0, 30.0, 200.0]), 0.0))[:, 1] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("stretch", [TALL, LONG])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_crop_shows_the_sun_where_its_target_says(stretch: Stretch, mirrored: bool) -> None:
    crop = take(stretched(source(), stretch), Camera(30.0, 15.0, 5.0, 70.0, 4 / 3, mirrored), SPEC)
    assert crop.sun_elevation != pytest.approx(SUN[1], abs=3.0)
    assert crop.sun_pixel is not None
    np.testing.assert_allclose(brightest(crop), crop.sun_pixel, atol=2.5)


def test_a_world_that_is_not_stretched_gives_the_same_crop() -> None:
    camera = Camera(30.0, 15.0, 5.0, 70.0, 4 / 3)
    np.testing.assert_array_equal(
        take(stretched(source(), NOT_STRETCHED), camera, SPEC).linear, take(source(), camera, SPEC).linear
    )


def test_a_panorama_without_a_sun_has_none_when_it_is_stretched() -> None:
    nan = math.nan
    sunless = source(sun=replace(label(), sun_azimuth=nan, sun_elevation=nan))
    assert math.isnan(stretched(sunless, TALL).label.sun_elevation)


def test_a_sky_that_was_fitted_around_another_sun_is_unknown() -> None:
    camera = Camera(0.0, 0.0, 0.0, 60.0, 1.0)
    one, other = (take(stretched(source(), stretch), camera, SPEC) for stretch in (NOT_STRETCHED, TALL))
    assert math.isfinite(one.turbidity * one.exposure)
    assert math.isnan(other.turbidity)
    assert math.isnan(other.exposure)


def test_a_stretch_costs_resolution() -> None:
    camera = Camera(0.0, 0.0, 0.0, 60.0, 1.0)
    assert is_resolved(source(), camera, 80)
    assert not is_resolved(stretched(source(), TALL), camera, 80)
    assert is_resolved(stretched(source(), Stretch(upwards=0.7)), camera, 80)


def test_the_light_around_is_that_of_the_stretched_world() -> None:
    camera = Camera(SUN[0], 0.0, 0.0, 60.0, 1.0)
    around = light_around(source())
    before, after = (
        seen_from(around, camera, np.ones(3), stretch).reshape(ROWS, COLUMNS, 3)[..., 0]
        for stretch in (NOT_STRETCHED, Stretch(upwards=4.0))
    )
    rows = [int(np.argmax(cells.max(axis=1))) for cells in (before, after)]
    assert rows == [ROWS * (90 - 25) // 180, ROWS * (90 - 62) // 180]


def test_stretches_are_drawn_within_their_limits_both_ways() -> None:
    drawn = [any_stretch(np.random.default_rng(seed)) for seed in range(300)]
    upwards, along = np.log2([s.upwards for s in drawn]), np.log2([s.along for s in drawn])
    assert np.abs(upwards).max() <= UPWARDS
    assert np.abs(along).max() <= ALONG
    assert abs(upwards.mean()) < 0.1
    assert np.ptp([s.heading for s in drawn]) > 150.0

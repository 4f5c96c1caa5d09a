"""Tests of targets."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.crops.crops import Camera, Source
from export.crops.targets import (
    CELLS,
    COLUMNS,
    MAX_CELL,
    MIN_RADIANCE,
    ROWS,
    clear_sun_to_sky_ratio,
    coarse_radiance,
    panorama_irradiance,
    sun_in_view_target,
    surroundings_in_camera,
)
from export.data.panoramas import Panorama
from export.networks.outdoor import network_specs
from lighting.color import tone_map
from lighting.envmap.render import render, sky_irradiance, sun_light
from lighting.geometry import latlong_solid_angle
from lighting.records import Lighting
from tests.helpers.panoramas import VIEWS, crop, label, source

SKY = Lighting(40.0, 25.0, 3.0, 0.02)


def panorama(kind: str, direct: str, notes: str = "", sun: str = "visible", *, disc: bool = True) -> Source:
    """A rendered sky whose sun stands where the label says."""
    image = np.array(render(SKY, 256, sun=disc))
    levels = (tone_map(image),) if kind == "ldr" else (image,)
    plain = source(kind)
    return Source(replace(plain.panorama, direct=direct, notes=notes, sun=sun), levels, label())


def test_an_unclipped_sun_tells_both_powers() -> None:
    irradiance = panorama_irradiance(panorama("hdr", "yes", "max/sky 4000; sun unclipped"))
    np.testing.assert_allclose(irradiance.sun, sun_light(SKY)[0], rtol=0.03)
    np.testing.assert_allclose(irradiance.sky, sky_irradiance(SKY), rtol=0.05)
    assert irradiance.cover == 0.0


def test_a_clipped_sun_is_that_of_a_clear_sky() -> None:
    irradiance = panorama_irradiance(panorama("ldr", "yes"))
    np.testing.assert_allclose(irradiance.sky, sky_irradiance(SKY), rtol=0.06)
    np.testing.assert_allclose(irradiance.sun, irradiance.sky * clear_sun_to_sky_ratio(25))


def test_without_direct_sun_the_sun_is_weak() -> None:
    irradiance = panorama_irradiance(panorama("ldr", "no", sun="none", disc=False))
    np.testing.assert_allclose(irradiance.sun, 0.01 * irradiance.sky)
    assert irradiance.cover == 1.0


def test_a_white_sky_tells_no_power() -> None:
    white = panorama("ldr", "partly")
    white.levels[0][:128] = 255
    irradiance = panorama_irradiance(white)
    assert np.isnan(irradiance.sky).all()
    assert np.isnan(irradiance.sun).all()


def test_the_integral_is_that_of_a_level_plane() -> None:
    """A sky of radiance 0.5 all over lights level ground with pi / 2."""
    grey = panorama("hdr", "no", sun="none")
    grey.levels[0][:] = 0.5
    assert latlong_solid_angle(256).sum() * 512 == pytest.approx(4 * np.pi, rel=1e-6)
    np.testing.assert_allclose(panorama_irradiance(grey).sky, 0.5 * np.pi, rtol=1e-3)


SPEC = network_specs("0")["outdoor"]


def test_a_sun_outside_the_picture_is_seen_nowhere_and_an_unknown_one_asks_nothing() -> None:
    assert sun_in_view_target(crop(VIEWS[0], 120.0, 17.0), SPEC, True)[0] == 1.0
    assert sun_in_view_target(crop(VIEWS[0], float("nan"), float("nan")), SPEC, False)[0] == 1.0
    assert sun_in_view_target(crop(VIEWS[0], 8.0, 17.0), SPEC, None).sum() == 0.0


ONE = np.ones(3)


def lit_at(azimuth: float, kind: str = "hdr") -> Source:
    """Bright and blue towards an azimuth [deg] above the horizon, dark and red elsewhere."""
    picture = np.tile(np.array([0.2, 0.1, 0.05], np.float32), (192, 384, 1))
    column = int((azimuth / 360 + 0.5) * 384)
    picture[:96, column - 20 : column + 20] = (0.5, 0.6, 0.8)
    levels = (tone_map(picture),) if kind == "ldr" else (picture,)
    return Source(Panorama("p", Path("p"), kind, "a", "train"), levels, label())


@pytest.mark.parametrize(("looking", "mirrored", "column"), [(90, False, 12), (30, False, 16), (30, True, 8)])
def test_the_map_is_seen_from_the_camera(looking: float, mirrored: bool, column: int) -> None:
    camera = Camera(looking, 10.0, 0.0, 50.0, 4 / 3, mirrored)
    cells = surroundings_in_camera(coarse_radiance(lit_at(90.0)), camera, ONE)
    assert cells.size == 3 * CELLS
    for plane in cells.reshape(ROWS, COLUMNS, 3).transpose(2, 0, 1):
        center = np.average(np.arange(COLUMNS) + 0.5, weights=(plane[: ROWS // 2] - plane.min()).sum(axis=0))
        assert center == pytest.approx(column, abs=0.3)
        assert np.ptp(plane[ROWS // 2 :]) < 1e-4


def test_the_photo_s_exposure_and_white_balance_count() -> None:
    around, gains = coarse_radiance(lit_at(0.0)), np.array([3.0, 2.0, 1.0])
    camera = Camera(0.0, 0.0, 0.0, 50.0, 1.0)
    one, other = (np.exp(surroundings_in_camera(around, camera, g)).reshape(-1, 3) - MIN_RADIANCE for g in (ONE, gains))
    np.testing.assert_allclose(other, one * gains, rtol=1e-3)


def test_a_sun_counts_as_a_few_whites_at_most() -> None:
    source = lit_at(0.0)
    source.levels[0][40:44, 180:184] = 1e4
    cells = surroundings_in_camera(coarse_radiance(source), Camera(0.0, 0.0, 0.0, 50.0, 1.0), ONE)
    assert np.exp(cells.max()) <= MAX_CELL + MIN_RADIANCE + 1e-4


def test_ldr_and_hdr_panoramas_show_the_same_light() -> None:
    np.testing.assert_allclose(coarse_radiance(lit_at(0.0, "ldr")), coarse_radiance(lit_at(0.0)), atol=0.05)

"""The powers of sun and sky that a panorama tells."""

from dataclasses import replace

import numpy as np
import pytest

from export.crops.irradiance import COVERED_SUN, clear_ratio, irradiance_of
from export.crops.sources import Source
from lighting.colour import tone_map
from lighting.envmap import render, sky_irradiance, sun_irradiance
from lighting.geometry import latlong_solid_angle
from lighting.records import Lighting
from tests.export.crops.examples import label, source

SKY = Lighting(40.0, 25.0, 3.0, 0.02)


def panorama(kind: str, direct: str, notes: str = "", sun: str = "visible", *, disc: bool = True) -> Source:
    """A rendered sky whose sun stands where the label says."""
    image = np.array(render(SKY, 256, sun=disc))
    levels = (tone_map(image),) if kind == "ldr" else (image,)
    plain = source(kind)
    return Source(replace(plain.panorama, direct=direct, notes=notes, sun=sun), levels, label())


def test_an_unclipped_sun_tells_both_powers() -> None:
    found = irradiance_of(panorama("hdr", "yes", "max/sky 4000; sun unclipped"))
    np.testing.assert_allclose(found.sun, sun_irradiance(SKY), rtol=0.03)
    np.testing.assert_allclose(found.sky, sky_irradiance(SKY), rtol=0.05)
    assert found.cover == 0.0


def test_a_clipped_sun_is_that_of_a_clear_sky() -> None:
    found = irradiance_of(panorama("ldr", "yes"))
    np.testing.assert_allclose(found.sky, sky_irradiance(SKY), rtol=0.06)
    np.testing.assert_allclose(found.sun, found.sky * clear_ratio(25))


def test_without_direct_sun_the_sun_is_weak() -> None:
    found = irradiance_of(panorama("ldr", "no", sun="none", disc=False))
    np.testing.assert_allclose(found.sun, COVERED_SUN * found.sky)
    assert found.cover == 1.0


def test_a_white_sky_tells_no_power() -> None:
    white = panorama("ldr", "partly")
    white.levels[0][:128] = 255
    found = irradiance_of(white)
    assert np.isnan(found.sky).all()
    assert np.isnan(found.sun).all()


def test_the_integral_is_that_of_a_level_plane() -> None:
    """A sky of radiance 0.5 all over lights level ground with pi / 2."""
    grey = panorama("hdr", "no", sun="none")
    grey.levels[0][:] = 0.5
    assert latlong_solid_angle(256).sum() * 512 == pytest.approx(4 * np.pi, rel=1e-6)
    np.testing.assert_allclose(irradiance_of(grey).sky, 0.5 * np.pi, rtol=1e-3)

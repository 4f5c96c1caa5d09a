"""Suns found in rendered panoramas."""

import numpy as np
import pytest

from export.data.pictures import decode
from export.data.synthetic import render_panorama
from lighting.geometry import angle_between, direction
from lighting.probe.sky_fit import fit_sky
from lighting.probe.sun_finder import find_sun
from tests.lighting.probe.examples import sun_of


@pytest.mark.slow
def test_no_sun_is_found_under_overcast_skies() -> None:
    assert [find_sun(decode(render_panorama(seed, 64, overcast=True).picture)) for seed in range(12)] == [None] * 12


def test_an_unclipped_sun_is_found_at_its_peak() -> None:
    scene = render_panorama(0, 128, things=0)
    sun = find_sun(scene.linear)
    assert sun is not None
    assert angle_between(sun.direction, sun_of(scene)) < 0.3


def test_an_hdr_picture_without_a_peak_has_no_sun() -> None:
    assert find_sun(render_panorama(0, 64, overcast=True).linear * 50) is None


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0, 1e38])
def test_a_plain_picture_has_neither_sun_nor_sky(value: float) -> None:
    plain = np.full((32, 64, 3), value, np.float32)
    assert find_sun(plain) is None
    assert fit_sky(plain, direction(0.0, 45.0)) is None


def test_the_sun_is_found_across_the_seam() -> None:
    scene = render_panorama(0, 128, things=0)
    shift = round((180.0 - (scene.sun_azimuth or 0.0)) / 360.0 * 256)
    sun = find_sun(np.roll(decode(scene.picture), shift, axis=1))
    assert sun is not None
    assert angle_between(sun.direction, direction(180.0, scene.sun_elevation or 0.0)) < 2.0

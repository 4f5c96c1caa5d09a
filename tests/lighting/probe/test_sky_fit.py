"""Turbidity, exposure and cover of skies."""

import numpy as np
import pytest

from export.data.panoramas import decode_srgb
from export.data.rendered_panoramas import render_panorama
from lighting.envmap.render import render
from lighting.errors import ProbeError
from lighting.geometry import angle_between, direction, latlong_angles, latlong_directions
from lighting.probe.sky_fit import _sky_mask, describe_sky, fit_sky
from lighting.records import Lighting
from tests.helpers.skies import sun_of


@pytest.mark.parametrize("turbidity", [2.0, 5.0])
def test_a_rendered_sky_is_described_as_it_was_made(turbidity: float) -> None:
    lighting = Lighting(sun_azimuth=-60.0, sun_elevation=40.0, turbidity=turbidity, exposure=0.7)
    state = describe_sky(render(lighting, 256, sun=True))
    assert (state.sun_azimuth, state.sun_elevation) == pytest.approx((-60.0, 40.0), abs=0.3)
    assert state.sun_source == "found"
    assert state.turbidity == pytest.approx(turbidity, abs=0.1)
    assert state.exposure == pytest.approx(0.7, rel=0.02)
    assert state.trusted
    assert state.cover < 0.01


def test_clouds_over_a_third_of_the_sky_are_its_cover() -> None:
    lighting = Lighting(sun_azimuth=0.0, sun_elevation=40.0, turbidity=3.0, exposure=0.7)
    image = render(lighting, 128, sun=True)
    azimuth, _ = latlong_angles(128)
    image[:64, np.abs(azimuth) > 120] = 3 * np.median(image[:64])
    state = describe_sky(image, (0.0, 40.0))
    assert state.sun_source == "given"
    assert state.cover == pytest.approx(1 / 3, abs=0.05)
    assert state.turbidity == pytest.approx(3.0, abs=0.3)


def test_skies_that_say_nothing_are_refused() -> None:
    grey = np.full((64, 128, 3), 0.3, np.float32)
    with pytest.raises(ProbeError, match="No sun"):
        describe_sky(grey)
    with pytest.raises(ProbeError, match="clear sky"):
        describe_sky(grey, (0.0, 30.0))
    with pytest.raises(ProbeError, match="below the horizon"):
        describe_sky(grey, (0.0, -3.0))


def test_maps_without_a_sky_are_refused() -> None:
    for value in (0.0, -1.0):
        with pytest.raises(ProbeError, match="black or negative"):
            describe_sky(np.full((64, 128, 3), value, np.float32), (0.0, 30.0))
    with pytest.raises(ProbeError, match=r"has 1 row; a sky needs 16"):
        describe_sky(np.ones((1, 2, 3), np.float32))
    with pytest.raises(ProbeError, match=r"has 15 rows; a sky needs 16"):
        describe_sky(np.ones((15, 30, 3), np.float32))


def test_a_few_values_under_zero_do_no_harm() -> None:
    image = render(Lighting(sun_azimuth=0.0, sun_elevation=40.0, turbidity=3.0, exposure=0.7), 128, sun=True)
    image[60, ::8] = -0.01
    assert describe_sky(image).turbidity == pytest.approx(3.0, abs=0.1)


def test_the_fit_ignores_clouds_and_white_balance() -> None:
    scene = render_panorama(4, 64)
    picture = decode_srgb(scene.picture) * np.array([0.92, 1.0, 1.06], np.float32)
    cloud = angle_between(latlong_directions(64), direction((scene.sun_azimuth or 0.0) + 120.0, 50.0)) < 25.0
    picture[cloud] = picture[cloud] * 0.5 + np.array([0.3, 0.3, 0.32], np.float32)
    fit = fit_sky(np.minimum(picture, 1.0), sun_of(scene))
    assert fit is not None
    assert scene.turbidity is not None
    assert abs(fit.turbidity - scene.turbidity) < 1.0
    assert fit.exposure == pytest.approx(scene.exposure, rel=0.1)


def test_a_sky_unlike_the_model_is_not_trusted() -> None:
    scene = render_panorama(0, 64, things=0)
    painted = decode_srgb(scene.picture)[::-1].copy()
    painted[:32] = np.linspace(0.8, 0.05, 32, dtype=np.float32)[:, None, None] * np.array([0.3, 0.5, 0.9], np.float32)
    fit = fit_sky(painted, sun_of(scene))
    assert fit is not None
    assert not fit.ok


def test_the_sky_mask_leaves_out_the_ground_the_sun_and_the_buildings() -> None:
    scene = render_panorama(4, 64)
    mask = _sky_mask(decode_srgb(scene.picture), sun_of(scene))
    assert mask.any()
    assert not mask[32:].any()
    assert not mask[angle_between(latlong_directions(64), sun_of(scene)) < 19.0].any()

"""Turbidity, exposure and cover of skies."""

import numpy as np
import pytest

from export.data.panoramas import decode_srgb
from export.data.rendered_panoramas import render_panorama
from lighting.envmap.render import render, sun_light
from lighting.errors import ProbeError
from lighting.geometry import angle_between, direction, latlong_angles, latlong_directions
from lighting.probe.sky_fit import _sky_mask, describe_sky, fit_sky
from lighting.probe.sun_detection import find_sun, find_sun_blob, is_clipped, label_regions, pixel_solid_angles
from lighting.records import Lighting
from tests.helpers.skies import sun_of


@pytest.mark.parametrize("turbidity", [2.0, 5.0])
def test_a_rendered_sky_is_described_as_it_was_made(turbidity: float) -> None:
    lighting = Lighting(sun_azimuth=-60.0, sun_elevation=40.0, turbidity=turbidity, exposure=0.7)
    state = describe_sky(render(lighting, 256, sun=True))
    assert (state.sun_azimuth, state.sun_elevation) == pytest.approx((-60.0, 40.0), abs=0.3)
    assert state.sun_source == "found"
    assert state.fit.turbidity == pytest.approx(turbidity, abs=0.1)
    assert state.fit.exposure == pytest.approx(0.7, rel=0.02)
    assert state.fit.ok
    assert state.cover < 0.01


def test_clouds_over_a_third_of_the_sky_are_its_cover() -> None:
    lighting = Lighting(sun_azimuth=0.0, sun_elevation=40.0, turbidity=3.0, exposure=0.7)
    image = render(lighting, 128, sun=True)
    azimuth, _ = latlong_angles(128)
    image[:64, np.abs(azimuth) > 120] = 3 * np.median(image[:64])
    state = describe_sky(image, (0.0, 40.0))
    assert state.sun_source == "given"
    assert state.cover == pytest.approx(1 / 3, abs=0.05)
    assert state.fit.turbidity == pytest.approx(3.0, abs=0.3)


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
    assert describe_sky(image).fit.turbidity == pytest.approx(3.0, abs=0.1)


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


def test_regions_join_across_the_seam_and_at_corners() -> None:
    mask = np.zeros((6, 12), bool)
    mask[2, :2] = mask[2, -2:] = True  # one region across the seam
    mask[4, 5] = mask[5, 6] = True  # one region by a corner
    regions = label_regions(mask)
    assert regions[2, 0] == regions[2, -1] != 0
    assert regions[4, 5] == regions[5, 6] != regions[2, 0]
    assert len(np.unique(regions[mask])) == 2
    assert (regions[~mask] == 0).all()


def test_solid_angles_of_all_pixels_make_a_sphere() -> None:
    area = pixel_solid_angles(16)
    assert area.shape == (16, 32)
    assert area.sum() == pytest.approx(4 * np.pi)
    assert area[7, 0] > 9 * area[0, 0]


def test_values_above_white_were_not_clipped() -> None:
    picture = np.full((4, 8, 3), 1.0, np.float32)
    assert is_clipped(picture)
    assert not is_clipped(picture * 1.01)


@pytest.mark.slow
def test_no_sun_is_found_under_overcast_skies() -> None:
    assert [find_sun(decode_srgb(render_panorama(seed, 64, overcast=True).picture)) for seed in range(12)] == [
        None
    ] * 12


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
    sun = find_sun(np.roll(decode_srgb(scene.picture), shift, axis=1))
    assert sun is not None
    assert angle_between(sun.direction, direction(180.0, scene.sun_elevation or 0.0)) < 2.0


LIGHTING = Lighting(sun_azimuth=-130.0, sun_elevation=35.0, turbidity=3.0, exposure=0.2)
NONE = np.zeros((256, 512), dtype=bool)


@pytest.mark.parametrize("azimuth", [-130.0, 179.9])
def test_the_sun_is_found_with_its_power(azimuth: float) -> None:
    lighting = Lighting(sun_azimuth=azimuth, sun_elevation=35.0, turbidity=3.0, exposure=0.2)
    spot = find_sun_blob(render(lighting, 256), NONE)
    assert spot is not None
    assert not spot.clipped
    # The disc lies in one or two of the map's pixels of 0.7 deg.
    assert angle_between(spot.direction, lighting.sun_direction) < 0.15
    assert spot.irradiance == pytest.approx(sun_light(lighting)[0], rel=0.01)


def test_a_clipped_sun_is_found_in_the_middle_of_what_is_clipped() -> None:
    image = np.minimum(render(LIGHTING, 256), 20.0)
    clipped = np.asarray(angle_between(latlong_directions(256), LIGHTING.sun_direction) < 2.0)
    spot = find_sun_blob(image, clipped)
    assert spot is not None
    assert spot.clipped
    assert spot.radius == pytest.approx(2.0, abs=0.2)
    assert angle_between(spot.direction, LIGHTING.sun_direction) < 0.2


def test_no_sun_is_found_in_a_sky_without_one() -> None:
    assert find_sun_blob(render(LIGHTING, 256, sun=False), NONE) is None


def test_a_sky_near_the_largest_float_has_no_sun() -> None:
    assert find_sun_blob(np.full((256, 512, 3), 1e38, np.float32), NONE) is None


def test_half_a_clipped_sky_is_no_sun() -> None:
    clipped = NONE.copy()
    clipped[:100, :300] = True
    assert find_sun_blob(render(LIGHTING, 256, sun=False), clipped) is None


def test_what_shines_below_the_horizon_is_no_sun() -> None:
    image = render(LIGHTING, 256, sun=False)
    image[200, 100] = 1e5
    assert find_sun_blob(image, NONE) is None

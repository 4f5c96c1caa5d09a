"""The sun in panoramas and in measured skies."""

import numpy as np
import pytest

from export.data.panoramas import decode_srgb
from export.data.rendered_panoramas import render_panorama
from lighting.envmap.render import render
from lighting.envmap.sun_disc import sun_irradiance
from lighting.geometry import angle_between, direction, latlong_directions
from lighting.probe.sky_fit import fit_sky
from lighting.probe.sun_detection import find_sun, find_sun_blob, is_clipped, label_regions, pixel_solid_angles
from lighting.records import Lighting
from tests.helpers.skies import sun_of


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
    assert spot.irradiance == pytest.approx(sun_irradiance(lighting), rel=0.01)


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

"""Tests of crops."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.crops.crops import (
    MAX_HORIZONTAL_FOV,
    Camera,
    Source,
    aimed_camera,
    crop_panorama,
    crop_rng,
    load_source,
    native_rows,
    paper_camera,
    phone_camera,
    sampling_weights,
    training_camera,
)
from export.crops.targets import COLUMNS, ROWS, coarse_radiance, surroundings_in_camera
from export.data.labels import Label
from export.data.panoramas import Panorama
from lighting.geometry import Pinhole, camera_directions, camera_pixel
from tests.helpers.panoramas import EXAMPLES_SPEC, SUN, brightest, crop, label, source


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("roll", [0.0, 9.0])
@pytest.mark.parametrize("aspect", [9 / 16, 4 / 3])
def test_the_target_points_at_the_brightest_pixel(aspect: float, roll: float, mirrored: bool) -> None:
    crop = crop_panorama(source(), Camera(30.0, 15.0, roll, 60.0, aspect, mirrored), EXAMPLES_SPEC)
    height, width = crop.linear.shape[:2]
    c = crop.camera
    expected = camera_pixel(crop.sun_direction, Pinhole(width, height, c.vertical_fov, 0.0, c.elevation, c.roll))
    assert crop.sun_azimuth == pytest.approx(-10.0 if mirrored else 10.0)
    np.testing.assert_allclose(brightest(crop), expected, atol=2.0)


def test_no_black_ring_surrounds_the_sun_of_an_hdr_panorama() -> None:
    hdr = source("hdr")
    bright = hdr.levels[0].copy()
    bright[:] = 0.2
    bright[bright.shape[0] // 2, bright.shape[1] // 2] = 1e4
    crop = crop_panorama(replace(hdr, levels=(bright,)), Camera(0.0, 0.0, 0.0, 60.0, 4 / 3), EXAMPLES_SPEC)
    assert crop.linear.max() > 100 * crop.linear.min()
    assert crop.linear.min() == pytest.approx(0.2 * crop.gain, rel=1e-3)


def test_ldr_and_hdr_crops_show_the_same_light() -> None:
    camera = Camera(0.0, 5.0, 2.0, 50.0, 4 / 3)
    ldr, hdr = crop_panorama(source("ldr"), camera, EXAMPLES_SPEC), crop_panorama(source("hdr"), camera, EXAMPLES_SPEC)
    np.testing.assert_allclose(ldr.linear * (hdr.exposure / ldr.exposure), hdr.linear, rtol=0.05, atol=0.01)


def test_lower_sharpness_and_narrow_views_keep_the_size_and_lose_detail() -> None:
    noise = np.random.default_rng(0).random((768, 1536, 3)).astype(np.float32)
    noisy = Source(source().panorama, (noise,), label())
    sizes = set()
    spread = []
    for fov, sharpness in ((60.0, 1.0), (60.0, 0.4), (25.0, 1.0)):
        crop = crop_panorama(noisy, Camera(0.0, 0.0, 0.0, fov, 4 / 3), EXAMPLES_SPEC, sharpness)
        sizes.add(crop.linear.shape)
        spread.append(float(np.abs(np.diff(crop.linear[..., 0] / crop.linear[..., 0].mean(), axis=1)).mean()))
    assert sizes == {(168, 224, 3)}
    assert spread[0] > 1.5 * spread[1]
    assert spread[0] > 1.5 * spread[2]


def test_unknown_suns_and_untrusted_fits_are_nan() -> None:
    nan = math.nan
    unknown = Label("p", nan, nan, nan, "none", nan, nan, 3.0, 0.5, 0.1, False, "")
    crop = crop_panorama(source(sun=unknown), Camera(0.0, 0.0, 0.0, 50.0, 1.0), EXAMPLES_SPEC)
    assert np.isnan(crop.sun_direction).all()
    np.testing.assert_array_equal(np.isnan(crop.parameters), [True, True, False, False, False, True])


def test_rays_above_the_horizon_see_the_upper_half() -> None:
    upper = np.zeros((256, 512, 3), np.float32)
    upper[:128] = 1.0
    crop = crop_panorama(
        Source(source().panorama, (upper,), label()), Camera(77.0, 12.0, 6.0, 50.0, 4 / 3), EXAMPLES_SPEC
    )
    rays = camera_directions(Pinhole(224, 168, 50.0, 0.0, 12.0, 6.0))
    clear = np.abs(rays[..., 1]) > 0.02
    assert ((crop.linear[..., 0] > 0.5 * crop.linear.max()) == (rays[..., 1] > 0))[clear].all()


def test_randomness_depends_on_name_index_and_purpose_alone() -> None:
    values = {crop_rng(n, i, p).random() for n in "ab" for i in range(3) for p in ("train", "tune")}
    assert len(values) == 12
    assert crop_rng("a", 1, "train").random() == crop_rng("a", 1, "train").random()


def test_large_places_and_common_elevations_are_drawn_less_each() -> None:
    crowd = [source(place="big") for _ in range(9)] + [source(place="small")]
    weights = sampling_weights(crowd)
    assert weights.sum() == pytest.approx(1.0)
    assert weights[-1] == pytest.approx(3 * weights[0])
    low = sampling_weights([source(place=str(i)) for i in range(16)] + [source(place="x", sun=label(elevation=5.0))])
    assert low[-1] == pytest.approx(8 * low[0])


def test_sources_are_halved_for_wide_views(tmp_path: Path) -> None:
    from PIL import Image

    Image.new("RGB", (1536, 768), (10, 200, 30)).save(tmp_path / "p.png")
    loaded = load_source(Panorama("p", tmp_path / "p.png", "ldr", "a", "train"), label())
    assert [level.shape[0] for level in loaded.levels] == [768, 384, 192]
    assert all((level == [10, 200, 30]).all() for level in loaded.levels)
    crop = crop_panorama(loaded, Camera(0.0, 0.0, 0.0, 80.0, 1.0), EXAMPLES_SPEC)
    assert np.ptp(crop.linear, axis=(0, 1)).max() < 1e-3


def test_the_crop_shows_the_sun_where_its_target_says() -> None:
    crop = crop_panorama(source(), Camera(30.0, 15.0, 5.0, 70.0, 4 / 3, mirrored=True), EXAMPLES_SPEC)
    assert crop.sun_pixel is not None
    np.testing.assert_allclose(brightest(crop), crop.sun_pixel, atol=2.5)


def test_a_panorama_resolves_as_many_rows_of_a_view_as_it_has() -> None:
    """256 rows of 180 degrees are 85 of 60 degrees."""
    camera = Camera(0.0, 0.0, 0.0, 60.0, 1.0)
    assert 85 <= native_rows(source(), camera) < 86


def test_the_light_around_is_brightest_at_the_sun_s_height() -> None:
    around = coarse_radiance(source())
    cells = surroundings_in_camera(around, Camera(SUN[0], 0.0, 0.0, 60.0, 1.0), np.ones(3)).reshape(ROWS, COLUMNS, 3)
    assert int(np.argmax(cells[..., 0].max(axis=1))) == ROWS * (90 - 25) // 180


@pytest.mark.parametrize("draw", [paper_camera, phone_camera, training_camera])
def test_cameras_stay_inside_their_protocol(draw: object) -> None:
    drawn = [draw(crop_rng("name", i, "test")) for i in range(300)]  # type: ignore[operator]
    elevation, fov = 20 if draw is paper_camera else 35, (25, 90)
    roll = {paper_camera: 0.0, phone_camera: 10.0, training_camera: 45.0}[draw]  # type: ignore[index]
    assert all(
        abs(c.elevation) <= elevation and abs(c.roll) <= roll and fov[0] <= c.vertical_fov <= fov[1] for c in drawn
    )
    widths = [2 * math.degrees(math.atan(c.aspect * math.tan(math.radians(c.vertical_fov / 2)))) for c in drawn]
    assert max(widths) <= MAX_HORIZONTAL_FOV + 0.01
    assert min(c.elevation for c in drawn) < -0.9 * elevation
    assert max(c.elevation for c in drawn) > 0.9 * elevation


def test_aimed_cameras_hold_the_sun() -> None:
    rng = np.random.default_rng(1)
    in_view = 0
    for azimuth, elevation in [(0.0, 5.0), (100.0, 30.0), (-170.0, 45.0)]:
        for _ in range(20):
            camera = aimed_camera(rng, azimuth, elevation)
            in_view += crop(camera, azimuth - camera.azimuth, elevation).sun_pixel is not None
    assert in_view > 55

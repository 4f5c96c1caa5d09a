"""Crops: their targets agree with what their pixels show."""

import math
from dataclasses import replace

import numpy as np
import pytest

from export.crops.cameras import Camera
from export.crops.crops import take
from export.crops.sources import Source
from export.data.labels import Label
from lighting.geometry import Pinhole, camera_directions, camera_pixel
from tests.export.crops.examples import SPEC, brightest, label, source


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("roll", [0.0, 9.0])
@pytest.mark.parametrize("aspect", [9 / 16, 4 / 3])
def test_the_target_points_at_the_brightest_pixel(aspect: float, roll: float, mirrored: bool) -> None:
    crop = take(source(), Camera(30.0, 15.0, roll, 60.0, aspect, mirrored), SPEC)
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
    crop = take(replace(hdr, levels=(bright,)), Camera(0.0, 0.0, 0.0, 60.0, 4 / 3), SPEC)
    assert crop.linear.max() > 100 * crop.linear.min()
    assert crop.linear.min() == pytest.approx(0.2 * crop.gain, rel=1e-3)


def test_ldr_and_hdr_crops_show_the_same_light() -> None:
    camera = Camera(0.0, 5.0, 2.0, 50.0, 4 / 3)
    ldr, hdr = take(source("ldr"), camera, SPEC), take(source("hdr"), camera, SPEC)
    np.testing.assert_allclose(ldr.linear * (hdr.exposure / ldr.exposure), hdr.linear, rtol=0.05, atol=0.01)


def test_lower_sharpness_and_narrow_views_keep_the_size_and_lose_detail() -> None:
    noise = np.random.default_rng(0).random((768, 1536, 3)).astype(np.float32)
    noisy = Source(source().panorama, (noise,), label())
    sizes = set()
    spread = []
    for fov, sharpness in ((60.0, 1.0), (60.0, 0.4), (25.0, 1.0)):
        crop = take(noisy, Camera(0.0, 0.0, 0.0, fov, 4 / 3), SPEC, sharpness)
        sizes.add(crop.linear.shape)
        spread.append(float(np.abs(np.diff(crop.linear[..., 0] / crop.linear[..., 0].mean(), axis=1)).mean()))
    assert sizes == {(168, 224, 3)}
    assert spread[0] > 1.5 * spread[1]
    assert spread[0] > 1.5 * spread[2]


def test_unknown_suns_and_untrusted_fits_are_nan() -> None:
    nan = math.nan
    unknown = Label("p", nan, nan, nan, "none", nan, nan, 3.0, 0.5, 0.1, False, "")
    crop = take(source(sun=unknown), Camera(0.0, 0.0, 0.0, 50.0, 1.0), SPEC)
    assert np.isnan(crop.sun_direction).all()
    np.testing.assert_array_equal(np.isnan(crop.parameters), [True, True, False, False, False, True])


def test_rays_above_the_horizon_see_the_upper_half() -> None:
    upper = np.zeros((256, 512, 3), np.float32)
    upper[:128] = 1.0
    crop = take(Source(source().panorama, (upper,), label()), Camera(77.0, 12.0, 6.0, 50.0, 4 / 3), SPEC)
    rays = camera_directions(Pinhole(224, 168, 50.0, 0.0, 12.0, 6.0))
    clear = np.abs(rays[..., 1]) > 0.02
    assert ((crop.linear[..., 0] > 0.5 * crop.linear.max()) == (rays[..., 1] > 0))[clear].all()

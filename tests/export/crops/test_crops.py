"""Crops: their targets agree with what their pixels show."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from export.crops.augment import augment
from export.crops.crops import (
    MAX_HORIZONTAL_FOV,
    Camera,
    Crop,
    Source,
    generator,
    load_source,
    paper_camera,
    phone_camera,
    sampling_weights,
    take,
    training_camera,
)
from export.data.labels import Label
from export.data.panoramas import Panorama
from export.networks.network import specs
from lighting.colour import tone_map
from lighting.geometry import angle_between, camera_directions, camera_pixel, direction, latlong_directions

SPEC = specs("0")["outdoor"]
SUN = (40.0, 25.0)  # deg


def label(azimuth: float = SUN[0], elevation: float = SUN[1], *, ok: bool = True) -> Label:
    return Label("p", azimuth, elevation, 2.0, "given", azimuth, elevation, 3.0, 0.5, 0.1, ok, "yes")


def source(kind: str = "hdr", place: str = "a", sun: Label | None = None) -> Source:
    """A panorama whose radiance falls off around the sun, so that its brightest pixel is the sun."""
    near = angle_between(latlong_directions(256), direction(*SUN))
    picture = np.repeat(np.exp(-((near / 8) ** 2))[..., None] * 0.8 + 0.1, 3, axis=-1).astype(np.float32)
    levels = (tone_map(picture),) if kind == "ldr" else (picture,)
    return Source(Panorama("p", Path("p"), kind, place, "train"), levels, sun or label())


def brightest(crop: Crop) -> tuple[float, float]:
    y, x = np.unravel_index(np.argmax(crop.linear[..., 1]), crop.linear.shape[:2])
    return float(x) + 0.5, float(y) + 0.5


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("roll", [0.0, 9.0])
@pytest.mark.parametrize("aspect", [9 / 16, 4 / 3])
def test_the_target_points_at_the_brightest_pixel(aspect: float, roll: float, mirrored: bool) -> None:
    crop = take(source(), Camera(30.0, 15.0, roll, 60.0, aspect, mirrored), SPEC)
    height, width = crop.linear.shape[:2]
    c = crop.camera
    expected = camera_pixel(crop.sun_direction, width, height, c.vertical_fov, 0.0, c.elevation, c.roll)
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


@pytest.mark.parametrize("draw", [paper_camera, phone_camera, training_camera])
def test_cameras_stay_inside_their_protocol(draw: object) -> None:
    drawn = [draw(generator("name", i, "test")) for i in range(300)]  # type: ignore[operator]
    elevation, roll, fov = 20 if draw is paper_camera else 35, 0 if draw is paper_camera else 10, (25, 90)
    assert all(
        abs(c.elevation) <= elevation and abs(c.roll) <= roll and fov[0] <= c.vertical_fov <= fov[1] for c in drawn
    )
    widths = [2 * math.degrees(math.atan(c.aspect * math.tan(math.radians(c.vertical_fov / 2)))) for c in drawn]
    assert max(widths) <= MAX_HORIZONTAL_FOV + 0.01
    assert min(c.elevation for c in drawn) < -0.9 * elevation
    assert max(c.elevation for c in drawn) > 0.9 * elevation


def test_randomness_depends_on_name_index_and_purpose_alone() -> None:
    values = {generator(n, i, p).random() for n in "ab" for i in range(3) for p in ("train", "tune")}
    assert len(values) == 12
    assert generator("a", 1, "train").random() == generator("a", 1, "train").random()


def test_augmentation_keeps_the_size_and_tells_its_gain() -> None:
    flat = Crop(np.full((120, 160, 3), 0.2, np.float32), Camera(0, 0, 0, 50.0, 4 / 3), 0.0, 20.0, 2.0, 1.0, 3.0, 0.5)
    rng = np.random.default_rng(3)
    drawn = [augment(flat, rng) for _ in range(60)]
    assert {picture.shape for picture, _, _ in drawn} == {(120, 160, 3)}
    brightness = [float(np.median(picture)) for picture, _, _ in drawn]
    assert np.corrcoef(brightness, [np.log(gain) for _, gain, _ in drawn])[0, 1] > 0.8


def test_an_underexposed_sun_stays_white() -> None:
    white = Crop(np.ones((64, 64, 3), np.float32), Camera(0, 0, 0, 50.0, 1.0), 90.0, 20.0, 2.0, 1.0, 3.0, 0.5)
    rng = np.random.default_rng(0)
    dim = [picture for picture, gain, _ in (augment(white, rng) for _ in range(40)) if gain < 0.8]
    assert np.median([np.median(picture) for picture in dim]) > 235


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
    crop = take(loaded, Camera(0.0, 0.0, 0.0, 80.0, 1.0), SPEC)
    assert np.ptp(crop.linear, axis=(0, 1)).max() < 1e-3


def test_rays_above_the_horizon_see_the_upper_half() -> None:
    upper = np.zeros((256, 512, 3), np.float32)
    upper[:128] = 1.0
    crop = take(Source(source().panorama, (upper,), label()), Camera(77.0, 12.0, 6.0, 50.0, 4 / 3), SPEC)
    rays = camera_directions(224, 168, 50.0, 0.0, 12.0, 6.0)
    clear = np.abs(rays[..., 1]) > 0.02
    assert ((crop.linear[..., 0] > 0.5 * crop.linear.max()) == (rays[..., 1] > 0))[clear].all()

"""The rendered map: sky, power of the sun, ground, turning."""

from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from lighting.envmap import render, sky_irradiance, sun_irradiance, with_irradiance
from lighting.errors import ParameterError
from lighting.geometry import (
    SUN_RADIUS,
    Floats,
    angle_between,
    direction,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
)
from lighting.records import Lighting
from lighting.sky.hosek_wilkie import SUN_SOLID_ANGLE, sky_radiance, sun_disc_points, sun_disc_radiance, sun_radiance

HEIGHTS = (16, 18, 50, 128, 1024)
SUNS = {  # azimuth and elevation, deg
    "ordinary": (-41.2, 33.0),
    "seam": (180.0, 20.0),
    "beside the seam": (-179.9, 5.0),
    "half set": (12.0, 0.0),
    "touching the horizon": (100.0, 0.2),
    "beside the zenith": (70.0, 89.6),
    "over the zenith": (-70.0, 89.85),
    "zenith": (0.0, 90.0),
}
SUN_CASES = pytest.mark.parametrize(("azimuth", "elevation"), SUNS.values(), ids=SUNS.keys())


def lighting(azimuth: float = -41.2, elevation: float = 33.0, **fields: float) -> Lighting:
    given: dict[str, Any] = {"turbidity": 2.6, "exposure": 1.0, **fields}
    return Lighting(sun_azimuth=azimuth, sun_elevation=elevation, **given)


@lru_cache(maxsize=8)
def disc_of(light: Lighting, height: int) -> Floats:
    """What painting the sun adds above the horizon (H / 2, 2H, 3)."""
    return (render(light, height, sun=True) - render(light, height, sun=False))[: height // 2].astype(np.float64)


def power(light: Lighting, height: int) -> Floats:
    return np.asarray(disc_of(light, height).sum(axis=1).T @ latlong_solid_angle(height)[: height // 2])


def expected_power(light: Lighting) -> Floats:
    points, weight = sun_disc_points(light.sun_direction, rings=100, spokes=400)
    return weight @ sun_disc_radiance(points, light.sun_direction, light.turbidity) * light.exposure


def horizontal_irradiance(image: Floats) -> Floats:
    """The hemisphere integral of radiance x cosine, pixel by pixel."""
    up = np.maximum(np.sin(np.radians(latlong_angles(len(image))[1])), 0)
    return np.asarray(image.sum(axis=1, dtype=np.float64).T @ (up * latlong_solid_angle(len(image))))


# The picture as a whole


@pytest.mark.parametrize("height", [16, 18, 512, np.int64(64)])
def test_shape_type_and_finite_values(height: int) -> None:
    image = render(lighting(), height)
    assert image.shape == (height, 2 * height, 3)
    assert image.dtype == np.float32
    assert np.isfinite(image).all()
    assert image.min() >= 0


@pytest.mark.parametrize("height", [0, 14, 17, 511, 4098, -512, 512.0, True, "512"])
def test_other_heights_are_one_sentence(height: Any) -> None:
    with pytest.raises(ParameterError, match=r"^height is .*; it must be an even number from 16 to 4096\.$"):
        render(lighting(), height)


@pytest.mark.slow
def test_the_largest_height() -> None:
    light = lighting(*SUNS["seam"])
    image = render(light, 4096)
    assert image.shape == (4096, 8192, 3)
    azimuth, elevation = latlong_angles(4096)
    directions = direction(azimuth[::8], elevation[:2048:64, None])
    away = angle_between(directions, light.sun_direction) > 1
    expected = sky_radiance(directions[away], light.sun_direction, 2.6, 0.3)
    np.testing.assert_allclose(image[:2048:64, ::8][away], expected, rtol=1e-3)
    rows = np.abs(elevation - light.sun_elevation) < 0.4
    around = np.roll(image[rows], 20, axis=1)[:, :40]
    columns = np.roll(azimuth, 20)[:40]
    disc = around - sky_radiance(direction(columns, elevation[rows, None]), light.sun_direction, 2.6, 0.3)
    assert disc.sum(axis=1).T @ latlong_solid_angle(4096)[rows] == pytest.approx(expected_power(light), rel=0.01)


def test_exposure_scales_everything() -> None:
    np.testing.assert_allclose(render(lighting(exposure=0.02), 64), 0.02 * render(lighting(), 64), rtol=1e-5)


# Sky


@pytest.mark.parametrize("turbidity", [1.0, 2.2, 10.0])
@pytest.mark.parametrize("elevation", [0.0, 3.0, 33.0, 90.0])
@pytest.mark.parametrize("height", [16, 256])
def test_sky_pixels_hold_the_sky_model(height: int, elevation: float, turbidity: float) -> None:
    light = lighting(25.0, elevation, turbidity=turbidity, ground_albedo=0.6)
    sky = render(light, height, sun=False)[: height // 2]
    expected = sky_radiance(latlong_directions(height)[: height // 2], light.sun_direction, turbidity, 0.6)
    strongest = expected.max(axis=-1, keepdims=True)
    assert (np.abs(sky - expected) / strongest).max() < 1e-3


# Sun


@SUN_CASES
@pytest.mark.parametrize("height", HEIGHTS)
def test_sun_power_is_the_same_at_every_height(azimuth: float, elevation: float, height: int) -> None:
    light = lighting(azimuth, elevation)
    expected = expected_power(light)
    assert np.abs(power(light, height) - expected).max() < 0.01 * expected.max()


@SUN_CASES
def test_the_disc_is_where_the_sun_is(azimuth: float, elevation: float) -> None:
    light, height = lighting(azimuth, elevation), 512
    disc = disc_of(light, height)[..., 0]
    directions = latlong_directions(height)[: height // 2]
    pixel_diagonal = 2**0.5 * 180 / height
    assert angle_between(directions[disc > 0], light.sun_direction).max() < SUN_RADIUS + pixel_diagonal / 2
    centre = np.tensordot(disc * latlong_solid_angle(height)[: height // 2, None], directions, axes=2)
    assert angle_between(centre, light.sun_direction) < (0.02 if elevation > 0.3 else SUN_RADIUS)


@pytest.mark.parametrize(("rows", "columns"), [(0, 0), (2, 0), (0, 2), (-3, 0), (6, 0)])
def test_large_maps_resolve_the_disc_and_its_limb(rows: int, columns: int) -> None:
    height, row, column = 2048, 568, 2048
    azimuth, elevation = latlong_angles(height)
    light = lighting(azimuth[column], elevation[row])
    painted = disc_of(light, height)[row + rows, column + columns]
    inside = (np.arange(64) + 0.5) / 64 * (180 / height) - 90 / height
    points = direction(azimuth[column + columns] + inside, elevation[row + rows] + inside[:, None])
    model = sun_disc_radiance(points, light.sun_direction, light.turbidity).mean(axis=(0, 1))
    assert painted == pytest.approx(model, rel=0.01, abs=0.03 * sun_radiance(light.sun_direction, 2.6).max())


def test_half_of_a_setting_sun_is_painted() -> None:
    set_, whole = lighting(30.0, 0.0), lighting(30.0, 0.3)
    assert disc_of(set_, 512).sum() > 0
    radiance = sun_radiance(set_.sun_direction, set_.turbidity) * SUN_SOLID_ANGLE / 2
    assert power(set_, 512) == pytest.approx(radiance, rel=0.01)
    assert power(set_, 512)[0] < 0.6 * power(whole, 512)[0]


@pytest.mark.parametrize(("visibility", "painted"), [(0.49, False), (0.5, True), (1.0, True)])
def test_visibility_decides_about_the_disc(visibility: float, painted: bool) -> None:
    light = lighting(sun_visibility=visibility)
    np.testing.assert_array_equal(render(light, 32), render(light, 32, sun=painted))
    assert (render(light, 32, sun=True) > render(light, 32, sun=False)).any()


# Ground


@pytest.mark.parametrize("sun", [False, True])
@pytest.mark.parametrize("elevation", [4.0, 33.0, 90.0])
@pytest.mark.parametrize("albedo", [0.3, 1.0])
def test_ground_reflects_the_hemisphere_integral(albedo: float, elevation: float, sun: bool) -> None:
    light = lighting(60.0, elevation, ground_albedo=albedo)
    image = render(light, 512, sun=sun)
    assert (image[256:] == image[256, 0]).all()
    assert image[-1, 0] == pytest.approx(albedo / np.pi * horizontal_irradiance(image), rel=0.01)


def test_ground_is_the_same_at_every_height() -> None:
    expected = render(lighting(), 1024)[-1, 0]
    for height in HEIGHTS:
        np.testing.assert_array_equal(render(lighting(), height)[-1, 0], expected)


def test_black_ground_is_black() -> None:
    assert not render(lighting(ground_albedo=0.0), 32)[16:].any()


# Given irradiances

SUN, SKY, GROUND = (1.9, 1.5, 0.9), (0.4, 0.5, 0.8), (0.12, 0.11, 0.1)


def given_light(elevation: float = 33.0, **fields: Any) -> Lighting:
    return Lighting(-41.2, elevation, 2.6, 5.0, sun_irradiance=SUN, sky_irradiance=SKY, ground_color=GROUND, **fields)


def test_what_is_no_lighting_is_named() -> None:
    with pytest.raises(ParameterError, match="A Lighting is needed, not dict; an estimate has one as `lighting`"):
        render({"sun_azimuth": 3.0})  # type: ignore[arg-type]


@pytest.mark.parametrize("cover", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("elevation", [0.3, 33.0, 89.0])
@pytest.mark.parametrize("height", [16, 128])
def test_the_integrals_are_those_given(cover: float, elevation: float, height: int) -> None:
    light = given_light(elevation, sky_cover=cover)
    assert power(light, height) == pytest.approx(SUN, rel=1e-4)
    image = render(light, height)
    up = np.sin(np.radians(elevation))
    assert image[-1, 0] == pytest.approx(np.array(GROUND) / np.pi * (np.array(SKY) + up * np.array(SUN)), rel=1e-5)
    fine = render(light, 512, sun=False)
    assert horizontal_irradiance(fine) == pytest.approx(SKY, rel=2e-4)
    assert fine[-1, 0] == pytest.approx(np.array(GROUND) / np.pi * np.array(SKY), rel=1e-5)


def test_a_covered_sun_fades_by_its_irradiance_whatever_its_visibility() -> None:
    faint = Lighting(0.0, 40.0, 3.0, 1.0, sun_visibility=0.1, sun_irradiance=(0.1, 0.1, 0.1), sky_irradiance=SKY)
    assert power(faint, 64) == pytest.approx([0.1] * 3, rel=1e-4)
    assert faint.sun_painted
    assert not faint.sun_shines


def test_without_a_colour_the_given_ground_is_dark_grey_and_the_old_one_its_albedo() -> None:
    plain = Lighting(0.0, 40.0, 3.0, 1.0, sun_irradiance=(0.0, 0.0, 0.0), sky_irradiance=SKY)
    assert render(plain, 32)[-1, 0] == pytest.approx(0.12 / np.pi * np.array(SKY), rel=1e-5)
    red = Lighting(0.0, 40.0, 3.0, 1.0, ground_color=(0.6, 0.3, 0.3))
    assert render(red, 32)[-1, 0] == pytest.approx(render(lighting(0.0, 40.0, turbidity=3.0), 32)[-1, 0] * [2, 1, 1])


def test_stated_irradiances_are_those_of_the_model() -> None:
    old = lighting()
    stated = with_irradiance(old)
    assert sun_irradiance(stated) == pytest.approx(sun_irradiance(old))
    assert sky_irradiance(stated) == pytest.approx(sky_irradiance(old))
    np.testing.assert_allclose(render(stated, 128, sun=False), render(old, 128, sun=False), rtol=2e-3)
    assert with_irradiance(stated) is stated
    assert with_irradiance(lighting(sun_visibility=0.2)).sun_irradiance == (0.0, 0.0, 0.0)


def test_a_sun_that_haze_has_put_out_is_painted_in_its_given_colour() -> None:
    light = Lighting(10.0, 0.0, 10.0, 1.0, sun_irradiance=SUN, sky_irradiance=SKY)
    assert power(light, 64) == pytest.approx(SUN, rel=1e-4)

"""The rendered map: sky, power of the sun, ground, turning."""

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.envmap import render, rotate, turn
from lighting.errors import ParameterError
from lighting.geometry import (
    SUN_RADIUS,
    Floats,
    angle_between,
    direction,
    latlong_angles,
    latlong_directions,
    latlong_solid_angle,
    wrap_azimuth,
)
from lighting.records import Lighting
from lighting.sky import (
    SUN_SOLID_ANGLE,
    sky_radiance,
    sun_disc_points,
    sun_disc_radiance,
    sun_radiance,
)

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


@pytest.mark.parametrize("height", [16, 18, 512])
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


# Turning

SMALL = render(lighting(), 16)


@given(st.integers(-100, 100))
def test_whole_pixels_turn_exactly(columns: int) -> None:
    np.testing.assert_array_equal(rotate(SMALL, columns * 360 / 32), np.roll(SMALL, columns, axis=1))


@pytest.mark.parametrize("yaw", [46.0, -100.0, 170.0, 522.0])
def test_turning_the_map_turns_the_sun(yaw: float) -> None:
    turned = rotate(render(lighting(0.0), 90), yaw)
    azimuth = (yaw + 180) % 360 - 180
    np.testing.assert_allclose(turned, render(lighting(azimuth), 90), rtol=2e-3)


@given(st.floats(-1000, 1000))
def test_turning_keeps_the_energy_and_interpolates(yaw: float) -> None:
    turned = rotate(SMALL, yaw)
    assert turned.dtype == np.float32
    np.testing.assert_allclose(turned.sum(axis=1), SMALL.sum(axis=1), rtol=1e-4)
    assert turned.max() <= SMALL.max() * (1 + 1e-6)


def test_half_a_pixel_is_the_mean_of_neighbours() -> None:
    image = np.zeros((8, 16, 3), dtype=np.float32)
    image[:, 15] = 2.0
    turned = rotate(image, 360 / 16 / 2)
    assert turned[0, :, 0].tolist() == [1.0, *[0.0] * 14, 1.0]


@pytest.mark.parametrize("yaw", [float("nan"), float("inf")])
def test_a_yaw_is_finite(yaw: float) -> None:
    with pytest.raises(ParameterError, match=r"^yaw must be a finite number"):
        rotate(SMALL, yaw)


def test_a_turned_record_keeps_the_suns_compass_azimuth() -> None:
    known = replace(lighting(0.0), camera_heading=350.0, camera_heading_probability=(0.0,) * 350 + (1.0,) + (0.0,) * 9)
    turned = turn(known, -30.0)
    assert turned.sun_azimuth == pytest.approx(wrap_azimuth(known.sun_azimuth - 30.0))
    assert turned.camera_heading == pytest.approx(20.0)
    assert np.argmax(turned.camera_heading_probability) == 20
    assert turn(turned, 30.0) == known
    assert turn(lighting(0.0), 30.0).camera_heading is None

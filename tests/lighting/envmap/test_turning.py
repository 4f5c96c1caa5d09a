"""Turned and brightened maps and records."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.envmap import brighten, render, rotate, turn
from lighting.errors import ParameterError
from lighting.geometry import wrap_azimuth
from tests.lighting.envmap.test_render import given_light, lighting

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


def test_turned_angles_have_no_digits_of_rounding() -> None:
    known = replace(lighting(0.0), sun_azimuth=57.5527, camera_heading=142.67, relative_heading=33.4)
    assert turn(known, 360.0) == known
    turned = turn(known, 123.456)
    assert (turned.sun_azimuth, turned.camera_heading, turned.relative_heading) == (-178.9913, 19.214, 269.944)
    assert turn(replace(known, camera_heading=30.0), 30.0 + 1e-9).camera_heading == 0.0


def test_a_brightened_record_renders_a_brightened_map() -> None:
    gain = np.array([2.0, 2.0, 2.0])
    for light in (lighting(), given_light(sky_cover=0.3)):
        np.testing.assert_allclose(render(brighten(light, gain), 32), 2 * render(light, 32), rtol=1e-5)


def test_a_tint_changes_the_irradiances_alone() -> None:
    tinted = brighten(given_light(), np.array([2.0, 1.0, 0.5]))
    assert tinted.sky_irradiance == pytest.approx((0.8, 0.5, 0.4))
    assert brighten(lighting(), np.ones(3)).sky_irradiance is None


def test_a_turned_record_turns_its_heading_against_other_photos() -> None:
    known = replace(lighting(0.0), relative_heading=20.0)
    assert turn(known, 30.0).relative_heading == pytest.approx(350.0)
    assert turn(turn(known, 30.0), -30.0) == known

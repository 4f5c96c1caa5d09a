"""From the network's distribution to a direction, radii, irradiances and the sun's color."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.color import luminance
from lighting.decoding import (
    blend_to_clear_sun,
    correct_sun_color,
    doubts_sun,
    light_from_vector,
    light_to_vector,
    lighting_from_prediction,
    sun_from_rings,
    with_dappled_sun,
)
from lighting.fields import RANGES
from lighting.geometry import angle_between, direction, wrap_azimuth
from lighting.prediction import Light, Prediction
from lighting.records import Lighting, visibility_attenuation
from lighting.sun_grid import HEADINGS, soft_label, von_mises
from tests.conftest import TINY

FINE = "fibonacci:1024"
CONCENTRATION = 80.0
BARE = Lighting(0.0, 30.0, 3.0, 1.0)  # without irradiances

azimuths = st.floats(-180.0, 180.0)
elevations = st.floats(0.0, 90.0)


def prediction(**values: Any) -> Prediction:
    grid = "fibonacci:1024"
    given: dict[str, Any] = {
        "sun_visibility": 0.8,
        "turbidity": 3.0,
        "exposure": 0.05,
        "camera_elevation": 2.0,
        "camera_roll": 1.0,
        "vertical_fov": 50.0,
        **values,
    }
    probability = soft_label(direction(-70.0, 40.0), 80.0, grid).astype(np.float32)
    return Prediction(spec=replace(TINY, sun_grid=grid), sun_probability=probability, **given)


def test_lighting_from_a_prediction() -> None:
    lighting = lighting_from_prediction(prediction())
    assert angle_between(lighting.sun_direction, direction(-70.0, 40.0)) < 0.5
    assert (lighting.turbidity, lighting.exposure, lighting.vertical_fov) == (3.0, 0.05, 50.0)
    assert (lighting.model_name, lighting.model_version) == ("tiny", "0.0.1")
    assert lighting.radius_50 == pytest.approx(7.55, abs=0.75)
    assert lighting.radius_90 == pytest.approx(13.78, abs=0.75)
    json.dumps(lighting.to_dict(), allow_nan=False)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_network_that_overshoots_is_clipped_into_the_ranges(sign: float) -> None:
    names = ["sun_visibility", "turbidity", "exposure", "camera_elevation", "camera_roll", "vertical_fov"]
    lighting = lighting_from_prediction(prediction(**dict.fromkeys(names, sign * 1e9)))
    for name in names:
        assert getattr(lighting, name) == RANGES[name][sign > 0]


def bell(center: float, spread: float) -> np.ndarray:
    curve = von_mises(HEADINGS - center, spread)
    return np.asarray(curve / curve.sum())


@given(st.floats(-180.0, 180.0), st.floats(1.0, 85.0))
def test_a_sun_on_a_ring_keeps_the_elevation_of_the_ring(azimuth: float, elevation: float) -> None:
    sun = sun_from_rings(direction(HEADINGS, elevation), bell(azimuth, 15.0))
    assert sun.elevation == pytest.approx(elevation, abs=1e-9)
    assert abs(float(wrap_azimuth(sun.azimuth - azimuth))) < 0.2
    assert sun.radius_50 <= 0.7 * 15.0 * math.cos(math.radians(elevation)) + 1.0


def test_rings_far_apart_are_not_averaged() -> None:
    suns = np.concatenate([direction(HEADINGS, 15.0), direction(HEADINGS, 60.0), direction(HEADINGS, 66.0)])
    sun = sun_from_rings(suns, np.concatenate([0.4 * bell(80.0, 10.0), 0.3 * bell(80.0, 10.0), 0.3 * bell(80.0, 10.0)]))
    assert sun.elevation == pytest.approx(63.0, abs=0.1)
    assert sun.azimuth == pytest.approx(80.0, abs=0.1)


WHITE = (3.0, 3.0, 3.0)


def test_lights_are_averaged_by_their_numbers() -> None:
    light = Light(np.array([1.0, 2.0, 0.0]), np.array([0.5, 0.5, 0.5]), 0.2, 0.9)
    back = light_from_vector(light_to_vector(light))
    assert back.sun_irradiance == pytest.approx([1.0, 2.0, 1e-6])
    assert (back.cover, back.suitable) == pytest.approx((0.2, 0.9))


def test_a_sun_that_hardly_shines_keeps_little_of_its_power() -> None:
    assert visibility_attenuation(1.0) == visibility_attenuation(0.8) == 1.0
    assert 0.05 < visibility_attenuation(0.5) < 0.15
    assert visibility_attenuation(0.1) < 1e-3
    light = Light(np.array([4.0, 4.0, 4.0]), np.ones(3), 0.5, 1.0)
    doubtful, sure = (lighting_from_prediction(prediction(sun_visibility=v, light=light)) for v in (0.4, 0.9))
    assert np.array(sure.sun_irradiance) == pytest.approx(4.0 * 2**0.6, rel=1e-5)
    assert np.array(doubtful.sun_irradiance) == pytest.approx(0.125 * 2**0.6, rel=1e-5)
    assert doubtful.sky_irradiance == sure.sky_irradiance


def test_a_sun_that_is_known_to_be_low_is_warmer_and_as_bright() -> None:
    red, green, blue = correct_sun_color(WHITE, 14.0, 5.0)
    as_said = correct_sun_color(WHITE, 14.0, 14.0)
    assert red > green > blue
    assert red / blue > 1.5 * as_said[0] / as_said[2]
    assert luminance(np.array([red, green, blue])) == pytest.approx(3.0, rel=1e-4)
    assert correct_sun_color(WHITE, 5.0, 14.0) == correct_sun_color(WHITE, 5.0, 5.0)
    assert correct_sun_color(WHITE, 20.0, 60.0) == correct_sun_color(WHITE, 20.0, 20.0)
    assert correct_sun_color(WHITE, 40.0, 0.0) == correct_sun_color(WHITE, 40.0, 3.0)
    assert correct_sun_color((0.0, 0.0, 0.0), 14.0, 5.0) == (0.0, 0.0, 0.0)
    faint = np.array(correct_sun_color((3e-8, 3e-8, 3e-8), 14.0, 5.0))
    assert faint == pytest.approx(1e-8 * np.array([red, green, blue]), rel=1e-4)


def test_a_sun_s_colour_goes_to_that_of_a_clear_one_as_high() -> None:
    assert correct_sun_color(WHITE, 60.0, 60.0) == pytest.approx(WHITE, rel=1e-4)
    shades = [
        red / blue for red, _, blue in (correct_sun_color(WHITE, e, e) for e in (3.0, 5.0, 10.0, 20.0, 40.0, 90.0))
    ]
    assert shades == sorted(shades, reverse=True)
    assert shades[-1] == pytest.approx(1.0, abs=0.03)
    cyan = np.array([2.2, 3.0, 3.3])
    assert blend_to_clear_sun(cyan, 60.0, 0.0) == pytest.approx(cyan)
    half, whole = (blend_to_clear_sun(cyan, 60.0, power) for power in (0.5, 1.0))
    assert whole == pytest.approx(np.full(3, float(luminance(cyan))))
    assert half[0] / half[1] == pytest.approx((2.2 / 3.0) ** 0.5)
    assert luminance(half) == pytest.approx(luminance(cyan))


def test_an_overcast_sky_is_brighter_than_the_network_states() -> None:
    clear, overcast = (Light(np.ones(3), np.ones(3), cover, 1.0) for cover in (0.0, 1.0))
    skies = [lighting_from_prediction(prediction(light=light)).sky_irradiance for light in (clear, overcast)]
    assert skies[0] == (1.0, 1.0, 1.0)
    assert skies[1] == pytest.approx((2**0.7,) * 3, rel=1e-5)


def doubtful(visibility: float, **fields: Any) -> Lighting:
    """A light whose network saw a sun of irradiance 4 and doubts it."""
    sun = 4.0 * min(visibility / 0.8, 1.0) ** 5
    irradiances = {"sun_irradiance": (sun, sun, 0.5 * sun), "sky_irradiance": (1.0, 1.0, 1.0)}
    return replace(BARE, **{**irradiances, "sun_visibility": visibility, **fields})


def test_a_doubtful_sun_in_patches_is_as_strong_as_they_say() -> None:
    """In patches of 2 stops, level ground has four times the sky's light; three are the sun's, six at 30 deg."""
    sun = with_dappled_sun(doubtful(0.5), 0.4, 2.0).sun_irradiance
    assert sun is not None
    assert luminance(np.array(sun)) == pytest.approx(0.4 * 6.0, rel=1e-3)
    assert sun[2] == pytest.approx(0.5 * sun[0], rel=1e-4)
    strongest = with_dappled_sun(doubtful(0.5), 0.5, 5.0).sun_irradiance
    assert luminance(np.array(strongest)) == pytest.approx(0.5 * 8.0, rel=1e-3)


@pytest.mark.parametrize(
    "light",
    [
        doubtful(0.9),
        doubtful(0.1),
        doubtful(0.5, sun_elevation=3.0),
        doubtful(0.5, sun_irradiance=(0.0, 0.0, 0.0)),
        doubtful(0.5, sun_irradiance=(0.001, 0.001, 0.001)),
        Lighting(0.0, 30.0, 3.0, 1.0, sun_visibility=0.5),
    ],
)
def test_a_sure_or_a_missing_sun_is_not_sought_on_the_ground(light: Lighting) -> None:
    assert not doubts_sun(light)
    assert doubts_sun(doubtful(0.5))


def test_patches_take_nothing_from_a_sun() -> None:
    assert with_dappled_sun(doubtful(0.75), 0.16, 2.0) == doubtful(0.75)


@pytest.mark.parametrize(("before", "after"), [(0.3, 0.5), (0.5, 0.5), (0.7, 0.7)])
def test_a_sun_in_patches_is_no_shade(before: float, after: float) -> None:
    light = with_dappled_sun(doubtful(before), 0.5, 3.0)
    assert light.sun_visibility == after
    assert light.sun_shines

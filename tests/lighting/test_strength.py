"""How strong the light is and which colour it has."""

import numpy as np
import pytest

from lighting.colour import luminance
from lighting.records import Light
from lighting.strength import fading, light_numbers, light_of_numbers, strength_of, tinted, toward_clear

WHITE = (3.0, 3.0, 3.0)


def test_lights_are_averaged_by_their_numbers() -> None:
    light = Light(np.array([1.0, 2.0, 0.0]), np.array([0.5, 0.5, 0.5]), 0.2, 0.9)
    back = light_of_numbers(light_numbers(light))
    assert back.sun_irradiance == pytest.approx([1.0, 2.0, 1e-6])
    assert (back.cover, back.suitable) == pytest.approx((0.2, 0.9))


def test_a_sun_that_hardly_shines_keeps_little_of_its_power() -> None:
    assert fading(1.0) == fading(0.8) == 1.0
    assert 0.05 < fading(0.5) < 0.15
    assert fading(0.1) < 1e-3
    light = Light(np.array([4.0, 4.0, 4.0]), np.ones(3), 0.5, 1.0)
    doubtful, sure = (strength_of(light, visibility) for visibility in (0.4, 0.9))
    assert np.array(sure.sun_irradiance) == pytest.approx(4.0 * 2**0.18, rel=1e-5)
    assert np.array(doubtful.sun_irradiance) == pytest.approx(0.125 * 2**0.18, rel=1e-5)
    assert doubtful.sky_irradiance == sure.sky_irradiance


def test_a_sun_that_is_known_to_be_low_is_warmer_and_as_bright() -> None:
    red, green, blue = tinted(WHITE, 14.0, 5.0)
    as_said = tinted(WHITE, 14.0, 14.0)
    assert red > green > blue
    assert red / blue > 1.5 * as_said[0] / as_said[2]
    assert luminance(np.array([red, green, blue])) == pytest.approx(3.0, rel=1e-4)
    assert tinted(WHITE, 5.0, 14.0) == tinted(WHITE, 5.0, 5.0)
    assert tinted(WHITE, 20.0, 60.0) == tinted(WHITE, 20.0, 20.0)
    assert tinted(WHITE, 40.0, 0.0) == tinted(WHITE, 40.0, 3.0)
    assert tinted((0.0, 0.0, 0.0), 14.0, 5.0) == (0.0, 0.0, 0.0)
    faint = np.array(tinted((3e-8, 3e-8, 3e-8), 14.0, 5.0))
    assert faint == pytest.approx(1e-8 * np.array([red, green, blue]), rel=1e-4)


def test_a_sun_s_colour_goes_to_that_of_a_clear_one_as_high() -> None:
    assert tinted(WHITE, 60.0, 60.0) == pytest.approx(WHITE, rel=1e-4)
    shades = [red / blue for red, _, blue in (tinted(WHITE, e, e) for e in (3.0, 5.0, 10.0, 20.0, 40.0, 90.0))]
    assert shades == sorted(shades, reverse=True)
    assert shades[-1] == pytest.approx(1.0, abs=0.03)
    cyan = np.array([2.2, 3.0, 3.3])
    assert toward_clear(cyan, 60.0, 0.0) == pytest.approx(cyan)
    half, whole = (toward_clear(cyan, 60.0, power) for power in (0.5, 1.0))
    assert whole == pytest.approx(np.full(3, float(luminance(cyan))))
    assert half[0] / half[1] == pytest.approx((2.2 / 3.0) ** 0.5)
    assert luminance(half) == pytest.approx(luminance(cyan))


def test_an_overcast_sky_is_brighter_than_the_network_states() -> None:
    clear, overcast = (Light(np.ones(3), np.ones(3), cover, 1.0) for cover in (0.0, 1.0))
    skies = [strength_of(light, 1.0).sky_irradiance for light in (clear, overcast)]
    assert skies[0] == (1.0, 1.0, 1.0)
    assert skies[1] == pytest.approx((2**0.7,) * 3, rel=1e-5)

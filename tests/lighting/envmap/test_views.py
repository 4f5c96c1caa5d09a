"""The map that a caller asks for."""

from dataclasses import replace

import numpy as np
import pytest

from lighting.envmap import Place, render, rotate, surround, view
from tests.lighting.envmap.test_render import given_light

LIGHT = given_light(sky_cover=0.2)
PLACE = Place(np.full((40, 60, 3), 90, np.uint8))


def test_a_view_is_the_map_of_its_record() -> None:
    image, light = view(LIGHT, 32)
    assert light is LIGHT
    np.testing.assert_array_equal(image, render(LIGHT, 32))


def test_another_sky_is_in_the_record() -> None:
    image, light = view(LIGHT, 32, sky="preetham")
    assert light == replace(LIGHT, sky_model="preetham")
    np.testing.assert_array_equal(image, render(light, 32))


def test_the_place_turns_with_the_map() -> None:
    image, light = view(LIGHT, 32, yaw=90.0, place=PLACE)
    np.testing.assert_array_equal(image, rotate(surround(LIGHT, PLACE, 32), 90.0))
    assert light.sun_azimuth == pytest.approx(LIGHT.sun_azimuth + 90.0)

"""The sun in maps that were rendered with it."""

import numpy as np
import pytest

from lighting.envmap import render, sun_irradiance
from lighting.geometry import angle_between, latlong_directions
from lighting.probe.sun_spot import find_spot
from lighting.records import Lighting

LIGHTING = Lighting(sun_azimuth=-130.0, sun_elevation=35.0, turbidity=3.0, exposure=0.2)
NONE = np.zeros((256, 512), dtype=bool)


@pytest.mark.parametrize("azimuth", [-130.0, 179.9])
def test_the_sun_is_found_with_its_power(azimuth: float) -> None:
    lighting = Lighting(sun_azimuth=azimuth, sun_elevation=35.0, turbidity=3.0, exposure=0.2)
    spot = find_spot(render(lighting, 256), NONE)
    assert spot is not None
    assert not spot.clipped
    # The disc lies in one or two of the map's pixels of 0.7 deg.
    assert angle_between(spot.direction, lighting.sun_direction) < 0.15
    assert spot.irradiance == pytest.approx(sun_irradiance(lighting), rel=0.01)


def test_a_clipped_sun_is_found_in_the_middle_of_what_is_clipped() -> None:
    image = np.minimum(render(LIGHTING, 256), 20.0)
    clipped = np.asarray(angle_between(latlong_directions(256), LIGHTING.sun_direction) < 2.0)
    spot = find_spot(image, clipped)
    assert spot is not None
    assert spot.clipped
    assert spot.radius == pytest.approx(2.0, abs=0.2)
    assert angle_between(spot.direction, LIGHTING.sun_direction) < 0.2


def test_no_sun_is_found_in_a_sky_without_one() -> None:
    assert find_spot(render(LIGHTING, 256, sun=False), NONE) is None


def test_a_sky_near_the_largest_float_has_no_sun() -> None:
    assert find_spot(np.full((256, 512, 3), 1e38, np.float32), NONE) is None


def test_half_a_clipped_sky_is_no_sun() -> None:
    clipped = NONE.copy()
    clipped[:100, :300] = True
    assert find_spot(render(LIGHTING, 256, sun=False), clipped) is None


def test_what_shines_below_the_horizon_is_no_sun() -> None:
    image = render(LIGHTING, 256, sun=False)
    image[200, 100] = 1e5
    assert find_spot(image, NONE) is None

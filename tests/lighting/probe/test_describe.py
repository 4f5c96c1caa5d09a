"""What is said of skies that were rendered."""

import numpy as np
import pytest

from lighting.envmap import render
from lighting.errors import ProbeError
from lighting.geometry import latlong_angles
from lighting.probe.describe import describe
from lighting.records import Lighting


@pytest.mark.parametrize("turbidity", [2.0, 5.0])
def test_a_rendered_sky_is_described_as_it_was_made(turbidity: float) -> None:
    lighting = Lighting(sun_azimuth=-60.0, sun_elevation=40.0, turbidity=turbidity, exposure=0.7)
    state = describe(render(lighting, 256, sun=True))
    assert (state.sun_azimuth, state.sun_elevation) == pytest.approx((-60.0, 40.0), abs=0.3)
    assert state.sun_source == "found"
    assert state.turbidity == pytest.approx(turbidity, abs=0.1)
    assert state.exposure == pytest.approx(0.7, rel=0.02)
    assert state.trusted
    assert state.cover < 0.01


def test_clouds_over_a_third_of_the_sky_are_its_cover() -> None:
    lighting = Lighting(sun_azimuth=0.0, sun_elevation=40.0, turbidity=3.0, exposure=0.7)
    image = render(lighting, 128, sun=True)
    azimuth, _ = latlong_angles(128)
    image[:64, np.abs(azimuth) > 120] = 3 * np.median(image[:64])
    state = describe(image, (0.0, 40.0))
    assert state.sun_source == "given"
    assert state.cover == pytest.approx(1 / 3, abs=0.05)
    assert state.turbidity == pytest.approx(3.0, abs=0.3)


def test_skies_that_say_nothing_are_refused() -> None:
    grey = np.full((64, 128, 3), 0.3, np.float32)
    with pytest.raises(ProbeError, match="No sun"):
        describe(grey)
    with pytest.raises(ProbeError, match="clear sky"):
        describe(grey, (0.0, 30.0))
    with pytest.raises(ProbeError, match="below the horizon"):
        describe(grey, (0.0, -3.0))


def test_maps_without_a_sky_are_refused() -> None:
    for value in (0.0, -1.0):
        with pytest.raises(ProbeError, match="black or negative"):
            describe(np.full((64, 128, 3), value, np.float32), (0.0, 30.0))
    with pytest.raises(ProbeError, match=r"has 1 row; a sky needs 16"):
        describe(np.ones((1, 2, 3), np.float32))
    with pytest.raises(ProbeError, match=r"has 15 rows; a sky needs 16"):
        describe(np.ones((15, 30, 3), np.float32))


def test_a_few_values_under_zero_do_no_harm() -> None:
    image = render(Lighting(sun_azimuth=0.0, sun_elevation=40.0, turbidity=3.0, exposure=0.7), 128, sun=True)
    image[60, ::8] = -0.01
    assert describe(image).turbidity == pytest.approx(3.0, abs=0.1)

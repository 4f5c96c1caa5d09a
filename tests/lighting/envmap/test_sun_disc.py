"""The sun's disc by its share of pixels."""

import numpy as np
import pytest

from lighting.envmap.sun_disc import disc_power, splat_sun_disc
from lighting.geometry import latlong_solid_angle
from tests.helpers.lights import model_light


@pytest.mark.parametrize(("azimuth", "elevation"), [(-41.2, 33.0), (180.0, 20.0), (-179.9, 5.0), (0.0, 90.0)])
def test_the_power_asked_for_is_painted(azimuth: float, elevation: float) -> None:
    image = np.zeros((32, 64, 3), np.float32)
    power = np.array([3.0, 2.0, 1.0])
    splat_sun_disc(image, model_light(azimuth, elevation), power)
    assert image.sum(axis=1).T @ latlong_solid_angle(32) == pytest.approx(power, rel=1e-4)


def test_level_ground_receives_the_power_by_the_suns_height() -> None:
    power, ground = disc_power(model_light(elevation=30.0))
    assert ground == pytest.approx(power / 2, rel=1e-3)

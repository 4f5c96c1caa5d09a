"""Pictures whose light has a closed form."""

import math

import numpy as np
import pytest

from export.evaluation.sphere import HEIGHT, PLANE_ALBEDO, SIZE, picture, pooled
from lighting.envmap import render
from lighting.geometry import direction, latlong_directions, latlong_solid_angle
from lighting.records import Lighting

pytestmark = pytest.mark.slow


CORNER = (2, 2)  # a pixel of the plane, far behind the sphere


def lamp(azimuth: float, elevation: float) -> np.ndarray:
    """A dark map but for the pixel towards a direction, which gives unit irradiance on a surface facing it."""
    light = np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32)
    row, column = np.unravel_index(
        np.argmax(latlong_directions(HEIGHT) @ direction(azimuth, elevation)), light.shape[:2]
    )
    light[row, column] = 1 / latlong_solid_angle(HEIGHT)[row]
    return light


def test_a_white_sky_lights_the_plane_by_its_albedo() -> None:
    sky = np.where(latlong_directions(HEIGHT)[..., 1:2] > 0, 1.0, 0.0) * np.ones(3)
    seen = picture(sky)[CORNER]
    assert (seen < PLANE_ALBEDO).all()  # the sphere hides some of the sky
    np.testing.assert_allclose(seen, PLANE_ALBEDO, rtol=0.06)


@pytest.mark.parametrize("azimuth", [-120.0, 30.0, 90.0])
def test_the_shadow_falls_away_from_the_sun(azimuth: float) -> None:
    seen = picture(lamp(azimuth, 40.0))[..., 1]
    lit = PLANE_ALBEDO / math.pi * math.sin(math.radians(40.0))
    assert seen[CORNER] == pytest.approx(lit, rel=0.05)
    columns = np.nonzero(seen < 0.01 * lit)[1]
    across = (columns.mean() + 0.5) / SIZE * 2 - 1
    assert np.sign(across) == -np.sign(math.sin(math.radians(azimuth)))


def test_pooling_keeps_the_power_of_the_sun() -> None:
    fine = render(Lighting(20.0, 30.0, 3.0, 1.0), 512, sun=True)
    small = pooled(fine)
    power = [np.einsum("hwc,h->c", m, latlong_solid_angle(m.shape[0])) for m in (fine, small)]
    np.testing.assert_allclose(power[0], power[1], rtol=1e-5)
    assert small.shape == (HEIGHT, 2 * HEIGHT, 3)

"""The sky and the sun of Lalonde and Matthews."""

import math

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import direction, latlong_directions, latlong_solid_angle
from lighting.sky.lalonde_matthews import lalonde_matthews_sky, lalonde_matthews_sun
from lighting.sky.preetham import preetham_luminance

SUN = direction(30.0, 40.0)


@pytest.mark.parametrize(("beta", "kappa"), [(20.0, 0.1), (5.0, 0.4), (50.0, 1.0)])
def test_the_sun_follows_the_papers_formula(beta: float, kappa: float) -> None:
    away = np.array([0.5, 2.0, 10.0, 35.0])
    found = lalonde_matthews_sun(direction(30.0, 40.0 + away), SUN, beta, kappa)
    expected = [math.exp(-beta * math.exp(-kappa / math.radians(a))) for a in away]
    assert found == pytest.approx(expected, rel=1e-6)
    assert lalonde_matthews_sun(SUN, SUN, beta, kappa) == pytest.approx(1.0)


def test_half_of_a_clear_suns_light_lies_near_it() -> None:
    rays = latlong_directions(360)
    light = lalonde_matthews_sun(rays, SUN) * latlong_solid_angle(360)[:, None]
    near = rays @ SUN > math.cos(math.radians(3.0))
    assert light[near].sum() > 0.5 * light.sum()
    assert not light[180:].any()


def test_the_sky_is_preethams_luminance_at_any_turbidity() -> None:
    rays = latlong_directions(16)
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 3.0), preetham_luminance(rays, SUN, 3.0))
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 1.0), preetham_luminance(rays, SUN, 1.7))


@pytest.mark.parametrize(("beta", "kappa"), [(0.5, 0.1), (20.0, 1.5)])
def test_a_width_out_of_range_is_refused(beta: float, kappa: float) -> None:
    with pytest.raises(ParameterError, match=r"^The sun's (beta|kappa) is .* must lie in"):
        lalonde_matthews_sun(SUN, SUN, beta, kappa)

"""Tests of preetham."""

import math

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import angle_between, direction, latlong_directions, latlong_solid_angle
from lighting.sky.perez import (
    _preetham_luminance,
    _preetham_zenith,
    lalonde_matthews_sky,
    lalonde_matthews_sun,
    preetham_radiance,
)

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
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 3.0), _preetham_luminance(rays, SUN, 3.0))
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 1.0), _preetham_luminance(rays, SUN, 1.7))


@pytest.mark.parametrize(("beta", "kappa"), [(0.5, 0.1), (20.0, 1.5)])
def test_a_width_out_of_range_is_refused(beta: float, kappa: float) -> None:
    with pytest.raises(ParameterError, match=r"^The sun's (beta|kappa) is .* must lie in"):
        lalonde_matthews_sun(SUN, SUN, beta, kappa)


# What appendix A.2 of the paper gives at turbidity 3: A to E of luminance, x and y.
LUMINANCE = (-0.9269, -0.6387, 5.2570, -2.2153, 0.1693)
X = (-0.3171, -0.1987, 0.2113, -1.0912, 0.0353)
Y = (-0.3109, -0.2758, 0.1865, -1.7860, 0.0202)


def perez(numbers: tuple[float, ...], theta: float, gamma: float) -> float:
    a, b, c, d, e = numbers
    return (1 + a * math.exp(b / math.cos(theta))) * (1 + c * math.exp(d * gamma) + e * math.cos(gamma) ** 2)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 60.0), (35.0, 20.0), (180.0, 75.0), (-90.0, 8.0)])
def test_radiance_is_that_of_the_paper(azimuth: float, elevation: float) -> None:
    sun, there = direction(20.0, 35.0), direction(azimuth, elevation)
    theta, sun_theta = math.radians(90 - elevation), math.radians(55.0)
    gamma = math.radians(float(angle_between(there, sun)))
    zenith = _preetham_zenith(sun_theta, 3.0)
    luminance, x, y = (
        z * perez(n, theta, gamma) / perez(n, 0.0, sun_theta) for z, n in zip(zenith, (LUMINANCE, X, Y), strict=True)
    )
    found = preetham_radiance(there, sun, 3.0)
    xyz = np.linalg.solve([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]], found)
    assert xyz[1] == pytest.approx(luminance, rel=1e-4)
    assert xyz / xyz.sum() == pytest.approx([x, y, 1 - x - y], abs=1e-4)


def test_the_zenith_of_the_paper() -> None:
    """At turbidity 2 and a sun at 45 deg: (4.0453 T - 4.9710) tan chi - 0.2155 T + 2.4192, chi = 0.6719.

    x and y are the sums over powers of the turbidity of the polynomials in the sun's angle that the paper prints.
    """
    theta = math.pi / 4
    luminance, x, y = _preetham_zenith(math.pi / 4, 2.0)
    assert luminance == pytest.approx(3.1196 * math.tan((4 / 9 - 2 / 120) * math.pi / 2) + 1.9882, rel=1e-9)
    assert x == pytest.approx(
        4 * (0.00166 * theta**3 - 0.00375 * theta**2 + 0.00209 * theta)
        + 2 * (-0.02903 * theta**3 + 0.06377 * theta**2 - 0.03202 * theta + 0.00394)
        + (0.11693 * theta**3 - 0.21196 * theta**2 + 0.06052 * theta + 0.25886),
        rel=1e-9,
    )
    assert y == pytest.approx(
        4 * (0.00275 * theta**3 - 0.00610 * theta**2 + 0.00317 * theta)
        + 2 * (-0.04214 * theta**3 + 0.08970 * theta**2 - 0.04153 * theta + 0.00516)
        + (0.15346 * theta**3 - 0.26756 * theta**2 + 0.06670 * theta + 0.26688),
        rel=1e-9,
    )


def test_a_clear_sky_is_blue_and_brightest_at_the_sun() -> None:
    sun = direction(0.0, 40.0)
    sky = preetham_radiance(latlong_directions(32), sun, 2.5)
    assert not sky[16:].any()
    row, column = np.unravel_index(np.argmax(sky[..., 1]), sky.shape[:2])
    assert angle_between(latlong_directions(32)[row, column], sun) < 6
    assert sky[2, :, 2].mean() > 1.5 * sky[2, :, 0].mean()
    assert _preetham_luminance([0.0, 1.0, 0.0], sun, 2.5) == pytest.approx(1.0)


@pytest.mark.parametrize("turbidity", [1.0, 11.0])
def test_a_turbidity_out_of_range_is_refused(turbidity: float) -> None:
    with pytest.raises(ParameterError, match=r"^The turbidity is .*covers 1\.7 to 10\.$"):
        preetham_radiance([0.0, 1.0, 0.0], direction(0.0, 30.0), turbidity)


def test_a_sun_below_the_horizon_is_refused() -> None:
    with pytest.raises(ParameterError, match="below the horizon"):
        preetham_radiance([0.0, 1.0, 0.0], direction(0.0, -5.0), 3.0)

"""The all-weather sky against the coefficients that Radiance's gendaylit computes, and its shape."""

import math

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import Floats, angle_between, direction, latlong_directions, latlong_solid_angle
from lighting.sky import Weather
from lighting.sky.perez import (
    general_luminance,
    lalonde_matthews_sky,
    lalonde_matthews_sun,
    overcast_luminance,
    perez_luminance,
    perez_weather,
    preetham_radiance,
)

ZENITH = np.array([0.0, 1.0, 0.0])
RAYS_UP = np.tile([5.0, 20.0, 45.0, 70.0, 90.0], 6)  # deg
RAYS = direction(np.repeat(np.arange(0.0, 360.0, 60.0), 5), RAYS_UP)


def xyz_of(radiance: Floats) -> Floats:
    """CIE XYZ (..., 3) of linear Rec.709."""
    matrix = [[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]]
    return np.asarray(radiance @ np.linalg.inv(matrix).T)


def luminance_and_chromaticity(radiance: Floats) -> Floats:
    """Y, x and y (3,) of linear Rec.709."""
    xyz = xyz_of(radiance)
    return np.array([xyz[1], *xyz[:2] / xyz.sum()])


# Clearness, brightness, sun elevation [deg]; a, b, c, d, e as `gendaylit -ang ELEVATION 0 -P CLEARNESS BRIGHTNESS` of
# Radiance 6 (pyradiance 1.3.1) prints them. One row for each row of the table.
GENDAYLIT = [
    (1.03, 0.30, 30.0, (0.550721, -0.422983, 1.816622, -1.079877, 0.045791)),
    (1.15, 0.35, 50.0, (-0.997204, -1.325535, 9.325269, -2.531551, 0.127962)),
    (1.40, 0.40, 20.0, (-1.041562, -1.168182, 10.688093, -2.852180, 0.075660)),
    (1.70, 0.30, 60.0, (-0.865169, -0.893514, 13.262453, -3.138170, 0.261874)),
    (2.30, 0.25, 35.0, (-1.009351, -0.637059, 12.767386, -3.201918, 0.029277)),
    (3.50, 0.18, 45.0, (-0.923796, -0.346831, 12.996290, -3.456184, 0.234041)),
    (5.50, 0.14, 25.0, (-0.987015, -0.242789, 13.198552, -3.875638, 0.506601)),
    (6.50, 0.12, 40.0, (-0.936066, -0.130486, 18.673943, -5.210489, 1.221014)),
    (9.00, 0.10, 65.0, (-0.979126, -0.196641, 22.540392, -5.692285, 1.429845)),
]


@pytest.mark.parametrize(("clearness", "brightness", "elevation", "expected"), GENDAYLIT)
def test_coefficients_are_those_of_radiance(
    clearness: float, brightness: float, elevation: float, expected: tuple[float, ...]
) -> None:
    sun, up = direction(0.0, elevation), np.sin(np.radians(RAYS_UP))
    angle = np.radians(angle_between(RAYS, sun))
    a, b, c, d, e = expected

    def relative(up: Floats, angle: Floats) -> Floats:
        return np.asarray((1 + a * np.exp(b / up)) * (1 + c * np.exp(d * angle) + e * np.cos(angle) ** 2))

    zenith = relative(np.asarray(1.0), np.asarray(np.radians(90 - elevation)))
    ours = perez_luminance(RAYS, sun, clearness, brightness)
    assert ours == pytest.approx(np.maximum(relative(up, angle) / zenith, 0), rel=2e-5, abs=1e-5)


def test_dark_broken_skies_count_as_brighter() -> None:
    broken, clear = (
        [perez_luminance(RAYS, direction(0.0, 44.0), clearness, brightness) for brightness in (0.05, 0.2)]
        for clearness in (1.4, 6.5)
    )
    assert broken[0] == pytest.approx(broken[1])
    assert clear[0] != pytest.approx(clear[1])


@pytest.mark.parametrize("clearness", [1.0, 1.2, 1.4, 1.9, 2.7, 4.4, 6.1, 8.0])
def test_luminance_is_one_at_the_zenith_finite_everywhere_and_none_below(clearness: float) -> None:
    sun = direction(0.0, 35.0)
    azimuth, elevation = np.meshgrid(np.arange(0.0, 360.0, 15.0), np.arange(0.0, 91.0, 5.0))
    value = perez_luminance(direction(azimuth, elevation), sun, clearness, 0.2)
    assert perez_luminance(ZENITH, sun, clearness, 0.2) == pytest.approx(1)
    assert np.isfinite(value).all()
    assert (value >= 0).all()
    assert perez_luminance(direction(0.0, -5.0), sun, clearness, 0.2) == 0


def test_overcast_is_brightest_overhead_and_clear_is_brightest_at_the_sun() -> None:
    sun, elevations = direction(0.0, 35.0), np.arange(10.0, 91.0, 5.0)
    overcast = perez_luminance(direction(180.0, elevations), sun, 1.0, 0.15)
    clear = perez_luminance(direction(0.0, elevations), sun, 7.0, 0.1)
    assert overcast.argmax() == len(elevations) - 1
    assert overcast[0] < 0.65
    assert elevations[clear.argmax()] == 35.0
    assert clear.max() > 5


def test_clearness_and_brightness_of_known_irradiances() -> None:
    zenith = np.radians(60.0)
    low = direction(0.0, 30.0)
    assert perez_weather(Weather(3.0, 0.3, 0.0, 100.0), low)[0] == pytest.approx(1)  # no direct sun: overcast
    assert perez_weather(Weather(3.0, 0.3, 7.0, 100.0), ZENITH)[0] == pytest.approx(8)  # overhead: the plain ratio
    clearness, brightness = perez_weather(Weather(3.0, 0.3, 7.0, 136.1), low)
    assert clearness == pytest.approx((8 + 1.041 * zenith**3) / (1 + 1.041 * zenith**3))
    assert brightness == pytest.approx(0.1 * 1.9943, rel=1e-4)  # air mass of Kasten and Young


def test_what_no_sky_has_is_refused() -> None:
    for clearness, brightness in ((0.9, 0.2), (2.0, 0.7), (2.0, 0.0), (float("nan"), 0.2)):
        with pytest.raises(ParameterError):
            perez_luminance(ZENITH, direction(0.0, 60.0), clearness, brightness)
    with pytest.raises(ParameterError, match="horizon"):
        perez_luminance(ZENITH, direction(0.0, -2.0), 2.0, 0.2)


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
    sky, zenith = (xyz_of(preetham_radiance(where, SUN, 3.0))[..., 1] for where in (rays, ZENITH))
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 3.0), sky / zenith, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(lalonde_matthews_sky(rays, SUN, 1.0), lalonde_matthews_sky(rays, SUN, 1.7))


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
    zenith = luminance_and_chromaticity(preetham_radiance(ZENITH, sun, 3.0))
    luminance, x, y = (
        z * perez(n, theta, gamma) / perez(n, 0.0, sun_theta) for z, n in zip(zenith, (LUMINANCE, X, Y), strict=True)
    )
    found = preetham_radiance(there, sun, 3.0)
    assert luminance_and_chromaticity(found) == pytest.approx([luminance, x, y], rel=1e-4)


def test_the_zenith_of_the_paper() -> None:
    """At turbidity 2 and a sun at 45 deg: (4.0453 T - 4.9710) tan chi - 0.2155 T + 2.4192, chi = 0.6719.

    x and y are the sums over powers of the turbidity of the polynomials in the sun's angle that the paper prints.
    """
    theta = math.pi / 4
    luminance, x, y = luminance_and_chromaticity(preetham_radiance(ZENITH, direction(70.0, 45.0), 2.0))
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
    assert lalonde_matthews_sky(ZENITH, sun, 2.5) == pytest.approx(1.0)


@pytest.mark.parametrize("turbidity", [1.0, 11.0])
def test_a_turbidity_out_of_range_is_refused(turbidity: float) -> None:
    with pytest.raises(ParameterError, match=r"^The turbidity is .*covers 1\.7 to 10\.$"):
        preetham_radiance([0.0, 1.0, 0.0], direction(0.0, 30.0), turbidity)


def test_a_sun_below_the_horizon_is_refused() -> None:
    with pytest.raises(ParameterError, match="below the horizon"):
        preetham_radiance([0.0, 1.0, 0.0], direction(0.0, -5.0), 3.0)


UNIFORM, CLEAR, POLLUTED = 5, 12, 13  # types of the general sky with names of their own
CIE_SUN = direction(30.0, 40.0)


def integral(luminance: Floats) -> float:
    """Horizontal illuminance under a map (H, 2H)."""
    height = len(luminance)
    up = np.maximum(latlong_directions(height)[..., 1], 0)
    return float((luminance * up).sum(axis=1) @ latlong_solid_angle(height))


def test_overcast_sky_is_three_times_brighter_at_the_zenith() -> None:
    elevation = np.array([0.0, 30.0, 42.0, 90.0])
    # 42 deg is where the overcast sky has 7/9 of the zenith's luminance, its mean weighted by the cosine.
    assert overcast_luminance(direction(0.0, elevation)) == pytest.approx([1 / 3, 2 / 3, 0.7794, 1.0], abs=1e-4)
    assert overcast_luminance(direction(0.0, -1.0)) == 0


def test_overcast_sky_lights_the_ground_by_seven_ninths_of_pi() -> None:
    assert integral(overcast_luminance(latlong_directions(256))) == pytest.approx(7 * np.pi / 9, rel=1e-3)


@pytest.mark.parametrize("kind", range(1, 16))
def test_every_type_is_one_at_the_zenith(kind: int) -> None:
    assert general_luminance(ZENITH, CIE_SUN, kind) == pytest.approx(1)


def test_type_5_is_uniform() -> None:
    assert integral(general_luminance(latlong_directions(128), CIE_SUN, UNIFORM)) == pytest.approx(np.pi, rel=1e-3)


def test_type_1_is_nearly_the_overcast_sky() -> None:
    elevation = np.linspace(5.0, 90.0, 18)
    towards = direction(0.0, elevation)
    # The standard keeps the overcast sky's own formula beside the type: they differ by up to 0.1 of the zenith.
    assert general_luminance(towards, CIE_SUN, 1) == pytest.approx(overcast_luminance(towards), abs=0.1)


@pytest.mark.parametrize(
    ("kind", "numbers"), [(CLEAR, (0.91, 10.0, 0.45)), (POLLUTED, (0.856, 16.0, 0.3))], ids=["clear", "polluted"]
)
def test_clear_types_are_the_standard_clear_skies_of_1973(kind: int, numbers: tuple[float, float, float]) -> None:
    constant, peak, bowl = numbers  # as CIE publication 22 and its polluted variant print them
    towards = latlong_directions(16)[:8]
    away, from_zenith = np.radians(angle_between(towards, CIE_SUN)), np.radians(angle_between(CIE_SUN, ZENITH))

    def scatter(angle: Floats) -> Floats:
        return np.asarray(constant + peak * np.exp(-3 * angle) + bowl * np.cos(angle) ** 2)

    expected = scatter(away) * (1 - np.exp(-0.32 / towards[..., 1])) / (scatter(from_zenith) * 0.27385)
    assert general_luminance(towards, CIE_SUN, kind) == pytest.approx(expected, rel=1e-3)


def around_the_sun(kind: int) -> Floats:
    """Luminance at 0, 5 ... 85 deg from a sun on the horizon, along it, over that at 90 deg: the scattering alone."""
    sun = direction(0.0, 0.0)
    return general_luminance(direction(np.arange(0.0, 90.0, 5.0), 0.0), sun, kind) / general_luminance(
        direction(90.0, 0.0), sun, kind
    )


@pytest.mark.parametrize("kind", range(1, 16))
def test_luminance_falls_away_from_the_sun(kind: int) -> None:
    assert (np.diff(around_the_sun(kind)) <= 1e-12).all()


@pytest.mark.parametrize(
    ("kind", "c", "d", "e"), [(1, 0.0, -1.0, 0.0), (4, 2.0, -1.5, 0.15), (12, 10.0, -3.0, 0.45), (15, 24.0, -2.8, 0.15)]
)
def test_the_scattering_is_that_of_the_standard(kind: int, c: float, d: float, e: float) -> None:
    angle = np.radians(np.arange(0.0, 90.0, 5.0))
    expected = 1 + c * (np.exp(d * angle) - np.exp(d * np.pi / 2)) + e * np.cos(angle) ** 2
    assert around_the_sun(kind) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("kinds", "sign"), [((1, 2, 3, 4), 1), ((9, 10, 11, 12, 13, 14, 15), -1)])
def test_overcast_skies_brighten_to_the_zenith_and_clear_ones_to_the_horizon(kinds: tuple[int, ...], sign: int) -> None:
    """At 90 deg from the sun, where the scattering is the same."""
    aside = direction(90.0, np.arange(5.0, 91.0, 5.0))
    assert all((np.diff(general_luminance(aside, direction(0.0, 0.0), kind)) * sign > 0).all() for kind in kinds)


def test_unknown_types_and_night_are_refused() -> None:
    for kind in (0, 16):
        with pytest.raises(ParameterError, match="types 1 to 15"):
            general_luminance(ZENITH, CIE_SUN, kind)
    with pytest.raises(ParameterError, match="below the horizon"):
        general_luminance(ZENITH, direction(0.0, -1.0), CLEAR)

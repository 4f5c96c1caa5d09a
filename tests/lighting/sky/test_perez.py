"""The all-weather sky against the coefficients that Radiance's gendaylit computes, and its shape."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import direction
from lighting.sky.perez import _perez_coefficients, _sky_brightness, _sky_clearness, perez_luminance

ZENITH = np.array([0.0, 1.0, 0.0])

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
    ours = _perez_coefficients(clearness, brightness, np.radians(90 - elevation))
    assert ours == pytest.approx(expected, abs=2e-6)


def test_dark_broken_skies_count_as_brighter() -> None:
    assert _perez_coefficients(1.4, 0.05, 0.8) == pytest.approx(_perez_coefficients(1.4, 0.2, 0.8))
    assert _perez_coefficients(6.5, 0.05, 0.8) != pytest.approx(_perez_coefficients(6.5, 0.2, 0.8))


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
    assert _sky_clearness(100.0, 0.0, zenith) == pytest.approx(1)  # no direct sun: overcast
    assert _sky_clearness(100.0, 700.0, 0.0) == pytest.approx(8)  # the sun overhead: the plain ratio
    assert _sky_clearness(100.0, 700.0, zenith) == pytest.approx((8 + 1.041 * zenith**3) / (1 + 1.041 * zenith**3))
    assert _sky_brightness(136.1, zenith) == pytest.approx(0.1 * 1.9939, rel=1e-3)  # air mass of Kasten and Young


def test_what_no_sky_has_is_refused() -> None:
    for clearness, brightness in ((0.9, 0.2), (2.0, 0.7), (2.0, 0.0), (float("nan"), 0.2)):
        with pytest.raises(ParameterError):
            _perez_coefficients(clearness, brightness, 0.5)
    with pytest.raises(ParameterError, match="horizon"):
        perez_luminance(ZENITH, direction(0.0, -2.0), 2.0, 0.2)

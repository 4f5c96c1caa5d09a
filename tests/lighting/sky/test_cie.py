"""The CIE's skies against the integrals and the older standards that they contain."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import Floats, angle_between, direction, latlong_directions, latlong_solid_angle
from lighting.sky.perez import _gradation, _indicatrix, general_luminance, overcast_luminance

UNIFORM, CLEAR, POLLUTED = 5, 12, 13  # types of the general sky with names of their own
SUN = direction(30.0, 40.0)
ZENITH = np.array([0.0, 1.0, 0.0])


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
def test_every_type_is_one_at_the_zenith_and_at_its_reference_angles(kind: int) -> None:
    assert general_luminance(ZENITH, SUN, kind) == pytest.approx(1)
    assert _indicatrix(np.pi / 2, kind) == pytest.approx(1)  # the standard's normalisation
    assert _gradation(0.0, kind) == pytest.approx(1)


def test_type_5_is_uniform() -> None:
    assert integral(general_luminance(latlong_directions(128), SUN, UNIFORM)) == pytest.approx(np.pi, rel=1e-3)


def test_type_1_is_nearly_the_overcast_sky() -> None:
    elevation = np.linspace(5.0, 90.0, 18)
    towards = direction(0.0, elevation)
    # The standard keeps the overcast sky's own formula beside the type: they differ by up to 0.1 of the zenith.
    assert general_luminance(towards, SUN, 1) == pytest.approx(overcast_luminance(towards), abs=0.1)


@pytest.mark.parametrize(
    ("kind", "numbers"), [(CLEAR, (0.91, 10.0, 0.45)), (POLLUTED, (0.856, 16.0, 0.3))], ids=["clear", "polluted"]
)
def test_clear_types_are_the_standard_clear_skies_of_1973(kind: int, numbers: tuple[float, float, float]) -> None:
    constant, peak, bowl = numbers  # as CIE publication 22 and its polluted variant print them
    towards = latlong_directions(16)[:8]
    away, from_zenith = np.radians(angle_between(towards, SUN)), np.radians(angle_between(SUN, ZENITH))

    def scatter(angle: Floats) -> Floats:
        return np.asarray(constant + peak * np.exp(-3 * angle) + bowl * np.cos(angle) ** 2)

    expected = scatter(away) * (1 - np.exp(-0.32 / towards[..., 1])) / (scatter(from_zenith) * 0.27385)
    assert general_luminance(towards, SUN, kind) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("kind", range(1, 16))
def test_luminance_falls_away_from_the_sun(kind: int) -> None:
    at = _indicatrix(np.radians(np.arange(0.0, 90.0, 5.0)), kind)
    assert (np.diff(at) <= 1e-12).all()


@pytest.mark.parametrize(("kinds", "sign"), [((1, 2, 3, 4), 1), ((9, 10, 11, 12, 13, 14, 15), -1)])
def test_overcast_skies_brighten_to_the_zenith_and_clear_ones_to_the_horizon(kinds: tuple[int, ...], sign: int) -> None:
    up = np.sin(np.radians(np.arange(5.0, 91.0, 5.0)))
    assert all((np.diff(_gradation(up, kind)) * sign > 0).all() for kind in kinds)


def test_unknown_types_and_night_are_refused() -> None:
    for kind in (0, 16):
        with pytest.raises(ParameterError, match="types 1 to 15"):
            general_luminance(ZENITH, SUN, kind)
    with pytest.raises(ParameterError, match="below the horizon"):
        general_luminance(ZENITH, direction(0.0, -1.0), CLEAR)

"""The sky and the sun against Mitsuba's, stored and live, and against the published formula."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import SUN_RADIUS, Floats, angle_between, direction, latlong_directions
from lighting.sky.hosek_wilkie import (
    SUN_SOLID_ANGLE,
    sky_coefficients,
    sky_parameters,
    sky_radiance,
    sun_disc_points,
    sun_disc_radiance,
    sun_radiance,
)
from tests.data.sky_reference import REFERENCE, cases, disc_directions, mitsuba_radiance, sky_directions

SUN = direction(25.0, 33.0)


@pytest.fixture(scope="module")
def reference() -> dict[str, Floats]:
    with np.load(REFERENCE, allow_pickle=False) as archive:
        return {name: archive[name].astype(np.float64) for name in archive.files}


@pytest.fixture(scope="module")
def mitsuba() -> None:
    pytest.importorskip("mitsuba").set_variant("scalar_rgb")


def relative_error(value: Floats, expected: Floats) -> float:
    """The largest error over its value, where a channel counts as at least 1/1000 of its colour's brightest."""
    floor = 1e-3 * expected.max(axis=-1, keepdims=True)
    return float(np.max(np.abs(value - expected) / np.maximum(expected, np.maximum(floor, 1e-9))))


@pytest.mark.parametrize("index", range(len(cases())))
def test_sky_and_disc_match_the_stored_reference(reference: dict[str, Floats], index: int) -> None:
    turbidity, albedo, elevation = cases()[index]
    azimuth = float(reference["azimuth"][index])
    sun = direction(azimuth, elevation)
    sky = sky_radiance(reference["directions"][index], sun, turbidity, albedo)
    assert relative_error(sky, reference["sky"][index]) < 1e-3
    disc = sun_disc_radiance(disc_directions(azimuth, elevation), sun, turbidity)
    assert relative_error(disc, reference["disc"][index][: len(disc)]) < 5e-3


@pytest.mark.usefixtures("mitsuba")
@pytest.mark.parametrize("seed", range(20))
def test_sky_and_disc_match_mitsuba_anywhere(seed: int) -> None:
    rng = np.random.default_rng(seed)
    turbidity, albedo = float(rng.uniform(1, 10)), float(rng.uniform(0, 1))
    azimuth, elevation = float(rng.uniform(-180, 180)), float(rng.uniform(0.1, 90))
    sun = direction(azimuth, elevation)
    directions = sky_directions(sun, rng)
    expected = mitsuba_radiance(directions, sun, turbidity, albedo, sky=1.0)
    assert relative_error(sky_radiance(directions, sun, turbidity, albedo), expected) < 1e-3
    directions = disc_directions(azimuth, elevation)
    expected = mitsuba_radiance(directions, sun, turbidity, albedo, disc=1.0)
    assert relative_error(sun_disc_radiance(directions, sun, turbidity), expected) < 5e-3


def test_float32_stays_float32_and_close() -> None:
    directions = latlong_directions(64)[:32]
    for elevation in (0.0, 10.0, 90.0):
        exact = sky_radiance(directions, direction(25.0, elevation), 2.5, 0.3)
        fast = sky_radiance(directions.astype(np.float32), direction(25.0, elevation), 2.5, 0.3)
        assert [exact.dtype.name, fast.dtype.name] == ["float64", "float32"]
        assert relative_error(fast.astype(np.float64), exact) < 1e-3


def test_one_direction_gives_one_colour() -> None:
    assert sky_radiance(direction(0, 45), SUN, 3, 0.3).shape == (3,)
    assert sky_radiance([0.0, 1.0, 0.0], SUN * 7, 3, 0.3) == pytest.approx(sky_radiance([0.0, 1.0, 0.0], SUN, 3, 0.3))


def test_nothing_below_the_horizon() -> None:
    low = direction([0.0, 25.0, 120.0], -0.01)
    assert not sky_radiance(low, SUN, 3, 0.3).any()
    assert not sun_disc_radiance(low, direction(25.0, 0.0), 3).any()
    assert (sky_radiance(direction(0.0, 0.0), SUN, 3, 0.3) > 0).all()


def test_the_sky_is_never_negative() -> None:
    assert sky_radiance(latlong_directions(32), direction(0, 0), 1.0, 0.0).min() == 0.0


@pytest.mark.parametrize("elevation", [5.0, 40.0])
def test_the_sky_mirrors_about_the_suns_meridian(elevation: float) -> None:
    left, right = direction(25.0 - 40.0, 20.0), direction(25.0 + 40.0, 20.0)
    sun = direction(25.0, elevation)
    assert sky_radiance(left, sun, 3, 0.3) == pytest.approx(sky_radiance(right, sun, 3, 0.3))


def test_the_coefficients_reproduce_the_sky_by_the_published_formula() -> None:
    record = sky_coefficients(33.0, 3.4, 0.3)
    view = direction(-70.0, 21.0)
    gamma, theta = np.radians(angle_between(view, SUN)), np.radians(90 - 21.0)
    for channel, name in enumerate("rgb"):
        a, b, c, d, e, f, g, i, h = record[name]
        chi = (1 + np.cos(gamma) ** 2) / (1 + h * h - 2 * h * np.cos(gamma)) ** 1.5
        shape = 1 + a * np.exp(b / (np.cos(theta) + 0.01))
        shape *= c + d * np.exp(e * gamma) + f * np.cos(gamma) ** 2 + g * chi + i * np.sqrt(np.cos(theta))
        expected = sky_radiance(view, SUN, 3.4, 0.3)[channel]
        assert shape * record["radiance"][channel] == pytest.approx(expected, rel=1e-5)


def test_coefficients_are_plain_numbers() -> None:
    record = sky_coefficients(0.0, 10, 1)
    assert {name: len(values) for name, values in record.items()} == {"r": 9, "g": 9, "b": 9, "radiance": 3}
    assert all(type(value) is float for values in record.values() for value in values)


def test_turbidity_and_albedo_are_continuous() -> None:
    def mean(turbidity: float, albedo: float) -> Floats:
        return sky_parameters(20.0, turbidity, albedo)[1]

    assert mean(3.5, 0.3) == pytest.approx((mean(3, 0.3) + mean(4, 0.3)) / 2)
    assert mean(3, 0.25) == pytest.approx(0.75 * mean(3, 0) + 0.25 * mean(3, 1))
    assert mean(9.999999, 0.3) == pytest.approx(mean(10, 0.3), rel=1e-5)


def test_disc_darkens_towards_its_limb_and_ends_there() -> None:
    across = direction(25.0, 33.0 + SUN_RADIUS * np.array([0, 0.5, 0.9, 0.999, 1.001, 50.0]))
    green = sun_disc_radiance(across, SUN, 3)[:, 1]
    assert (np.diff(green[:4]) < 0).all()
    assert green[3] > 0
    assert not green[4:].any()
    assert not sun_disc_radiance(-SUN, SUN, 3).any()


def test_mean_radiance_is_that_of_the_disc() -> None:
    points, weight = sun_disc_points(SUN, rings=200, spokes=50)
    assert weight.sum() == pytest.approx(SUN_SOLID_ANGLE)
    assert angle_between(points, SUN).max() < SUN_RADIUS
    mean = sun_disc_radiance(points, SUN, 3).mean(axis=0)
    assert sun_radiance(SUN, 3) == pytest.approx(mean, rel=2e-3)


def test_half_of_a_setting_sun_shows() -> None:
    points, weight = sun_disc_points(direction(170.0, 0.0))
    assert weight.sum() == pytest.approx(SUN_SOLID_ANGLE / 2, rel=1e-3)
    assert (points[weight > 0][:, 1] >= 0).all()
    assert sun_radiance(direction(170.0, 0.0), 2)[0] > 0


def test_the_sun_of_a_clear_noon_sky_is_realistic() -> None:
    sun = direction(0, 60)
    power = sun_radiance(sun, 2.5) * SUN_SOLID_ANGLE * np.sin(np.radians(60))
    up = latlong_directions(64)[:32].reshape(-1, 3)
    area = np.cos(np.arcsin(up[:, 1])) * (np.pi / 64) ** 2
    sky = (area * up[:, 1]) @ sky_radiance(up, sun, 2.5, 0.2)
    assert 2 < power[1] / sky[1] < 12  # direct over diffuse on clear days


@pytest.mark.parametrize(
    ("elevation", "turbidity", "albedo", "named"),
    [
        (-1.0, 3.0, 0.3, "sun elevation"),
        (91.0, 3.0, 0.3, "sun elevation"),
        (30.0, 0.9, 0.3, "turbidity"),
        (30.0, 10.1, 0.3, "turbidity"),
        (30.0, float("nan"), 0.3, "turbidity"),
        (30.0, 3.0, -0.1, "albedo"),
        (30.0, 3.0, 1.1, "albedo"),
    ],
)
def test_out_of_range_is_one_sentence(elevation: float, turbidity: float, albedo: float, named: str) -> None:
    with pytest.raises(ParameterError, match=rf"^The {named} is [^.]*(\.\d+)?; [^.]* covers \d+ to \d+\.$"):
        sky_parameters(elevation, turbidity, albedo)


def test_a_sun_below_the_horizon_is_refused_everywhere() -> None:
    low = direction(0, -5)
    with pytest.raises(ParameterError, match="sun elevation"):
        sky_radiance(SUN, low, 3, 0.3)
    with pytest.raises(ParameterError, match="sun elevation"):
        sun_radiance(low, 3)
    with pytest.raises(ParameterError, match="turbidity"):
        sun_radiance(SUN, 11)


def test_rounding_at_the_ends_is_forgiven() -> None:
    assert sky_parameters(90.0000001, 10.0000001, 1.0000001)[1] == pytest.approx(sky_parameters(90, 10, 1)[1])
    sun = np.array([1.0, -1e-7, 0.0], dtype=np.float32)
    assert np.isfinite(sky_radiance(SUN, sun, 3, 0.3)).all()

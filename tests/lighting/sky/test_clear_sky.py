"""Clear skies and their suns against Mitsuba's, the published formula, and the Prague model's own data set."""

from pathlib import Path

import numpy as np
import pytest

from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import SUN_RADIUS, Floats, angle_between, direction, latlong_directions
from lighting.sky import SKY_MODELS, Weather, format_sky_models, sky_shape
from lighting.sky.clear_sky import (
    SUN_SOLID_ANGLE,
    prague_radiance,
    sky_coefficients,
    sky_parameters,
    sky_radiance,
    sun_disc_points,
    sun_disc_radiance,
    sun_radiance,
)
from lighting.sky.perez import perez_weather, sky_angles
from tests.data.sky_reference import REFERENCE, cases, disc_directions, mitsuba_radiance, sky_directions

SUN = direction(25.0, 33.0)

# Radiances of the Prague sky model by its own data set, which tests/data/prague_reference.py of commit de718dbf made.
PRAGUE_REFERENCE = Path(__file__).parents[2] / "data" / "prague_reference.npz"
TURBIDITIES = (3.0, 4.0, 6.0, 8.5, 10.0)
VISIBILITIES = (131.8, 131.8, 70.29972, 32.04434, 20.0)  # km, of the turbidities
ELEVATIONS = (-4.2, -3.1, -1.5, -0.5, 0.0, 1.0, 3.0, 5.23, 8.0, 14.0, 18.64, 27.17, 36.71, 47.16, 83.34, 90.0)  # deg


@pytest.fixture(scope="module")
def reference() -> dict[str, Floats]:
    with np.load(REFERENCE, allow_pickle=False) as archive:
        return {name: archive[name].astype(np.float64) for name in archive.files}


@pytest.fixture(scope="module")
def mitsuba() -> None:
    import mitsuba

    mitsuba.set_variant("scalar_rgb")


def relative_error(value: Floats, expected: Floats) -> float:
    """The largest error over its value, where a channel counts as at least 1/1000 of its color's brightest."""
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


@pytest.fixture(scope="module")
def data_set() -> dict[str, Floats]:
    with np.load(PRAGUE_REFERENCE, allow_pickle=False) as archive:
        return {name: archive[name].astype(np.float64) for name in archive.files}


def test_the_table_is_the_data_set_within_a_tenth_of_a_stop(data_set: dict[str, Floats]) -> None:
    """A quarter of the directions lie within 5 deg of the horizon, where the set changes fastest."""
    stops = np.empty_like(data_set["radiance"])
    for t, turbidity in enumerate(TURBIDITIES):
        for e, elevation in enumerate(ELEVATIONS):
            sky = prague_radiance(data_set["directions"][e], direction(20.0, elevation), turbidity)
            stops[t, e] = np.abs(np.log2(sky / data_set["radiance"][t, e]))
    assert np.quantile(stops, 0.99) < 0.1
    assert stops.max() < 0.25
    assert np.median(stops, axis=(0, 2, 3)).max() < 0.02  # of each sun


def test_the_clearest_sky_of_the_table_is_that_of_turbidity_4() -> None:
    rays = latlong_directions(16)[:8]
    clearest, four, five = (prague_radiance(rays, SUN, turbidity) for turbidity in (1.0, 4.0, 5.0))
    assert np.array_equal(clearest, four)
    assert not np.allclose(five, four, rtol=0.01)


@pytest.mark.parametrize("elevation", np.arange(-4.2, 90.1, 2.9))
def test_every_sky_is_smooth_and_mirrored_about_the_sun(elevation: float) -> None:
    """Between its suns the data set has colored arcs, which the table does not."""
    image = prague_radiance(latlong_directions(64)[:32], direction(0.0, elevation), 8.0)
    assert image.min() > 0
    assert image == pytest.approx(image[:, ::-1], rel=1e-5)
    chroma = np.log2(image[..., [0, 2]] / image[..., [1]])
    away = chroma[:, :16]  # more than 90 deg from the sun's side, where nothing changes fast
    assert np.abs(np.diff(away, axis=0)).max() < 0.6
    assert np.abs(np.diff(away, axis=1)).max() < 0.1


def test_twilight_fades() -> None:
    levels = []
    for elevation in (5.0, 1.0, 0.0, -1.0, -2.5, -4.2):
        sky = prague_radiance(latlong_directions(32)[:16].astype(np.float32), direction(0.0, elevation), 5.0)
        assert sky.dtype == np.float32
        levels.append(irradiance_from_rows(row_irradiance(32)[:16], np.asarray(sky, dtype=np.float32))[1])
    assert all(np.diff(levels) < 0)
    assert 20 < levels[2] / levels[-1] < 200  # civil twilight lies a factor of a hundred below sunset


def test_the_sun_may_not_be_lower() -> None:
    with pytest.raises(
        ParameterError, match=r"^The sun is 4\.5 deg below the horizon; the Prague sky reaches"
    ) as caught:
        prague_radiance(direction(0.0, 10.0), direction(0.0, -4.5), 3.0)
    assert caught.value.code == ErrorCode.NIGHT
    assert caught.value.field == "sun_direction"


def test_nothing_shines_from_below_the_horizon() -> None:
    assert not prague_radiance(direction(0.0, -0.1), direction(0.0, 10.0), 3.0).any()
    assert prague_radiance(direction(0.0, 0.0), direction(0.0, 10.0), 3.0).all()


PRAGUE_SUN = direction(0.0, 40.0)
CLEAR, COVERED = Weather(3.0, 0.3, beam=6.0, diffuse=120.0), Weather(3.0, 0.3, beam=0.0, diffuse=200.0)


@pytest.mark.parametrize("model", SKY_MODELS)
@pytest.mark.parametrize("elevation", [0.0, 40.0, 90.0])
def test_every_model_is_finite_and_ends_at_the_horizon(model: str, elevation: float) -> None:
    sky = sky_shape(model, latlong_directions(32), direction(10.0, elevation), CLEAR)
    assert sky.shape == (32, 64, 3)
    assert np.isfinite(sky).all()
    assert sky.min() >= 0
    assert sky[:16].max() > 0
    assert not sky[16:].any()


def test_the_all_weather_model_reads_the_weather_from_the_light() -> None:
    clear, _ = perez_weather(CLEAR, PRAGUE_SUN)
    covered, brightness = perez_weather(COVERED, PRAGUE_SUN)
    assert clear > 4
    assert covered == pytest.approx(1.0)
    assert 0.01 <= brightness <= 0.6
    up = np.array([0.0, 1.0, 0.0])
    peak = [
        float(sky_shape("perez", PRAGUE_SUN, PRAGUE_SUN, w)[0] / sky_shape("perez", up, PRAGUE_SUN, w)[0])
        for w in (CLEAR, COVERED)
    ]
    assert peak[0] > 2 * peak[1]


def test_another_model_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^The sky model 'cie-16' is not known; it must be one of hosek-wilkie"):
        sky_shape("cie-16", PRAGUE_SUN, PRAGUE_SUN, CLEAR)


def test_advanced_models_are_named_as_a_range() -> None:
    text = format_sky_models(" and ")
    plain = [name for name, model in SKY_MODELS.items() if not model.advanced]
    assert {"hosek-wilkie", "preetham", "perez", "lalonde-matthews", "cie-overcast"} <= set(plain)
    assert text == f"{', '.join(plain)} and cie-1 to cie-15"


def test_angles_are_those_from_the_sun_and_from_the_zenith() -> None:
    up, sun_angle, sun_zenith = sky_angles([direction(0.0, 40.0), direction(180.0, 0.0)], PRAGUE_SUN, "sky")
    assert up == pytest.approx([np.sin(np.radians(40.0)), 0.0])
    assert np.degrees(sun_angle) == pytest.approx([0.0, 140.0], abs=1e-4)
    assert np.degrees(sun_zenith) == pytest.approx(50.0)
    with pytest.raises(ParameterError, match=r"^The sun is below the horizon; the toy sky needs it above\.$"):
        sky_angles(PRAGUE_SUN, direction(0.0, -1.0), "toy sky")

"""The Prague sky against radiances of the data set that its table was made from."""

import numpy as np
import pytest

from lighting.envmap.latlong import irradiance_from_rows, row_irradiance
from lighting.errors import ErrorCode, ParameterError
from lighting.geometry import Floats, direction, latlong_directions
from lighting.sky import SKY_MODELS, Weather, format_sky_models, sky_angles, sky_shape
from lighting.sky.perez import perez_weather
from lighting.sky.prague import _visibility_from_turbidity, prague_radiance
from tests.data.prague_reference import ELEVATIONS, REFERENCE, TURBIDITIES, VISIBILITIES


@pytest.fixture(scope="module")
def reference() -> dict[str, Floats]:
    with np.load(REFERENCE, allow_pickle=False) as archive:
        return {name: archive[name].astype(np.float64) for name in archive.files}


def test_the_table_is_the_data_set_within_a_tenth_of_a_stop(reference: dict[str, Floats]) -> None:
    """A quarter of the directions lie within 5 deg of the horizon, where the set changes fastest."""
    stops = np.empty_like(reference["radiance"])
    for t, turbidity in enumerate(TURBIDITIES):
        for e, elevation in enumerate(ELEVATIONS):
            sky = prague_radiance(reference["directions"][e], direction(20.0, elevation), turbidity)
            stops[t, e] = np.abs(np.log2(sky / reference["radiance"][t, e]))
    assert np.quantile(stops, 0.99) < 0.1
    assert stops.max() < 0.25
    assert np.median(stops, axis=(0, 2, 3)).max() < 0.02  # of each sun


def test_turbidity_maps_to_visibility() -> None:
    visibilities = [_visibility_from_turbidity(turbidity) for turbidity in TURBIDITIES]
    assert visibilities == pytest.approx(VISIBILITIES, rel=1e-4)
    assert _visibility_from_turbidity(1.0) == _visibility_from_turbidity(4.0) == 131.8


@pytest.mark.parametrize("elevation", np.arange(-4.2, 90.1, 2.9))
def test_every_sky_is_smooth_and_mirrored_about_the_sun(elevation: float) -> None:
    """Between its suns the data set has coloured arcs, which the table does not."""
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


SUN = direction(0.0, 40.0)
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
    clear, _ = perez_weather(CLEAR, SUN)
    covered, brightness = perez_weather(COVERED, SUN)
    assert clear > 4
    assert covered == pytest.approx(1.0)
    assert 0.01 <= brightness <= 0.6
    up = np.array([0.0, 1.0, 0.0])
    peak = [float(sky_shape("perez", SUN, SUN, w)[0] / sky_shape("perez", up, SUN, w)[0]) for w in (CLEAR, COVERED)]
    assert peak[0] > 2 * peak[1]


def test_another_model_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^The sky model 'cie-16' is not known; it must be one of hosek-wilkie"):
        sky_shape("cie-16", SUN, SUN, CLEAR)


def test_advanced_models_are_named_as_a_range() -> None:
    text = format_sky_models(" and ")
    plain = [name for name, model in SKY_MODELS.items() if not model.advanced]
    assert {"hosek-wilkie", "preetham", "perez", "lalonde-matthews", "cie-overcast"} <= set(plain)
    assert text == f"{', '.join(plain)} and cie-1 to cie-15"


def test_angles_are_those_from_the_sun_and_from_the_zenith() -> None:
    up, sun_angle, sun_zenith = sky_angles([direction(0.0, 40.0), direction(180.0, 0.0)], SUN, "sky")
    assert up == pytest.approx([np.sin(np.radians(40.0)), 0.0])
    assert np.degrees(sun_angle) == pytest.approx([0.0, 140.0], abs=1e-4)
    assert np.degrees(sun_zenith) == pytest.approx(50.0)
    with pytest.raises(ParameterError, match=r"^The sun is below the horizon; the toy sky needs it above\.$"):
        sky_angles(SUN, direction(0.0, -1.0), "toy sky")

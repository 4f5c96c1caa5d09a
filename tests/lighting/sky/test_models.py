"""Sky models by name."""

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.geometry import direction, latlong_directions
from lighting.sky import SKY_MODELS, Weather, format_sky_models, sky_angles, sky_shape
from lighting.sky.perez import perez_weather

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

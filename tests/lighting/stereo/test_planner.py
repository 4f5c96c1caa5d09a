"""Plans: what they are asked, answer and draw."""

from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lighting.errors import EnvironmentMapError, ParameterError, ProbeError
from lighting.files.exr import write_exr
from lighting.geometry import angle_between, latlong_directions
from lighting.stereo.planner import (
    MAX_GAIN,
    MAX_PROBE_GAP,
    MIN_GAIN,
    MeasuredSkies,
    ModelledSkies,
    _gain_colors,
    _read_day,
    format_angle_error,
    plan_conditions,
    probe_days,
    read_skies,
)
from lighting.stereo.schedule import PlanRequest, SurfaceOrientation, format_clock

JUNE = date(2026, 6, 21)


def sky(height: int = 16) -> NDArray[np.float32]:
    """Even but for one bright pixel."""
    image = np.ones((height, 2 * height, 3), dtype=np.float32)
    image[height // 4, height] = 1000
    return image


def fill(folder: Path, *names: str, height: int = 16) -> None:
    for name in names:
        (folder / "20260621" / name).mkdir(parents=True)
        write_exr(folder / "20260621" / name / "envmap.exr", sky(height))


def test_the_brightest_spot_is_the_sun(tmp_path: Path) -> None:
    fill(tmp_path, "100000")
    (sun,) = read_skies(list(probe_days(tmp_path)[JUNE].values())).sun_direction
    assert angle_between(sun, latlong_directions(16)[4, 16]) < 0.1


def test_folders_are_days_by_a_clock(tmp_path: Path) -> None:
    fill(tmp_path, "100000", "103000")
    assert sorted(probe_days(tmp_path)[JUNE]) == [600, 630]
    assert list(probe_days(tmp_path)) == [JUNE]
    day = _read_day(JUNE, probe_days(tmp_path)[JUNE])
    assert day.minutes.tolist() == [600, 630]
    assert day.tolerance == MAX_PROBE_GAP / 2
    assert day.skies.radiance.max() < 1000  # the sun is out of the map
    assert day.skies.sun_irradiance.min() > 0


def test_a_probe_with_values_that_are_no_numbers_is_named(tmp_path: Path) -> None:
    image = sky()
    image[2, 3] = np.inf
    write_exr(tmp_path / "a.exr", image)
    with pytest.raises(EnvironmentMapError, match=r"a\.exr: The map holds values that are not finite numbers\.$"):
        read_skies([tmp_path / "a.exr"])


def test_one_probe_is_no_day_and_sizes_do_not_mix(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="two or more"):
        _read_day(JUNE, {600.0: tmp_path})
    fill(tmp_path, "100000")
    fill(tmp_path, "110000", height=32)
    with pytest.raises(EnvironmentMapError, match="differ in size"):
        read_skies(list(probe_days(tmp_path)[JUNE].values()))


def test_the_clock_is_the_longitudes_unless_told() -> None:
    assert ModelledSkies(47.0, 10.0, JUNE, JUNE).location.utc_offset == 1
    assert ModelledSkies(47.0, -76.0, JUNE, JUNE).location.utc_offset == -5
    assert ModelledSkies(47.0, 10.0, JUNE, JUNE, utc_offset=2.0).location.utc_offset == 2


def test_conditions_are_said() -> None:
    said = plan_conditions(ModelledSkies(47.0, -52.0, JUNE, JUNE, utc_offset=-3.5), PlanRequest(90.0, 5, 0.5))
    assert said == "surface facing 90°, 5 photos a window, noise 0.5 %, times UTC-03:30"


@pytest.mark.parametrize(("latitude", "longitude", "name"), [(91.0, 0.0, "latitude"), (0.0, 181.0, "longitude")])
def test_places_are_checked(latitude: float, longitude: float, name: str) -> None:
    with pytest.raises(ParameterError, match=name):
        ModelledSkies(latitude, longitude, JUNE, JUNE)


def test_another_sky_is_refused() -> None:
    cloudy: Any = "cloudy"
    with pytest.raises(ParameterError, match="'cloudy' is not known; it must be one of clear, overcast, mixed"):
        ModelledSkies(47.0, 10.0, JUNE, JUNE, cloudy)


def test_days_and_clocks_are_checked(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="before the first"):
        ModelledSkies(47.0, 10.0, JUNE, date(2026, 6, 20))
    with pytest.raises(ParameterError, match="utc_offset"):
        ModelledSkies(47.0, 10.0, JUNE, JUNE, utc_offset=20.0)
    with pytest.raises(ProbeError, match="holds no probe"):
        MeasuredSkies(tmp_path).days()


@pytest.mark.parametrize(
    "wrong", [{"shots": 2}, {"noise": 0.0}, {"noise": 101.0}, {"facing": 361.0}, {"facing": float("nan")}]
)
def test_questions_are_checked(wrong: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match=next(iter(wrong))):
        PlanRequest(**wrong)  # type: ignore[arg-type]


def test_what_the_light_does_not_resolve_is_null() -> None:
    found = SurfaceOrientation("level", 0.0, 90.0, 90.0, np.inf, (0.123456, np.inf, 1.0)).to_dict()
    assert found["gain"] is None
    assert found["interval_95"] == [0.1235, None, 1.0]


def test_times_are_written_as_a_clock_shows_them() -> None:
    assert format_clock(645.0) == "10:45"
    assert format_clock(59.6) == "01:00"


def test_less_gain_is_brighter_and_the_ends_of_the_scale_hold() -> None:
    colors = _gain_colors(np.array([0.1, MIN_GAIN, 10.0, 100.0, MAX_GAIN, np.inf])).astype(int)
    assert (np.diff(colors.sum(axis=1)) <= 0).all()
    np.testing.assert_array_equal(colors[0], colors[1])
    np.testing.assert_array_equal(colors[-1], colors[-2])


def test_errors_that_say_nothing_are_not_told_as_numbers() -> None:
    assert format_angle_error(7.25) == "7.2°"
    assert format_angle_error(60.0) == ">45°"

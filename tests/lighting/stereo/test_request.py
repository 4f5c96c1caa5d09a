"""Questions about a place or about a folder, in words and as records."""

from datetime import date
from pathlib import Path
from typing import Any

import pytest

from lighting.errors import ParameterError, ProbeError
from lighting.stereo.plan import Question
from lighting.stereo.request import MeasuredSkies, ModelledSkies, conditions

JUNE = date(2026, 6, 21)


def test_the_clock_is_the_longitudes_unless_told() -> None:
    assert ModelledSkies(47.0, 10.0, JUNE, JUNE).place.utc_offset == 1
    assert ModelledSkies(47.0, -76.0, JUNE, JUNE).place.utc_offset == -5
    assert ModelledSkies(47.0, 10.0, JUNE, JUNE, utc_offset=2.0).place.utc_offset == 2


def test_conditions_are_said() -> None:
    said = conditions(ModelledSkies(47.0, -52.0, JUNE, JUNE, utc_offset=-3.5), Question(90.0, 5, 0.5))
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

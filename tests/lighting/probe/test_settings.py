"""What is told of a probe's exposures."""

from datetime import UTC, datetime, timedelta

import pytest

from lighting.errors import ProbeError
from lighting.probe.settings import Moment, Settings, check_day

NOON = Moment(datetime(2024, 6, 1, 12, tzinfo=UTC), 0.0, 0.0)


def test_numbers_that_are_not_finite_are_refused() -> None:
    with pytest.raises(ProbeError, match="lens"):
        Settings(radius=float("nan"))
    with pytest.raises(ProbeError, match="place"):
        Moment(NOON.time, float("nan"), 8.0)


@pytest.mark.parametrize("told", [{"nd": -1.0}, {"nd": 500.0}, {"pitch": 100.0}, {"fov": 361.0}, {"radius": 0.0}])
def test_numbers_that_cannot_be_are_refused(told: dict[str, float]) -> None:
    """500 stops made a map of infinite radiance."""
    with pytest.raises(ProbeError, match="0"):
        Settings(**told)  # type: ignore[arg-type]


def test_the_sun_of_a_june_noon_on_the_equator_is_in_the_north() -> None:
    azimuth, elevation = NOON.sun
    assert abs(azimuth) < 5
    assert elevation == pytest.approx(90 - 22.1, abs=0.3)  # the sun's declination on 1 June


def test_night_is_refused() -> None:
    check_day(NOON)
    with pytest.raises(ProbeError, match="below the horizon: it is night"):
        check_day(Moment(NOON.time + timedelta(hours=12), 0.0, 0.0))

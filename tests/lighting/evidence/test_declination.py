"""The compass needle against published values of the World Magnetic Model."""

from concurrent.futures import ThreadPoolExecutor
from datetime import datetime

import pytest

from lighting.evidence.declination import magnetic_declination


@pytest.mark.parametrize(
    ("latitude", "longitude", "year", "expected"),
    [  # from the test values that NOAA publishes with the model of 2020, at sea level or nearly
        (80.0, 0.0, 2020.0, -1.28),
        (0.0, 120.0, 2020.0, 0.16),
    ],
)
def test_published_values(latitude: float, longitude: float, year: float, expected: float) -> None:
    assert magnetic_declination(latitude, longitude, datetime(int(year), 1, 1)) == pytest.approx(expected, abs=0.05)


def test_east_is_positive() -> None:
    assert magnetic_declination(47.6, -122.3, datetime(2022, 7, 1)) == pytest.approx(15.3, abs=0.5)  # Seattle
    assert magnetic_declination(44.6, -63.6, datetime(2022, 7, 1)) == pytest.approx(-16.4, abs=0.7)  # Halifax


@pytest.mark.parametrize("time", [datetime(2009, 12, 31), datetime(2030, 1, 1)])
def test_unknown_outside_the_models_years(time: datetime) -> None:
    assert magnetic_declination(48.0, 11.0, time) is None


@pytest.mark.parametrize("time", [datetime(2010, 1, 1), datetime(2024, 12, 31, 23, 59), datetime(2029, 12, 31, 23, 59)])
def test_known_to_the_last_day(time: datetime) -> None:
    assert magnetic_declination(48.0, 11.0, time) == pytest.approx(3.5, abs=1.8)


def test_unknown_where_compasses_fail() -> None:
    assert magnetic_declination(86.5, 160.0, datetime(2022, 1, 1)) is None


def test_threads_do_not_disturb_each_other() -> None:
    places = [(-60.0 + i % 120, -180.0 + 3 * (i % 120)) for i in range(1200)]

    def there(place: tuple[float, float]) -> float | None:
        return magnetic_declination(*place, datetime(2024, 6, 1))

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(there, places)) == list(map(there, places))

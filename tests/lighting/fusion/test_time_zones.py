"""Offsets from UTC by place and by file, and the hemisphere that they tell."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from itertools import product
from zoneinfo import ZoneInfo, available_timezones

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.errors import warning_code
from lighting.fusion.metadata_prior import observations_from_metadata
from lighting.fusion.time_zones import OFFSET_RULES, clock_offsets, offset_in_file, resolve_hemisphere
from lighting.fusion.user_input import UserInput
from lighting.photo.clock import UTC_OFFSETS
from lighting.photo.metadata import PhotoMetadata
from tests.helpers.predictions import METADATA, MORNING, ZONELESS, sun_at


@pytest.mark.parametrize(
    ("place", "time", "hours"),
    [
        ((48.14, 11.58), datetime(2024, 6, 1, 18, 49), [2.0]),  # Munich in summer
        ((48.14, 11.58), datetime(2024, 12, 1, 12, 0), [1.0]),
        ((48.14, 11.58), datetime(2024, 10, 27, 2, 30), [2.0, 1.0]),  # the hour that summer time repeats
        ((48.14, 11.58), datetime(2024, 3, 31, 2, 30), [1.0, 2.0]),  # the hour that it leaves out
        ((39.74, -104.99), datetime(2025, 9, 14, 8, 18), [-6.0]),
        ((27.7, 85.32), datetime(2023, 10, 30, 11, 16), [5.75]),
        ((10.5, -66.9), datetime(2010, 2, 1, 12, 0), [-4.5]),  # Venezuela's until 2016
        ((10.5, -66.9), datetime(2018, 2, 1, 12, 0), [-4.0]),
        ((39.0, 125.8), datetime(2017, 2, 1, 12, 0), [8.5]),  # North Korea's 2015 to 2018
        ((55.75, 37.62), datetime(2012, 7, 1, 12, 0), [4.0]),  # Moscow's summer all year
        ((43.83, 87.6), datetime(2024, 6, 1, 12, 0), [8.0, 6.0]),  # Urumqi keeps two times
        ((44.95, 34.1), datetime(2024, 12, 1, 12, 0), [3.0, 2.0]),  # Crimea
        ((48.0, 37.8), datetime(2024, 12, 1, 12, 0), [2.0, 3.0]),  # Donetsk
        ((43.0, 41.0), datetime(2024, 12, 1, 12, 0), [4.0, 3.0]),  # Abkhazia
        ((1.87, -157.4), datetime(2024, 6, 1, 12, 0), [14.0]),  # Kiritimati
    ],
)
def test_offsets_of_a_place(place: tuple[float, float], time: datetime, hours: list[float]) -> None:
    found = clock_offsets(*place, time)
    assert [one.hours for one in found] == hours
    assert sum(one.weight for one in found) == pytest.approx(1.0)


def test_at_sea_there_are_several_and_the_coasts_count() -> None:
    off_norway = {one.hours: one.weight for one in clock_offsets(62.0, 2.5, datetime(2024, 6, 1, 12, 0))}
    assert off_norway.keys() >= {-1.0, 0.0, 1.0, 2.0}
    mid_atlantic = {one.hours for one in clock_offsets(30.0, -45.0, datetime(2024, 6, 1, 12, 0))}
    assert mid_atlantic == {-4.0, -3.0, -2.0}


@given(st.floats(-90, 90), st.floats(-180, 180))
@settings(max_examples=60, deadline=None)
def test_every_place_has_a_zone(latitude: float, longitude: float) -> None:
    found = clock_offsets(latitude, longitude, datetime(2024, 6, 1, 12, 0))
    assert found
    assert sum(one.weight for one in found) == pytest.approx(1.0)
    assert all(one.hours in UTC_OFFSETS for one in found)


def test_the_offsets_of_this_world() -> None:
    """By the time zone database, whose zones follow a full hour or a quarter since there are digital cameras."""
    days = [datetime(year, month, 15) for year in range(1995, 2027, 2) for month in (1, 7)]
    zones = [ZoneInfo(name) for name in available_timezones() if "/" in name and not name.startswith("right/")]
    seen = {zone.utcoffset(day) / timedelta(hours=1) for zone in zones for day in days}  # type: ignore[operator]
    assert seen <= UTC_OFFSETS


def test_a_rule_for_the_offset_is_one_function_and_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """CONTRIBUTING's recipe: ships keep the zone of their longitude; a toy rule says so of every photo."""

    def nautical_offset(metadata: PhotoMetadata) -> float | None:
        return None if metadata.longitude is None else float(round(metadata.longitude / 15.0))

    monkeypatch.setitem(OFFSET_RULES, "zone of the longitude", nautical_offset)
    (sun,) = observations_from_metadata(ZONELESS, UserInput()).observations.candidates
    assert ZONELESS.local_time is not None
    assert sun == sun_at((ZONELESS.local_time - timedelta(hours=1)).replace(tzinfo=UTC))
    stated = observations_from_metadata(METADATA, UserInput()).observations.candidates
    assert stated == (sun_at(MORNING),)  # what the file states goes first


def test_a_brands_rule_asks_who_made_the_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OFFSET_RULES, "Acme's clock", lambda known: 0.0 if known.camera_make == "acme" else None)
    noon = datetime(2024, 6, 1, 12, 0)
    assert offset_in_file(PhotoMetadata(local_time=noon, camera_make="acme")) == (0.0, "Acme's clock")
    assert offset_in_file(PhotoMetadata(local_time=noon, camera_make="other")) is None


def test_a_rule_is_about_the_files_clock_and_not_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OFFSET_RULES, "always one hour", lambda _: 1.0)
    noon = datetime(2024, 6, 1, 12, 0)
    by_rule = observations_from_metadata(ZONELESS, UserInput()).observations.candidates
    by_user = observations_from_metadata(ZONELESS, UserInput(time=noon)).observations.candidates
    assert by_rule == (sun_at(datetime(2024, 6, 1, 8, 10, tzinfo=UTC)),)
    assert by_user == (sun_at(datetime(2024, 6, 1, 10, 0, tzinfo=UTC)),)


NOON = datetime(2024, 6, 1, 12)


def unsigned(latitude: float, longitude: float, utc_offset: float | None = None) -> PhotoMetadata:
    places = tuple((a * latitude, b * longitude) for a, b in product((1, -1), (1, -1)))
    return PhotoMetadata(local_time=NOON, utc_offset=utc_offset, locations=places)


@pytest.mark.parametrize(
    ("size", "utc_offset", "expected"),
    [
        ((48.14, 11.58), 2.0, (48.14, 11.58)),  # Munich
        ((48.14, 11.58), None, (48.14, 11.58)),  # the others lie in the sea
        ((48.14, 11.58), -4.0, (48.14, 11.58)),  # by a traveller's clock
        ((39.74, 104.99), -6.0, (39.74, -104.99)),  # Denver
        ((39.74, 104.99), 8.0, (39.74, 104.99)),  # Inner Mongolia
        ((33.87, 151.21), 10.0, (-33.87, 151.21)),  # Sydney
    ],
)
def test_the_zone_and_the_land_tell_the_hemisphere(
    size: tuple[float, float], utc_offset: float | None, expected: tuple[float, float]
) -> None:
    metadata, warnings = resolve_hemisphere(unsigned(*size, utc_offset))
    assert metadata.location == expected
    assert metadata.locations == ()
    (warning,) = warnings
    assert warning_code(warning) == "location-open"


def test_the_difference_of_clock_and_gps_tells_it_too() -> None:
    metadata, _ = resolve_hemisphere(replace(unsigned(39.74, 104.99), gps_time=datetime(2024, 6, 1, 18, tzinfo=UTC)))
    assert metadata.location == (39.74, -104.99)


@pytest.mark.parametrize(("size", "utc_offset"), [((39.74, 104.99), None), ((30.0, 22.0), 2.0), ((45.0, 30.0), 30.0)])
def test_a_place_that_stays_open_is_not_used(size: tuple[float, float], utc_offset: float | None) -> None:
    metadata, (warning,) = resolve_hemisphere(unsigned(*size, utc_offset))
    if metadata.location is None:
        assert "was not used" in warning
    assert not any(character.isdigit() for character in warning)


def test_a_place_with_a_hemisphere_stays() -> None:
    known = PhotoMetadata(latitude=48.0, longitude=11.0)
    assert resolve_hemisphere(known) == (known, ())
    assert resolve_hemisphere(PhotoMetadata()) == (PhotoMetadata(), ())

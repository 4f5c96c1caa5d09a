"""Local times, offsets from UTC and the zones that a location allows."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from itertools import product
from zoneinfo import ZoneInfo, available_timezones

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lighting.errors import ParameterError
from lighting.fusion.instants import (
    OFFSET_RULES,
    _offsets_of_place,
    resolve_hemisphere,
    resolve_instants,
    resolve_together,
)
from lighting.fusion.metadata_prior import observations_from_metadata, observations_multi, share_location
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.clock import UTC_OFFSETS
from lighting.photo.metadata import PhotoMetadata
from lighting.records import warning_code
from tests.helpers.predictions import METADATA, MORNING, ZONELESS, observations_of, sun_at


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
    found = _offsets_of_place(*place, time)
    assert [one.hours for one in found] == hours
    assert sum(one.weight for one in found) == pytest.approx(1.0)


def test_at_sea_there_are_several_and_the_coasts_count() -> None:
    off_norway = {one.hours: one.weight for one in _offsets_of_place(62.0, 2.5, datetime(2024, 6, 1, 12, 0))}
    assert off_norway.keys() >= {-1.0, 0.0, 1.0, 2.0}
    mid_atlantic = {one.hours for one in _offsets_of_place(30.0, -45.0, datetime(2024, 6, 1, 12, 0))}
    assert mid_atlantic == {-4.0, -3.0, -2.0}


@given(st.floats(-90, 90), st.floats(-180, 180))
@settings(max_examples=60, deadline=None)
def test_every_place_has_a_zone(latitude: float, longitude: float) -> None:
    found = _offsets_of_place(latitude, longitude, datetime(2024, 6, 1, 12, 0))
    assert found
    assert sum(one.weight for one in found) == pytest.approx(1.0)
    assert all(one.hours in UTC_OFFSETS for one in found)


def test_the_offsets_of_this_world() -> None:
    """By the time zone database, whose zones follow a full hour or a quarter since there are digital cameras."""
    days = [datetime(year, month, 15) for year in range(1995, 2027, 2) for month in (1, 7)]
    zones = [ZoneInfo(name) for name in available_timezones() if "/" in name and not name.startswith("right/")]
    seen = {zone.utcoffset(day) / timedelta(hours=1) for zone in zones for day in days}  # type: ignore[operator]
    assert seen <= UTC_OFFSETS


def test_what_is_said_takes_the_place_of_the_facts() -> None:
    there = timezone(timedelta(hours=-4))
    stated = UserInput(
        time=datetime(2023, 3, 3, 15, 0, tzinfo=there), latitude=40.7, longitude=-74.0, vertical_fov=33.0
    )
    found = observations_from_metadata(METADATA, stated)
    (sun,) = found.observations.candidates
    assert sun == sun_at(datetime(2023, 3, 3, 19, 0, tzinfo=UTC), 40.7, -74.0)
    assert found.observations.vertical_fov == 33.0
    assert found.warnings == ()


def test_a_local_time_that_is_said_does_not_borrow_the_photos_zone() -> None:
    """A photo of a camera on another zone."""
    metadata = replace(METADATA, utc_offset=-7.0)
    noon = datetime(2024, 6, 1, 12, 0)
    assert observations_of(metadata, time=noon).candidates == (sun_at(noon.replace(hour=10, tzinfo=UTC)),)
    assert observations_of(metadata, time=noon, utc_offset=5.0).candidates == (
        sun_at(noon.replace(hour=7, tzinfo=UTC)),
    )


def instants_of(*metadata: PhotoMetadata) -> list[tuple[datetime, str]]:
    found = resolve_together(share_location(metadata), UserInput())
    return [(one.likeliest.utc_time, one.likeliest.source) for one in found if one.likeliest]


def test_photos_together_share_place_and_zone() -> None:
    metadata = [replace(ZONELESS, latitude=None, longitude=None), METADATA, replace(ZONELESS, latitude=1.0)]
    for fact in share_location(metadata):
        assert (fact.latitude, fact.longitude) == (METADATA.latitude, METADATA.longitude)
    assert instants_of(*metadata) == [
        (MORNING, "other photos"),
        (MORNING, "offset in the file"),
        (MORNING, "other photos"),
    ]


def test_a_clock_beside_the_satellites_time_tells_the_zone() -> None:
    by_satellite = replace(METADATA, utc_offset=None, gps_time=MORNING + timedelta(seconds=40))
    later = replace(ZONELESS, local_time=datetime(2024, 6, 1, 10, 10))
    assert instants_of(by_satellite, later) == [(MORNING, "GPS"), (MORNING + timedelta(hours=1), "other photos")]


def test_a_clock_that_was_reset_tells_no_offset_to_the_others() -> None:
    reset = replace(METADATA, local_time=datetime(1970, 1, 1, 0, 10), utc_offset=0.0, gps_time=MORNING)
    assert instants_of(reset, ZONELESS) == [(MORNING, "GPS"), (MORNING, "zone of the place")]


@pytest.mark.parametrize("hours", [-4.5, 8.5, 11.5])
def test_a_clock_of_a_former_zone_tells_it(hours: float) -> None:
    """Venezuela's to 2016, North Korea's to 2018, Norfolk Island's to 2015: the other photos were left without time."""
    local = MORNING.replace(tzinfo=None) + timedelta(hours=hours)
    by_satellite = replace(METADATA, local_time=local, utc_offset=None, gps_time=MORNING)
    later = replace(ZONELESS, local_time=local + timedelta(hours=1))
    assert instants_of(by_satellite, later)[1] == (MORNING + timedelta(hours=1), "other photos")


def test_a_clock_that_runs_wrong_tells_no_zone_and_refuses_nothing() -> None:
    by_satellite = replace(METADATA, utc_offset=None, gps_time=MORNING + timedelta(minutes=23))
    doubted, other = (k.observations for k in observations_multi([by_satellite, ZONELESS], UserInput()))
    assert len(doubted.candidates) == len(other.candidates) == 2
    assert other.candidates[0] == other.candidates[1] == doubted.candidates[0]
    assert doubted.weights == other.weights
    doubted, stated = (k.observations for k in observations_multi([by_satellite, ZONELESS], UserInput(utc_offset=2.0)))
    assert doubted.candidates == stated.candidates == (sun_at(MORNING),)


def test_photos_of_two_seasons_share_the_zone_of_the_place() -> None:
    summer, winter = (replace(ZONELESS, local_time=datetime(2024, month, 1, 12, 0)) for month in (6, 12))
    assert instants_of(summer, winter) == [
        (datetime(2024, 6, 1, 10, 0, tzinfo=UTC), "zone of the place"),
        (datetime(2024, 12, 1, 11, 0, tzinfo=UTC), "zone of the place"),
    ]


def test_photos_of_the_hour_that_repeats_share_its_half() -> None:
    first, second = (replace(ZONELESS, local_time=datetime(2024, 10, 27, 2, minute)) for minute in (10, 50))
    earlier, later = resolve_together([first, second], UserInput())
    assert [one.utc_offset for one in earlier.instants] == [one.utc_offset for one in later.instants] == [2.0, 1.0]
    assert [one.clock for one in earlier.instants] == [one.clock for one in later.instants]


def test_time_and_place_give_one_sun() -> None:
    (sun,) = observations_of().candidates
    assert sun == sun_at(MORNING)
    assert sun == pytest.approx((35.9, 96.3), abs=0.2)


def test_a_local_time_is_of_the_zone_of_its_place() -> None:
    assert observations_of(ZONELESS).candidates == observations_of().candidates


@pytest.mark.parametrize(("year", "warns"), [(1960, True), (1969, True), (1970, False), (2024, False)])
def test_a_zone_before_1970_is_doubted(year: int, warns: bool) -> None:
    """PyPI's tzdata gives Oslo Berlin's clocks of 1960, Debian's Norway's own."""
    taken = PhotoMetadata(local_time=datetime(year, 7, 1, 17), latitude=59.91, longitude=10.75)
    for metadata, user_input in (
        (taken, NO_USER_INPUT),
        (replace(taken, local_time=None), UserInput(time=taken.local_time)),
    ):
        found = resolve_instants(metadata, user_input)
        hours = found.instants[0].utc_offset
        assert hours in (1.0, 2.0)
        sentence = f"Zone files differ before 1970: if +{hours:02.0f}:00 is wrong, state the offset from UTC."
        assert found.warnings == ((sentence,) if warns else ())
    assert resolve_instants(taken, UserInput(utc_offset=2.0)).warnings == ()
    assert resolve_instants(replace(taken, utc_offset=2.0), NO_USER_INPUT).warnings == ()


@pytest.mark.parametrize(
    ("latitude", "hour", "words"),
    [(75.0, 11, "nautical twilight of the polar night"), (88.0, 11, "polar night"), (50.0, 23, "(night;")],
)
def test_how_dark_it_is(latitude: float, hour: int, words: str) -> None:
    time = datetime(2024, 12, 21, hour, tzinfo=UTC)
    with pytest.raises(ParameterError) as caught:
        observations_from_metadata(PhotoMetadata(), UserInput(time=time, latitude=latitude, longitude=14.4))
    assert words in str(caught.value)


def test_zones_in_the_night_keep_their_turn() -> None:
    """Photos taken together share the zone by its place in the list."""
    at_sea = replace(ZONELESS, latitude=50.0, longitude=-30.0, local_time=datetime(2024, 12, 21, 7, 0))
    suns = observations_of(at_sea).candidates
    assert len(suns) == 3
    assert min(elevation for elevation, _ in suns) < -6.0
    assert not any(-6.0 <= elevation < 0.0 for elevation, _ in suns)


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

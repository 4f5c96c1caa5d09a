"""Local times, offsets from UTC and the zones that a location allows."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import pytest

from lighting.errors import ParameterError
from lighting.fusion.instants import resolve_instants, resolve_together
from lighting.fusion.metadata_prior import observations_from_metadata, observations_multi, share_location
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.metadata import PhotoMetadata
from tests.helpers.predictions import METADATA, MORNING, ZONELESS, observations_of, sun_at


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

"""Local times, offsets from UTC and the zones that a location allows."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.errors import ParameterError
from lighting.fusion.metadata_prior import observations_from_metadata, observations_multi
from lighting.fusion.timezones import OFFSET_RULES, candidate_utc_offsets, share_location
from lighting.fusion.user_input import UserInput
from lighting.photo.metadata import PhotoMetadata
from tests.helpers.predictions import METADATA, MORNING, ZONELESS, observations_of, sun_at


@pytest.mark.parametrize(
    ("longitude", "hours", "there"),
    [
        (13.4, 1, True),  # Berlin
        (13.4, 2, True),
        (13.4, -1, False),
        (75.0, 8, True),  # Kashgar
        (97.0, 5.5, True),  # Arunachal Pradesh
        (-8.7, 2, True),  # Galicia in summer
        (-157.4, 14, True),  # Kiritimati
        (-157.4, -10, True),
        (172.0, 12.75, True),
        (0.0, 5.75, False),
    ],
)
def test_zones_that_a_longitude_allows(longitude: float, hours: float, there: bool) -> None:
    assert (hours in candidate_utc_offsets(50.0, longitude)) is there


@pytest.mark.parametrize(
    ("latitude", "longitude", "hours"),
    [(10.5, -66.9, -4.5), (39.0, 125.8, 8.5), (-31.7, 128.9, 9.75), (-29.1, 168.0, 11.5), (-25.1, -130.1, -8.5)],
)
def test_a_zone_of_the_past_counts_where_clocks_followed_it(latitude: float, longitude: float, hours: float) -> None:
    """Photos of Caracas of 2010 without an offset were half an hour, and the sun 7°, off."""
    assert hours in candidate_utc_offsets(latitude, longitude)
    assert hours not in candidate_utc_offsets(latitude + 20.0, longitude)
    metadata = replace(ZONELESS, latitude=latitude, longitude=longitude, local_time=datetime(2010, 2, 1, 12, 0))
    sun = sun_at(datetime(2010, 2, 1, 12, 0, tzinfo=timezone(timedelta(hours=hours))), latitude, longitude)
    assert any(sun == candidate for candidate in observations_of(metadata).candidates)


@given(st.floats(-90, 90), st.floats(-180, 180))
def test_every_place_has_its_own_zone(latitude: float, longitude: float) -> None:
    allowed = candidate_utc_offsets(latitude, longitude)
    assert allowed == tuple(sorted(set(allowed)))
    assert 4 <= len(allowed) <= 14
    assert any(abs((zone - longitude / 15 + 12) % 24 - 12) <= 0.5 for zone in allowed)


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
    assert len(observations_of(time=datetime(2024, 6, 1, 12, 0)).candidates) == 6
    assert len(observations_of(time=datetime(2024, 6, 1, 12, 0), utc_offset=2.0).candidates) == 1


def test_photos_together_share_place_and_zone() -> None:
    metadata = [replace(ZONELESS, latitude=None, longitude=None), METADATA, replace(ZONELESS, latitude=1.0)]
    for fact in share_location(metadata):
        assert (fact.latitude, fact.longitude, fact.utc_time) == (METADATA.latitude, METADATA.longitude, MORNING)


def test_a_clock_beside_the_satellites_time_tells_the_zone() -> None:
    by_satellite = replace(METADATA, utc_offset=None, utc_time=MORNING + timedelta(seconds=40))
    later = replace(ZONELESS, local_time=datetime(2024, 6, 1, 10, 10))
    assert [fact.utc_time for fact in share_location([by_satellite, later])] == [
        MORNING + timedelta(seconds=40),
        MORNING + timedelta(hours=1),
    ]


@pytest.mark.parametrize("hours", [-4.5, 8.5, 11.5])
def test_a_clock_of_a_former_zone_tells_it(hours: float) -> None:
    """Venezuela's to 2016, North Korea's to 2018, Norfolk Island's to 2015: the other photos were left without time."""
    local = MORNING.replace(tzinfo=None) + timedelta(hours=hours)
    by_satellite = replace(METADATA, local_time=local, utc_offset=None, utc_time=MORNING)
    later = replace(ZONELESS, local_time=local + timedelta(hours=1))
    assert share_location([by_satellite, later])[1].utc_time == MORNING + timedelta(hours=1)


def test_a_clock_that_runs_wrong_tells_no_zone_and_refuses_nothing() -> None:
    by_satellite = replace(METADATA, utc_offset=None, utc_time=MORNING + timedelta(minutes=23))
    sure, unsure = (k.observations for k in observations_multi([by_satellite, ZONELESS], UserInput()))
    assert len(sure.candidates) == 1
    assert unsure.candidates == ()  # takes the other's
    _, stated = (k.observations for k in observations_multi([by_satellite, ZONELESS], UserInput(utc_offset=2.0)))
    assert len(stated.candidates) == 1


def test_time_and_place_give_one_sun() -> None:
    (sun,) = observations_of().candidates
    assert sun == sun_at(MORNING)
    assert sun == pytest.approx((35.9, 96.3), abs=0.2)


def test_a_local_time_gives_one_sun_a_zone() -> None:
    suns = observations_of(ZONELESS).candidates
    assert len(suns) == len(candidate_utc_offsets(48.14, 11.575)) == 6
    assert observations_of().candidates[0] in [pytest.approx(sun) for sun in suns]
    elevations = [elevation for elevation, _ in suns]
    assert max(elevations) - min(elevations) > 30


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
    suns = observations_of(replace(ZONELESS, local_time=datetime(2024, 12, 21, 9, 0))).candidates
    assert len(suns) == 6
    assert min(elevation for elevation, _ in suns) < -6.0
    assert not any(-6.0 <= elevation < 0.0 for elevation, _ in suns)
    assert max(elevation for elevation, _ in suns) > 5.0


def test_a_rule_for_the_offset_is_one_function_and_one_entry(monkeypatch: pytest.MonkeyPatch) -> None:
    """CONTRIBUTING's recipe: ships keep the zone of their longitude; a toy rule says so of every photo."""

    def nautical_offset(metadata: PhotoMetadata) -> float | None:
        return None if metadata.longitude is None else float(round(metadata.longitude / 15.0))

    before = observations_from_metadata(ZONELESS, UserInput()).observations.candidates
    monkeypatch.setitem(OFFSET_RULES, "zone of the longitude", nautical_offset)
    (sun,) = observations_from_metadata(ZONELESS, UserInput()).observations.candidates
    assert len(before) > 1
    assert ZONELESS.local_time is not None
    assert sun in before
    assert sun == sun_at((ZONELESS.local_time - timedelta(hours=1)).replace(tzinfo=UTC))
    stated = observations_from_metadata(METADATA, UserInput()).observations.candidates
    assert stated == (sun_at(MORNING),)  # what the file states goes first


def test_a_rule_is_about_the_files_clock_and_not_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(OFFSET_RULES, "always one hour", lambda _: 1.0)
    noon = datetime(2024, 6, 1, 12, 0)
    by_rule = observations_from_metadata(ZONELESS, UserInput()).observations.candidates
    by_user = observations_from_metadata(ZONELESS, UserInput(time=noon)).observations.candidates
    assert len(by_rule) == 1
    assert len(by_user) > 1

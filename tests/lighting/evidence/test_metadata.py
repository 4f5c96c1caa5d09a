"""Facts and what the user says, as evidence."""

import math
from dataclasses import replace
from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lighting.errors import ParameterError
from lighting.evidence import Given, zones
from lighting.evidence.answer import estimate_of
from lighting.evidence.declination import magnetic_declination
from lighting.evidence.ephemeris import sun_position
from lighting.evidence.facts import of_one_place
from lighting.evidence.fusion import COMPASS_SPREAD, Evidence, fuse
from lighting.evidence.metadata import GIVEN_HEADING_SPREAD, known, known_together
from lighting.photo.exif import PhotoFacts
from lighting.records import Lighting, Prediction
from lighting.sun_grid import grid_directions, soft_label
from tests.conftest import TINY

MORNING = datetime(2024, 6, 1, 7, 10, tzinfo=UTC)
FACTS = PhotoFacts(
    local_time=datetime(2024, 6, 1, 9, 10),
    utc_offset=2.0,
    utc_time=MORNING,
    latitude=48.14,
    longitude=11.575,
    heading=60.0,
    heading_reference="true",
    focal_length=26.0,
    vertical_fov=53.0,
)
ZONELESS = replace(FACTS, utc_offset=None, utc_time=None)
NIGHT = datetime(2024, 6, 1, 23, 0, tzinfo=UTC)
TROMSO_NOON: dict[str, Any] = {"latitude": 69.65, "longitude": 18.96, "time": datetime(2024, 12, 21, 11, 0, tzinfo=UTC)}


def evidence_of(facts: PhotoFacts = FACTS, **said: Any) -> Evidence:
    return known(facts, Given(**said)).evidence


def sun_at(time: datetime, latitude: float = 48.14, longitude: float = 11.575) -> Any:
    azimuth, elevation = sun_position(time, latitude, longitude)
    return pytest.approx((float(elevation), float(azimuth)))


# From facts to evidence


def test_time_and_place_give_one_sun() -> None:
    (sun,) = evidence_of().candidates
    assert sun == sun_at(MORNING)
    assert sun == pytest.approx((35.9, 96.3), abs=0.2)


def test_nothing_known_is_no_evidence() -> None:
    assert evidence_of(PhotoFacts()) == Evidence()
    assert known(FACTS, Given(use_exif=False)).evidence == Evidence()


@pytest.mark.parametrize("lost", [{"latitude": None, "longitude": None}, {"utc_time": None, "local_time": None}])
def test_a_time_without_place_gives_no_sun_nor_the_other_way_round(lost: dict[str, None]) -> None:
    facts = replace(FACTS, **lost)
    assert evidence_of(facts).candidates == ()
    assert known(facts, Given()).warnings == ()


def test_a_local_time_gives_one_sun_a_zone() -> None:
    suns = evidence_of(ZONELESS).candidates
    assert len(suns) == len(zones(11.575)) == 6
    assert evidence_of().candidates[0] in [pytest.approx(sun) for sun in suns]
    elevations = [elevation for elevation, _ in suns]
    assert max(elevations) - min(elevations) > 30


def test_the_offset_of_the_user_ends_the_doubt() -> None:
    assert evidence_of(ZONELESS, utc_offset=2.0).candidates == evidence_of().candidates


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
    assert (hours in zones(longitude)) is there


@given(st.floats(-180, 180))
def test_every_longitude_has_its_own_zone(longitude: float) -> None:
    allowed = zones(longitude)
    assert 4 <= len(allowed) <= 14
    assert any(abs((zone - longitude / 15 + 12) % 24 - 12) <= 0.5 for zone in allowed)


# Headings


def test_a_true_heading_stays() -> None:
    assert (evidence_of().heading, evidence_of().heading_spread) == (60.0, COMPASS_SPREAD)


def test_a_magnetic_heading_is_turned_by_the_declination() -> None:
    found = evidence_of(replace(FACTS, heading_reference="magnetic"))
    off = magnetic_declination(48.14, 11.575, MORNING)
    assert off is not None
    assert found.heading == pytest.approx(60.0 + off)
    assert found.heading_spread == COMPASS_SPREAD


@pytest.mark.parametrize("lost", [{"latitude": None, "longitude": None}, {"utc_time": MORNING.replace(year=2005)}])
def test_an_unknown_declination_widens_the_heading(lost: dict[str, Any]) -> None:
    found = evidence_of(replace(FACTS, heading_reference="magnetic", **lost))
    assert found.heading == 60.0
    assert found.heading_spread == pytest.approx(math.hypot(COMPASS_SPREAD, 17.0))


def test_an_unknown_reference_widens_the_heading_by_the_declination() -> None:
    facts = replace(FACTS, heading_reference=None, latitude=47.6, longitude=-122.3)  # Seattle
    found = evidence_of(facts)
    assert found.heading == 60.0
    assert found.heading_spread == pytest.approx(math.hypot(COMPASS_SPREAD, 15.3), abs=0.2)


def test_a_heading_that_is_said_counts_for_more() -> None:
    found = evidence_of(replace(FACTS, heading_reference="magnetic"), heading=-30.0)
    assert (found.heading, found.heading_spread) == (330.0, GIVEN_HEADING_SPREAD)


# What the user says


def test_what_is_said_takes_the_place_of_the_facts() -> None:
    there = timezone(timedelta(hours=-4))
    said = Given(time=datetime(2023, 3, 3, 15, 0, tzinfo=there), latitude=40.7, longitude=-74.0, vertical_fov=33.0)
    found = known(FACTS, said)
    (sun,) = found.evidence.candidates
    assert sun == sun_at(datetime(2023, 3, 3, 19, 0, tzinfo=UTC), 40.7, -74.0)
    assert found.evidence.vertical_fov == 33.0
    assert found.warnings == ()


def test_a_local_time_that_is_said_does_not_borrow_the_photos_zone() -> None:
    assert len(evidence_of(time=datetime(2024, 6, 1, 12, 0)).candidates) == 6
    assert len(evidence_of(time=datetime(2024, 6, 1, 12, 0), utc_offset=2.0).candidates) == 1


@pytest.mark.parametrize(
    ("facts", "said", "part"),
    [
        (PhotoFacts(), {"time": MORNING}, "time"),
        (PhotoFacts(), {"latitude": 1.0, "longitude": 2.0}, "place"),
        (replace(FACTS, local_time=None), {"utc_offset": 1.0}, "offset"),
    ],
)
def test_what_is_said_in_vain_is_told(facts: PhotoFacts, said: dict[str, Any], part: str) -> None:
    (warning,) = known(facts, Given(**said)).warnings
    assert f"The {part}" in warning
    assert "not used" in warning


@pytest.mark.parametrize(
    "said",
    [
        {"latitude": 90.1, "longitude": 0.0},
        {"latitude": 0.0, "longitude": math.nan},
        {"latitude": 10.0},
        {"longitude": 10.0},
        {"time": MORNING, "utc_offset": 2.0},
        {"time": MORNING.replace(year=2101)},
        {"time": MORNING.replace(year=1)},
        {"utc_offset": 15.0},
        {"heading": 400.0},
        {"vertical_fov": 0.0},
        {"use_exif": False, "time": MORNING},
        {"use_exif": False, "latitude": 1.0, "longitude": 2.0},
        {"use_exif": False, "utc_offset": 2.0},
    ],
)
def test_the_impossible_and_the_contradictory_are_refused_in_one_sentence(said: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match=r"^[^\n]*\.$"):
        Given(**said)


# The sun below the horizon


def test_night_in_the_photo_is_told_and_not_used() -> None:
    found = known(replace(FACTS, utc_time=NIGHT), Given())
    assert found.evidence.candidates == ()
    assert found.sun_is_up
    (warning,) = found.warnings
    assert "below the horizon" in warning
    assert "not used" in warning
    assert "48" not in warning


@pytest.mark.parametrize("said", [{"time": NIGHT}, {"latitude": -48.0, "longitude": -170.0}])
def test_night_by_what_the_user_says_is_refused(said: dict[str, Any]) -> None:
    facts = FACTS if "time" in said else replace(FACTS, utc_time=MORNING.replace(hour=11))
    with pytest.raises(ParameterError, match=r"below the horizon \(.*night; civil twilight ends at 6°.*\.$"):
        known(facts, Given(**said))


def test_twilight_puts_the_sun_on_the_horizon_without_light() -> None:
    found = known(PhotoFacts(), Given(**TROMSO_NOON))
    ((elevation, azimuth),) = found.evidence.candidates
    assert elevation == 0.0
    assert azimuth == pytest.approx(180, abs=5)
    assert not found.sun_is_up
    (warning,) = found.warnings
    assert "civil twilight of the polar night" in warning


def test_half_a_sun_still_shines() -> None:
    """Bodo at the winter solstice: the centre is seen 0.1 deg below the horizon."""
    found = known(PhotoFacts(), Given(**{**TROMSO_NOON, "latitude": 67.3, "longitude": 14.4}))
    assert found.evidence.candidates[0][0] == 0.0
    assert found.sun_is_up
    assert found.warnings == ()


@pytest.mark.parametrize(
    ("latitude", "hour", "words"),
    [(75.0, 11, "nautical twilight of the polar night"), (88.0, 11, "polar night"), (50.0, 23, "(night;")],
)
def test_how_dark_it_is(latitude: float, hour: int, words: str) -> None:
    time = datetime(2024, 12, 21, hour, tzinfo=UTC)
    with pytest.raises(ParameterError) as caught:
        known(PhotoFacts(), Given(time=time, latitude=latitude, longitude=14.4))
    assert words in str(caught.value)


def test_zones_in_the_night_keep_their_turn() -> None:
    """Photos taken together share the zone by its place in the list."""
    suns = evidence_of(replace(ZONELESS, local_time=datetime(2024, 12, 21, 9, 0))).candidates
    assert len(suns) == 6
    assert min(elevation for elevation, _ in suns) < -6.0
    assert not any(-6.0 <= elevation < 0.0 for elevation, _ in suns)
    assert max(elevation for elevation, _ in suns) > 5.0


# Several photos


def test_photos_together_share_place_and_zone() -> None:
    facts = [replace(ZONELESS, latitude=None, longitude=None), FACTS, replace(ZONELESS, latitude=1.0)]
    for fact in of_one_place(facts):
        assert (fact.latitude, fact.longitude, fact.utc_time) == (FACTS.latitude, FACTS.longitude, MORNING)


def test_a_clock_beside_the_satellites_time_tells_the_zone() -> None:
    by_satellite = replace(FACTS, utc_offset=None, utc_time=MORNING + timedelta(seconds=40))
    later = replace(ZONELESS, local_time=datetime(2024, 6, 1, 10, 10))
    assert [fact.utc_time for fact in of_one_place([by_satellite, later])] == [
        MORNING + timedelta(seconds=40),
        MORNING + timedelta(hours=1),
    ]


def test_a_clock_that_runs_wrong_tells_no_zone_and_refuses_nothing() -> None:
    by_satellite = replace(FACTS, utc_offset=None, utc_time=MORNING + timedelta(minutes=23))
    sure, unsure = (k.evidence for k in known_together([by_satellite, ZONELESS], Given()))
    assert len(sure.candidates) == 1
    assert unsure.candidates == ()  # takes the other's
    _, said = (k.evidence for k in known_together([by_satellite, ZONELESS], Given(utc_offset=2.0)))
    assert len(said.candidates) == 1


def test_a_photo_of_night_leaves_no_time_to_the_others() -> None:
    day, night = known_together([FACTS, replace(FACTS, utc_time=NIGHT)], Given())
    assert day.evidence.candidates == night.evidence.candidates == ()
    assert "says that it was night" in day.warnings[-1]
    assert "below the horizon" in night.warnings[-1]
    assert [k.is_night for k in known_together([FACTS, FACTS], Given())] == [False, False]


def test_photos_that_know_nothing_stay_as_they_are() -> None:
    assert of_one_place([PhotoFacts(), PhotoFacts()]) == [PhotoFacts(), PhotoFacts()]


# The answer


def prediction(probability: Any = None) -> Prediction:
    cells = grid_directions(TINY.sun_grid)
    p = np.full(len(cells), 1 / len(cells)) if probability is None else probability
    return Prediction(TINY, p.astype(np.float32), 0.9, 3.0, 0.1, 4.0, -1.0, 50.0)


def answer(facts: PhotoFacts = FACTS, **said: Any) -> Lighting:
    found = known(facts, Given(**said))
    return estimate_of(fuse(prediction(), found.evidence), found).lighting


def test_the_answer_says_what_it_rests_on() -> None:
    assert answer().evidence == ("pixels", "time+place", "heading", "focal length")
    assert answer(use_exif=False).evidence == ("pixels",)
    assert answer(replace(FACTS, vertical_fov=None, heading=None)).evidence == ("pixels", "time+place")


def test_the_answer_holds_sun_lens_and_heading() -> None:
    light = answer()
    assert light.sun_elevation == pytest.approx(35.9, abs=0.2)
    assert light.vertical_fov == 53.0
    assert light.camera_heading == pytest.approx(60.0, abs=1.0)
    assert sum(light.camera_heading_probability) == pytest.approx(1.0, abs=1e-3)
    assert light.camera_heading_radius_50 is not None
    assert light.camera_heading_radius_90 is not None
    assert light.camera_heading_radius_50 < light.camera_heading_radius_90
    assert Lighting.from_dict(light.to_dict()) == light


def test_the_sun_is_a_compass() -> None:
    """With a sun seen 30 deg to the right, the camera points 30 deg left of the sun's compass azimuth."""
    found = known(replace(FACTS, heading=None), Given())
    elevation, azimuth = found.evidence.candidates[0]
    ahead = soft_label([math.sin(math.radians(30)), 0.6, -math.cos(math.radians(30))], 80.0, TINY.sun_grid)
    light = estimate_of(fuse(prediction(ahead), found.evidence), found).lighting
    assert light.camera_heading == pytest.approx(azimuth - light.sun_azimuth, abs=1.0)
    assert light.camera_heading == pytest.approx(azimuth - 30, abs=15.0)
    assert light.sun_elevation == pytest.approx(elevation, abs=0.1)


def test_the_place_is_told_only_if_asked_for() -> None:
    assert answer().latitude is None
    assert "place" not in answer().to_dict()
    assert "48.1" not in repr(known(FACTS, Given(keep_location=True)))
    kept = answer(keep_location=True)
    assert (kept.latitude, kept.longitude) == (48.14, 11.575)
    assert kept.to_dict()["place"] == {"latitude": 48.14, "longitude": 11.575}
    assert "48.1" not in repr(kept)


def test_no_direct_sunlight_in_twilight() -> None:
    light = answer(PhotoFacts(), **TROMSO_NOON)
    assert light.sun_visibility == 0.0
    assert light.sun_elevation == pytest.approx(0.0, abs=0.01)
    assert "twilight" in light.warnings[0]

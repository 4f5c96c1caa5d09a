"""Facts and what the user says, as evidence."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest

from lighting.errors import ParameterError
from lighting.evidence import Given
from lighting.evidence.declination import magnetic_declination
from lighting.evidence.facts import of_one_place
from lighting.evidence.fusion import COMPASS_SPREAD, Evidence
from lighting.evidence.metadata import GIVEN_HEADING_SPREAD, known, known_alone, known_together
from lighting.photo.exif import HeadingReference, PhotoFacts
from tests.lighting.evidence.samples import FACTS, MORNING, ZONELESS, evidence_of

NIGHT = datetime(2024, 6, 1, 23, 0, tzinfo=UTC)


TROMSO_NOON: dict[str, Any] = {"latitude": 69.65, "longitude": 18.96, "time": datetime(2024, 12, 21, 11, 0, tzinfo=UTC)}


def test_nothing_known_is_no_evidence() -> None:
    assert evidence_of(PhotoFacts()) == Evidence()
    assert known(FACTS, Given(use_exif=False)).evidence == Evidence()


@pytest.mark.parametrize("lost", [{"latitude": None, "longitude": None}, {"utc_time": None, "local_time": None}])
def test_a_time_without_place_gives_no_sun_nor_the_other_way_round(lost: dict[str, None]) -> None:
    facts = replace(FACTS, **lost)
    assert evidence_of(facts).candidates == ()
    assert known(facts, Given()).warnings == ()


def test_the_offset_of_the_user_ends_the_doubt() -> None:
    assert evidence_of(ZONELESS, utc_offset=2.0).candidates == evidence_of().candidates


def test_a_true_heading_stays() -> None:
    assert (evidence_of().heading, evidence_of().heading_spread) == (60.0, COMPASS_SPREAD)


def test_a_magnetic_heading_is_turned_by_the_declination() -> None:
    found = evidence_of(replace(FACTS, heading_reference=HeadingReference.MAGNETIC))
    off = magnetic_declination(48.14, 11.575, MORNING)
    assert off is not None
    assert found.heading == pytest.approx(60.0 + off)
    assert found.heading_spread == COMPASS_SPREAD


@pytest.mark.parametrize("lost", [{"latitude": None, "longitude": None}, {"utc_time": MORNING.replace(year=2005)}])
def test_an_unknown_declination_widens_the_heading(lost: dict[str, Any]) -> None:
    found = evidence_of(replace(FACTS, heading_reference=HeadingReference.MAGNETIC, **lost))
    assert found.heading == 60.0
    assert found.heading_spread == pytest.approx(math.hypot(COMPASS_SPREAD, 17.0))


def test_an_unknown_reference_widens_the_heading_by_the_declination() -> None:
    facts = replace(FACTS, heading_reference=None, latitude=47.6, longitude=-122.3)  # Seattle
    found = evidence_of(facts)
    assert found.heading == 60.0
    assert found.heading_spread == pytest.approx(math.hypot(COMPASS_SPREAD, 15.3), abs=0.2)


def test_a_heading_that_is_said_counts_for_more() -> None:
    found = evidence_of(replace(FACTS, heading_reference=HeadingReference.MAGNETIC), heading=-30.0)
    assert (found.heading, found.heading_spread) == (330.0, GIVEN_HEADING_SPREAD)


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


def test_a_heading_without_time_and_place_is_told_of_a_photo_alone() -> None:
    (warning,) = known_alone(PhotoFacts(), Given(heading=10.0)).warnings
    assert warning == "The heading was not used, because time and place of the photo are not both known."
    of_time, of_heading = known_alone(PhotoFacts(), Given(heading=10.0, time=MORNING)).warnings
    assert "The time was not used" in of_time
    assert of_heading == warning
    at_night = known_alone(replace(FACTS, utc_time=NIGHT), Given(heading=10.0))
    assert len(at_night.warnings) == 1
    assert known_alone(FACTS, Given(heading=10.0)).warnings == ()
    assert known_alone(PhotoFacts(heading=10.0), Given()).warnings == ()


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


def test_a_photo_of_night_leaves_no_time_to_the_others() -> None:
    day, night = known_together([FACTS, replace(FACTS, utc_time=NIGHT)], Given())
    assert day.evidence.candidates == night.evidence.candidates == ()
    assert "says that it was night" in day.warnings[-1]
    assert "below the horizon" in night.warnings[-1]
    assert [k.is_night for k in known_together([FACTS, FACTS], Given())] == [False, False]


def test_clocks_by_which_one_photo_is_of_night_in_every_zone_are_not_used() -> None:
    """Munich in June: by zones in which the first photo was taken by day, the second was taken at night."""
    early, late = (replace(ZONELESS, local_time=datetime(2024, 6, 1, hour)) for hour in (5, 23))
    for found in known_together([early, late], Given()):
        assert found.evidence.candidates == ()
        assert found.warnings[-1].startswith("Whatever the zone of their clocks, one of the photos")
    with pytest.raises(ParameterError, match="taken at night: too dark") as refused:
        known_together([early, late], Given(latitude=48.0, longitude=11.0))
    assert refused.value.field == "latitude"  # the times are the photos' own
    assert all(known.evidence.candidates for known in known_together([early, early], Given()))


def test_photos_of_different_places_are_told() -> None:
    assert FACTS.latitude is not None
    near, far = replace(FACTS, latitude=FACTS.latitude + 0.5), replace(FACTS, latitude=-FACTS.latitude)
    found = known_together([FACTS, near, far], Given())
    assert [bool(k.warnings) for k in found] == [False, False, True]
    assert "km from that of the first photo" in found[2].warnings[-1]
    assert not any(k.warnings for k in known_together([FACTS, far], Given(use_exif=False)))
    timeless = [replace(f, local_time=None, utc_time=None) for f in (FACTS, far)]
    assert not any(k.warnings for k in known_together(timeless, Given()))
    assert not any(k.warnings for k in known_together([FACTS, far], Given(latitude=48.0, longitude=11.0)))


def test_photos_that_know_nothing_stay_as_they_are() -> None:
    assert of_one_place([PhotoFacts(), PhotoFacts()]) == [PhotoFacts(), PhotoFacts()]

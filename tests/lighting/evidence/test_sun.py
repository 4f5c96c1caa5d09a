"""Where the sun stood, and how dark it was."""

from dataclasses import replace
from datetime import UTC, datetime

import pytest

from lighting.errors import ParameterError
from lighting.evidence import Given, zones
from lighting.evidence.metadata import known
from lighting.photo.exif import PhotoFacts
from tests.lighting.evidence.samples import MORNING, ZONELESS, evidence_of, sun_at


def test_time_and_place_give_one_sun() -> None:
    (sun,) = evidence_of().candidates
    assert sun == sun_at(MORNING)
    assert sun == pytest.approx((35.9, 96.3), abs=0.2)


def test_a_local_time_gives_one_sun_a_zone() -> None:
    suns = evidence_of(ZONELESS).candidates
    assert len(suns) == len(zones(48.14, 11.575)) == 6
    assert evidence_of().candidates[0] in [pytest.approx(sun) for sun in suns]
    elevations = [elevation for elevation, _ in suns]
    assert max(elevations) - min(elevations) > 30


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

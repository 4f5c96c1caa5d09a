"""Heading, latitude, date and clock from suns whose place and time are known."""

from dataclasses import replace
from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.evidence import Given
from lighting.evidence.ephemeris import sun_position
from lighting.evidence.fit import Series, fit, likely, series_of
from lighting.evidence.fusion import Evidence
from lighting.geometry import wrap_azimuth
from lighting.photo import PhotoFacts
from lighting.records import Light
from lighting.turns import Placed
from tests.lighting.evidence.test_fusion import lobe

HOURS = (-4.0, -1.5, 1.0, 3.5)  # from noon
WITHOUT_EXIF = Given(use_exif=False)
SHARP = 60.0  # concentration: about 7 deg around the true sun


def day(latitude: float, longitude: float, day_of_year: int, heading: float, lost: tuple[str, ...] = ()) -> Series:
    """Photos from a tripod over one day, by a network that sees the sun; `lost` facts are unknown."""
    noon = datetime(2025, 1, 1, 12, tzinfo=UTC) + timedelta(days=day_of_year - 1, hours=-longitude / 15)
    times = [noon + timedelta(hours=h) for h in HOURS]
    suns = [tuple(float(v) for v in sun_position(t, latitude, longitude)) for t in times]
    said = [lobe(azimuth - heading, elevation, SHARP) for azimuth, elevation in suns]
    unknown: dict[str, Any] = dict.fromkeys(lost)
    facts = [
        replace(PhotoFacts(t.replace(tzinfo=None), 0.0, t, latitude=latitude, longitude=longitude), **unknown)
        for t in times
    ]
    evidence = [Evidence(((elevation, azimuth),)) for azimuth, elevation in suns]
    return Series(said, facts, evidence, np.zeros(len(times)))


PLACES = [(47.0, 11.0, 172, 30.0), (-33.0, 151.0, 40, 200.0), (12.0, -70.0, 300, 300.0)]


@pytest.mark.parametrize("place", PLACES)
def test_the_heading_is_found(place: tuple[float, float, int, float]) -> None:
    found = fit(day(*place), "heading")
    assert abs(float(wrap_azimuth(found.heading - place[3]))) < 2.0
    assert found.heading_radius_50 < found.heading_radius_90 < 25.0
    assert set(found.to_dict()) == {"heading"}


@pytest.mark.parametrize("place", PLACES[1:])
def test_the_latitude_is_found_without_it(place: tuple[float, float, int, float]) -> None:
    found = fit(day(*place), "latitude")
    assert found.latitude is not None
    assert found.latitude.best == pytest.approx(place[0], abs=4.0)
    assert abs(float(wrap_azimuth(found.heading - place[3]))) < 2.0


def test_the_zone_of_the_clock_stands_in_for_the_longitude() -> None:
    found = fit(day(47.0, -5.0, 172, 30.0, lost=("latitude", "longitude")), "latitude")
    assert found.latitude is not None
    assert found.latitude.best == pytest.approx(47.0, abs=6.0)


@pytest.mark.parametrize("place", PLACES[:1])
def test_date_and_clock_are_found(place: tuple[float, float, int, float]) -> None:
    """Around the solstice there is one date with its declination, not two."""
    found = fit(day(*place), "time")
    assert found.day_of_year is not None
    assert found.clock_shift is not None
    assert found.day_of_year.best == pytest.approx(place[2], abs=20.0)
    assert found.clock_shift.best == pytest.approx(0.0, abs=0.5)


def test_days_of_winter_lie_within_the_year() -> None:
    found = fit(day(47.0, 11.0, 355, 30.0), "time").day_of_year
    assert found is not None
    ends = [end for interval in (*found.in_50, *found.in_90) for end in interval]
    assert min(ends) == 1.0
    assert max(ends) == 365.0


def test_without_a_zone_it_is_no_error_of_the_clock() -> None:
    """The same photos: the clock is right by its zone, and UTC's own where no zone is known."""
    lost = ("utc_time", "utc_offset")
    found = fit(day(*PLACES[0], lost=lost), "time")
    assert found.clock_shift is None
    assert found.utc_minus_clock is not None
    assert found.utc_minus_clock.best == pytest.approx(0.0, abs=0.5)
    assert set(found.to_dict()) == {"heading", "day_of_year", "utc_minus_clock"}


def test_what_speaks_against_a_photo_is_carried_along() -> None:
    whole = day(*PLACES[0])
    facts = [*whole.facts[:-1], replace(whole.facts[-1], latitude=-33.0, longitude=151.0)]
    odd = replace(whole.predictions[1], light=Light(np.ones(3), np.ones(3), 0.0, 0.0))
    said = [whole.predictions[0], odd, *whole.predictions[2:]]
    found = fit(series_of(said, facts, Given(), [0.0] * len(HOURS)), "heading")
    assert [w.split(":")[0] for w in found.warnings] == ["Photo 2", "Photo 4"]
    assert "does not look like an ordinary photo" in found.warnings[0]
    assert "Its own place lies 16" in found.warnings[1]
    assert found.to_dict()["warnings"] == list(found.warnings)


def test_a_photo_that_was_exposed_for_a_dark_scene_is_told_of() -> None:
    whole = day(*PLACES[0])
    said = [replace(p, light=Light(np.ones(3), np.ones(3), 0.0, 1.0)) for p in whole.predictions]
    facts = [replace(fact, exposure_value=ev) for fact, ev in zip(whole.facts, (14.0, 5.0, 14.0, 14.0), strict=True)]
    with_exif, without = (series_of(said, facts, g, [0.0] * len(HOURS)).warnings for g in (Given(), WITHOUT_EXIF))
    assert [w.split(":")[0] for w in with_exif] == ["Photo 2", "Photo 2"]
    assert "exposed for a dark scene (EV 5.0 at ISO 100)" in with_exif[0]
    assert without == ()


def test_a_latitude_that_is_given_and_fitted_is_said_to_be_unused() -> None:
    whole = day(*PLACES[1])
    given = Given(latitude=-33.0, longitude=151.0)
    at, stated = (series_of(whole.predictions, whole.facts, g, [0.0] * len(HOURS)) for g in (Given(), given))
    assert fit(at, "latitude").warnings == ()
    assert fit(stated, "heading").warnings == ()
    assert fit(stated, "latitude").warnings == (
        "The latitude that was given was not used, since it is what is fitted.",
    )


@pytest.mark.parametrize(
    ("kind", "lost", "needs"),
    [
        ("heading", ("latitude", "longitude"), "when and where"),
        ("latitude", ("utc_time",), "when they were taken, with the zone"),
        ("latitude", ("longitude", "latitude", "utc_offset"), "longitude or the zone"),
        ("time", ("latitude",), "where they are"),
    ],
)
def test_what_is_missing_is_named(kind: str, lost: tuple[str, ...], needs: str) -> None:
    whole = day(47.0, 11.0, 172, 30.0, lost)
    evidence = [Evidence()] * len(HOURS) if kind == "heading" else whole.evidence
    with pytest.raises(ParameterError, match=needs):
        fit(Series(whole.predictions, whole.facts, evidence, whole.turns), kind)


def test_photos_that_nothing_connects_need_their_headings() -> None:
    whole = day(47.0, 11.0, 172, 30.0)
    apart = [Placed(min(i, 1), 0.0, 0.0, 0.0, 0.0, 50.0) for i in range(len(HOURS))]
    with pytest.raises(ParameterError, match="Photo 2 shows nothing"):
        series_of(whole.predictions, whole.facts, Given(), None, apart)
    stated = series_of(whole.predictions, whole.facts, Given(), [10.0] * len(HOURS))
    assert not stated.turns.any()


def test_likely_values_are_intervals_that_hold_their_share() -> None:
    values = np.arange(10.0)
    found = likely(values, np.array([0, 4, 5, 0, 0, 0, 0, 1, 0, 0], float))
    assert found.in_50 == ((1.5, 2.5),)
    assert found.in_90 == ((0.5, 2.5),)
    assert found.best == 2.0

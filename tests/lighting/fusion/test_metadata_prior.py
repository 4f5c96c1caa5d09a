"""What a photo's metadata tell: suns, heading, declination, daylight."""

import math
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest

from lighting.errors import ParameterError
from lighting.fusion.estimate import build_estimate
from lighting.fusion.metadata_prior import (
    USER_HEADING_STD,
    observations_from_metadata,
    observations_multi,
    observations_single,
    share_location,
)
from lighting.fusion.multi_view import fuse_views
from lighting.fusion.single_view import COMPASS_STD, Observations, fuse
from lighting.fusion.user_input import UserInput
from lighting.geometry import wrap_azimuth
from lighting.photo.metadata import HeadingReference, PhotoMetadata
from lighting.prediction import Light
from lighting.records import Lighting
from tests.helpers.predictions import METADATA, MORNING, ZONELESS, clock, observations_of, prediction


def declination(latitude: float, longitude: float, time: datetime) -> float | None:
    """By how much [deg] a magnetic heading is turned; None where it stays, and is less sure."""
    reference = HeadingReference.MAGNETIC
    metadata = PhotoMetadata(gps_time=time.replace(tzinfo=UTC), heading=0.0, heading_reference=reference)
    found = observations_of(replace(metadata, latitude=latitude, longitude=longitude))
    assert found.heading is not None
    return float(wrap_azimuth(found.heading)) if found.heading_std == COMPASS_STD else None


@pytest.mark.parametrize(
    ("latitude", "longitude", "year", "expected"),
    [  # from the test values that NOAA publishes with the model of 2020, at sea level or nearly
        (80.0, 0.0, 2020.0, -1.28),
        (0.0, 120.0, 2020.0, 0.16),
    ],
)
def test_published_values(latitude: float, longitude: float, year: float, expected: float) -> None:
    assert declination(latitude, longitude, datetime(int(year), 1, 1)) == pytest.approx(expected, abs=0.05)


def test_east_is_positive() -> None:
    assert declination(47.6, -122.3, datetime(2022, 7, 1)) == pytest.approx(15.3, abs=0.5)  # Seattle
    assert declination(44.6, -63.6, datetime(2022, 7, 1)) == pytest.approx(-16.4, abs=0.7)  # Halifax


@pytest.mark.parametrize("time", [datetime(2009, 12, 31), datetime(2030, 1, 1)])
def test_unknown_outside_the_models_years(time: datetime) -> None:
    assert declination(48.0, 11.0, time) is None


@pytest.mark.parametrize("time", [datetime(2010, 1, 1), datetime(2024, 12, 31, 23, 59), datetime(2029, 12, 31, 23, 59)])
def test_known_to_the_last_day(time: datetime) -> None:
    assert declination(48.0, 11.0, time) == pytest.approx(3.5, abs=1.8)


def test_unknown_where_compasses_fail() -> None:
    assert declination(86.5, 160.0, datetime(2022, 1, 1)) is None


def test_threads_do_not_disturb_each_other() -> None:
    places = [(-60.0 + i % 120, -180.0 + 3 * (i % 120)) for i in range(1200)]

    def there(place: tuple[float, float]) -> float | None:
        return declination(*place, datetime(2024, 6, 1))

    with ThreadPoolExecutor(8) as pool:
        assert list(pool.map(there, places)) == list(map(there, places))


SUITS = replace(prediction(), light=Light(np.ones(3), np.ones(3), 0.0, 0.99))
DARK = "The photo was exposed for the dark (EV 5.0): probably night or indoors."


def answered(metadata: PhotoMetadata, given: UserInput | None = None) -> Lighting:
    found = observations_from_metadata(metadata, given or UserInput())
    return build_estimate(fuse(SUITS, found.observations), found).lighting


@pytest.mark.parametrize(
    ("exposure_value", "low", "high"),
    [(15.0, 0.99, 1.0), (12.0, 0.99, 1.0), (10.0, 0.95, 1.0), (8.0, 0.5, 0.5), (6.0, 0.0, 0.05), (-20.0, 0.0, 1e-9)],
)
def test_daylight_is_bright(exposure_value: float, low: float, high: float) -> None:
    probability = (answered(PhotoMetadata(exposure_value=exposure_value)).suitable or 0.0) / 0.99
    assert low - 1e-4 <= probability <= high + 1e-4


def test_only_dark_scenes_are_told_of() -> None:
    assert DARK not in answered(PhotoMetadata(exposure_value=12.0)).warnings
    assert answered(PhotoMetadata(exposure_value=5.0)).warnings[0] == DARK


def test_a_photo_of_a_dark_scene_does_not_suit() -> None:
    light = answered(PhotoMetadata(exposure_value=5.0))
    assert light.suitable == pytest.approx(0.99 / (1 + 2.0 ** (2.5 * (8.0 - 5.0))), rel=1e-5)
    assert light.warnings[0] == DARK
    assert "do not trust this result" in light.warnings[1]
    assert light.evidence == ("pixels", "camera exposure")


def test_a_bright_one_suits_as_the_pixels_say() -> None:
    light = answered(PhotoMetadata(exposure_value=14.0))
    assert light.suitable == pytest.approx(0.99, abs=1e-4)
    assert light.warnings == ()


def test_without_exif_the_exposure_does_not_count() -> None:
    light = answered(PhotoMetadata(exposure_value=5.0), UserInput(metadata=False))
    assert (light.suitable, light.warnings, light.evidence) == (0.99, (), ("pixels",))


def test_an_exposure_is_not_used_where_the_network_does_not_say_what_suits() -> None:
    found = observations_from_metadata(PhotoMetadata(exposure_value=5.0), UserInput())
    light = build_estimate(fuse(prediction(), found.observations), found).lighting
    assert (light.suitable, light.warnings, light.evidence) == (None, (), ("pixels",))


def test_in_twilight_no_photo_suits() -> None:
    """The sun sets at 19:07 UTC."""
    light = answered(replace(METADATA, local_time=clock(datetime(2024, 6, 1, 19, 25, tzinfo=UTC))))
    assert light.suitable == 0.1
    assert "civil twilight" in light.warnings[0]


def test_each_of_several_photos_has_its_own_exposure() -> None:
    found = [observations_from_metadata(PhotoMetadata(exposure_value=value), UserInput()) for value in (14.0, 5.0)]
    fused = fuse_views([SUITS, SUITS], [k.observations for k in found], [0.0, 0.0])
    bright, dark = (build_estimate(f, k).lighting for f, k in zip(fused, found, strict=True))
    assert bright.suitable == pytest.approx(0.99, abs=1e-4)
    assert dark.suitable == pytest.approx(0.99 / (1 + 2.0 ** (2.5 * (8.0 - 5.0))), rel=1e-5)
    assert dark.evidence == ("pixels", "camera exposure", "other photos")


NIGHT = datetime(2024, 6, 1, 23, 0, tzinfo=UTC)


TROMSO_NOON: dict[str, Any] = {"latitude": 69.65, "longitude": 18.96, "time": datetime(2024, 12, 21, 11, 0, tzinfo=UTC)}


def test_nothing_known_is_no_evidence() -> None:
    assert observations_of(PhotoMetadata()) == Observations()
    assert observations_from_metadata(METADATA, UserInput(metadata=False)).observations == Observations()


@pytest.mark.parametrize("lost", [{"latitude": None, "longitude": None}, {"local_time": None}])
def test_a_time_without_place_gives_no_sun_nor_the_other_way_round(lost: dict[str, Any]) -> None:
    metadata = replace(METADATA, **lost)
    assert observations_of(metadata).candidates == ()
    assert observations_from_metadata(metadata, UserInput()).warnings == ()


def test_the_offset_of_the_user_ends_the_doubt() -> None:
    assert observations_of(ZONELESS, utc_offset=2.0).candidates == observations_of().candidates


def test_a_true_heading_stays() -> None:
    assert (observations_of().heading, observations_of().heading_std) == (60.0, COMPASS_STD)


def test_a_magnetic_heading_is_turned_by_the_declination() -> None:
    found = observations_of(replace(METADATA, heading_reference=HeadingReference.MAGNETIC))
    assert found.heading == pytest.approx(64.5, abs=0.3)  # Munich in 2024
    assert found.heading_std == COMPASS_STD


@pytest.mark.parametrize(
    "lost", [{"latitude": None, "longitude": None}, {"local_time": clock(MORNING.replace(year=2005))}]
)
def test_an_unknown_declination_widens_the_heading(lost: dict[str, Any]) -> None:
    found = observations_of(replace(METADATA, heading_reference=HeadingReference.MAGNETIC, **lost))
    assert found.heading == 60.0
    assert found.heading_std == pytest.approx(math.hypot(COMPASS_STD, 17.0))


def test_an_unknown_reference_widens_the_heading_by_the_declination() -> None:
    metadata = replace(METADATA, heading_reference=None, latitude=47.6, longitude=-122.3)  # Seattle
    found = observations_of(metadata)
    assert found.heading == 60.0
    assert found.heading_std == pytest.approx(math.hypot(COMPASS_STD, 15.3), abs=0.2)


def test_a_heading_that_is_said_counts_for_more() -> None:
    found = observations_of(replace(METADATA, heading_reference=HeadingReference.MAGNETIC), heading=-30.0)
    assert (found.heading, found.heading_std) == (330.0, USER_HEADING_STD)


@pytest.mark.parametrize(
    ("metadata", "stated", "part"),
    [
        (PhotoMetadata(), {"time": MORNING}, "time"),
        (PhotoMetadata(), {"latitude": 1.0, "longitude": 2.0}, "place"),
        (replace(METADATA, local_time=None, gps_time=MORNING), {"utc_offset": 1.0}, "offset"),
    ],
)
def test_what_is_said_in_vain_is_told(metadata: PhotoMetadata, stated: dict[str, Any], part: str) -> None:
    (warning,) = observations_from_metadata(metadata, UserInput(**stated)).warnings
    assert f"The {part}" in warning
    assert "not used" in warning


def test_a_heading_without_time_and_place_is_told_of_a_photo_alone() -> None:
    (warning,) = observations_single(PhotoMetadata(), UserInput(heading=10.0)).warnings
    assert warning == "The heading was not used: time and place are not both known."
    of_time, of_heading = observations_single(PhotoMetadata(), UserInput(heading=10.0, time=MORNING)).warnings
    assert "The time was not used" in of_time
    assert of_heading == warning
    at_night = observations_single(replace(METADATA, local_time=clock(NIGHT)), UserInput(heading=10.0))
    assert len(at_night.warnings) == 1
    assert observations_single(METADATA, UserInput(heading=10.0)).warnings == ()
    assert observations_single(PhotoMetadata(heading=10.0), UserInput()).warnings == ()


def test_night_in_the_photo_is_told_and_not_used() -> None:
    found = observations_from_metadata(replace(METADATA, local_time=clock(NIGHT)), UserInput())
    assert found.observations.candidates == ()
    assert found.twilight_sun is None
    (warning,) = found.warnings
    assert "below the horizon" in warning
    assert "not used" in warning
    assert "48" not in warning


@pytest.mark.parametrize("stated", [{"time": NIGHT}, {"latitude": -48.0, "longitude": -170.0}])
def test_night_by_what_the_user_says_is_refused(stated: dict[str, Any]) -> None:
    metadata = METADATA if "time" in stated else replace(METADATA, local_time=clock(MORNING.replace(hour=11)))
    with pytest.raises(ParameterError, match=r"below the horizon \(.*night; civil twilight ends at 6°.*\.$"):
        observations_from_metadata(metadata, UserInput(**stated))


def test_twilight_puts_the_sun_on_the_horizon_without_light() -> None:
    found = observations_from_metadata(PhotoMetadata(), UserInput(**TROMSO_NOON))
    ((elevation, azimuth),) = found.observations.candidates
    assert elevation == 0.0
    assert azimuth == pytest.approx(180, abs=5)
    assert found.twilight_sun == pytest.approx(-3.1, abs=0.2)
    (warning,) = found.warnings
    assert warning == "The sun is 3.1° below the horizon (civil twilight): the answer has no direct sunlight."


def test_half_a_sun_still_shines() -> None:
    """Bodo at the winter solstice: the center is seen 0.1 deg below the horizon."""
    found = observations_from_metadata(
        PhotoMetadata(), UserInput(**{**TROMSO_NOON, "latitude": 67.3, "longitude": 14.4})
    )
    assert found.observations.candidates[0][0] == 0.0
    assert found.twilight_sun is None
    assert found.warnings == ()


def test_a_photo_of_night_leaves_no_time_to_the_others() -> None:
    day, night = observations_multi([METADATA, replace(METADATA, local_time=clock(NIGHT))], UserInput())
    assert day.observations.candidates == night.observations.candidates == ()
    assert "was taken at night" in day.warnings[-1]
    assert "below the horizon" in night.warnings[-1]
    assert [k.is_night for k in observations_multi([METADATA, METADATA], UserInput())] == [False, False]


def test_clocks_by_which_one_photo_is_of_night_in_every_zone_are_not_used() -> None:
    """At sea in June: by zones in which the first photo was taken by day, the second was taken at night."""
    at_sea = replace(ZONELESS, latitude=50.0, longitude=-30.0)
    early, late = (replace(at_sea, local_time=datetime(2024, 6, 1, *time)) for time in ((2, 30), (21, 30)))
    for found in observations_multi([early, late], UserInput()):
        assert found.observations.candidates == ()
        assert found.warnings[-1].startswith("One photo is of the night in every zone")
    with pytest.raises(ParameterError, match="in every zone: too dark") as refused:
        observations_multi([early, late], UserInput(latitude=50.5, longitude=-30.0))
    assert refused.value.field == "latitude"  # the times are the photos' own
    assert all(known.observations.candidates for known in observations_multi([early, early], UserInput()))


def test_photos_of_different_places_are_told() -> None:
    assert METADATA.latitude is not None
    near, far = replace(METADATA, latitude=METADATA.latitude + 0.5), replace(METADATA, latitude=-METADATA.latitude)
    found = observations_multi([METADATA, near, far], UserInput())
    assert [bool(k.warnings) for k in found] == [False, False, True]
    assert "km from the first photo's" in found[2].warnings[-1]
    assert not any(k.warnings for k in observations_multi([METADATA, far], UserInput(metadata=False)))
    timeless = [replace(f, local_time=None) for f in (METADATA, far)]
    assert not any(k.warnings for k in observations_multi(timeless, UserInput()))
    assert not any(k.warnings for k in observations_multi([METADATA, far], UserInput(latitude=48.0, longitude=11.0)))


def test_photos_that_know_nothing_stay_as_they_are() -> None:
    assert share_location([PhotoMetadata(), PhotoMetadata()]) == [PhotoMetadata(), PhotoMetadata()]

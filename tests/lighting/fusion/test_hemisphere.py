"""Places whose file states no hemisphere."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import product

import pytest

from lighting.fusion.timezones import resolve_hemisphere
from lighting.photo.metadata import PhotoMetadata
from lighting.records import warning_code

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

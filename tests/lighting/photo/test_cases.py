"""What files say of their time in the wild: spellings, clocks that contradict each other, and what is right.

Each row is a situation that people report of cameras and programs; the tags are invented to fit one sun. The picture
is a lobe of probability at the sun's elevation, so that the pixels can choose where the file is in doubt.
"""

import csv
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image

from lighting.errors import PhotoError, WarningCode, warning_code
from lighting.fusion.estimate import build_estimate
from lighting.fusion.instants import resolve_instants
from lighting.fusion.metadata_prior import observations_single
from lighting.fusion.single_view import fuse
from lighting.fusion.time_zones import resolve_hemisphere
from lighting.fusion.user_input import UserInput
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import Photo, read_photo
from lighting.photo.timestamps import to_utc
from lighting.records import Lighting
from tests.conftest import encode, exif
from tests.helpers.photos import packet
from tests.helpers.predictions import lobe_prediction

SCENE = np.full((48, 64, 3), 120, np.uint8)

MUNICH = {"place": (48.14, 11.58), "DateTimeOriginal": "2024:06:01 18:49:00", "sun": 20.0}
DENVER = {"place": (39.74, -104.99), "DateTimeOriginal": "2025:09:14 08:18:00", "sun": 17.8}
AUCKLAND = {"place": (-36.85, 174.76), "DateTimeOriginal": "2024:02:03 18:54:00", "sun": 17.9}
HELSINKI = {"place": (60.17, 24.94), "DateTimeOriginal": "2024:06:15 19:22:00", "heading": 224.35, "sun": 20.0}
KATHMANDU = {"place": (27.7, 85.32), "DateTimeOriginal": "2023:10:30 11:16:00", "sun": 47.9}
APIA = {"place": (-13.83, -171.77), "DateTimeOriginal": "2024:02:03 09:18:00", "sun": 40.9}
UTC_OF = {
    -13.83: datetime(2024, 2, 2, 20, 18, tzinfo=UTC),
    48.14: datetime(2024, 6, 1, 16, 49, tzinfo=UTC),
    39.74: datetime(2025, 9, 14, 14, 18, tzinfo=UTC),
    -36.85: datetime(2024, 2, 3, 5, 54, tzinfo=UTC),
    60.17: datetime(2024, 6, 15, 16, 22, tzinfo=UTC),
    27.7: datetime(2023, 10, 30, 5, 31, tzinfo=UTC),
}


ARABIC = "2024:06:01 18:49:00".translate({ord("0") + digit: 0x660 + digit for digit in range(10)})


def degrees(angle: float) -> tuple[float, float, float]:
    return (float(int(abs(angle))), 60.0 * (abs(angle) % 1.0), 0.0)


def file_of(tags: dict[str, Any]) -> bytes:
    """A JPEG with these tags; `place`, `heading` and `gps` stand for several, `main` for those of the first IFD."""
    base, gps = ExifTags.Base, ExifTags.GPS
    position: dict[int, Any] = {}
    if "place" in tags:
        latitude, longitude = tags["place"]
        position |= {gps.GPSLatitude: degrees(latitude), gps.GPSLatitudeRef: "NS"[latitude < 0]}
        position |= {gps.GPSLongitude: degrees(longitude), gps.GPSLongitudeRef: "EW"[longitude < 0]}
    if "heading" in tags:
        position |= {gps.GPSImgDirection: tags["heading"], gps.GPSImgDirectionRef: "T"}
    if "gps" in tags:
        date, _, time = tags["gps"].rpartition(" ")
        position |= {gps.GPSTimeStamp: tuple(map(float, time.split(":")))}
        position |= {gps.GPSDateStamp: date} if date else {}
    camera: dict[int, Any] = {
        base[name]: value for name, value in tags.items() if name in base.__members__ and value is not None
    }
    if "zone" in tags:
        camera[0x882A] = tags["zone"]
    block = exif(camera, position)
    for name, value in tags.get("main", {}).items():
        block[base[name]] = value
    return encode(SCENE, exif=block, **({"xmp": tags["xmp"]} if "xmp" in tags else {}))


def answer(metadata: PhotoMetadata, sun: float, heading: float | None = None, **stated: Any) -> Lighting:
    """The answer about a picture whose pixels show the sun's elevation, and its azimuth where a heading is noted."""
    prior = observations_single(metadata, UserInput(**stated))
    azimuth = 57.6 if heading is not None else 20.0
    return build_estimate(fuse(lobe_prediction(azimuth, sun, 30.0), prior.observations), prior).lighting


def clock_warnings(light: Lighting) -> list[str]:
    codes = (WarningCode.CLOCK_CONTRADICTED, WarningCode.OFFSET_REPLACED)
    return [warning for warning in light.warnings if warning_code(warning) in codes]


ZONE, FILE, GPS = "zone of the place", "offset in the file", "GPS"

SPELLINGS: dict[str, tuple[dict[str, Any], dict[str, Any], float | None, str]] = {
    "Z in the date": (MUNICH, {"DateTimeOriginal": "2024:06:01 16:49:00Z"}, 0.0, FILE),
    "z in the date": (MUNICH, {"DateTimeOriginal": "2024:06:01 16:49:00z"}, 0.0, FILE),
    "offset in the date": (MUNICH, {"DateTimeOriginal": "2024:06:01 18:49:00+02:00"}, 2.0, FILE),
    "offset without a colon": (DENVER, {"DateTimeOriginal": "2025-09-14T08:18:00-0600"}, -6.0, FILE),
    "fraction and Z": (DENVER, {"DateTimeOriginal": "2025:09:14 14:18:00.250Z"}, 0.0, FILE),
    "ISO of an app": (MUNICH, {"DateTimeOriginal": "2024-06-01T16:49:00Z"}, 0.0, FILE),
    "basic ISO": (MUNICH, {"DateTimeOriginal": "20240601T184900+0200"}, 2.0, FILE),
    "zone by name in the date": (MUNICH, {"DateTimeOriginal": "2024-06-01T18:49:00+02:00[Europe/Berlin]"}, 2.0, FILE),
    "IANA zone as offset": (MUNICH, {"OffsetTimeOriginal": "Europe/Paris"}, 2.0, FILE),
    "abbreviation": (MUNICH, {"OffsetTimeOriginal": "CEST"}, 2.0, FILE),
    "UTC+2": (MUNICH, {"OffsetTimeOriginal": "UTC+2"}, 2.0, FILE),
    "GMT-06:00": (DENVER, {"OffsetTimeOriginal": "GMT-06:00"}, -6.0, FILE),
    "seconds of the offset": (KATHMANDU, {"OffsetTimeOriginal": "+05:45:00"}, 5.75, FILE),
    "date of Java": (MUNICH, {"DateTimeOriginal": "Sat Jun 01 18:49:00 GMT+02:00 2024"}, 2.0, FILE),
    "date of mail": (MUNICH, {"DateTimeOriginal": "Sat, 1 Jun 2024 18:49:00 +0200"}, 2.0, FILE),
    "date of C": (MUNICH, {"DateTimeOriginal": "Sat Jun  1 18:49:00 2024"}, 2.0, ZONE),
    "month by name, PM": (MUNICH, {"DateTimeOriginal": "June 1st, 2024 at 6:49 PM"}, 2.0, ZONE),
    "seconds since 1970": (MUNICH, {"DateTimeOriginal": "1717260540"}, 0.0, FILE),
    "thousandths since 1970": (MUNICH, {"DateTimeOriginal": "1717260540000"}, 0.0, FILE),
    "hyphens alone": (MUNICH, {"DateTimeOriginal": "2024-06-01-18-49-00"}, 2.0, ZONE),
    "zone by name alone": (MUNICH, {"DateTimeOriginal": "2024-06-01T18:49:00[Europe/Rome]"}, 2.0, FILE),
    "German abbreviation": (MUNICH, {"DateTimeOriginal": "2024:06:01 18:49:00 MESZ"}, 2.0, FILE),
    "Portuguese PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 06:49:00 da tarde", "zone": 2}, 2.0, FILE),
    "minutes of the offset behind a dot": (KATHMANDU, {"OffsetTimeOriginal": "+5.45"}, 5.75, FILE),
    "an offset that is none": (MUNICH, {"OffsetTimeOriginal": "120"}, 2.0, ZONE),
    "PM": (HELSINKI, {"DateTimeOriginal": "2024:06:15 07:22:00 PM", "OffsetTimeOriginal": "+03:00"}, 3.0, FILE),
    "p.m.": (HELSINKI, {"DateTimeOriginal": "2024:06:15 07:22:00\xa0p.m.", "OffsetTimeOriginal": "+03:00"}, 3.0, FILE),
    "AM": (DENVER, {"DateTimeOriginal": "2025:09:14 08:18:00 a.m.", "OffsetTimeOriginal": "-06:00"}, -6.0, FILE),
    "Chinese PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 下午06:49:00".encode(), "zone": 2}, 2.0, FILE),
    "Korean PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 오후 6:49:00".encode(), "zone": 2}, 2.0, FILE),
    "24 hours and PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 18:49:00下午".encode(), "zone": 2}, 2.0, FILE),
    "Arabic digits": (MUNICH, {"DateTimeOriginal": ARABIC.encode()}, 2.0, ZONE),
    "Buddhist year": (MUNICH, {"DateTimeOriginal": "2567:06:01 18:49:00"}, 2.0, ZONE),
    "no seconds": (MUNICH, {"DateTimeOriginal": "2024:06:01 18:49"}, 2.0, ZONE),
    "no seconds, behind UTC": (DENVER, {"DateTimeOriginal": "2025-09-14T08:18-06:00"}, -6.0, FILE),
    "no seconds, dashes": (MUNICH, {"DateTimeOriginal": "2024-06-01 18:49", "OffsetTimeOriginal": "+02:00"}, 2.0, FILE),
    "slashes": (MUNICH, {"DateTimeOriginal": "2024/06/01 18:49:00"}, 2.0, ZONE),
    "a NUL too many": (MUNICH, {"DateTimeOriginal": "2024:06:01 18:49:00\0\0"}, 2.0, ZONE),
    "OffsetTime alone": (MUNICH, {"OffsetTime": "+02:00"}, 2.0, FILE),
    "OffsetTimeDigitized alone": (MUNICH, {"OffsetTimeDigitized": "+02:00"}, 2.0, FILE),
    "the original's offset first": (MUNICH, {"OffsetTimeOriginal": "+02:00", "OffsetTime": "+01:00"}, 2.0, FILE),
    "the offset of a later edit": (
        MUNICH,
        {"OffsetTime": "+01:00", "main": {"DateTime": "2024:12:24 10:00:00"}},
        2.0,
        ZONE,
    ),
    "TimeZoneOffset": (MUNICH, {"zone": 2}, 2.0, FILE),
    "TimeZoneOffset of two": (DENVER, {"zone": (-6, -6)}, -6.0, FILE),
    "TimeZoneOffset without a sign": (DENVER, {"zone": 65530}, -6.0, FILE),
    "the writing's time alone": (
        MUNICH,
        {"DateTimeOriginal": None, "main": {"DateTime": "2024:06:01 18:49:00"}, "OffsetTime": "+02:00"},
        2.0,
        FILE,
    ),
    "the writing's time by a camera's firmware": (
        MUNICH,
        {"DateTimeOriginal": None, "main": {"DateTime": "2024:06:01 18:49:00", "Software": "17.5.1", "Make": "Apple"}},
        2.0,
        ZONE,
    ),
    "the writing's time by a phone's build": (
        MUNICH,
        {
            "DateTimeOriginal": None,
            "main": {"DateTime": "2024:06:01 18:49:00", "Software": "G991BXXU3AUGM", "Make": "samsung"},
        },
        2.0,
        ZONE,
    ),
    "the writing's time in XMP": (
        MUNICH,
        {
            "DateTimeOriginal": None,
            "xmp": packet("http://ns.adobe.com/xap/1.0/", {"ModifyDate": "2024-06-01T18:49:00+02:00"}),
        },
        2.0,
        FILE,
    ),
    "the writing's time of the same second": (
        DENVER,
        {"xmp": packet("http://ns.adobe.com/xap/1.0/", {"ModifyDate": "2025-09-14T08:18:00-06:00"}, True)},
        -6.0,
        FILE,
    ),
    "an offset alone in XMP": (
        DENVER,
        {"xmp": packet("http://cipa.jp/exif/1.0/", {"OffsetTimeOriginal": "-06:00"})},
        -6.0,
        FILE,
    ),
    "the offset of a later edit in XMP": (
        MUNICH,
        {"xmp": packet("http://cipa.jp/exif/1.0/", {"OffsetTime": "+01:00"})},
        2.0,
        ZONE,
    ),
    "an offset in quotes": (MUNICH, {"OffsetTimeOriginal": '"+02:00"'}, 2.0, FILE),
    "Swahili PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 06:49:00 alasiri"}, 2.0, ZONE),
    "Malay PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 PTG 06:49:00"}, 2.0, ZONE),
    "Tamil PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 பிற்பகல் 6:49:00".encode()}, 2.0, ZONE),
    "Lao PM": (MUNICH, {"DateTimeOriginal": "2024:06:01 06:49:00 ຫຼັງທ່ຽງ".encode()}, 2.0, ZONE),
    "no zone at all": (KATHMANDU, {}, 5.75, ZONE),
    "XMP of the same second": (
        DENVER,
        {"xmp": packet("http://ns.adobe.com/exif/1.0/", {"DateTimeOriginal": "2025-09-14T08:18:00-06:00"})},
        -6.0,
        FILE,
    ),
    "offset of its own in XMP": (
        DENVER,
        {
            "DateTimeOriginal": None,
            "xmp": packet(
                "http://ns.adobe.com/exif/1.0/",
                {"DateTimeOriginal": "2025-09-14T08:18:00", "OffsetTimeOriginal": "-06:00"},
            ),
        },
        -6.0,
        FILE,
    ),
    "XMP in UTC": (
        DENVER,
        {"xmp": packet("http://ns.adobe.com/exif/1.0/", {"DateTimeOriginal": "2025-09-14T14:18:00Z"})},
        -6.0,
        FILE,
    ),
    "Photoshop's date": (
        KATHMANDU,
        {"xmp": packet("http://ns.adobe.com/photoshop/1.0/", {"DateCreated": "2023-10-30T11:16:00+05:45"}, True)},
        5.75,
        FILE,
    ),
    "XMP alone": (
        MUNICH,
        {
            "DateTimeOriginal": None,
            "xmp": packet("http://ns.adobe.com/xap/1.0/", {"CreateDate": "2024-06-01T18:49:00+02:00"}),
        },
        2.0,
        FILE,
    ),
    "XMP without seconds": (
        DENVER,
        {
            "DateTimeOriginal": "2025:09:14 08:18:23",
            "xmp": packet("http://ns.adobe.com/xap/1.0/", {"CreateDate": "2025-09-14T08:18-06:00"}),
        },
        -6.0,
        FILE,
    ),
    "GPS without a date behind the date line": (APIA, {"gps": "20:18:00"}, 13.0, ZONE),
    "GPS of the same time": (MUNICH, {"gps": "2024:06:01 16:49:00"}, 2.0, GPS),
    "GPS a minute late": (MUNICH, {"gps": "2024:06:01 16:50:01", "OffsetTimeOriginal": "+02:00"}, 2.0, FILE),
    "GPS a minute late, no offset": (MUNICH, {"gps": "2024:06:01 16:50:01"}, 2.0, GPS),
    "GPS without a date": (MUNICH, {"gps": "16:49:00"}, 2.0, GPS),
    "GPS without a date by the date line": (AUCKLAND, {"gps": "05:54:00"}, 13.0, GPS),
    "home zone abroad": (
        DENVER,
        {"DateTimeOriginal": "2025:09:14 16:18:00", "OffsetTimeOriginal": "+02:00", "gps": "2025:09:14 14:18:00"},
        2.0,
        FILE,
    ),
    "home zone abroad by GPS": (
        DENVER,
        {"DateTimeOriginal": "2025:09:14 16:18:00", "gps": "2025:09:14 14:18:00"},
        2.0,
        GPS,
    ),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_times_are_read_however_they_are_written(name: str) -> None:
    base, tags, offset, source = SPELLINGS[name]
    metadata = read_photo(file_of(base | tags)).metadata
    light = answer(metadata, base["sun"], base.get("heading"))
    assert light.utc_time is not None
    assert abs(light.utc_time - UTC_OF[base["place"][0]]).total_seconds() < 61
    assert (light.utc_offset, light.time_source) == (offset, source)
    assert light.sun_elevation == pytest.approx(base["sun"], abs=0.6)
    assert clock_warnings(light) == []


CONFLICTS: dict[str, tuple[dict[str, Any], dict[str, Any], str, str]] = {
    "GPS 1024 weeks early": (MUNICH, {"gps": "2004:10:16 16:49:00"}, ZONE, "1024 weeks"),
    "GPS 2048 weeks early": (
        MUNICH,
        {"gps": "1985:03:02 16:49:00", "OffsetTimeOriginal": "+02:00"},
        FILE,
        "2048 weeks",
    ),
    "GPS 1024 weeks late": (MUNICH, {"gps": "2044:01:16 16:49:00"}, ZONE, "1024 weeks"),
    "1024 weeks and another zone": (
        DENVER,
        {"DateTimeOriginal": "2025:09:14 16:18:00", "gps": "2006:01:29 14:18:00"},
        GPS,
        "1024 weeks",
    ),
    "receiver without a fix": (AUCKLAND, {"gps": "1980:01:06 00:00:41"}, ZONE, "without a fix"),
    "receiver at the first second": (AUCKLAND, {"gps": "1980:01:06 00:00:00"}, ZONE, "without a fix"),
    "receiver of the future": (MUNICH, {"gps": "2036:02:07 06:28:16"}, ZONE, "future"),
    "the local time in place of GPS's": (
        KATHMANDU,
        {"gps": "2023:10:30 11:16:00", "OffsetTimeOriginal": "+05:45"},
        FILE,
        "5 h 45",
    ),
    "receiver at its second epoch": (MUNICH, {"gps": "1999:08:22 00:01:10"}, ZONE, "without a fix"),
    "fix of breakfast": (MUNICH, {"gps": "2024:06:01 11:41:48"}, ZONE, "7 min"),
    "fix 47 min old": (DENVER, {"gps": "2025:09:14 13:30:51"}, ZONE, "47 min"),
    "fix of before the flight": (
        DENVER,
        {"gps": "2025:09:14 04:58:00", "OffsetTimeOriginal": "-06:00"},
        FILE,
        "9 h 20",
    ),
    "fix 47 min old without a date": (DENVER, {"gps": "13:30:51"}, ZONE, "47 min"),
    "fix of the day before": (MUNICH, {"gps": "2024:05:31 16:49:00"}, ZONE, "a day"),
    "clock reset to 2000": (
        MUNICH,
        {"DateTimeOriginal": "2000:01:01 00:03:12", "gps": "2024:06:01 16:49:00"},
        GPS,
        "reset",
    ),
    "clock reset to 1970": (
        AUCKLAND,
        {"DateTimeOriginal": "1970:01:01 00:12:44", "OffsetTimeOriginal": "+00:00", "gps": "2024:02:03 05:54:00"},
        GPS,
        "reset",
    ),
    "clock reset to 2016": (
        AUCKLAND,
        {"DateTimeOriginal": "2016:01:01 00:02:10", "OffsetTimeOriginal": "+00:00", "gps": "2024:02:03 05:54:00"},
        GPS,
        "reset",
    ),
    "clock reset weeks ago": (
        AUCKLAND,
        {"DateTimeOriginal": "2012:01:09 04:40:10", "OffsetTimeOriginal": "+00:00", "gps": "2024:02:03 05:54:00"},
        GPS,
        "days",
    ),
    "clock at the wrong half of the day": (
        HELSINKI,
        {"DateTimeOriginal": "2024:06:15 07:22:00", "OffsetTimeOriginal": "+03:00", "gps": "2024:06:15 16:22:00"},
        GPS,
        "12 h 00",
    ),
    "offset of another season": (MUNICH, {"gps": "2024:06:01 16:49:00", "OffsetTimeOriginal": "+01:00"}, GPS, "1 h 00"),
    "clock half an hour slow": (
        DENVER,
        {"DateTimeOriginal": "2025:09:14 07:41:00", "OffsetTimeOriginal": "-06:00", "gps": "2025:09:14 14:18:00"},
        GPS,
        "37 min",
    ),
    "clock of the future": (
        MUNICH,
        {"DateTimeOriginal": "2097:06:01 18:49:00", "OffsetTimeOriginal": "+02:00", "gps": "2024:06:01 16:49:00"},
        GPS,
        "future",
    ),
}


@pytest.mark.parametrize("name", CONFLICTS)
def test_of_clocks_that_contradict_each_other_the_right_one_is_used_and_told(name: str) -> None:
    base, tags, source, words = CONFLICTS[name]
    metadata = read_photo(file_of(base | tags)).metadata
    light = answer(metadata, base["sun"], base.get("heading"))
    assert light.utc_time is not None
    assert abs(light.utc_time - UTC_OF[base["place"][0]]).total_seconds() < 61
    assert light.time_source == source
    assert light.sun_elevation == pytest.approx(base["sun"], abs=0.6)
    (warning,) = clock_warnings(light)
    assert words in warning
    assert "was used" in warning
    assert len(warning.split()) <= 15
    assert "48.14" not in warning  # no place
    if (heading := base.get("heading")) is not None:
        assert light.camera_heading == pytest.approx(heading, abs=3.0)


@pytest.mark.parametrize(
    ("base", "clock", "gps", "source"),
    [
        (MUNICH, "2024:06:01 18:49:00", "2024:05:31 16:49:00", ZONE),
        (MUNICH, "2024:05:31 18:49:00", "2024:06:01 16:49:00", GPS),
        (AUCKLAND, "2024:02:04 07:54:00", "2024:02:04 18:54:00", ZONE),  # the local date beside the universal time
        (DENVER, "2025:09:14 18:18:00", "2025:09:14 00:18:00", ZONE),
    ],
)
def test_of_two_clocks_a_day_apart_the_later_is_likelier(
    base: dict[str, Any], clock: str, gps: str, source: str
) -> None:
    """Old fixes and resets are early; a GPS date that is the local one is no sign of a wrong clock."""
    metadata = read_photo(file_of(base | {"DateTimeOriginal": clock, "gps": gps})).metadata
    found = resolve_instants(metadata, UserInput())
    assert found.likeliest is not None
    assert found.likeliest.source == source
    is_of_a_zone = base is AUCKLAND  # as beyond the date line
    assert is_of_a_zone or "a day" in found.conflict_warnings(found.likeliest)[0]


@pytest.mark.parametrize("sun", [17.8, 63.3])
def test_the_pixels_choose_between_clock_and_gps(sun: float) -> None:
    """One file, two pictures: of the clock's sun, and of that of GPS."""
    metadata = read_photo(file_of(MUNICH | {"gps": "2024:06:01 11:41:48"})).metadata
    light = answer(metadata, sun)
    assert light.time_source == (ZONE if sun < 30 else GPS)
    assert light.sun_elevation == pytest.approx(20.0 if sun < 30 else 63.3, abs=0.6)
    (warning,) = clock_warnings(light)
    assert ("the GPS time was used" if sun > 30 else "the camera's clock was used") in warning


@pytest.mark.parametrize(("sun", "offset"), [(28.0, -1.0), (8.7, -2.0)])
def test_at_sea_the_pixels_choose_the_clock_of_the_ship(sun: float, offset: float) -> None:
    tags = {"place": (38.0, -30.0), "DateTimeOriginal": "2024:06:01 18:24:00"}
    assert answer(read_photo(file_of(tags)).metadata, sun).utc_offset == offset


@pytest.mark.parametrize("sun", [20.0, 49.4])
def test_the_pixels_choose_between_an_old_fix_and_a_clock_of_another_zone(sun: float) -> None:
    """GPS is five hours before the clock: Pakistan's zone, or a fix three hours old."""
    metadata = read_photo(file_of(MUNICH | {"gps": "2024:06:01 13:49:00"})).metadata
    light = answer(metadata, sun)
    assert light.utc_offset == (2.0 if sun < 30 else 5.0)
    assert light.sun_elevation == pytest.approx(sun, abs=0.6)
    assert len(clock_warnings(light)) == (sun < 30)


@pytest.mark.parametrize(
    ("time", "words"),
    [("1970:01:01 00:12:44", "reset"), ("1980:01:01 11:00:00", "reset"), ("2000:01:01 07:12:00", "reset")],
)
def test_a_clock_that_was_reset_is_no_time(time: str, words: str) -> None:
    light = answer(read_photo(file_of(MUNICH | {"DateTimeOriginal": time})).metadata, 20.0)
    assert light.utc_time is None
    assert "time+place" not in light.evidence
    (warning,) = clock_warnings(light)
    assert words in warning


def test_two_clocks_that_began_anew_are_no_time() -> None:
    tags = {"DateTimeOriginal": "2000:01:01 00:01:12", "gps": "1980:01:06 00:00:10"}
    light = answer(read_photo(file_of(MUNICH | tags)).metadata, 20.0)
    assert light.utc_time is None
    (warning,) = clock_warnings(light)
    assert "no time was used" in warning


@pytest.mark.parametrize(
    ("gps", "words"),
    [("1980:01:06 00:00:10", "without a fix"), ("2042:06:01 03:04:05", "of the future")],
)
def test_a_clock_without_a_zone_is_no_time_beside_a_gps_that_cannot_be(gps: str, words: str) -> None:
    tags = {"DateTimeOriginal": MUNICH["DateTimeOriginal"], "gps": gps}
    light = answer(read_photo(file_of(tags)).metadata, 20.0)
    assert light.utc_time is None
    (warning,) = clock_warnings(light)
    assert words in warning
    assert "no time was used" in warning


def test_new_year_is_a_day_as_any_other() -> None:
    tags = {"DateTimeOriginal": "2017:01:01 12:30:00", "OffsetTimeOriginal": "+01:00"}
    light = answer(read_photo(file_of(MUNICH | tags)).metadata, 18.0)
    assert light.utc_time == datetime(2017, 1, 1, 11, 30, tzinfo=UTC)
    assert clock_warnings(light) == []


@pytest.mark.parametrize(
    "text", ["01/06/2024 18:49:00", "2024:06:01", "2024:13:01 10:00:00", "June", "2024:06:01 25:00:00"]
)
def test_a_date_in_doubt_is_none(text: str) -> None:
    metadata = read_photo(file_of(MUNICH | {"DateTimeOriginal": text})).metadata
    assert metadata.local_time is None


def test_the_writing_time_of_a_program_is_not_the_pictures() -> None:
    main = {"DateTime": "2024:06:01 18:49:00", "Software": "GIMP 2.10"}
    assert read_photo(file_of(MUNICH | {"DateTimeOriginal": None, "main": main})).metadata.local_time is None


@pytest.mark.parametrize("program", ["GIMP 2.10", "Adobe Photoshop 25.9 (Windows)", "Snapseed 2.0", "paint.net 5"])
def test_a_program_s_name_is_no_camera_s_firmware(program: str) -> None:
    main = {"DateTime": "2024:06:01 18:49:00", "Software": program, "Make": "Apple", "Model": "iPhone 13"}
    assert read_photo(file_of(MUNICH | {"DateTimeOriginal": None, "main": main})).metadata.local_time is None


# Places whose clocks are unlike others: half hours, half an hour of summer time, the date line, and zones that changed.

PLACES = [
    ((-31.55, 159.08), "2024:01:15 17:48:00", 11.0),  # Lord Howe, whose summer time is half an hour
    ((-31.55, 159.08), "2023:07:15 14:10:00", 10.5),
    ((-43.95, -176.56), "2023:12:25 19:08:00", 13.75),  # Chatham
    ((-43.95, -176.56), "2024:04:20 09:00:00", 12.75),
    ((-13.83, -171.77), "2010:08:03 16:30:00", -11.0),  # Apia, before it crossed the date line
    ((1.87, -157.4), "2024:05:05 16:30:00", 14.0),  # Kiritimati
    ((-31.68, 128.88), "2024:11:02 17:00:00", 8.75),  # Eucla
    ((47.56, -52.71), "2021:06:20 18:44:00", -2.5),  # St. John's
    ((10.48, -66.9), "2012:06:20 16:30:00", -4.5),  # Caracas, from 2007 to 2016
    ((39.02, 125.75), "2017:06:20 18:00:00", 8.5),  # Pyongyang, from 2015 to 2018
    ((55.75, 37.62), "2012:06:20 20:00:00", 4.0),  # Moscow, from 2011 to 2014
    ((35.7, 51.4), "2021:06:20 18:00:00", 4.5),  # Tehran, with its last summer time
    ((35.7, 51.4), "2023:06:20 17:00:00", 3.5),
    ((33.57, -7.59), "2024:03:20 17:00:00", 0.0),  # Casablanca in Ramadan
    ((-23.55, -46.63), "2018:12:20 18:00:00", -2.0),  # Sao Paulo, with summer time until 2019
    ((-23.55, -46.63), "2022:12:20 17:00:00", -3.0),
    ((33.45, -112.07), "2023:07:04 17:54:00", -7.0),  # Phoenix
]


@pytest.mark.parametrize(("place", "time", "offset"), PLACES)
def test_the_zone_of_the_place_with_its_history(place: tuple[float, float], time: str, offset: float) -> None:
    tags = {"place": place, "DateTimeOriginal": time}
    expected = to_utc(datetime.strptime(time, "%Y:%m:%d %H:%M:%S"), offset)
    for more in ({}, {"gps": f"{expected:%Y:%m:%d %H:%M:%S}"}, {"gps": f"{expected:%H:%M:%S}"}):
        found = resolve_instants(read_photo(file_of(tags | more)).metadata, UserInput())
        assert found.conflict is None
        assert found.likeliest is not None
        assert (found.likeliest.utc_time, found.likeliest.utc_offset) == (expected, offset)


@pytest.mark.parametrize(("place", "time", "offset"), PLACES[:8])
def test_a_rollover_at_any_place(place: tuple[float, float], time: str, offset: float) -> None:
    expected = to_utc(datetime.strptime(time, "%Y:%m:%d %H:%M:%S"), offset)
    early = f"{expected - timedelta(weeks=1024):%Y:%m:%d %H:%M:%S}"
    metadata = read_photo(file_of({"place": place, "DateTimeOriginal": time, "gps": early})).metadata
    found = resolve_instants(metadata, UserInput())
    assert found.likeliest is not None
    assert found.likeliest.utc_time == expected
    assert "1024 weeks" in found.conflict_warnings(found.likeliest)[0]


def test_the_users_offset_wins_and_what_it_replaced_is_told() -> None:
    metadata = read_photo(file_of(MUNICH | {"OffsetTimeOriginal": "+05:00"})).metadata
    light = answer(metadata, 20.0, utc_offset=2.0)
    assert (light.utc_time, light.utc_offset, light.time_source) == (UTC_OF[48.14], 2.0, "user")
    (warning,) = clock_warnings(light)
    assert "+02:00" in warning
    assert "+05:00" in warning
    assert clock_warnings(answer(metadata, 20.0, utc_offset=5.0)) == []


def test_the_time_is_told_without_a_place() -> None:
    tags = {name: value for name, value in MUNICH.items() if name != "place"}
    light = answer(read_photo(file_of(tags | {"OffsetTimeOriginal": "+02:00"})).metadata, 20.0)
    assert (light.utc_time, light.utc_offset, light.time_source) == (UTC_OF[48.14], 2.0, FILE)
    assert light.to_dict()["time"] == {"utc": "2024-06-01T16:49:00Z", "utc_offset": 2.0, "source": FILE}


def iptc(date: str, time: str) -> bytes:
    """An IPTC block of Photoshop with a date and a time."""
    sets = b"".join(
        b"\x1c\x02" + bytes([number]) + len(text).to_bytes(2, "big") + text.encode()
        for number, text in ((55, date), (60, time))
    )
    block = b"8BIM\x04\x04\0\0" + len(sets).to_bytes(4, "big") + sets + b"\0" * (len(sets) % 2)
    return b"Photoshop 3.0\0" + block


@pytest.mark.parametrize(("time", "offset", "source"), [("184900+0200", 2.0, FILE), ("184900", 2.0, ZONE)])
def test_the_time_of_iptc(time: str, offset: float, source: str) -> None:
    plain = file_of(MUNICH | {"DateTimeOriginal": None})
    segment = iptc("20240601", time)
    data = plain[:2] + b"\xff\xed" + (len(segment) + 2).to_bytes(2, "big") + segment + plain[2:]
    light = answer(read_photo(data).metadata, 20.0)
    assert (light.utc_time, light.utc_offset, light.time_source) == (UTC_OF[48.14], offset, source)


# Files beside the photo.

TAKEOUT = {
    "title": "photo.jpg",
    "photoTakenTime": {"timestamp": "1717260540"},
    "geoData": {"latitude": 48.14, "longitude": 11.58, "altitude": 0.0},
}


@pytest.mark.parametrize(
    ("photo", "file"),
    [
        ("photo.jpg", "photo.jpg.supplemental-metadata.json"),
        ("photo.jpg", "photo.jpg.json"),
        ("photo.jpg", "photo.jpg.supplemental-me.json"),
        ("photo(2).jpg", "photo.jpg.supplemental-metadata(2).json"),
        ("photo(2).jpg", "photo.jpg(2).json"),
        ("photo(2).jpg", "photo(2).jpg.json"),
        ("photo-edited.jpg", "photo.jpg.supplemental-metadata.json"),
        ("photo-bearbeitet.jpg", "photo.jpg.supplemental-metadata.json"),
        ("photo-edited(1).jpg", "photo.jpg.supplemental-metadata(1).json"),
        (f"{'x' * 44}.jpg", f"{'x' * 44}.j.json"),
    ],
)
def test_the_time_of_google_takeout(tmp_path: Path, photo: str, file: str) -> None:
    (tmp_path / photo).write_bytes(encode(SCENE))
    (tmp_path / file).write_text(json.dumps(TAKEOUT))
    metadata = read_photo(tmp_path / photo).metadata
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2024, 6, 1, 16, 49), 0.0)
    assert metadata.location == pytest.approx((48.14, 11.58))
    assert read_photo((tmp_path / photo).read_bytes()).metadata == PhotoMetadata()
    assert read_photo((tmp_path / photo).read_bytes(), path=tmp_path / photo).metadata == metadata


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", '{"a": 1}', '{"photoTakenTime": 3}', '{"photoTakenTime": {"timestamp": "1e999"}}', "[" * 100_000],
)
def test_other_json_says_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "photo.jpg").write_bytes(encode(SCENE))
    (tmp_path / "photo.jpg.json").write_text(text)
    assert read_photo(tmp_path / "photo.jpg").metadata == PhotoMetadata()


def test_takeouts_time_tells_the_offset_of_a_clock_unless_google_took_it_for_utc(tmp_path: Path) -> None:
    tags = {"DateTimeOriginal": "2024:06:01 18:49:00"}
    (tmp_path / "photo.jpg").write_bytes(file_of(tags))
    (tmp_path / "photo.jpg.json").write_text(json.dumps(TAKEOUT))
    assert read_photo(tmp_path / "photo.jpg").metadata.utc_offset == 2.0
    (tmp_path / "photo.jpg.json").write_text(json.dumps(TAKEOUT | {"photoTakenTime": {"timestamp": "1717267740"}}))
    assert read_photo(tmp_path / "photo.jpg").metadata.utc_offset is None


EXIFTOOL = {
    "SourceFile": "./photo.jpg",
    "DateTimeOriginal": "2024:06:01 18:49:00",
    "OffsetTimeOriginal": "+02:00",
    "GPSLatitude": "48 deg 8' 24.00\" N",
    "GPSLongitude": "11 deg 34' 48.00\" E",
    "GPSDateTime": "2024:06:01 16:49:03Z",
    "GPSImgDirection": 224.35,
    "GPSImgDirectionRef": "True North",
    "FocalLengthIn35mmFormat": "26 mm",
}
_EXIF_GROUPS = {name: value for name, value in EXIFTOOL.items() if not name.startswith(("Offset", "GPSL", "GPSD"))}
EXIFTOOL_OUTPUTS: dict[str, Any] = {
    "plain": [EXIFTOOL],
    "of several photos": [{"SourceFile": "a.jpg", "DateTimeOriginal": "2020:01:05 10:00:00"}, EXIFTOOL],
    "an object": EXIFTOOL,
    "-n": [EXIFTOOL | {"GPSLatitude": 48.14, "GPSLongitude": 11.58, "FocalLengthIn35mmFormat": 26}],
    "-n -G": [
        {f"EXIF:{name}": value for name, value in EXIFTOOL.items()}
        | {"EXIF:GPSLatitude": 48.14, "EXIF:GPSLongitude": 11.58, "Composite:GPSLongitude": 11.58}
    ],
    "-G": [{f"EXIF:{name}" if name != "SourceFile" else name: value for name, value in EXIFTOOL.items()}],
    "-g": [{"SourceFile": "photo.jpg", "EXIF": EXIFTOOL}],
    "without groups of EXIF": [
        _EXIF_GROUPS
        | {"SubSecDateTimeOriginal": "2024:06:01 18:49:00.25+02:00", "GPSDateStamp": "2024:06:01"}
        | {"GPSTimeStamp": "16:49:03", "GPSLatitude": "48.14", "GPSLatitudeRef": "North"}
        | {"GPSLongitude": "11.58", "GPSLongitudeRef": "East"}
    ],
}


@pytest.mark.parametrize("name", EXIFTOOL_OUTPUTS)
@pytest.mark.parametrize("file", ["photo.jpg.json", "photo.json"])
def test_json_of_exiftool(tmp_path: Path, name: str, file: str) -> None:
    (tmp_path / "photo.jpg").write_bytes(encode(SCENE))
    (tmp_path / file).write_text(json.dumps(EXIFTOOL_OUTPUTS[name]))
    found = read_photo(tmp_path / "photo.jpg").metadata
    assert (found.local_time, found.utc_offset) == (datetime(2024, 6, 1, 18, 49), 2.0)
    assert found.gps_time == datetime(2024, 6, 1, 16, 49, 3, tzinfo=UTC)
    assert found.location == pytest.approx((48.14, 11.58))
    assert (found.heading, found.heading_reference, found.focal_length) == (224.35, "true", 26.0)


def test_json_of_other_photos_says_nothing(tmp_path: Path) -> None:
    (tmp_path / "photo.jpg").write_bytes(encode(SCENE))
    others = [EXIFTOOL | {"SourceFile": name} for name in ("a.jpg", "b.jpg")]
    (tmp_path / "photo.json").write_text(json.dumps(others))
    assert read_photo(tmp_path / "photo.jpg").metadata == PhotoMetadata()


@pytest.mark.parametrize("name", ["photo.jpg.xmp", "photo.xmp", "photo.XMP", "photo.JPG.xmp"])
def test_xmp_beside_the_photo_fills_gaps(tmp_path: Path, name: str) -> None:
    (tmp_path / "photo.jpg").write_bytes(encode(SCENE))
    place = {"GPSLatitude": "48,8.4000N", "GPSLongitude": "11,34.8000E"}
    beside = packet("http://ns.adobe.com/exif/1.0/", {"DateTimeOriginal": "2024-06-01T18:49:00+02:00", **place})
    (tmp_path / name).write_bytes(beside)
    metadata = read_photo(tmp_path / "photo.jpg").metadata
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2024, 6, 1, 18, 49), 2.0)
    assert metadata.location == pytest.approx((48.14, 11.58))
    (tmp_path / "photo.jpg").write_bytes(file_of(DENVER | {"OffsetTimeOriginal": "-06:00"}))
    own = read_photo(tmp_path / "photo.jpg").metadata
    assert (own.local_time, own.utc_offset) == (datetime(2025, 9, 14, 8, 18), -6.0)


# The table of files: what each does now, without the network.

CASES = Path(__file__).parents[2] / "data" / "cases"
with (CASES / "cases.csv").open(encoding="utf-8", newline="") as _table:
    ROWS = {row["id"]: row for row in csv.DictReader(_table)}
REFERENCES = ("ref-garden_noon.jpg", "ref-railway_field.jpg")  # the same pictures in sRGB
UPRIGHT = "rep-heic-irot.heic"  # of the pictures that their files turn
MAX_COLOR_DIFFERENCE = 3.0  # of 255, of a picture's mean: HDR files were clipped before


def describe_time(metadata: PhotoMetadata) -> list[str]:
    resolved, warnings = resolve_hemisphere(metadata)
    found = resolve_instants(resolved, UserInput())
    used = found.likeliest
    time = "no time" if used is None else f"{used.utc_time:%Y-%m-%d %H:%M} UTC by {used.source}"
    facts = [time, *(["place"] if resolved.location else [])]
    if resolved.heading is not None:
        facts.append(f"heading {resolved.heading:.0f}")
    codes = [warning_code(warning) for warning in (*warnings, *found.warnings, *found.conflict_warnings(used))]
    return [*facts, *(str(code) for code in codes)]


def describe_camera(metadata: PhotoMetadata) -> list[str]:
    fovs = [fov for fov in (metadata.vertical_fov, *metadata.other_vertical_fovs) if fov is not None]
    facts = ["vertical_fov " + " or ".join(f"{fov:.1f}" for fov in fovs)] if fovs else ["no lens"]
    facts += ["panorama"] if metadata.is_panorama else []
    if metadata.camera_elevation is not None:
        facts.append(f"elevation {metadata.camera_elevation:.1f}")
    return facts if metadata.camera_roll is None else [*facts, f"roll {metadata.camera_roll:.1f}"]


def describe_frame(photo: Photo) -> list[str]:
    crop = photo.crop
    whole = f" of {crop.picture_width} x {crop.picture_height}" if crop else ""
    return [f"{photo.width} x {photo.height}{whole}", *(str(warning_code(warning)) for warning in photo.warnings)]


def describe_colors(photo: Photo) -> list[str]:
    means = {name: read_photo(CASES / name).pixels.mean(axis=(0, 1)) for name in REFERENCES}
    off = {name: np.abs(photo.pixels.mean(axis=(0, 1)) - mean).max() for name, mean in means.items()}
    return [f"as {name.removesuffix('.jpg')}" for name, value in off.items() if value <= MAX_COLOR_DIFFERENCE]


def describe_turn(photo: Photo) -> list[str]:
    small = [Image.fromarray(picture.pixels).resize((42, 56)) for picture in (photo, read_photo(CASES / UPRIGHT))]
    off = np.abs(np.subtract(*(np.asarray(picture, np.float32) for picture in small))).mean()
    return ["upright" if off < MAX_COLOR_DIFFERENCE else "lies"]


def describe_case(kind: str, file: Path) -> str:
    """What reading does with a file, in the words of the table."""
    try:
        photo = read_photo(file)
    except PhotoError as error:
        return str(error)
    if kind == "border":
        facts = describe_frame(photo)
    elif kind in ("color", "picture"):
        facts = describe_colors(photo)
    elif kind == "orientation":
        facts = describe_turn(photo)
    else:
        metadata = photo.metadata
        facts = [] if kind in ("lens", "gimbal") else describe_time(metadata)
        facts += describe_camera(metadata) if kind in ("lens", "gimbal", "facts") else []
    return "; ".join(facts)


@pytest.mark.parametrize("case", ROWS)
def test_each_file_does_what_the_table_says(case: str) -> None:
    """The files are drawings and reduced examples; their places and times are invented to fit the sun."""
    row = ROWS[case]
    assert describe_case(row["kind"], CASES / row["file"]) == row["now"]

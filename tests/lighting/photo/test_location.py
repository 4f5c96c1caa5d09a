"""Places and headings in the spellings of cameras and programs."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags
from PIL.TiffImagePlugin import IFDRational

from lighting.photo.metadata import read_heading, read_locations

GPS = ExifTags.GPS
EXIF, DJI = "http://ns.adobe.com/exif/1.0", "http://www.dji.com/drone-dji/1.0"
MUNICH, DENVER = (48.14, 11.58), (39.74, -104.99)


def gps(latitude: object, north: object, longitude: object, east: object) -> dict[int, object]:
    values = zip(
        (GPS.GPSLatitude, GPS.GPSLatitudeRef, GPS.GPSLongitude, GPS.GPSLongitudeRef),
        (latitude, north, longitude, east),
        strict=True,
    )
    return {tag: value for tag, value in values if value is not None}


UNKNOWN = IFDRational(0, 0)


@pytest.mark.parametrize(
    ("tags", "place"),
    [
        (gps((48, 8, 24), "N", (11, 34, 48), "E"), MUNICH),
        (gps((48, 8.4, UNKNOWN), "N", (11, 34.8, UNKNOWN), "E"), MUNICH),
        (gps((48.14, UNKNOWN, UNKNOWN), "N", (11.58, UNKNOWN, UNKNOWN), "E"), MUNICH),
        (gps((48.14,), "North", (11.58,), "East"), MUNICH),
        (gps(48.14, "n", 11.58, "e"), MUNICH),
        (gps("48.14", "N", "11.58", "E"), MUNICH),
        (gps("48,8.4", "N", "11,34.8", "E"), MUNICH),
        (gps("48/1 84/10 0/1", "N", "11/1 348/10 0/1", "E"), MUNICH),
        (gps("48 deg 8' 24\" N", None, "11 deg 34' 48\" E", None), MUNICH),
        (gps(b"48.14\0", b"N\0", b"11.58\0", b"E\0"), MUNICH),
        (gps("48°8'24\"".encode().decode("latin-1"), "N", "11°34'48\"".encode().decode("latin-1"), "E"), MUNICH),
        (gps((39.74, 0, 0), "N", (IFDRational(2**32 - 10499, 100), 0, 0), "W"), DENVER),
        (gps((39.74, 0, 0), "N", (-104.99, 0, 0), "W"), DENVER),
        (gps((39.74, 0, 0), None, (-104.99, 0, 0), None), DENVER),
        (gps((39.74, 0, 0), "", (-104, -59, -24), ""), DENVER),
        (gps((39.74, 0, 0), "N", (-104.99, 0, 0), "E"), DENVER),  # the sign was meant
        (gps((33, 51, 36), "S", (-151, 12, 36), "W"), (-33.86, -151.21)),
    ],
)  # fmt: skip
def test_a_place_in_exif(tags: dict[int, object], place: tuple[float, float]) -> None:
    (found,) = read_locations(tags, {})
    assert found == pytest.approx(place, abs=1e-9)


@pytest.mark.parametrize(
    ("properties", "place"),
    [
        ({f"{EXIF} GPSLatitude": "48,8.4000N", f"{EXIF} GPSLongitude": "11,34.8000E"}, MUNICH),
        ({f"{EXIF} GPSLatitude": "48,8,24N", f"{EXIF} GPSLongitude": "11,34,48E"}, MUNICH),
        ({f"{EXIF} GPSLatitude": "39.74", f"{EXIF} GPSLongitude": "-104.99"}, DENVER),
        ({f"{EXIF} GPSLatitude": "39,44.4N", f"{EXIF} GPSLongitude": "104,59.4W"}, DENVER),
        ({f"{EXIF} GPSLatitude": "48.14", f"{EXIF} GPSLatitudeRef": "N", f"{EXIF} GPSLongitude": "11.58",
          f"{EXIF} GPSLongitudeRef": "E"}, MUNICH),
        ({f"{EXIF} GPSLatitude": "48º 8' 24'' N", f"{EXIF} GPSLongitude": "11º 34' 48'' E"}, MUNICH),
        ({f"{EXIF} GPSLatitude": "48,1400000 N", f"{EXIF} GPSLongitude": "11,5800000 E"}, MUNICH),
        ({f"{EXIF} GPSLatitude": "48.14 degrees N", f"{EXIF} GPSLongitude": "11.58 degrees E"}, MUNICH),
        ({f"{DJI} GpsLatitude": "+39.74", f"{DJI} GpsLongtitude": "-104.99"}, DENVER),
        ({f"{DJI} Latitude": "+39.74", f"{DJI} Longitude": "-104.99"}, DENVER),
    ],
)  # fmt: skip
def test_a_place_in_xmp_alone(properties: dict[str, str], place: tuple[float, float]) -> None:
    (found,) = read_locations({}, properties)
    assert found == pytest.approx(place, abs=1e-9)


def test_exif_counts_before_xmp() -> None:
    elsewhere = {f"{EXIF} GPSLatitude": "39,44.4N", f"{EXIF} GPSLongitude": "104,59.4W"}
    assert read_locations(gps((48, 8, 24), "N", (11, 34, 48), "E"), elsewhere)[0] == pytest.approx(MUNICH)


def test_a_hemisphere_that_nothing_states_is_open() -> None:
    assert len(read_locations(gps((48, 8, 24), "", (11, 34, 48), ""), {})) == 4
    assert set(read_locations(gps(48.0, "N", 11.0, None), {})) == {(48.0, 11.0), (48.0, -11.0)}


@pytest.mark.parametrize(
    "tags",
    [
        {},
        gps((0, 0, 0), "N", (0, 0, 0), "E"),
        gps((95, 0, 0), "N", (11, 0, 0), "E"),
        gps((48, 75, 0), "N", (11, 0, 0), "E"),
        gps((48, UNKNOWN, 0), "N", (11, 0, 0), "E"),
        gps((UNKNOWN, UNKNOWN, UNKNOWN), "N", (11, 0, 0), "E"),
        gps("somewhere", "N", "11", "E"),
        gps("1,2,3,4", "N", "11", "E"),
        gps((), "N", (11, 0, 0), "E"),
        gps(None, "N", (11, 0, 0), "E"),
    ],
)
def test_what_can_be_no_place_is_none(tags: dict[int, object]) -> None:
    assert read_locations(tags, {}) == ()


@given(st.text(max_size=80), st.one_of(st.none(), st.text(max_size=5), st.binary(max_size=5), st.floats()))
def test_no_text_raises(text: str, reference: object) -> None:
    for latitude, longitude in read_locations(gps(text, reference, text, reference), {f"{EXIF} GPSLatitude": text}):
        assert abs(latitude) <= 90.0
        assert math.isfinite(longitude)


def test_a_heading_in_exif_or_else_in_xmp() -> None:
    properties = {f"{EXIF} GPSImgDirection": "22329/100", f"{EXIF} GPSImgDirectionRef": "T"}
    heading, reference = read_heading({}, properties)
    assert heading == pytest.approx(223.29)
    assert str(reference) == "true"
    assert read_heading({GPS.GPSImgDirection: 60.0, GPS.GPSImgDirectionRef: "M"}, properties) == (60.0, "magnetic")
    assert read_heading({}, {f"{EXIF} GPSImgDirection": "5/0"}) == (None, None)
    assert read_heading({GPS.GPSImgDirection: 361.0}, {}) == (None, None)


@pytest.mark.parametrize("value", ["224", "224/1", "224,0", b"22400/100\0", (224.0,), -136.0])
def test_a_heading_however_it_is_written(value: object) -> None:
    assert read_heading({GPS.GPSImgDirection: value}, {})[0] == pytest.approx(224.0)

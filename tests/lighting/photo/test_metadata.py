"""Tests of metadata."""

import math
import struct
import time
from collections.abc import Mapping
from dataclasses import replace
from datetime import UTC, datetime
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, Image
from PIL.PngImagePlugin import PngInfo
from PIL.TiffImagePlugin import IFDRational

from lighting.fusion.time_zones import resolve_hemisphere
from lighting.photo.camera import vertical_fov_from_focal_length
from lighting.photo.metadata import PhotoMetadata, read_metadata
from lighting.photo.reader import read_photo
from lighting.photo.tags import MAX_XMP_BYTES, PhotoTags, read_tags, read_xmp
from tests.conftest import encode, exif, munich, scene
from tests.helpers.photos import DJI, RDF, drone, packet

SCENE = scene(160, 120)
BASE, GPS = ExifTags.Base, ExifTags.GPS


def metadata_of(block: Image.Exif, picture: Any = SCENE, file_format: str = "JPEG") -> PhotoMetadata:
    return read_photo(encode(picture, file_format, exif=block.tobytes())).metadata


def told(gps: Mapping[int, object], xmp: Mapping[str, str]) -> PhotoMetadata:
    """What a photo with these tags alone says."""
    return read_metadata(PhotoTags("JPEG", None, {}, {}, dict(gps), {}, xmp, {}), 160, 120)


def places(gps: Mapping[int, object], xmp: Mapping[str, str]) -> tuple[tuple[float, float], ...]:
    """The places that tags tell: of several hemispheres where those are open."""
    metadata = told(gps, xmp)
    return metadata.locations or ((metadata.location,) if metadata.location else ())


def heading_of(gps: Mapping[int, object], xmp: Mapping[str, str]) -> tuple[float | None, str | None]:
    metadata = told(gps, xmp)
    return metadata.heading, metadata.heading_reference


@pytest.mark.parametrize(("make", "said"), [("Apple\0", "apple"), (" DJI ", "dji"), ("", None), (None, None)])
def test_who_made_the_camera_is_told_in_small_letters(make: str | None, said: str | None) -> None:
    block = munich()
    if make is not None:
        block[BASE.Make] = make
    assert metadata_of(block).camera_make == said


@pytest.mark.parametrize("file_format", ["JPEG", "PNG", "WEBP", "HEIF"])
def test_what_a_phone_notes(file_format: str) -> None:
    metadata = metadata_of(munich(), file_format=file_format)
    assert metadata.local_time == datetime(2024, 6, 1, 9, 10)
    assert metadata.utc_offset == 2.0
    assert metadata.gps_time is None
    assert metadata.latitude == pytest.approx(48 + 8 / 60 + 15 / 3600)
    assert metadata.longitude == pytest.approx(11 + 34 / 60 + 30 / 3600)
    assert (metadata.heading, metadata.heading_reference) == (60.0, "magnetic")
    assert metadata.focal_length == 26.0


def test_a_photo_without_exif_has_no_facts() -> None:
    assert read_photo(encode(SCENE)).metadata == PhotoMetadata()


def test_the_repr_does_not_tell_the_place() -> None:
    photo = read_photo(encode(SCENE, exif=munich().tobytes()))
    assert photo.metadata.latitude is not None
    for text in (repr(photo.metadata), repr(photo)):
        assert "48." not in text
        assert "itude" not in text


def test_the_southwest_is_negative() -> None:
    metadata = metadata_of(munich(GPSLatitudeRef="S", GPSLongitudeRef="w"))
    assert metadata.latitude == pytest.approx(-48.1375)
    assert metadata.longitude == pytest.approx(-11.575)


def test_a_local_time_without_zone_stays_local() -> None:
    metadata = metadata_of(munich(OffsetTimeOriginal=None))
    assert metadata.local_time == datetime(2024, 6, 1, 9, 10)
    assert metadata.utc_offset is None
    assert metadata.gps_time is None


def test_the_satellites_time_is_utc() -> None:
    time = {"GPSDateStamp": "2024:06:01", "GPSTimeStamp": (7.0, 9.0, 58.5)}
    metadata = metadata_of(munich(OffsetTimeOriginal=None, **time))
    assert metadata.gps_time == datetime(2024, 6, 1, 7, 9, 58, 500000, tzinfo=UTC)
    assert metadata_of(munich(DateTimeOriginal=None, **time)).gps_time == metadata.gps_time
    assert metadata_of(munich(**time)).gps_time == metadata.gps_time


def test_a_gps_time_of_zeros_is_unknown() -> None:
    time = {"DateTimeOriginal": None, "GPSDateStamp": "2024:06:01"}
    assert metadata_of(munich(**time, GPSTimeStamp=(0.0, 0.0, 0.0))).gps_time is None
    just_after = metadata_of(munich(**time, GPSTimeStamp=(0.0, 0.0, 1.0))).gps_time
    assert just_after == datetime(2024, 6, 1, 0, 0, 1, tzinfo=UTC)


def test_the_day_a_film_was_scanned_counts_if_nothing_better_does() -> None:
    metadata = metadata_of(
        munich(DateTimeOriginal=None, DateTimeDigitized="1998-04-05 16:20:00", OffsetTimeOriginal=None)
    )
    assert metadata.local_time == datetime(1998, 4, 5, 16, 20)


def test_the_offset_of_a_scan_is_not_that_of_the_picture() -> None:
    scan = {"DateTimeDigitized": "2023:02:03 12:00:00", "OffsetTimeDigitized": "-08:00"}
    metadata = metadata_of(munich(OffsetTimeOriginal=None, **scan))
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2024, 6, 1, 9, 10), None)
    same = {"DateTimeDigitized": "2024:06:01 09:10:00", "OffsetTimeDigitized": "+02:00"}
    assert metadata_of(munich(OffsetTimeOriginal=None, **same)).utc_offset == 2.0


def test_a_blank_time_hides_no_good_one() -> None:
    scan = {"DateTimeDigitized": "2023:02:03 12:00:00", "OffsetTimeDigitized": "-08:00"}
    metadata = metadata_of(munich(DateTimeOriginal="    :  :     :  :  ", **scan))
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2023, 2, 3, 12, 0), -8.0)


@pytest.mark.parametrize(
    ("name", "value", "lost"),
    [
        ("DateTimeOriginal", "0000:00:00 00:00:00", "local_time"),
        ("DateTimeOriginal", "2024:02:30 09:10:00", "local_time"),
        ("DateTimeOriginal", "0024:02:20 09:10:00", "local_time"),
        ("DateTimeOriginal", "yesterday", "local_time"),
        ("OffsetTimeOriginal", "+25:00", "utc_offset"),
        ("OffsetTimeOriginal", "Berlin", "utc_offset"),
        ("GPSLatitude", (95.0, 0.0, 0.0), "latitude"),
        ("GPSLatitude", (48.0, math.nan, 0.0), "latitude"),
        ("GPSLatitude", "north", "latitude"),
        ("GPSLatitudeRef", None, "longitude"),
        ("GPSLatitudeRef", "E", "longitude"),
        ("GPSLongitude", (181.0, 0.0, 0.0), "latitude"),
        ("GPSLongitude", None, "latitude"),
        ("GPSImgDirection", 361.0, "heading"),
        ("GPSImgDirection", None, "heading"),
        ("GPSImgDirectionRef", None, "heading_reference"),
        ("GPSImgDirectionRef", "X", "heading_reference"),
        ("FocalLengthIn35mmFilm", 0, "vertical_fov"),
        ("FocalLengthIn35mmFilm", 0, "focal_length"),
        ("FocalLengthIn35mmFilm", None, "focal_length"),
    ],
)
def test_a_bad_tag_is_an_absent_one(name: str, value: object, lost: str) -> None:
    good = metadata_of(munich())
    image = Image.fromarray(SCENE)
    image.info["exif"] = b""
    block = munich(**{name: value})
    image.getexif = lambda: block  # type: ignore[method-assign]  # what a file cannot hold as such
    metadata = read_metadata(read_tags(image), 160, 120)
    assert getattr(good, lost) is not None
    assert getattr(metadata, lost) is None
    told = [field for field, value in vars(good).items() if value is not None]
    assert sum(getattr(metadata, field) is None for field in told) <= 3


SETTINGS = {"ExposureTime": 1 / 125, "FNumber": 16.0, "ISOSpeedRatings": 100}


@pytest.mark.parametrize(
    ("other", "exposure_value"),
    [
        ({}, 14.97),
        ({"ISOSpeedRatings": 400}, 12.97),
        ({"ISOSpeedRatings": (100, 100)}, 14.97),
        ({"FNumber": 2.8, "ExposureTime": 2.0}, 1.97),
        ({"FNumber": 0.0}, None),
        ({"ISOSpeedRatings": 0}, None),
        ({"ExposureTime": 0.0}, None),
        ({"ExposureTime": 1e12}, None),
    ],
)
def test_exposure_value_by_the_cameras_settings(other: dict[str, Any], exposure_value: float | None) -> None:
    block = exif({ExifTags.Base[name]: value for name, value in {**SETTINGS, **other}.items()})
    assert metadata_of(block).exposure_value == (exposure_value and pytest.approx(exposure_value, abs=0.01))


@pytest.mark.parametrize("absent", SETTINGS)
def test_all_of_an_exposures_settings_must_be_noted(absent: str) -> None:
    """A lens without contacts notes no f-number."""
    block = exif({ExifTags.Base[name]: value for name, value in SETTINGS.items() if name != absent})
    assert metadata_of(block).exposure_value is None


def test_zero_north_zero_east_is_nowhere() -> None:
    metadata = metadata_of(munich(GPSLatitude=(0.0, 0.0, 0.0), GPSLongitude=(0.0, 0.0, 0.0)))
    assert metadata.latitude is metadata.longitude is None


# The lens


@pytest.mark.parametrize(
    ("focal_length", "size", "degrees"),
    [
        (24.0, (3600, 2400), 53.13),  # full frame, 24 mm: 24 mm of height
        (24.0, (2400, 3600), 73.74),
        (26.0, (4032, 3024), 53.06),  # a phone: 4:3 on the same diagonal is 25.96 mm high
        (26.0, (3024, 4032), 67.30),
    ],
)
def test_field_of_view_by_the_diagonal(focal_length: float, size: tuple[int, int], degrees: float) -> None:
    assert vertical_fov_from_focal_length(focal_length, *size) == pytest.approx(degrees, abs=0.01)


@pytest.mark.parametrize(("focal_length", "degrees"), [(1.0, 120.0), (65535.0, 5.0)])
def test_field_of_view_is_clamped(focal_length: float, degrees: float) -> None:
    assert vertical_fov_from_focal_length(focal_length, 400, 300) == degrees


@pytest.mark.parametrize("orientation", range(1, 9))
def test_field_of_view_is_that_of_the_upright_photo(orientation: int) -> None:
    block = munich()
    block[BASE.Orientation] = orientation
    photo = read_photo(encode(SCENE, exif=block.tobytes()))
    assert photo.metadata.vertical_fov == pytest.approx(vertical_fov_from_focal_length(26.0, photo.width, photo.height))
    assert (photo.width, photo.height) == ((120, 160) if orientation > 4 else (160, 120))


@pytest.mark.parametrize(
    ("noted", "known"), [((4032, 3024), True), ((3024, 4032), True), ((4032, 2268), False), ((0, 3024), True)]
)
def test_a_crop_has_no_known_field_of_view(noted: tuple[int, int], known: bool) -> None:
    metadata = metadata_of(munich(ExifImageWidth=noted[0], ExifImageHeight=noted[1]))
    assert (metadata.vertical_fov is not None) is known
    assert metadata.focal_length == 26.0


# Hostile input

VALUES = st.one_of(
    st.integers(),
    st.floats(),
    st.text(max_size=30),
    st.binary(max_size=30),
    st.booleans(),
    st.none(),
    st.builds(IFDRational, st.integers(0, 5), st.integers(0, 3)),
)
TAGS = st.sampled_from(
    [
        BASE.DateTimeOriginal,
        BASE.DateTimeDigitized,
        BASE.OffsetTimeOriginal,
        BASE.OffsetTimeDigitized,
        BASE.FocalLengthIn35mmFilm,
        BASE.ExifImageWidth,
        BASE.ExifImageHeight,
        *GPS,
    ]
)


@pytest.mark.slow
@given(st.dictionaries(TAGS, VALUES | st.tuples(VALUES) | st.tuples(VALUES, VALUES, VALUES)))
def test_any_value_of_any_tag_gives_facts(tags: dict[int, Any]) -> None:
    image = Image.new("RGB", (40, 60))
    image.getexif = lambda: exif(tags, tags)  # type: ignore[method-assign]
    metadata = read_metadata(read_tags(image), 40, 60)
    assert metadata.vertical_fov is None or 5.0 <= metadata.vertical_fov <= 120.0
    assert (metadata.latitude is None) is (metadata.longitude is None)
    assert metadata.latitude is None or abs(metadata.latitude) <= 90
    assert metadata.heading is None or 0 <= metadata.heading < 360


GOOD = munich().tobytes()


@pytest.mark.slow
@given(st.lists(st.tuples(st.integers(6, len(GOOD) - 1), st.integers(0, 255)), min_size=1, max_size=12))
def test_a_damaged_block_never_rejects_a_photo(changes: list[tuple[int, int]]) -> None:
    block = bytearray(GOOD)
    for position, value in changes:
        block[position] = value
    photo = read_photo(encode(SCENE, exif=bytes(block)))
    assert {photo.width, photo.height} == {160, 120}


@given(st.binary(max_size=200))
def test_nor_does_a_block_of_noise(noise: bytes) -> None:
    photo = read_photo(encode(SCENE, exif=b"Exif\0\0" + struct.pack("<2sHI", b"II", 42, 8) + noise))
    assert photo.metadata.gps_time is None or isinstance(photo.metadata.gps_time, datetime)


PITCH = "http://www.dji.com/drone-dji/1.0 GimbalPitchDegree"
BOMB = (
    b'<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">'
    + b"".join(f'<!ENTITY {chr(98 + i)} "{f"&{chr(97 + i)};" * 10}">'.encode() for i in range(12))
    + b']><x xmlns:d="http://www.dji.com/drone-dji/1.0/" d:GimbalPitchDegree="1"><y>&m;</y></x>'
)


def test_attributes_and_elements_are_alike() -> None:
    for elements in (False, True):
        found = read_xmp(drone("-12.30", elements=elements))
        assert found[PITCH] == "-12.30"
        assert read_xmp(drone("-12.30", elements=elements) + b"\0\0 \n") == found
        assert read_xmp(packet(DJI.rstrip("/"), {"GimbalPitchDegree": "-12.30"}, elements))[PITCH] == "-12.30"


def test_the_first_of_two_counts() -> None:
    twice = packet(DJI, {"GimbalPitchDegree": "-1"}).replace(b"</rdf:RDF>", b"<d:a xmlns:d='u'>2</d:a></rdf:RDF>")
    assert read_xmp(twice)[PITCH] == "-1"


@pytest.mark.parametrize(
    "data",
    [
        None,
        (1, 2),
        "text",
        b"",
        b"<x",
        b"<x></y>",
        b"\xff\xfe",
        b"<?xml version='1.0' encoding='nobody-knows'?><x/>",
        BOMB,
        b'<!DOCTYPE x SYSTEM "file:///etc/passwd"><x/>',
        b'<!DOCTYPE x [<!ENTITY e SYSTEM "file:///etc/passwd">]><x>&e;</x>',
        drone("-1").replace(b"<rdf:RDF", b"<!--" + b"x" * MAX_XMP_BYTES + b"--><rdf:RDF"),
    ],
)
def test_what_is_damaged_large_or_an_attack_counts_as_absent(data: Any) -> None:
    assert read_xmp(data) == {}


@pytest.mark.parametrize(
    "data",
    [
        BOMB,
        b"<x>" * (MAX_XMP_BYTES // 3),
        b"<x " + b" ".join(f'a{i}="1"'.encode() for i in range(20_000)) + b"/>",
        b"<x>" + b"&amp;" * (MAX_XMP_BYTES // 5 - 10) + b"</x>",
        b"<x>" + b"\0" * 60_000_000,
    ],
)
def test_no_packet_takes_long(data: bytes) -> None:
    start = time.process_time()
    read_xmp(data)
    assert time.process_time() - start < 1.0


def test_megabytes_of_it_leave_the_photo_as_it_is() -> None:
    packet = b"<x>" + b"a" * 4_000_000
    plain, heavy = (read_photo(encode(scene(160, 120), "WEBP", **options)) for options in ({}, {"xmp": packet}))
    assert heavy.metadata == plain.metadata
    assert (heavy.pixels == plain.pixels).all()


@given(st.binary(max_size=200))
def test_no_packet_whatever_raises(data: bytes) -> None:
    for start in (b"", b"<", b"<x ", drone("-1")[:200]):
        read_xmp(start + data)


def with_segment(jpeg: bytes, block: bytes) -> bytes:
    """The JPEG with another EXIF segment before its own."""
    body = b"Exif\0\0" + block
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + jpeg[2:]


def test_the_second_exif_segment_counts_where_the_first_says_nothing() -> None:
    """Each with its own byte order; of two that say the same, the first counts."""
    editor = Image.Exif()
    editor[BASE.Orientation] = 6
    first = editor.tobytes().removeprefix(b"Exif\0\0")
    metadata = read_photo(with_segment(encode(SCENE, exif=munich().tobytes()), first)).metadata
    assert metadata == read_photo(encode(SCENE.transpose(1, 0, 2), exif=munich().tobytes())).metadata
    photo = read_photo(with_segment(encode(SCENE, exif=munich(Orientation=8).tobytes()), first))
    assert photo.pixels.shape[:2] == (160, 120)
    assert photo.pixels[0, 0, 1] > 200  # turned as the first says


def test_segments_of_damaged_exif_lose_no_photo() -> None:
    for block in (b"", b"II*\0", b"MM\0*\xff\xff\xff\xff", b"\0" * 100):
        assert read_photo(with_segment(encode(SCENE, exif=munich().tobytes()), block)).pixels.shape == (120, 160, 3)


def test_the_first_of_several_xmp_packets_counts_where_it_says_something() -> None:
    said = packet("http://ns.adobe.com/exif/1.0/", {"FocalLengthIn35mmFilm": "26"})
    data = encode(SCENE)
    for packets in ([said, b"<x/>"], [b"<x/>", said], [said, said.replace(b"26", b"50")]):
        segments = b"".join(
            b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body
            for body in (b"http://ns.adobe.com/xap/1.0/\0" + one for one in packets)
        )
        assert read_photo(data[:2] + segments + data[2:]).metadata.focal_length == 26.0


def test_xmp_in_utf_16_and_with_junk_behind_it() -> None:
    assert read_xmp(drone("-1").decode().encode("utf-16"))[PITCH] == "-1"
    assert read_xmp(drone("-1") + b"\0\0junk")[PITCH] == "-1"


@pytest.mark.parametrize(
    ("name", "prefix"),
    [("exif", b""), ("exif", b"Exif\0\0"), ("APP1", b"Exif\0\0"), ("app1", b""), ("EXIF", b"Exif\0\0")],
)
def test_exif_as_text_in_a_png(name: str, prefix: bytes) -> None:
    """As ImageMagick and old versions of ExifTool write it."""
    block = prefix + munich().tobytes().removeprefix(b"Exif\0\0")
    assert read_photo(raw_profile(name, block)).metadata == metadata_of(munich(), file_format="PNG")


def test_xmp_as_text_in_a_png() -> None:
    xmp = packet("http://ns.adobe.com/exif/1.0/", {"FocalLengthIn35mmFilm": "26"})
    assert read_photo(raw_profile("xmp", xmp)).metadata.focal_length == 26.0
    chunks = PngInfo()
    chunks.add_text("XML:com.adobe.xmp", xmp.decode())
    assert read_photo(encode(SCENE, "PNG", pnginfo=chunks)).metadata.focal_length == 26.0
    assert read_photo(raw_profile("APP1", b"http://ns.adobe.com/xap/1.0/\0" + xmp)).metadata.focal_length == 26.0


@pytest.mark.parametrize("text", ["", "\nexif\n 4\nzz", "\nexif\n", "x" * 1000])
def test_damaged_text_in_a_png_is_no_exif(text: str) -> None:
    chunks = PngInfo()
    chunks.add_text("Raw profile type exif", text, zip=True)
    assert read_photo(encode(SCENE, "PNG", pnginfo=chunks)).metadata == PhotoMetadata()


def raw_profile(name: str, block: bytes) -> bytes:
    digits = block.hex()
    lines = "\n".join(digits[i : i + 72] for i in range(0, len(digits), 72))
    chunks = PngInfo()
    chunks.add_text(f"Raw profile type {name}", f"\n{name}\n{len(block):8d}\n{lines}\n", zip=True)
    return encode(SCENE, "PNG", pnginfo=chunks)


def iptc_resources(date: str, time: str) -> bytes:
    """Photoshop's resources with IPTC's date and time."""
    sets = b"".join(
        b"\x1c\x02" + bytes([number]) + len(text).to_bytes(2, "big") + text.encode()
        for number, text in ((55, date), (60, time))
    )
    return b"8BIM\x04\x04\0\0" + len(sets).to_bytes(4, "big") + sets + b"\0" * (len(sets) % 2)


@pytest.mark.parametrize("name", ["iptc", "8bim"])
@pytest.mark.parametrize("prefix", [b"", b"Photoshop 3.0\0"])
def test_iptc_in_a_png(name: str, prefix: bytes) -> None:
    metadata = read_photo(raw_profile(name, prefix + iptc_resources("20240601", "184900+0200"))).metadata
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2024, 6, 1, 18, 49), 2.0)
    assert read_photo(raw_profile(name, b"no resources")).metadata == PhotoMetadata()


@pytest.mark.parametrize(
    ("text", "offset"),
    [("Sat, 01 Jun 2024 18:49:00 +0200", 2.0), ("2024:06:01 18:49:00", None), ("2024-06-01T18:49:00+02:00", 2.0)],
)
def test_the_creation_time_of_a_png(text: str, offset: float | None) -> None:
    chunks = PngInfo()
    chunks.add_text("Creation Time", text)
    metadata = read_photo(encode(SCENE, "PNG", pnginfo=chunks)).metadata
    assert (metadata.local_time, metadata.utc_offset) == (datetime(2024, 6, 1, 18, 49), offset)


def test_exif_as_imagemagick_tells_it_in_a_png() -> None:
    texts = {"DateTimeOriginal": "2024:06:01 18:49:00", "OffsetTimeOriginal": "+02:00", "FocalLengthIn35mmFilm": "26"}
    texts |= {"GPSLatitude": "48/1, 8/1, 2400/100", "GPSLatitudeRef": "N", "GPSLongitude": "11/1, 34/1, 48/1"}
    texts |= {"GPSLongitudeRef": "E", "GPSTimeStamp": "16/1, 49/1, 3/1", "GPSDateStamp": "2024:06:01"}
    texts |= {"GPSImgDirection": "22435/100", "GPSImgDirectionRef": "T"}
    chunks = PngInfo()
    for name, text in texts.items():
        chunks.add_text(f"exif:{name}", text)
    found = read_photo(encode(SCENE, "PNG", pnginfo=chunks)).metadata
    assert (found.local_time, found.utc_offset) == (datetime(2024, 6, 1, 18, 49), 2.0)
    assert found.gps_time == datetime(2024, 6, 1, 16, 49, 3, tzinfo=UTC)
    assert found.location == pytest.approx(MUNICH)
    assert (found.focal_length, found.heading, found.heading_reference) == (26.0, 224.35, "true")


def place_of(element: str, latitude: str) -> str:
    inside = f"<e:GPSLatitude>{latitude}</e:GPSLatitude><e:GPSLongitude>11,34.8E</e:GPSLongitude>"
    return f'<i:{element}><r:Bag><r:li r:parseType="Resource">{inside}</r:li></r:Bag></i:{element}>'


def test_the_place_that_a_photo_shows_is_not_the_camera_s() -> None:
    names = f'xmlns:r="{RDF}" xmlns:e="http://ns.adobe.com/exif/1.0/"'
    names += ' xmlns:i="http://iptc.org/std/Iptc4xmpExt/2008-02-29/"'
    places = place_of("LocationShown", "28,8.4N") + place_of("LocationCreated", "48,8.4N")
    data = f"<r:RDF {names}><r:Description>{places}</r:Description></r:RDF>".encode()
    assert read_photo(encode(SCENE, xmp=data)).metadata.location == pytest.approx((48.14, 11.58))


GPS_TAGS = ExifTags.GPS
EXIF, DJI_NAMESPACE = "http://ns.adobe.com/exif/1.0", "http://www.dji.com/drone-dji/1.0"
MUNICH, DENVER = (48.14, 11.58), (39.74, -104.99)


def gps(latitude: object, north: object, longitude: object, east: object) -> dict[int, object]:
    values = zip(
        (GPS_TAGS.GPSLatitude, GPS_TAGS.GPSLatitudeRef, GPS_TAGS.GPSLongitude, GPS_TAGS.GPSLongitudeRef),
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
    (found,) = places(tags, {})
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
        ({f"{DJI_NAMESPACE} GpsLatitude": "+39.74", f"{DJI_NAMESPACE} GpsLongtitude": "-104.99"}, DENVER),
        ({f"{DJI_NAMESPACE} Latitude": "+39.74", f"{DJI_NAMESPACE} Longitude": "-104.99"}, DENVER),
    ],
)  # fmt: skip
def test_a_place_in_xmp_alone(properties: dict[str, str], place: tuple[float, float]) -> None:
    (found,) = places({}, properties)
    assert found == pytest.approx(place, abs=1e-9)


def test_exif_counts_before_xmp() -> None:
    elsewhere = {f"{EXIF} GPSLatitude": "39,44.4N", f"{EXIF} GPSLongitude": "104,59.4W"}
    assert places(gps((48, 8, 24), "N", (11, 34, 48), "E"), elsewhere)[0] == pytest.approx(MUNICH)


def test_a_hemisphere_that_nothing_states_is_open() -> None:
    assert len(places(gps((48, 8, 24), "", (11, 34, 48), ""), {})) == 4
    assert set(places(gps(48.0, "N", 11.0, None), {})) == {(48.0, 11.0), (48.0, -11.0)}


@pytest.mark.parametrize(
    ("word", "signs"), [("O", {1, -1}), ("V", {1, -1}), ("Ost", {1}), ("OESTE", {-1}), ("West", {-1})]
)
def test_a_hemisphere_in_other_languages(word: str, signs: set[int]) -> None:
    """O is east in German and west in French."""
    for tags in (gps(48.0, "N", 11.0, word), gps(48.0, "N", f"11.0 {word}", None)):
        assert set(places(tags, {})) == {(48.0, sign * 11.0) for sign in signs}
    if word == "O":
        clock = replace(metadata_of(munich()), local_time=datetime(2024, 6, 1, 12), utc_offset=-6.0)
        denver = replace(clock, latitude=None, longitude=None, locations=((39.74, 104.99), (39.74, -104.99)))
        assert resolve_hemisphere(denver)[0].location == DENVER


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
    assert places(tags, {}) == ()


@given(st.text(max_size=80), st.one_of(st.none(), st.text(max_size=5), st.binary(max_size=5), st.floats()))
def test_no_text_raises(text: str, reference: object) -> None:
    for latitude, longitude in places(gps(text, reference, text, reference), {f"{EXIF} GPSLatitude": text}):
        assert abs(latitude) <= 90.0
        assert math.isfinite(longitude)


def test_a_heading_in_exif_or_else_in_xmp() -> None:
    properties = {f"{EXIF} GPSImgDirection": "22329/100", f"{EXIF} GPSImgDirectionRef": "T"}
    heading, reference = heading_of({}, properties)
    assert heading == pytest.approx(223.29)
    assert str(reference) == "true"
    assert heading_of({GPS_TAGS.GPSImgDirection: 60.0, GPS_TAGS.GPSImgDirectionRef: "M"}, properties) == (
        60.0,
        "magnetic",
    )
    assert heading_of({}, {f"{EXIF} GPSImgDirection": "5/0"}) == (None, None)
    assert heading_of({GPS_TAGS.GPSImgDirection: 361.0}, {}) == (None, None)


@pytest.mark.parametrize("value", ["224", "224/1", "224,0", b"22400/100\0", (224.0,), -136.0])
def test_a_heading_however_it_is_written(value: object) -> None:
    assert heading_of({GPS_TAGS.GPSImgDirection: value}, {})[0] == pytest.approx(224.0)


@pytest.mark.parametrize(
    ("namespace", "name", "value", "is_thermal"),
    [
        (DJI, "ImageSource", "InfraredCamera", True),
        (DJI, "ImageSource", "WideCamera", False),
        ("http://pix4d.com/camera/1.0/", "BandName", "LWIR", True),
        ("http://pix4d.com/camera/1.0/", "BandName", "Red", False),
        ("http://ns.flir.com/xmp/1.0/", "TelemetryVersion", "2", True),
    ],
)
def test_xmp_tells_a_thermal_camera(namespace: str, name: str, value: str, is_thermal: bool) -> None:
    photo = encode(scene(64, 48), xmp=packet(namespace, {name: value}))
    assert read_photo(photo).metadata.is_thermal == is_thermal


def test_flirs_segments_tell_a_thermal_camera() -> None:
    plain = encode(scene(64, 48))
    segment = b"FLIR\0\1\0\0" + bytes(40)
    marked = plain[:2] + b"\xff\xe1" + (len(segment) + 2).to_bytes(2, "big") + segment + plain[2:]
    assert read_photo(marked).metadata.is_thermal
    assert not read_photo(plain).metadata.is_thermal

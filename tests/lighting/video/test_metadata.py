"""What clips' files say of how they were taken: tags, subtitles, XML; and how the pixels choose among their clocks."""

import struct
from dataclasses import replace
from datetime import UTC, datetime
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest

from lighting.errors import WarningCode, warning_code
from lighting.fusion.estimate import build_estimate
from lighting.fusion.single_view import fuse
from lighting.fusion.user_input import UserInput
from lighting.photo.metadata import PhotoMetadata
from lighting.records import Lighting
from lighting.video.decode import Clip
from lighting.video.gpmf import read_gps_fix
from lighting.video.metadata import (
    Gimbal,
    container_metadata,
    find_log_curve,
    merge_metadata,
    read_subtitles,
    subtitle_metadata,
    xml_metadata,
)
from lighting.video.tracking import ClipMetadata
from tests.helpers.clips import pan, write_clip
from tests.helpers.predictions import lobe_prediction

DJI = """1
00:00:00,000 --> 00:00:00,033
<font size="28">FrameCnt: 1, DiffTime: 33ms
2024-06-01 09:10:00.123
[iso: 100] [shutter: 1/1000.0] [fnum: 2.8] [focal_len: 24.00] [latitude: 48.1375] [longitude: 11.575]
[rel_alt: 10.0 abs_alt: 530.0] [gb_yaw: 350.0 gb_pitch: -10.0 gb_roll: 0.5] </font>

2
00:00:02,000 --> 00:00:02,033
<font size="28">FrameCnt: 61, DiffTime: 33ms
2024-06-01 09:10:02.123
[iso: 100] [focal_len: 24.00] [latitude: 48.1375] [longitude: 11.575]
[gb_yaw: 10.0 gb_pitch: -20.0 gb_roll: 0.5] </font>
"""


def _read(text: str, width: int, height: int) -> tuple[PhotoMetadata, Gimbal]:
    """Of an SRT file."""
    blocks = text.split("\n\n")
    return subtitle_metadata([(2.0 if "00:00:02,000 -->" in b else 0.0, b) for b in blocks], width, height)


def test_a_phone_from_apple_tells_time_zone_place_and_lens() -> None:
    facts = container_metadata(
        {
            "com.apple.quicktime.location.ISO6709": "+48.1375+011.5750+520.000/",
            "com.apple.quicktime.creationdate": "2024-06-01T09:10:00+0200",
            "com.apple.quicktime.camera.focal_length.35mm_equivalent": "26",
            "creation_time": "2024-06-01T09:00:00.000000Z",
        },
        1920,
        1080,
    )
    assert facts.local_time == datetime(2024, 6, 1, 9, 10)
    assert facts.utc_offset == 2.0
    assert (facts.latitude, facts.longitude) == (48.1375, 11.575)
    assert facts.vertical_fov == pytest.approx(44.4, abs=0.3)  # a diagonal of 43.27 mm at 26 mm, on 16:9


def test_a_phone_with_android_tells_utc_and_a_western_place() -> None:
    noted = {"location": "+40.7128-074.0060/", "creation_time": "2024-06-01T12:00:00.000000Z"}
    facts = container_metadata(noted, 640, 360)
    assert (facts.local_time, facts.utc_offset) == (datetime(2024, 6, 1, 12), 0.0)
    assert facts.longitude == -74.006


@pytest.mark.parametrize(
    "metadata",
    [
        {"location": "+95.0+011.0/"},
        {"location": "+00.0000+000.0000/"},
        {"location": "somewhere"},
        {"creation_time": "1904-01-01T00:00:00.000000Z"},
        {"creation_time": "yesterday"},
        {"com.apple.quicktime.camera.focal_length.35mm_equivalent": "nan"},
    ],
)
def test_what_cannot_be_true_is_absent(metadata: dict[str, str]) -> None:
    facts = container_metadata(metadata, 640, 360)
    assert [facts.latitude, facts.local_time, facts.vertical_fov] == [None] * 3


def test_subtitles_of_a_drone_tell_place_lens_clock_and_gimbal() -> None:
    facts, gimbal = _read(DJI, 1920, 1080)
    assert facts.local_time == datetime(2024, 6, 1, 9, 10)
    assert facts.latitude == 48.1375
    assert facts.focal_length == 24.0
    assert gimbal.at(1.0) == pytest.approx((0.0, -15.0, 0.5))  # half-way from 350 to 10 deg, over north
    assert gimbal.at(60.0) is None


def test_a_gimbal_on_its_head_points_where_the_upper_edge_of_its_picture_does() -> None:
    """DJI's may count straight down in two ways, half a turn of yaw and roll apart, and change between them."""
    down = DJI.replace("gb_yaw: 350.0 gb_pitch: -10.0 gb_roll: 0.5", "gb_yaw: 100.0 gb_pitch: -90.0 gb_roll: 0.0")
    down = down.replace("gb_yaw: 10.0 gb_pitch: -20.0 gb_roll: 0.5", "gb_yaw: -80.0 gb_pitch: -90.0 gb_roll: 180.0")
    _, gimbal = _read(down, 1920, 1080)
    assert [gimbal.at(time)[0] for time in (0.0, 1.0, 2.0)] == pytest.approx([100.0] * 3)  # type: ignore[index]


def test_a_roll_is_read_over_half_a_turn() -> None:
    turned = Gimbal(np.array([0.0, 2.0]), np.zeros(2), np.zeros(2), np.array([179.0, -179.0]))
    assert turned.at(1.0) == pytest.approx((0.0, 0.0, 180.0))


@pytest.mark.parametrize(
    ("said", "length"), [("24.00", 24.0), ("24", 24.0), ("240", 24.0), ("166.00", 166.0), ("2400", None), ("0", None)]
)
def test_a_drone_counts_its_focal_length_in_millimetres_or_tenths(said: str, length: float | None) -> None:
    facts, _ = _read(DJI.replace("24.00", said), 1920, 1080)
    assert facts.focal_length == pytest.approx(length)
    assert (facts.vertical_fov is None) == (length is None)


@pytest.mark.parametrize(
    ("ratio", "length"), [("10000, delta:0", 24.0), ("1.00", 24.0), ("20000, delta:0", None), ("1.50", None)]
)
def test_a_picture_that_is_zoomed_digitally_tells_no_lens(ratio: str, length: float | None) -> None:
    facts, _ = _read(DJI.replace("24.00]", f"24.00] [dzoom_ratio: {ratio}]"), 1920, 1080)
    assert facts.focal_length == length
    assert (facts.vertical_fov is None) == (length is None)


@pytest.mark.parametrize(
    "said",
    [
        "F/2.8, SS 1000, ISO 100, EV 0, GPS (-74.006, 40.7128, 15), D 10.2m, H 10.0m, H.S 0.0m/s",
        "HOME(-74.01,40.71) 2017.05.04 09:10:11\nGPS(-74.006,40.7128,15) BAROMETER:9.1\nISO:100 Shutter:60 Fnum:2.2",
    ],
)
def test_older_drones_write_the_longitude_first(said: str) -> None:
    facts, gimbal = _read(f"1\n00:00:00,000 --> 00:00:01,000\n{said}\n", 1920, 1080)
    assert (facts.latitude, facts.longitude) == (40.7128, -74.006)
    assert facts.local_time == (datetime(2017, 5, 4, 9, 10, 11) if "HOME" in said else None)
    assert (facts.focal_length, len(gimbal.time)) == (None, 0)


def test_subtitles_for_viewers_say_nothing() -> None:
    facts, gimbal = _read("1\n00:00:00,000 --> 00:00:02,000\nHello: 3 friends\n", 640, 360)
    assert facts.latitude is None
    assert len(gimbal.time) == 0


def test_gimbal_angles_out_of_order_are_not_believed() -> None:
    first, second = DJI.split("\n\n")
    _, gimbal = _read(f"{second}\n\n{first}", 640, 360)
    assert len(gimbal.time) == 0
    np.testing.assert_equal(gimbal.at(1.0), None)


def test_facts_are_merged_whole() -> None:
    drone, _ = _read(DJI, 1920, 1080)
    box = container_metadata({"location": "+10+010/", "creation_time": "2020-01-01T00:00:00Z"}, 1920, 1080)
    merged = merge_metadata(drone, box)
    assert merged.latitude == 48.1375
    assert (merged.utc_offset, merged.utc_probability) == (None, None)  # the drone's clock, not half of each


# Clocks: what the file's number means.

PHONE, UNKNOWN = {"com.android.version": "14"}, {"encoder": "Lavf62.12.102"}
CAMERAS = {
    "gopro-hero7": {"firmware": "HD7.01.01.90.00"},
    "gopro-hero12": {"firmware": "H23.01.02.32.00", "handler_name": "GoPro AVC"},
    "canon": {"major_brand": "mp42", "compatible_brands": "isomCAEPavc1mp41"},
    "nikon": {"major_brand": "niko"},
    "pentax": {"make": "PENTAX"},
    "insta360": {"make": "Arashi Vision"},
    "dji-osmo": {"encoder": "DJI OsmoPocket3"},
}
EVENING = datetime(2024, 6, 1, 16, 49, tzinfo=UTC)  # when the sun is 20.1 deg high in Munich


def answer(tags: dict[str, str], sun: float, **user: Any) -> Lighting:
    """What a clip in Munich whose pixels show a sun so high [deg] becomes."""
    clip = ClipMetadata(container_metadata(tags, 640, 360), user_input=UserInput(lat=48.14, lon=11.58, **user))
    prior = clip.prior_at(0.0)
    return build_estimate(fuse(lobe_prediction(0.0, sun), prior.observations), prior).lighting


def codes(lighting: Lighting) -> list[WarningCode]:
    return [warning_code(warning) for warning in lighting.warnings]


@pytest.mark.parametrize("marks", [*CAMERAS.values(), UNKNOWN], ids=[*CAMERAS, "unknown"])
def test_local_time_in_the_place_of_utc_is_found_by_the_pixels(marks: dict[str, str]) -> None:
    told = answer({**marks, "creation_time": "2024-06-01T18:49:00.000000Z"}, 21.0)
    assert (told.utc_time, told.utc_offset, told.time_source) == (EVENING, 2.0, "zone of the place")
    assert told.sun_elevation == pytest.approx(20.1, abs=0.2)
    assert codes(told) == [WarningCode.CLOCK_CONTRADICTED]
    assert "2024-06-01 18:49 UTC, may be local time" in told.warnings[0]
    assert told.warnings[0].endswith("local time was used.")


@pytest.mark.parametrize("marks", [PHONE, *CAMERAS.values(), UNKNOWN], ids=["phone", *CAMERAS, "unknown"])
def test_true_utc_stays_and_needs_no_word_where_the_pixels_are_plain(marks: dict[str, str]) -> None:
    told = answer({**marks, "creation_time": "2024-06-01T16:49:00.000000Z"}, 20.0)
    assert (told.utc_time, told.time_source) == (EVENING, "offset in the file")
    assert told.warnings == ()


def test_a_phones_utc_stays_whatever_the_pixels_show() -> None:
    told = answer({**PHONE, "creation_time": "2024-06-01T16:49:00Z"}, 65.0)  # as it was at noon
    assert told.utc_time == EVENING
    assert codes(told) == [WarningCode.ELEVATION_CONTRADICTED]


def test_a_clip_whose_utc_would_be_night_is_no_night() -> None:
    told = answer({**CAMERAS["nikon"], "creation_time": "2024-06-01T20:40:00Z"}, 4.0)
    assert told.utc_time == datetime(2024, 6, 1, 18, 40, tzinfo=UTC)
    assert told.sun_elevation == pytest.approx(2.9, abs=0.3)


def test_utc_is_doubted_aloud_where_the_pixels_do_not_tell_it_from_local_time() -> None:
    """At noon both suns are high."""
    told = answer({**UNKNOWN, "creation_time": "2024-06-01T12:20:00Z"}, 60.0)
    assert codes(told) == [WarningCode.CLOCK_CONTRADICTED]


def test_a_stated_offset_settles_it_without_a_word() -> None:
    told = answer({**CAMERAS["canon"], "creation_time": "2024-06-01T18:49:00Z"}, 65.0, utc_offset=2.0)
    assert (told.utc_time, told.time_source) == (EVENING, "user")
    assert codes(told) == [WarningCode.ELEVATION_CONTRADICTED]


def test_where_the_clock_is_utc_there_is_nothing_to_choose() -> None:
    clip = ClipMetadata(container_metadata({"creation_time": "2024-01-01T12:00:00Z"}, 640, 360))
    iceland = replace(clip, user_input=UserInput(lat=64.1, lon=-21.9)).prior_at(0.0)
    assert len(iceland.instants.instants) == 1
    assert iceland.instants.conflict is None


@pytest.mark.parametrize(
    ("tags", "offset", "probability"),
    [
        ({"creation_time": "2024-06-01 18:49:00"}, None, None),  # of AVI, without a zone
        ({"date": "2024-06-01T18:49:00+0200", "creation_time": "2024-06-01T18:49:00Z"}, 2.0, None),
        ({"date": "2024", "creation_time": "2024-06-01T18:49:00Z"}, 0.0, 0.75),
        ({"creation_time": "2024-06-01T18:49:00Z", "com.apple.quicktime.make": "Apple"}, 0.0, None),
        ({"creation_time": "2024-06-01T18:49:00Z", "make": "Canon"}, 0.0, 0.5),
    ],
)
def test_zones_are_as_the_tags_have_them(tags: dict[str, str], offset: float | None, probability: float | None) -> None:
    metadata = container_metadata(tags, 640, 360)
    assert metadata.local_time == datetime(2024, 6, 1, 18, 49)
    assert (metadata.utc_offset, metadata.utc_probability) == (offset, probability)


def test_xml_beside_a_clip_tells_the_zone(tmp_path: Path) -> None:
    (tmp_path / "C0001M01.XML").write_text('<NonRealTimeMeta><CreationDate value="2024-06-01T18:49:00+02:00"/>')
    path = write_clip(tmp_path / "C0001.MP4", pan(3), metadata={"creation_time": "2024-06-01T18:49:00Z"})
    with Clip(path) as clip:
        assert (clip.info.metadata.utc_offset, clip.info.metadata.utc_probability) == (2.0, None)
    assert xml_metadata("<a/>") == PhotoMetadata()


def box(name: bytes, data: bytes) -> bytes:
    return (8 + len(data)).to_bytes(4, "big") + name + data


SONY = b'<NonRealTimeMeta><CreationDate value="2024-06-01T18:49:00+02:00"/>'
SONY += b'<Item name="CaptureGammaEquation" value="s-log3-cine"/></NonRealTimeMeta>'
XMP = b"<x:xmpmeta><aux:PictureProfile>S-Log3</aux:PictureProfile></x:xmpmeta>"


@pytest.mark.parametrize(
    ("inside", "offset"),
    [
        (box(b"meta", bytes(4) + box(b"hdlr", bytes(8) + b"nrtm" + bytes(13)) + box(b"xml ", bytes(4) + SONY)), 2.0),
        (box(b"uuid", b"\xbe\x7a\xcf\xcb\x97\xa9\x42\xe8\x9c\x71\x99\x94\x91\xe3\xaf\xac" + XMP), 0.0),
        (box(b"moov", box(b"udta", box(b"XMP_", XMP))), 0.0),
        ((1).to_bytes(4, "big") + b"uuid" + (16 + len(SONY)).to_bytes(8, "big") + SONY, 2.0),
        (bytes(4) + b"uuid" + XMP, 0.0),  # up to the end
    ],
)
def test_xml_in_boxes_of_a_clip_is_read_as_that_beside_it(tmp_path: Path, inside: bytes, offset: float) -> None:
    path = write_clip(tmp_path / "a.mp4", pan(3), metadata={"creation_time": "2024-06-01T18:49:00Z"})
    path.write_bytes(path.read_bytes() + box(b"free", b"") + inside)
    with Clip(path) as clip:
        assert (clip.form.curve, clip.info.metadata.utc_offset) == ("s-log3", offset)
        assert "S-Log3, by its XML" in clip.info.warnings[0]


@pytest.mark.parametrize("name", ["a.XMP", "a.mp4.xmp"])
def test_xmp_beside_a_clip_names_the_curve(tmp_path: Path, name: str) -> None:
    path = write_clip(tmp_path / "a.mp4", pan(3))
    (tmp_path / name).write_bytes(XMP)
    with Clip(path) as clip:
        assert clip.form.curve == "s-log3"


@pytest.mark.parametrize(
    "end", [b"\0\0\0\x07uuid", b"\xff\xff\xff\xffmeta<", b"\0\0\0\1uuid\0", b"\0\0\0\x09\xff\xfe\0\0<"]
)
def test_damaged_boxes_are_left_out(tmp_path: Path, end: bytes) -> None:
    path = write_clip(tmp_path / "a.mp4", pan(3))
    path.write_bytes(path.read_bytes() + end)
    with Clip(path) as clip:
        assert clip.form.curve is None


# GoPro's metadata track.


def key(name: bytes, kind: str, size: int, data: bytes) -> bytes:
    head = name + (kind.encode() if kind else b"\0") + bytes([size]) + (len(data) // size).to_bytes(2, "big")
    return head + data + bytes(-len(data) % 4)


def gopro_sample(fix: int, time: str = "240601164905.000", dilution: int = 180) -> bytes:
    """A second of a HERO5 to HERO10: its accelerometer, and its GPS."""
    place = struct.pack(">10i", 481375000, 115750000, 520000, 1200, 12, 481376000, 115751000, 520000, 1200, 12)
    gps = [
        key(b"GPSF", "L", 4, struct.pack(">I", fix)),
        key(b"GPSU", "U", 16, time.encode()),
        key(b"GPSP", "S", 2, struct.pack(">H", dilution)),
        key(b"SCAL", "l", 4, struct.pack(">5i", 10**7, 10**7, 1000, 1000, 100)),
        key(b"GPS5", "l", 20, place),
    ]
    motion = key(b"SCAL", "s", 2, b"\1\xa2") + key(b"ACCL", "s", 6, bytes(600))
    streams = key(b"STRM", "", 1, motion) + key(b"STRM", "", 1, b"".join(gps))
    return key(b"DEVC", "", 1, key(b"DVNM", "c", 1, b"HERO7 Black") + streams)


def gopro11_sample(fix: int) -> bytes:
    """A second of a HERO11 or later."""
    scales = struct.pack(">9i", 10**7, 10**7, 1000, 1000, 100, 1, 1000, 100, 1)
    days = (datetime(2024, 6, 1) - datetime(2000, 1, 1)).days
    seconds = 1000 * (16 * 3600 + 49 * 60 + 5)
    values = struct.pack(">7i2H", 481375000, 115750000, 520000, 1200, 12, days, seconds, 180, fix)
    gps = key(b"TYPE", "c", 1, b"lllllllSS") + key(b"SCAL", "l", 4, scales) + key(b"GPS9", "?", 32, values)
    return key(b"DEVC", "", 1, key(b"STRM", "", 1, gps))


@pytest.mark.parametrize("sample", [gopro_sample(3), gopro_sample(2), gopro11_sample(3)])
def test_gopros_track_has_time_and_place(sample: bytes) -> None:
    fix = read_gps_fix(sample)
    assert fix is not None
    assert fix.time == datetime(2024, 6, 1, 16, 49, 5, tzinfo=UTC)
    assert (fix.latitude, fix.longitude) == (48.1375, 11.575)


@pytest.mark.parametrize(
    "sample", [gopro_sample(0), gopro_sample(3, dilution=9999), gopro11_sample(0), b"DEVC", b"", b"DEVC" + bytes(40)]
)
def test_without_a_fix_gopros_track_says_nothing(sample: bytes) -> None:
    assert read_gps_fix(sample) is None


def test_a_damaged_gopro_track_says_nothing_or_what_it_says() -> None:
    sample, random = gopro_sample(3), np.random.default_rng(0)
    for _ in range(500):
        damaged = bytearray(sample[: random.integers(8, len(sample) + 1)])
        for place in random.integers(0, len(damaged), 3):
            damaged[place] = random.integers(256)
        read_gps_fix(bytes(damaged))


def test_the_satellites_time_of_a_gopro_counts_from_the_clips_start(tmp_path: Path) -> None:
    clock = {"creation_time": "2024-06-01T18:49:00Z"}  # local time, as the GoPro writes it
    samples = [(0, gopro_sample(0)), (5000, gopro_sample(3))]  # before and with a fix
    path = write_tracks(tmp_path / "a.mp4", "mov_text", samples, clock)
    path.write_bytes(path.read_bytes().replace(b"tx3g", b"gpmd").replace(b"sbtl", b"meta"))
    with Clip(path) as clip:
        metadata = clip.info.metadata
        circumstances = ClipMetadata.of_clip(clip, UserInput())
    assert metadata.gps_time == datetime(2024, 6, 1, 16, 49, 0, tzinfo=UTC)
    assert (metadata.latitude, metadata.longitude) == (48.1375, 11.575)
    instants = circumstances.prior_at(0.0).instants.instants
    assert [instant.utc_time for instant in instants] == [metadata.gps_time]


# Logarithms that files name.


@pytest.mark.parametrize(
    ("said", "name", "curve"),
    [
        ("dlog", "D-Log", "d-log"),
        ("d_log", "D-Log", "d-log"),
        ("D-Log M", "D-Log M", None),
        ("dlog_m", "D-Log M", None),
        ("default", None, None),
        ("d_cinelike", None, None),
    ],
)
def test_djis_subtitles_name_the_curve(said: str, name: str | None, curve: str | None) -> None:
    found, warning = find_log_curve({}, [(0.0, f"[iso: 100] [color_md : {said}] [focal_len: 24.00]")], "")
    assert found == curve
    assert (warning is None) == (name is None)
    if warning is not None:
        assert f"is in {name}, by its subtitles" in warning
        assert warning.code is WarningCode.CURVE
        assert ("was undone" in warning) == (curve is not None)


@pytest.mark.parametrize(
    ("xml", "curve"),
    [
        ('<Item name="CaptureGammaEquation" value="s-log3-cine"/>', "s-log3"),
        ('<Item name="CaptureGammaEquation" value="rec709"/>', None),
        ("<CaptureGamma>V-LOG</CaptureGamma>", "v-log"),
        ("<p2:CaptureGamma>V-Log L</p2:CaptureGamma>", "v-log"),
        ("<Gamma>Canon Log 3</Gamma>", "c-log3"),
        ('<rdf:Description crs:CameraProfile="Camera F-Log2" dc:format="video/mp4"/>', "f-log2"),
        ("<aux:PictureProfile> N-Log </aux:PictureProfile>", "n-log"),
        ('<rdf:Description dc:title="My vlog" dc:creator="S-Log3 Films"/>', None),
    ],
)
def test_xml_beside_a_clip_names_the_curve(xml: str, curve: str | None) -> None:
    assert find_log_curve({}, [], xml)[0] == curve


@pytest.mark.parametrize(
    ("tags", "curve"),
    [
        ({"com.apple.proapps.customgamma": "com.apple.rec2020.apple-log"}, "apple-log"),
        ({"com.apple.proapps.customgamma": "com.sony.slog3"}, "s-log3"),
        ({"com.arri.camera.ColorGammaSxS": "LOG-C4"}, "logc4"),
        ({"com.example.GammaCurve": "N-Log"}, "n-log"),
        ({"com.example.color_profile": "F-Log2"}, "f-log2"),
        ({"title": "My vlog in Munich", "comment": "no slog3"}, None),
    ],
)
def test_tags_of_a_clip_name_the_curve(tags: dict[str, str], curve: str | None) -> None:
    assert find_log_curve(tags, [], "")[0] == curve


# Subtitles inside the clip.


STYLES = b"""[Script Info]

[V4+ Styles]
Format: Name, Fontname, Fontsize
Style: Default,Arial,16

[Events]
Format: Layer, Start, End, Text
"""  # which encoders ask for


def write_subtitled(path: Path, codec: str) -> Path:
    """The clip with DJI's two entries as a track of subtitles."""
    texts = (block.split("\n", 2)[2].encode() for block in DJI.split("\n\n")[:2])
    coded = {
        "mov_text": lambda text: len(text).to_bytes(2, "big") + text,
        "ass": lambda text: b"0,0,Default,,0,0,0,," + text.replace(b"\n", b"\\N").replace(b"[iso", b"iso"),
    }.get(codec, bytes)
    return write_tracks(path, codec, list(zip((0, 2000), map(coded, texts), strict=True)))


def write_tracks(
    path: Path, codec: str, samples: list[tuple[int, bytes]], metadata: dict[str, str] | None = None
) -> Path:
    """A clip with samples, each with its thousandth of a second, as a track of subtitles."""
    plain = write_clip(path.with_name("plain.mp4"), pan(6))
    with av.open(str(plain)) as source, av.open(str(path), "w") as target:
        target.metadata.update(metadata or {})
        pictures = target.add_stream_from_template(source.streams.video[0])
        texts: Any = target.add_stream(codec)
        texts.codec_context.subtitle_header, texts.codec_context.time_base = STYLES, Fraction(1, 1000)
        for packet in source.demux(source.streams.video[0]):
            if packet.dts is not None:
                packet.stream = pictures
                target.mux(packet)
        for start, sample in samples:
            entry: Any = av.Packet(sample)
            entry.pts = entry.dts = start
            entry.duration, entry.time_base, entry.stream = 2000, Fraction(1, 1000), texts
            target.mux(entry)
    return path


@pytest.mark.parametrize(
    ("name", "codec"), [("a.mp4", "mov_text"), ("a.mov", "mov_text"), ("a.mkv", "subrip"), ("a.mkv", "ass")]
)
def test_subtitles_inside_a_clip_are_read_as_those_beside_it(tmp_path: Path, name: str, codec: str) -> None:
    path = write_subtitled(tmp_path / name, codec)
    with Clip(path) as clip:
        inside = clip.info
    path.with_suffix(".SRT").write_text(DJI)
    with Clip(path) as clip:
        beside = clip.info
    assert inside.metadata == beside.metadata
    assert inside.metadata.local_time == datetime(2024, 6, 1, 9, 10)
    assert inside.gimbal.at(1.0) == pytest.approx((0.0, -15.0, 0.5))
    assert inside.gimbal.at(1.0) == pytest.approx(beside.gimbal.at(1.0))


def test_the_file_beside_counts_before_the_track_inside(tmp_path: Path) -> None:
    path = write_subtitled(tmp_path / "a.mp4", "mov_text")
    path.with_suffix(".srt").write_text(DJI.replace("48.1375", "50.5"))
    assert read_subtitles(path)[1][0] == 2.0
    with Clip(path) as clip:
        assert clip.info.metadata.latitude == 50.5

"""How a clip was taken: by its container's tags, by DJI's subtitles in it or beside it, and by XML in it or beside it.

All are hostile input: whatever cannot be read, or cannot be true, counts as absent.

QuickTime and MP4 count seconds in UTC, and phones do so. Many cameras write local time there, and their make does not
tell: with a zone set, GoPro's HERO12 writes UTC, its forerunners did not. `lighting.fusion.instants` resolves it.
"""

import re
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import BinaryIO, TypeVar

import numpy as np

from lighting.color import LogCurve
from lighting.errors import CodedWarning, WarningCode
from lighting.geometry import Floats, wrap_azimuth
from lighting.photo.camera import vertical_fov_from_focal_length
from lighting.photo.clock import Stamp, read_stamp
from lighting.photo.imu import heading_from_gimbal
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.tags import read_number

_Value = TypeVar("_Value")
QUICKTIME = "com.apple.quicktime."
LOCATION_TAGS = (f"{QUICKTIME}location.ISO6709", "location", "location-eng", "\xa9xyz")
LENS_TAGS = (f"{QUICKTIME}camera.focal_length.35mm_equivalent",)
HEADING_TAGS = (f"{QUICKTIME}direction.facing",)
ZONED_TIME_TAGS = (f"{QUICKTIME}creationdate", "date", "date-eng")  # of texts, which name their zone
UNIVERSAL_TIME_TAG = "creation_time"  # of a number, which is in UTC by the format
FOCAL_LENGTHS = (8.0, 180.0)  # mm, as on 35 mm film, that a drone's lens may have
MAX_SUBTITLE_BYTES = 64_000_000  # bytes; an hour of DJI's at 30 frames a second is 30 million
MAX_XML_BYTES = 4_000_000  # of Sony's, which holds what changed from frame to frame

_UTC_PROBABILITY = 0.75  # of a number of which nothing tells who wrote it: phones do it right, most cameras do not
_UTC_PROBABILITY_OF_CAMERAS = 0.5
_CAMERA_TAGS = ("major_brand", "compatible_brands", "handler_name", "encoder", "make", "manufacturer", "firmware")
_CAMERA_MARKS = re.compile(
    r"(?i)gopro|\bH[D0-9][0-9.]+|CAEP|canon|niko|pentax|ricoh|olympus|om digital|panasonic|fujifilm|casio|leica|sigma"
    r"|insta360|arashi|\bdji|garmin|akaso|sjcam"
)
_PHONE_TAGS = ("com.android.", "com.samsung.", "com.google.")  # how the names of tags begin
_YEAR_OF_ZERO = 1904
_METADATA_BOXES = (b"meta", b"udta", b"uuid")
_MAX_BOXES = 10_000  # at one level of a file, of which fragments have many
_XML_TIME = re.compile(r'<CreationDate value="([^"]{10,40})"')

_ISO6709 = re.compile(r"([+-]\d{1,2}(?:\.\d+)?)([+-]\d{1,3}(?:\.\d+)?)(?:[+-]\d+(?:\.\d+)?)?(?:CRS[^/]*)?/?")
_NUMBER = re.compile(r"(\w+)\s*:\s*([+-]?\d+(?:\.\d+)?)")
# longitude first, as older models write it
_GPS_PAIR = re.compile(r"\bGPS ?\(([+-]?\d+(?:\.\d+)?), ?([+-]?\d+(?:\.\d+)?)")
_START_TIME = re.compile(r"(\d+):(\d\d):(\d\d)[,.](\d{3})\s*-->")
_NO_DIGITAL_ZOOM = (0.0, 1.0, 10000.0)  # ratios: some models count ten-thousandths, and 0 says nothing
_CLOCK = re.compile(r"\d{4}[-.]\d\d[-.]\d\d \d\d:\d\d:\d\d")

# Logarithms of cameras: in what their makers call them, letters and digits; their names for people, and the curve where
# it is published. Those that begin with another's letters are before it.
_LOG_NAMES: dict[str, tuple[str, LogCurve | None]] = {
    "applelog2": ("Apple Log 2", None),
    "applelog": ("Apple Log", "apple-log"),
    "dlogm": ("D-Log M", None),
    "dlog": ("D-Log", "d-log"),
    "slog3": ("S-Log3", "s-log3"),
    "slog": ("S-Log", None),
    "vlog": ("V-Log", "v-log"),
    "canonlog3": ("Canon Log 3", "c-log3"),
    "clog3": ("Canon Log 3", "c-log3"),
    "canonlog": ("Canon Log", None),
    "clog": ("Canon Log", None),
    "nlog": ("N-Log", "n-log"),
    "flog2": ("F-Log2", "f-log2"),
    "flog": ("F-Log", None),
    "logc4": ("LogC4", "logc4"),
    "logc": ("LogC3", "logc3"),
    "ilog": ("I-Log", None),
    "gplog": ("GP-Log", None),
    "log3g10": ("Log3G10", None),
    "filmlog": ("Blackmagic Film", None),
}
_DJI_COLORS = re.compile(r"\bcolor_md\s*:\s*([^\]\[\n]{1,40})")
_CURVE_TAG = re.compile(r"(?i)gamma|curve|transfer|colou?r|profile|_log")  # in the names of tags that may name one
_XML_ITEM = re.compile(r'name="([^"]{1,60})"\s+value="([^"]{1,60})"')  # of Sony's XML
_XML_ATTRIBUTE = re.compile(r'([\w:.-]{1,60})\s*=\s*["\']([^"\'<>]{1,60})["\']')
_XML_ELEMENT = re.compile(r"<([\w:.-]{1,60})(?:\s[^<>]*)?>\s*([^<>]{1,60}?)\s*</")
_UNDONE = "The clip is in {}, by {}: its curve was undone."
_NOT_UNDONE = "The clip is in {}, by {}, whose curve is unknown: colors are off."
LOOKS_LOGARITHMIC = CodedWarning(
    "The clip looks as if it were in a camera's logarithm: if it is, give its curve, for light and colors are off.",
    WarningCode.CURVE,
)

_WHOLE = (  # fields that are of one source, told where the first of them is
    ("local_time", "utc_offset", "utc_probability"),
    ("gps_time",),
    ("latitude", "longitude"),
    ("heading", "heading_reference"),
    ("vertical_fov", "focal_length"),
)

Subtitle = tuple[float, str]  # when it begins [s], and its text


@dataclass(frozen=True, eq=False)
class Gimbal:
    """Where a drone says its camera points; all (N,), N may be 0, times rising."""

    time: Floats = field(default_factory=lambda: np.empty(0))
    """Seconds from the clip's start."""
    heading: Floats = field(default_factory=lambda: np.empty(0))
    """Deg clockwise from north, as `heading_from_gimbal`."""
    elevation: Floats = field(default_factory=lambda: np.empty(0))
    """Elevation, deg."""
    roll: Floats = field(default_factory=lambda: np.empty(0))
    """Roll, deg."""

    def at(self, time: float) -> tuple[float, float, float] | None:
        """Return heading, elevation and roll [deg] at a time; None where the gimbal says nothing.

        Args:
            time: s from the clip's start.
        """
        if not len(self.time) or not self.time[0] - 1.0 <= time <= self.time[-1] + 1.0:
            return None
        headings, rolls = (np.degrees(np.unwrap(np.radians(angle))) for angle in (self.heading, self.roll))
        heading, elevation, roll = (float(np.interp(time, self.time, v)) for v in (headings, self.elevation, rolls))
        return heading % 360.0, elevation, float(wrap_azimuth(roll))


def container_metadata(tags: Mapping[str, str], width: int, height: int) -> PhotoMetadata:
    """Read the metadata of a container; what cannot be read or be true counts as absent.

    Args:
        tags: by name, as PyAV has them.
        width: pixels of the upright picture.
        height: pixels of the upright picture.
    """
    location = _first_value(tags, LOCATION_TAGS, _parse_iso6709)
    focal_length = _first_value(tags, LENS_TAGS, _positive)
    result = _lens_and_place(focal_length, location, width, height)
    return _with_recording_time(replace(result, heading=_first_value(tags, HEADING_TAGS, _degrees)), tags)


def _lens_and_place(
    focal_length: float | None, location: tuple[float, float] | None, width: int, height: int
) -> PhotoMetadata:
    """Metadata of a focal length [mm, as on 35 mm film] and of a latitude and longitude [deg]."""
    latitude, longitude = location or (None, None)
    fov = None if focal_length is None else vertical_fov_from_focal_length(focal_length, width, height)
    return PhotoMetadata(latitude=latitude, longitude=longitude, focal_length=focal_length, vertical_fov=fov)


def _first_value(tags: Mapping[str, str], names: tuple[str, ...], read: Callable[[str], _Value]) -> _Value | None:
    for name in names:
        with suppress(ArithmeticError, LookupError, TypeError, ValueError):  # a tag that is not there, too
            if (value := read(tags[name])) is not None:
                return value
    return None


def _parse_iso6709(text: str) -> tuple[float, float] | None:
    """Latitude and longitude [deg] of ISO 6709 in decimal degrees, "+48.1173+011.5167+520/"."""
    parts = _ISO6709.fullmatch(text.strip())
    return None if parts is None else _valid_location(float(parts[1]), float(parts[2]))


def _valid_location(latitude: float, longitude: float) -> tuple[float, float] | None:
    nowhere = latitude == longitude == 0.0  # what recorders write that have no fix
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 and not nowhere else None


def _positive(text: str) -> float | None:
    value = read_number(text)
    return value if value > 0 else None


def _degrees(text: str) -> float:
    return read_number(text) % 360.0


def _with_recording_time(result: PhotoMetadata, tags: Mapping[str, str]) -> PhotoMetadata:
    """The same with the moment of recording: of a text with its zone, else of the number that should be in UTC."""
    texts = [stamp for name in ZONED_TIME_TAGS if (stamp := _possible_stamp(tags.get(name)))]
    zoned = next((stamp for stamp in texts if stamp.utc_offset is not None), None)
    number = _possible_stamp(tags.get(UNIVERSAL_TIME_TAG))
    if (stamp := zoned or number or next(iter(texts), None)) is None:
        return result
    doubted = stamp is number and stamp.utc_offset == 0.0
    probability = _utc_probability(tags) if doubted else None
    return replace(result, local_time=stamp.time, utc_offset=stamp.utc_offset, utc_probability=probability)


def _possible_stamp(text: str | None) -> Stamp | None:
    """The time of a text; None where there is none, or that of a number which is 0, for QuickTime counts from 1904."""
    stamp = read_stamp(text)
    return stamp if stamp is not None and stamp.time.year > _YEAR_OF_ZERO else None


def _utc_probability(tags: Mapping[str, str]) -> float | None:
    """Probability that a number in UTC is not local time after all; None where the writer is known to do it right."""
    if any(name.startswith(_PHONE_TAGS) for name in tags) or tags.get(f"{QUICKTIME}make", "").lower() == "apple":
        return None
    marks = (tags.get(name, "") for name in (*_CAMERA_TAGS, f"{QUICKTIME}make"))
    return _UTC_PROBABILITY_OF_CAMERAS if any(map(_CAMERA_MARKS.search, marks)) else _UTC_PROBABILITY


def read_subtitles(clip: Path) -> list[Subtitle]:
    """Read the subtitle file of the same name as a clip; empty without one.

    Args:
        clip: the clip's file.
    """
    text = _read_beside(clip, (".SRT", ".srt"), MAX_SUBTITLE_BYTES)
    blocks = ((_START_TIME.search(block), block) for block in re.split(r"\r?\n\s*\r?\n", text))
    times = ((map(int, start.groups()), block) for start, block in blocks if start is not None)
    return [(3600.0 * h + 60.0 * m + s + ms / 1000.0, block) for (h, m, s, ms), block in times]


def read_xml(clip: Path) -> str:
    """Read the XML of cameras and the XMP of programs that lie beside a clip, then those in an MP4 or MOV.

    Args:
        clip: the clip's file.
    """
    names = ("M01.XML", "M01.xml", ".XML", ".xml"), (f"{clip.suffix}.xmp", ".XMP", ".xmp")
    beside = (_read_beside(clip, endings, MAX_XML_BYTES) for endings in names)
    return "\n".join(filter(None, (*beside, _text_of_boxes(clip))))


def _text_of_boxes(clip: Path) -> str:
    """The texts in an MP4's or a MOV's boxes for metadata: Sony's XML, XMP; empty of other files."""
    try:
        with clip.open("rb") as file:
            found = [data for data in _metadata_boxes(file, clip.stat().st_size, 0) if b"<" in data]
    except (OSError, struct.error):
        return ""
    return "\n".join(data.decode("utf-8", errors="replace") for data in found)


def _metadata_boxes(file: BinaryIO, end: int, depth: int) -> Iterator[bytes]:
    """The contents of boxes for metadata, up to where [bytes] the file, or the box around them, ends."""
    for _ in range(_MAX_BOXES):
        start = file.tell()
        header = file.read(8)
        if len(header) < 8 or not header[4:].strip(b"\xa9").isalnum():
            return
        size = int.from_bytes(header[:4], "big")
        size = struct.unpack(">Q", file.read(8))[0] if size == 1 else size or end - start
        stop = min(start + size, end)
        if header[4:] in _METADATA_BOXES and stop - start <= MAX_XML_BYTES:
            yield file.read(max(0, stop - file.tell()))
        elif header[4:] == b"moov" and depth == 0:
            yield from _metadata_boxes(file, stop, depth + 1)
        if stop <= start:
            return
        file.seek(stop)


def _read_beside(clip: Path, endings: Sequence[str], max_bytes: int) -> str:
    """The text of the first file that is there and has a clip's name and one of these endings; empty without."""
    for ending in endings:
        file = clip.with_name(clip.stem + ending)
        try:
            if file.is_file() and file.stat().st_size <= max_bytes:
                return file.read_text(encoding="utf-8", errors="replace")
        except (OSError, ValueError):
            return ""
    return ""


def xml_metadata(text: str) -> PhotoMetadata:
    """Read the moment of recording, which names its zone, of a clip's XML.

    Args:
        text: as `read_xml` has it; may be empty.
    """
    found = _XML_TIME.search(text)
    stamp = None if found is None else _possible_stamp(found[1])
    return PhotoMetadata() if stamp is None else PhotoMetadata(stamp.time, stamp.utc_offset)


def subtitle_metadata(subtitles: Sequence[Subtitle], width: int, height: int) -> tuple[PhotoMetadata, Gimbal]:
    """Read the metadata of DJI's first entry and the gimbal's angles of all; other subtitles say nothing.

    Args:
        subtitles: of the file or of a track in it.
        width: pixels of the upright picture.
        height: pixels of the upright picture.
    """
    entries = [(start, values, text) for start, text in subtitles if (values := _dji_values(text))]
    if not entries:
        return PhotoMetadata(), Gimbal()
    _, first, text = entries[0]
    zoomed = float(first.get("dzoom_ratio", 1.0)) not in _NO_DIGITAL_ZOOM  # a crop, of which the lens says nothing
    focal_length = None if zoomed else _parse_focal_length(first.get("focal_len", ""))
    clock = _CLOCK.search(text)
    stamp = read_stamp(clock[0]) if clock else None
    location = next((place for _, values, _ in entries if (place := _entry_location(values)) is not None), None)
    metadata = _lens_and_place(focal_length, location, width, height)
    gimbal = _make_gimbal([(start, values) for start, values, _ in entries])
    return replace(metadata, local_time=None if stamp is None else stamp.time), gimbal


def _dji_values(block: str) -> dict[str, str]:
    """The numbers of one entry as they stand, by the names that DJI gives them; none where it is not DJI's."""
    values = {name.lower(): value for name, value in _NUMBER.findall(block)}
    if position := _GPS_PAIR.search(block):
        values["longitude"], values["latitude"] = position[1], position[2]
    return values if {"latitude", "gb_yaw", "focal_len", "iso"} & values.keys() else {}


def _parse_focal_length(text: str) -> float | None:
    """Millimeters of "24.00", of "24", and of "240", as models write it that count tenths; None for what cannot be."""
    value = float(text or 0.0)
    value = 0.1 * value if value >= 100.0 and "." not in text else value
    return value if FOCAL_LENGTHS[0] <= value <= FOCAL_LENGTHS[1] else None


def _entry_location(values: Mapping[str, str]) -> tuple[float, float] | None:
    longitude = values.get("longitude", values.get("longtitude"))  # as some models spell it
    if "latitude" not in values or longitude is None:
        return None
    return _valid_location(float(values["latitude"]), float(longitude))


def _make_gimbal(entries: Sequence[tuple[float, Mapping[str, str]]]) -> Gimbal:
    names = ("gb_yaw", "gb_pitch", "gb_roll")
    complete = [(start, *map(values.__getitem__, names)) for start, values in entries if values.keys() >= set(names)]
    table = np.array(complete, dtype=np.float64)
    if not len(table) or np.any(np.diff(table[:, 0]) <= 0) or np.any(np.abs(table[:, 1:]) > 360.0):
        return Gimbal()
    time, yaw, pitch, roll = table.T
    heading = np.array([heading_from_gimbal(*angles) for angles in zip(pitch, roll, yaw, strict=True)])
    return Gimbal(time, heading, pitch, roll)


def find_log_curve(
    tags: Mapping[str, str], subtitles: Sequence[Subtitle], xml: str
) -> tuple[LogCurve | None, CodedWarning | None]:
    """Find the logarithm that a clip's files name.

    Args:
        tags: of the container, by name.
        subtitles: in the clip or beside it.
        xml: beside the clip or in it; may be empty.

    Returns:
        The curve, None where none is known, and what was done, None where the files name no logarithm.
    """
    of_drone = (found[1] for _, text in subtitles[:1] for found in _DJI_COLORS.finditer(text))
    pairs = (pattern.findall(xml) for pattern in (_XML_ITEM, _XML_ELEMENT, _XML_ATTRIBUTE))
    beside = (value for name, value in chain.from_iterable(pairs) if _CURVE_TAG.search(name))
    in_tags = (value for name, value in tags.items() if _CURVE_TAG.search(name))
    sources = (("its subtitles", of_drone), ("its XML", beside), ("its file", in_tags))
    for source, text in ((source, text) for source, texts in sources for text in texts):
        plain = re.sub(r"[^a-z0-9]", "", text.lower())
        if (found := next((log for name, log in _LOG_NAMES.items() if name in plain), None)) is not None:
            name, curve = found
            sentence = (_NOT_UNDONE if curve is None else _UNDONE).format(name, source)
            return curve, CodedWarning(sentence, WarningCode.CURVE)
    return None, None


def merge_metadata(first: PhotoMetadata, second: PhotoMetadata) -> PhotoMetadata:
    """Merge two sources of metadata; each clock and a location is taken whole.

    Args:
        first: what counts.
        second: what counts where `first` says nothing.
    """
    told = [names for names in _WHOLE if getattr(first, names[0]) is not None]
    return replace(second, **{name: getattr(first, name) for names in told for name in names})

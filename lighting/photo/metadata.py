"""EXIF and XMP -> PhotoMetadata; timestamps and UTC offsets parsed.

Both are hostile input: whatever cannot be read, or cannot be true, counts as absent.
"""

import math
import re
import reprlib
import struct
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta, timezone
from enum import StrEnum
from functools import partial
from typing import Any, TypeVar
from xml.parsers import expat

from PIL import ExifTags, Image

import lighting.photo.imu as imu
from lighting.errors import ErrorCode, ParameterError

_Tags = Mapping[int, Any]
_Value = TypeVar("_Value")

YEAR_RANGE = (1900, 2100)  # outside them no ephemeris is computed
UTC_OFFSET_RANGE = (-12.0, 14.0)  # h from UTC of all zones
FULL_FRAME_DIAGONAL = math.hypot(36.0, 24.0)  # mm, to which 35 mm equivalents refer

_TIME = re.compile(r"[0-9W-]+[Tt ][0-9:.,]+ ?(Z|[+-][0-9:.]+)?")  # Python's reader takes any character for T and space
_OFFSET = re.compile(r"([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|(Z)", re.ASCII)
_VERTICAL_FOV = (5.0, 120.0)  # deg, what an ordinary lens covers; values outside are clamped
_TIME_TAGS = (  # local times, the better one first, with their offsets from UTC
    (ExifTags.Base.DateTimeOriginal, ExifTags.Base.OffsetTimeOriginal),
    (ExifTags.Base.DateTimeDigitized, ExifTags.Base.OffsetTimeDigitized),
)
_EXPOSURE_VALUES = (-20.0, 25.0)  # EV at ISO 100 that a photo can have; others are damage
_SAME_ASPECT = 0.02  # relative difference up to which a picture counts as uncropped
_MAX_XMP_BYTES = 1 << 18  # of a packet that is read; what fits into one segment of a JPEG is a quarter of it


class HeadingReference(StrEnum):
    """The north from which a heading counts."""

    TRUE = "true"
    MAGNETIC = "magnetic"


@dataclass(frozen=True)
class PhotoMetadata:
    """How a photo was taken; None is unknown. The repr omits the location, so that no log shows it."""

    local_time: datetime | None = None  # naive
    utc_offset: float | None = None  # h, local minus universal time
    utc_time: datetime | None = None  # aware
    latitude: float | None = field(default=None, repr=False)  # deg, positive north
    longitude: float | None = field(default=None, repr=False)  # deg, positive east; None if latitude is
    heading: float | None = None  # deg clockwise from `heading_reference`, 0 to 360
    heading_reference: HeadingReference | None = None
    focal_length: float | None = None  # mm, of the 36 x 24 mm camera with the same diagonal field of view
    vertical_fov: float | None = None  # deg, of the upright photo
    camera_elevation: float | None = None  # deg, positive looks up, of the upright photo
    camera_roll: float | None = None  # deg, positive turns the camera clockwise; steep cameras have none
    gravity_source: str | None = None  # of the two: "accelerometer", "gimbal" or "elevation angle"
    gravity_spread: float | None = None  # deg, standard deviation of the two
    exposure_value: float | None = None  # EV at ISO 100, of the camera's settings


def read_metadata(image: Image.Image, width: int, height: int) -> PhotoMetadata:
    """The metadata in an image's EXIF and XMP. Never raises.

    Args:
        image: opened by Pillow.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
    """
    camera, gps = (_directory(image, ifd) for ifd in (ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo))
    xmp = _xmp_properties(image.info.get("xmp"))
    local_time, utc_offset = _local_time_and_offset(camera)
    utc_time = to_utc(local_time, utc_offset) if local_time and utc_offset is not None else _try_read(_gps_time, gps)
    latitude, longitude = _try_read(_gps_location, gps) or (None, None)
    heading, reference = _try_read(_heading, gps), _try_read(_heading_reference, gps)
    if heading is None and (heading := imu.heading_from_xmp(xmp)) is not None:
        reference = HeadingReference.TRUE
    focal_length = _try_read(_focal_length, camera)
    uncropped = _try_read(lambda tags: _is_uncropped(tags, width / height), camera)
    fov = vertical_fov_from_focal_length(focal_length, width, height) if focal_length and uncropped else None
    tilt = _camera_tilt(camera, xmp, read_orientation(image), (width, height)) if uncropped else None
    known = PhotoMetadata(local_time, utc_offset, utc_time, latitude, longitude, heading, reference, focal_length, fov)
    known = replace(known, exposure_value=_try_read(_exposure_value, camera))
    if tilt is None:
        return known
    known = replace(known, camera_elevation=tilt.elevation, camera_roll=tilt.roll)
    return replace(known, gravity_source=tilt.source, gravity_spread=tilt.std)


def read_exposure(image: Image.Image) -> float | None:
    """Exposure time [s] x ISO / 100 / f-number^2 in an image's EXIF block; None without a time. Never raises.

    Two photos by one lens differ in this as their pixels do. A sensitivity or an f-number that is absent counts as
    ISO 100 and f/1, for lenses without contacts note none.

    Args:
        image: opened by Pillow.
    """
    return _try_read(_exposure, _directory(image, ExifTags.IFD.Exif))


def read_orientation(image: Image.Image) -> int | None:
    """Orientation 1 to 8 by EXIF, or else by XMP, which Pillow reads for it; None without. Never raises.

    Args:
        image: opened by Pillow.
    """
    try:
        value = image.getexif().get(ExifTags.Base.Orientation)
    except Exception:  # EXIF is hostile input
        return None
    return value if isinstance(value, int) else None


def vertical_fov_from_focal_length(focal_length: float, width: int, height: int) -> float:
    """Vertical field of view of an upright photo in deg, clamped to 5 to 120.

    By the diagonal: the lens covers the photo's diagonal as one of that focal length covers that of 36 x 24 mm.

    Args:
        focal_length: mm, in 35 mm terms.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
    """
    half_height = 0.5 * FULL_FRAME_DIAGONAL * height / math.hypot(width, height)
    low, high = _VERTICAL_FOV
    return min(max(math.degrees(2 * math.atan2(half_height, focal_length)), low), high)


def parse_time(text: str) -> datetime:
    """A moment in ISO 8601, with the offset from UTC if it has one; ParameterError otherwise.

    Args:
        text: such as "2024-06-01T14:30" or "2024-06-01T14:30+02:00".
    """
    if not isinstance(text, str):
        raise _no_time(text)
    try:
        time = datetime.fromisoformat(text.strip())
        time.astimezone(UTC)
    except (ValueError, OverflowError) as error:
        raise _no_time(text) from error
    if len(text.strip()) <= len("2024-06-01"):
        raise ParameterError(f"{text!r} is a day without a time.", "time", ErrorCode.MALFORMED)
    if not _TIME.fullmatch(text.strip()):
        raise _no_time(text)
    if (offset := time.utcoffset()) is not None:
        _check_offset(offset / timedelta(hours=1))
    return time


def _no_time(text: object) -> ParameterError:
    sentence = f"{reprlib.repr(text)} is not a time such as 2024-06-01T14:30 or 2024-06-01T14:30+02:00."
    return ParameterError(sentence, "time", ErrorCode.MALFORMED)


def parse_utc_offset(text: str) -> float:
    """Hours from UTC, -12 to 14; ParameterError otherwise.

    Args:
        text: such as "+02:00", "-0330", "5.5" or "Z".
    """
    parts = _OFFSET.fullmatch(text.strip()) if isinstance(text, str) else None
    if not parts:
        sentence = f"{reprlib.repr(text)} is not an offset from UTC such as +02:00 or -3.5."
        raise ParameterError(sentence, "utc_offset", ErrorCode.MALFORMED)
    if parts[4]:
        hours = float(parts[4])
    else:
        hours = 0.0 if parts[5] else (int(parts[2]) + int(parts[3]) / 60) * (-1 if parts[1] == "-" else 1)
    _check_offset(hours)
    return hours


def _check_offset(hours: float) -> None:
    """Raise ParameterError where no zone is so far from UTC."""
    low, high = UTC_OFFSET_RANGE
    if not low <= hours <= high:
        sentence = f"The offset from UTC is {hours:g} h; it must lie in {low:g} to {high:g}."
        raise ParameterError(sentence, "utc_offset", ErrorCode.OUT_OF_RANGE)


def to_utc(local_time: datetime, utc_offset: float) -> datetime:
    """A naive local time as an aware one in UTC.

    Args:
        local_time: naive.
        utc_offset: h, local minus universal time.
    """
    return local_time.replace(tzinfo=timezone(timedelta(hours=utc_offset))).astimezone(UTC)


def _directory(image: Image.Image, ifd: int) -> _Tags:
    try:
        return dict(image.getexif().get_ifd(ifd))
    except Exception:  # Pillow raises nearly anything on hostile bytes
        return {}


def _camera_tilt(
    tags: _Tags, xmp: Mapping[str, str], orientation: int | None, size: tuple[int, int]
) -> imu.CameraTilt | None:
    """The camera's tilt, by the first source that has it."""
    by_phone = _try_read(lambda t: imu.tilt_from_accelerometer(t, orientation, size), tags)
    return by_phone or imu.tilt_from_gimbal(xmp, orientation) or _try_read(imu.tilt_from_elevation_angle, tags)


def _try_read(read: Callable[[_Tags], _Value | None], tags: _Tags) -> _Value | None:
    try:
        return read(tags)
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, struct.error):
        return None


def _local_time_and_offset(tags: _Tags) -> tuple[datetime | None, float | None]:
    """The first local time that can be read, and the offset of that time: of the picture's, or of its scan's."""
    times = [(_try_read(partial(_local_time, time), tags), offset) for time, offset in _TIME_TAGS]
    first = next((time for time, _ in times if time is not None), None)
    offsets = (_try_read(partial(_utc_offset, offset), tags) for time, offset in times if time == first)
    return first, next((offset for offset in offsets if offset is not None), None)


def _local_time(tag: int, tags: _Tags) -> datetime | None:
    year, month, day, hour, minute, second = map(int, re.findall(r"\d+", _text(tags[tag]))[:6])
    return _datable(datetime(year, month, day, hour, minute, second))


def _datable(time: datetime) -> datetime | None:
    return time if YEAR_RANGE[0] <= time.year <= YEAR_RANGE[1] else None


def _utc_offset(tag: int, tags: _Tags) -> float:
    return parse_utc_offset(_text(tags[tag]))


def _gps_time(tags: _Tags) -> datetime | None:
    year, month, day = map(int, re.findall(r"\d+", _text(tags[ExifTags.GPS.GPSDateStamp])))
    hours, minutes, seconds = map(_number, tags[ExifTags.GPS.GPSTimeStamp])
    valid = hours or minutes or seconds  # many programs write 0, 0, 0 where the time is unknown
    if not (valid and 0 <= hours < 24 and 0 <= minutes < 60 and 0 <= seconds < 61):
        return None
    clock = timedelta(hours=hours, minutes=minutes, seconds=seconds)
    return _datable(datetime(year, month, day, tzinfo=UTC) + clock)


def _gps_location(tags: _Tags) -> tuple[float, float] | None:
    gps = ExifTags.GPS
    latitude = _angle(tags[gps.GPSLatitude], _text(tags[gps.GPSLatitudeRef]), "NS")
    longitude = _angle(tags[gps.GPSLongitude], _text(tags[gps.GPSLongitudeRef]), "EW")
    nowhere = latitude == longitude == 0  # many programs write 0, 0 where the location is unknown
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 and not nowhere else None


def _angle(parts: Any, reference: str, signs: str) -> float:
    """Degrees from degrees, minutes and seconds, the last two of which may be absent."""
    size = sum(_number(part) / 60.0**power for power, part in enumerate(parts))
    if size < 0:
        raise ValueError("An angle with a reference has no sign.")
    return (1 - 2 * signs.index(reference[:1].upper() or "?")) * size


def _heading(tags: _Tags) -> float | None:
    heading = _number(tags[ExifTags.GPS.GPSImgDirection])
    return heading % 360.0 if 0 <= heading <= 360 else None


def _heading_reference(tags: _Tags) -> HeadingReference | None:
    reference = _text(tags[ExifTags.GPS.GPSImgDirectionRef])[:1].upper()
    return {"T": HeadingReference.TRUE, "M": HeadingReference.MAGNETIC}.get(reference)


def _focal_length(tags: _Tags) -> float | None:
    length = _number(tags[ExifTags.Base.FocalLengthIn35mmFilm])
    return length if length > 0 else None


def _exposure(tags: _Tags) -> float | None:
    base = ExifTags.Base
    iso = _iso(tags.get(base.ISOSpeedRatings, 100)) or 100.0
    aperture = _number(tags.get(base.FNumber, 1)) or 1.0
    exposure = _number(tags[base.ExposureTime]) * iso / 100.0 / aperture**2
    return exposure if exposure > 0 else None


def _exposure_value(tags: _Tags) -> float | None:
    """log2(f-number^2 / time x 100 / ISO); absent unless all three exist."""
    base = ExifTags.Base
    time, aperture = _number(tags[base.ExposureTime]), _number(tags[base.FNumber])
    value = math.log2(aperture**2 / time * 100.0 / _iso(tags[base.ISOSpeedRatings]))
    low, high = _EXPOSURE_VALUES
    return value if low <= value <= high else None


def _iso(value: Any) -> float:
    """ISO from a number, or from the first of several."""
    return _number(value[0] if isinstance(value, tuple) else value)


def _is_uncropped(tags: _Tags, aspect: float) -> bool:
    """Whether the photo has the aspect ratio, either way up, that the camera wrote; a crop has another lens."""
    width, height = (tags.get(tag) for tag in (ExifTags.Base.ExifImageWidth, ExifTags.Base.ExifImageHeight))
    if not width or not height:
        return True
    return abs(abs(math.log(aspect)) - abs(math.log(_number(width) / _number(height)))) < _SAME_ASPECT


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    return number


def _text(value: Any) -> str:
    text = value.decode("ascii") if isinstance(value, bytes) else value
    if not isinstance(text, str):
        raise TypeError("not a text")
    return text.strip("\0 ")


def _xmp_properties(packet: Any) -> dict[str, str]:
    """Attributes and elements of an XMP packet by "namespace name", the first of each; empty for what is no XMP.

    Namespaces have no slash at their ends, since writers disagree about it. Never raises.
    """
    if not isinstance(packet, bytes) or len(packet) > _MAX_XMP_BYTES:
        return {}
    reader = _Reader()
    try:
        reader.parser.Parse(packet.rstrip(b"\0 \t\r\n"), True)
    except (expat.ExpatError, ValueError, LookupError):  # LookupError: an encoding that nobody knows
        return {}
    return reader.properties


class _Reader:
    """Collects the properties while expat reads; nothing of it nests, however deep the packet is."""

    def __init__(self) -> None:
        self.properties: dict[str, str] = {}
        self._text: list[str] = []
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._refuse  # without a document type there are no entities to expand
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text.append

    def _refuse(self, *_: object) -> None:
        raise ValueError("A packet has no document type.")

    def _start(self, _: str, attributes: dict[str, str]) -> None:
        self._text.clear()
        for name, value in attributes.items():
            self._keep(name, value)

    def _end(self, name: str) -> None:
        self._keep(name, "".join(self._text))
        self._text.clear()

    def _keep(self, name: str, value: str) -> None:
        namespace, _, local = name.rpartition(" ")
        if text := value.strip():
            self.properties.setdefault(f"{namespace.rstrip('/')} {local}", text)

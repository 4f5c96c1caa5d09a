"""The photo's clocks: local time, its offset from UTC and the satellites' time, however programs write them."""

import re
import reprlib
from datetime import UTC, datetime, timedelta, timezone
from functools import partial

from PIL import ExifTags

from lighting.errors import ErrorCode, ParameterError
from lighting.photo.tags import Tags, read_number, read_text, try_read

YEAR_RANGE = (1900, 2100)  # outside them no ephemeris is computed
UTC_OFFSET_RANGE = (-12.0, 14.0)  # h from UTC of all zones

_TIME = re.compile(r"[0-9W-]+[Tt ][0-9:.,]+ ?(Z|[+-][0-9:.]+)?")  # Python's reader takes any character for T and space
_OFFSET = re.compile(r"([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|(Z)", re.ASCII)
_TIME_TAGS = (  # local times, the better one first, with their offsets from UTC
    (ExifTags.Base.DateTimeOriginal, ExifTags.Base.OffsetTimeOriginal),
    (ExifTags.Base.DateTimeDigitized, ExifTags.Base.OffsetTimeDigitized),
)


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


def read_local_time(tags: Tags) -> tuple[datetime | None, float | None]:
    """The first local time that can be read, and the offset of that time: of the picture's, or of its scan's.

    Args:
        tags: of the camera's directory.
    """
    times = [(try_read(partial(_local_time, time), tags), offset) for time, offset in _TIME_TAGS]
    first = next((time for time, _ in times if time is not None), None)
    offsets = (try_read(partial(_utc_offset, offset), tags) for time, offset in times if time == first)
    return first, next((offset for offset in offsets if offset is not None), None)


def _local_time(tag: int, tags: Tags) -> datetime | None:
    year, month, day, hour, minute, second = map(int, re.findall(r"\d+", read_text(tags[tag]))[:6])
    return _datable(datetime(year, month, day, hour, minute, second))


def _datable(time: datetime) -> datetime | None:
    return time if YEAR_RANGE[0] <= time.year <= YEAR_RANGE[1] else None


def _utc_offset(tag: int, tags: Tags) -> float:
    return parse_utc_offset(read_text(tags[tag]))


def read_gps_time(tags: Tags) -> datetime | None:
    """The satellites' time in UTC; None where it is unknown.

    Args:
        tags: of the GPS directory.
    """
    year, month, day = map(int, re.findall(r"\d+", read_text(tags[ExifTags.GPS.GPSDateStamp])))
    hours, minutes, seconds = map(read_number, tags[ExifTags.GPS.GPSTimeStamp])
    valid = hours or minutes or seconds  # many programs write 0, 0, 0 where the time is unknown
    if not (valid and 0 <= hours < 24 and 0 <= minutes < 60 and 0 <= seconds < 61):
        return None
    clock = timedelta(hours=hours, minutes=minutes, seconds=seconds)
    return _datable(datetime(year, month, day, tzinfo=UTC) + clock)

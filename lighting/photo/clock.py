"""Times and offsets from UTC as people and cameras write them."""

import re
import reprlib
from datetime import UTC, datetime, timedelta, timezone

from lighting.errors import ErrorCode, ParameterError

YEARS = (1900, 2100)  # outside them no ephemeris is asked
OFFSETS = (-12.0, 14.0)  # h from UTC of all zones

_TIME = re.compile(r"[0-9W-]+[Tt ][0-9:.,]+ ?(Z|[+-][0-9:.]+)?")  # Python's reader takes any character for T and space

_OFFSET = re.compile(r"([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|(Z)", re.ASCII)


def read_time(text: str) -> datetime:
    """A moment in ISO 8601, "2024-06-01T14:30", with the offset from UTC if it has one; ParameterError otherwise."""
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


def read_offset(text: str) -> float:
    """Hours from UTC in "+02:00", "-0330", "5.5" or "Z"; ParameterError otherwise."""
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
    if not OFFSETS[0] <= hours <= OFFSETS[1]:
        sentence = f"The offset from UTC is {hours:g} h; it must lie in {OFFSETS[0]:g} to {OFFSETS[1]:g}."
        raise ParameterError(sentence, "utc_offset", ErrorCode.OUT_OF_RANGE)


def in_utc(local_time: datetime, utc_offset: float) -> datetime:
    """A naive local time as an aware one in UTC; the offset is in h."""
    return local_time.replace(tzinfo=timezone(timedelta(hours=utc_offset))).astimezone(UTC)

"""Times and offsets from UTC that users state, in ISO 8601."""

import re
import reprlib
from datetime import UTC, datetime, timedelta, timezone

from lighting.errors import ErrorCode, ParameterError

YEAR_RANGE = (1900, 2100)  # outside them no ephemeris is computed
UTC_OFFSET_RANGE = (-12.0, 14.0)  # h from UTC of all zones

_TIME = r"[0-9W-]+[Tt ][0-9:.,]+ ?(Z|[+-][0-9:.]+)?"  # Python's reader takes any character for T and space
_OFFSET = r"(?a)([+-]?)(\d\d?):?([0-5]\d)|([+-]?\d\d?(?:\.\d+)?)|(Z)"


def parse_time(text: str) -> datetime:
    """A moment in ISO 8601, with the offset from UTC if it has one; ParameterError otherwise.

    Args:
        text: such as "2024-06-01T14:30" or "2024-06-01T14:30+02:00".
    """
    try:
        time = datetime.fromisoformat(text.strip())
        time.astimezone(UTC)
    except (AttributeError, TypeError, ValueError, OverflowError) as error:  # the first two of what is no text
        raise _no_time(text) from error
    if len(text.strip()) <= len("2024-06-01"):
        raise ParameterError(f"{text!r} is a day without a time.", "time", ErrorCode.MALFORMED)
    if not re.fullmatch(_TIME, text.strip()):
        raise _no_time(text)
    if (offset := time.utcoffset()) is not None:
        _check_offset(offset / timedelta(hours=1))
    return time


def _no_time(text: object) -> ParameterError:
    sentence = f"{reprlib.repr(text)} is not a time such as 2024-06-01T14:30 or 2024-06-01T14:30+02:00."
    return ParameterError(sentence, "time", _code_of_text(text))


def _code_of_text(text: object) -> ErrorCode:
    """What is wrong with a text that does not read as it should, or with what is no text."""
    return ErrorCode.MALFORMED if isinstance(text, str) else ErrorCode.WRONG_TYPE


def parse_utc_offset(text: str) -> float:
    """Hours from UTC, -12 to 14; ParameterError otherwise.

    Args:
        text: such as "+02:00", "-0330", "5.5" or "Z".
    """
    parts = re.fullmatch(_OFFSET, text.strip()) if isinstance(text, str) else None
    if not parts:
        sentence = f"{reprlib.repr(text)} is not an offset from UTC such as +02:00 or -3.5."
        raise ParameterError(sentence, "utc_offset", _code_of_text(text))
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

"""Times and offsets from UTC as texts, however users and programs write them.

Dates are read in every order that is beyond doubt, with words for morning and afternoon, and with offsets inside them.
Patterns are compiled when a photo first has such a text.
"""

import re
import reprlib
import unicodedata
from contextlib import suppress
from dataclasses import dataclass
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
    if not isinstance(text, str):
        raise _no_time(text)
    try:
        time = datetime.fromisoformat(text.strip())
        time.astimezone(UTC)
    except (ValueError, OverflowError) as error:
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


@dataclass(frozen=True, eq=False, repr=False)
class Stamp:
    """One date and time that a file holds."""

    time: datetime
    """Time, naive."""
    utc_offset: float | None = None
    """Hours, local minus universal time."""


_SEPARATED = (  # a date, whichever number is the year, and a time of day
    r"(?s)(\d{1,4}) ?[:/.\-年년] ?(\d{1,2}) ?[:/.\-月월] ?(\d{1,4})"
    r"(?:[T ,;_日일]|-(?=\d\d?[-:]\d\d?[-:]\d))*([^\d+\-]*)"
    r"(\d{1,2}) ?[:.\-h時时시] ?(\d{1,2})"
    r"(?: ?(?:[:.m分분]|(?<=-\d\d)-) ?(\d{1,2})(?:[.,:]\d+|[秒초])?)?(.*)"
)
_COMPACT = r"(?s)(\d{4})(\d\d)(\d\d)[T _-]?()(\d\d)(\d\d)(?:(\d\d)(?:[.,]\d+)?)?(.*)"
_MONTHS = "jan feb mar apr may jun jul aug sep oct nov dec"
_MONTH_NAME = rf"(?i)\b({_MONTHS.replace(' ', '|')})[a-z]*\b"
_YEAR, _DAY = r"\b(?:19|20)\d\d\b", r"(?<![:.+-])\b(\d{1,2})(?:st|nd|rd|th)?\b(?![:.])"
_TIME_OF_DAY = r"(?s)\d{1,2}:\d\d.*"
_SECONDS = r"([1-4]\d{9})(?:\d{3})?"  # since 1970 in UTC, after 2001, or thousandths of them
_OFFSET_TEXT = r"(?:UTC|GMT|UT)?([+-]?\d{1,2}(?::?[0-5]\d|\.\d+)?)(?!\d)|(?:UTC|GMT|UT|Z)(?![A-Z])"
_MINUTES_BEHIND_DOT = r"\.(?=(?:30|45)$)"
_ZONE_NAME = r"[A-Z][A-Za-z]+(?:/[A-Z][A-Za-z_-]+)+"
_MAX_LENGTH = 64  # characters of a date that are read
_BUDDHIST_ERA = 543  # years by which Thai phones count ahead
_ABBREVIATIONS = {  # of zones, h from UTC; others, such as CST, are of several
    **{"WET": 0, "WEST": 1, "BST": 1, "CET": 1, "CEST": 2, "MEZ": 1, "MESZ": 2, "EET": 2, "EEST": 3, "MSK": 3},
    **{"EST": -5, "EDT": -4, "CDT": -5, "MST": -7, "MDT": -6, "PST": -8, "PDT": -7, "AKST": -9, "AKDT": -8, "HST": -10},
    **{"JST": 9, "KST": 9, "HKT": 8, "AEST": 10, "AEDT": 11, "ACST": 9.5, "ACDT": 10.5, "AWST": 8, "NZST": 12},
    **{"NZDT": 13},
}
# Words that phones write for the halves of the day, in lower case without dots and blanks.
_MORNING = "damanhã demanhã delamañana paradite eparadites pg pagi পূর্বাহ্ন পূর্বাহ্ণ முற்பகல் "
_MORNING += "ಪೂರ್ವಾಹ್ನ asubuhi ጥዋት ກ່ອນທ່ຽງ ព្រឹក နံနက် rn dopoldne үө тң صبح قبلازظهر "
_MORNING += "priekšp priekšpusdienā priešpiet prijepodne преподне пријеподне günortadanöň goöň "
_MORNING += "am a 上午 早上 凌晨 清晨 午前 오전 ص صباحا قظ לפנהצ πμ sa öö dop de ap fm vm पूर्वाह्न ก่อนเที่ยง дп прел fh"
_AFTERNOON = "datarde danoite delatarde delanoche pasdite epasdites ptg petang অপরাহ্ন অপরাহ্ণ பிற்பகல் "
_AFTERNOON += "ಅಪರಾಹ್ನ alasiri mchana jioni ከሰዓት ຫຼັງທ່ຽງ ល្ងាច ညနေ in pop popoldne тк شام بعدازظهر "
_AFTERNOON += "pēcp pēcpusdienā popiet popodne поподне послијеподне günortadansoň gosoň үх "  # noqa: RUF001
_AFTERNOON += "pm p 下午 晚上 傍晚 中午 午後 오후 م مساء بظ אחהצ μμ ch ös odp du ip em nm अपराह्न หลังเที่ยง пп слоб eh"
_HALF_DAYS = dict.fromkeys(_MORNING.split(), 0) | dict.fromkeys(_AFTERNOON.split(), 12)


def read_stamp(value: object) -> Stamp | None:
    """A date and time with the offset from UTC that stands in it; None where they are absent or in doubt.

    Args:
        value: of a tag: "2024:06:01 18:49:00", "2024-06-01T16:49Z" or "2024:06:01 06:49:00 PM".
    """
    text = _with_month_number(plain_text(value).strip("\"'"))
    if seconds := re.fullmatch(_SECONDS, text):
        return Stamp(datetime.fromtimestamp(int(seconds[1]), UTC).replace(tzinfo=None), 0.0)
    parts = re.fullmatch(_SEPARATED, text) or re.fullmatch(_COMPACT, text)
    if parts is None or (date := _date(*parts.group(1, 2, 3))) is None:
        return None
    hour, minute, second = (int(part or 0) for part in parts.group(5, 6, 7))
    words, rest = _split_offset(parts[8])
    half_day = next((_HALF_DAYS[word] for word in map(_bare_word, (parts[4], words)) if word in _HALF_DAYS), None)
    if half_day is not None and hour <= 12:
        hour = hour % 12 + half_day
    try:
        time = datetime(*date, hour % 24 if hour == 24 else hour, minute, min(second, 59))
    except ValueError:
        return None
    return Stamp(time, offset_in_text(rest, time)) if YEAR_RANGE[0] <= time.year <= YEAR_RANGE[1] else None


def plain_text(value: object) -> str:
    """A tag's text with ASCII digits and plain blanks; Pillow hands UTF-8 over as if it were Latin-1.

    Args:
        value: of the tag.
    """
    if isinstance(value, str):
        with suppress(UnicodeEncodeError):
            value = value.encode("latin-1")
    if isinstance(value, bytes):
        value = value.decode("utf-8", errors="replace")
    if not isinstance(value, str):
        return ""
    text = "".join(str(unicodedata.digit(c)) if c.isdigit() else c for c in value.split("\0")[0][:_MAX_LENGTH])
    return " ".join(text.replace("\N{MINUS SIGN}", "-").split())


def _with_month_number(text: str) -> str:
    """A date such as "Sat Jun 01 18:49:00 GMT+02:00 2024" or "1 June 2024 18:49" as "2024:6:1 18:49" has it."""
    if not (month := re.search(_MONTH_NAME, text)) or not (year := re.search(_YEAR, text)):
        return text
    others = re.sub(_YEAR, "", text, count=1)
    day, time = re.search(_DAY, others), re.search(_TIME_OF_DAY, others)
    return (
        f"{year[0]}:{_MONTHS.index(month[1].lower()) // 4 + 1}:{day[1]} {' '.join(time[0].split())}"
        if day and time
        else text
    )


def _date(first: str, middle: str, last: str) -> tuple[int, int, int] | None:
    """Year, month and day; None where day and month cannot be told from each other."""
    if len(first) == 4:
        year, month, day = int(first), int(middle), int(last)
        return (year - _BUDDHIST_ERA if year > YEAR_RANGE[1] else year), month, day
    if len(last) != 4:
        return None
    if int(first) > 12 or first == middle:
        return int(last), int(middle), int(first)
    return (int(last), int(first), int(middle)) if int(middle) > 12 else None


def _split_offset(text: str) -> tuple[str, str]:
    """Words behind a time, and the offset from UTC behind them."""
    start = re.search(r"[+-]\d|\b[Zz]\b|^[Zz]|\bUTC|\bGMT|\b(?:[A-Z]{2,4}T|MESZ|MEZ|MSK)\b|\b[A-Z][a-z]+/|\[", text)
    return (text[: start.start()], text[start.start() :]) if start else (text, "")


def _bare_word(text: str) -> str:
    return "".join(c for c in text if unicodedata.category(c)[0] in "LM").lower()


def offset_in_text(text: str, time: datetime) -> float | None:
    """Hours from UTC in a text such as "+02:00", "UTC+2", "CEST" or "+02:00[Europe/Berlin]"; None where there are none.

    Args:
        text: plain.
        time: local, at which a zone that has a name is asked.
    """
    before, _, name = text.partition("[")
    text = (before.strip() or name.strip(" ]")).strip(" ()\"'")
    if text in _ABBREVIATIONS:
        return float(_ABBREVIATIONS[text])
    if re.fullmatch(_ZONE_NAME, text):
        return _offset_of_zone(text, time)
    if not (parts := re.match(_OFFSET_TEXT, text.replace(" ", "").upper())):
        return None
    try:
        hours = parse_utc_offset(re.sub(_MINUTES_BEHIND_DOT, ":", parts[1] or "Z"))
    except ParameterError:
        return None
    return hours if (4.0 * hours).is_integer() else None


def _offset_of_zone(name: str, time: datetime) -> float | None:
    from zoneinfo import ZoneInfo

    try:
        offset = time.replace(tzinfo=ZoneInfo(name)).utcoffset()
    except (KeyError, ValueError, OSError):  # no such zone
        return None
    return None if offset is None else offset / timedelta(hours=1)

"""What a photo's clocks say: local time, its offset from UTC and the satellites' time, however programs write them.

Dates are read in every order that is beyond doubt, with words for morning and afternoon, and with offsets inside them.
Patterns are compiled when a photo first has such a text.
"""

import re
import unicodedata
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from PIL import ExifTags

from lighting.errors import ParameterError
from lighting.photo.sidecars import TAKEOUT_TIME
from lighting.photo.tags import (
    EXIF_NAMESPACE,
    PNG_CREATION_TIME,
    TAG_ERRORS,
    IptcRecords,
    Tags,
    read_first_number,
    read_make,
    read_number,
    read_xmp_number,
    text_or_empty,
)
from lighting.photo.timestamps import UTC_OFFSET_RANGE, YEAR_RANGE, parse_utc_offset, to_utc

MAX_CLOCK_DIFFERENCE = timedelta(minutes=2)  # of two clocks that show one time

# Hours from UTC that clocks followed somewhere since there are digital cameras (time zone database of 2026).
_UTC_OFFSETS = (*range(-12, 15), -9.5, -8.5, -4.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.5, 8.75)
UTC_OFFSETS = frozenset(map(float, (*_UTC_OFFSETS, 9.5, 9.75, 10.5, 11.5, 12.75, 13.75)))


# A date and time, as programs write them.


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
    if value is None:  # as most of the many tags that may hold a time are
        return None
    text = _with_month_number(_plain_text(value).strip("\"'"))
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
    return Stamp(time, _offset_in_text(rest, time)) if YEAR_RANGE[0] <= time.year <= YEAR_RANGE[1] else None


def _plain_text(value: object) -> str:
    """A tag's text with ASCII digits and plain blanks; Pillow hands UTF-8 over as if it were Latin-1."""
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
    if not day or not time:
        return text
    return f"{year[0]}:{_MONTHS.index(month[1].lower()) // 4 + 1}:{day[1]} {' '.join(time[0].split())}"


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


def _offset_in_text(text: str, time: datetime) -> float | None:
    """Hours from UTC in a text such as "+02:00", "UTC+2", "CEST" or "+02:00[Europe/Berlin]"; None where there are none.

    A zone that has a name is asked at the local time.
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


# The file's clock.

_TIME_ZONE_OFFSET = 0x882A  # h, of EXIF for TIFF/EP
_PHOTOSHOP, _XMP = (f"http://ns.adobe.com/{name}/1.0" for name in ("photoshop", "xap"))
_EXIF_EX, _TIFF = "http://cipa.jp/exif/1.0", "http://ns.adobe.com/tiff/1.0"
_XMP_TIMES = (
    f"{EXIF_NAMESPACE} DateTimeOriginal",
    f"{_PHOTOSHOP} DateCreated",
    f"{_XMP} CreateDate",
    f"{EXIF_NAMESPACE} DateTimeDigitized",
    PNG_CREATION_TIME,
)
_XMP_WRITING_TIMES = (f"{_TIFF} DateTime", f"{_XMP} ModifyDate")
_XMP_SOFTWARE = (f"{_TIFF} Software", f"{_XMP} CreatorTool")
_FIRMWARE = (  # versions and builds of cameras; names of programs are words
    r"(?a)(?i:v|ver|version|firmware|fw)?[ ._]*\d[\d.,_ vr-]*|(?=[^a-z ]*\d)[A-Z\d._/-]{6,}|HDR\+ .*|MediaTek .*"
)
_IPTC_TIMES = (((2, 55), (2, 60)), ((2, 62), (2, 63)))  # date and time, of the picture and of its digital form


def read_clock(
    camera: Tags, main: Tags, xmp: Mapping[str, str], iptc: IptcRecords, *, is_located: bool = False
) -> Stamp | None:
    """The photo's local time, the best that its file holds, with the offset from UTC that the file has for it.

    Args:
        camera: EXIF tags of the camera's directory.
        main: EXIF tags of the main directory.
        xmp: properties by namespace and name.
        iptc: datasets by record and number.
        is_located: whether the place is known, whose zone is better than the offset of a later edit.
    """
    tags = {**main, **camera}
    exif = list(_exif_stamps(tags))
    others = [stamp for name in _XMP_TIMES if (stamp := _xmp_stamp(xmp, name))]
    others += _iptc_stamps(iptc)
    if (takeout := read_stamp(xmp.get(TAKEOUT_TIME))) and all(takeout.time != stamp.time for stamp in exif):
        others.append(takeout)  # else Google took the local time for UTC
    written = [stamp for name in _XMP_WRITING_TIMES if (stamp := _xmp_stamp(xmp, name))]
    stamps = exif + others or list(_late_stamps(tags)) or ([] if _was_edited(tags, xmp) else written)
    if not stamps:
        return None
    time = stamps[0].time
    same = (stamp.utc_offset for stamp in (*stamps, *written) if _is_same_time(stamp.time, time))
    offset = next((hours for hours in same if hours is not None), None)
    if offset is None:
        beside = ("Original", "Digitized", *(() if is_located else ("",)))  # the last is that of a later edit
        offset = _first_known(_offset_by_universal(time, others), _offset_in_xmp(xmp, beside, time))
    if offset is None:
        offset = _offset_of_edit(tags, time, is_located)
    return Stamp(time, offset)


def _is_same_time(time: datetime, other: datetime) -> bool:
    """Whether two local times are one, of which a program may have rounded the second or left it out."""
    return abs(time - other) < timedelta(seconds=1.5) or other.replace(second=0, microsecond=0) == time


def _exif_stamps(tags: Tags) -> Iterator[Stamp]:
    """The times of picture and scan, with the offsets beside them."""
    base = ExifTags.Base
    original, digitized = (read_stamp(tags.get(tag)) for tag in (base.DateTimeOriginal, base.DateTimeDigitized))
    if original:
        offset = _first_known(original.utc_offset, _offset(tags, base.OffsetTimeOriginal, original))
        alone = digitized is None or digitized.time == original.time
        scan = _offset(tags, base.OffsetTimeDigitized, original) if offset is None and alone else None
        yield Stamp(original.time, _first_known(offset, scan, _time_zone_offset(tags)))
    if digitized:
        offset = _first_known(digitized.utc_offset, _offset(tags, base.OffsetTimeDigitized, digitized))
        yield Stamp(digitized.time, offset)


def _late_stamps(tags: Tags) -> Iterator[Stamp]:
    """The time at which the file was written, unless a program did it later than the camera."""
    base = ExifTags.Base
    if (written := read_stamp(tags.get(base.DateTime))) and not _was_edited(tags, {}):
        yield Stamp(written.time, _first_known(written.utc_offset, _offset(tags, base.OffsetTime, written)))


def _was_edited(tags: Tags, xmp: Mapping[str, str]) -> bool:
    """Whether a program wrote the file, and not the camera, whose software is a version or its own name."""
    base = ExifTags.Base
    software, model = (text_or_empty(tags.get(tag)) for tag in (base.Software, base.Model))
    names = [name for name in (read_make(tags), model.lower()) if name]
    of_camera = bool(re.fullmatch(_FIRMWARE, software)) or any(software.lower().startswith(name) for name in names)
    by_camera = not software or (bool(names) and of_camera)
    return not by_camera or any(xmp.get(name, software) != software for name in _XMP_SOFTWARE)


def _offset_in_xmp(xmp: Mapping[str, str], times: Iterable[str], time: datetime) -> float | None:
    """The offset that XMP holds for one of the times of these names, the first counts."""
    texts = (
        _plain_text(xmp.get(f"{space} OffsetTime{name}")) for name in times for space in (_EXIF_EX, EXIF_NAMESPACE)
    )
    return _first_known(*(_offset_in_text(text, time) for text in texts))


def _offset_of_edit(tags: Tags, time: datetime, is_located: bool) -> float | None:
    """The offset of the time at which the file was written, which may have been another season's."""
    base = ExifTags.Base
    written = read_stamp(tags.get(base.DateTime))
    is_later = written is not None and abs(written.time - time) > MAX_CLOCK_DIFFERENCE
    return None if is_later and is_located else _offset(tags, base.OffsetTime, Stamp(time))


def _offset(tags: Tags, tag: int, stamp: Stamp) -> float | None:
    return _offset_in_text(_plain_text(tags.get(tag)), stamp.time)


def _time_zone_offset(tags: Tags) -> float | None:
    with suppress(*TAG_ERRORS):
        hours = read_first_number(tags[_TIME_ZONE_OFFSET])
        hours -= 65536 * (hours > 32767)  # of writers that take it as without a sign
        return hours if UTC_OFFSET_RANGE[0] <= hours <= UTC_OFFSET_RANGE[1] else None
    return None


def _first_known(*values: float | None) -> float | None:
    return next((value for value in values if value is not None), None)


def _xmp_stamp(xmp: Mapping[str, str], name: str) -> Stamp | None:
    stamp = read_stamp(xmp.get(name))
    suffix = name.rpartition("DateTime")[2]
    if stamp is None or stamp.utc_offset is not None or suffix not in ("Original", "Digitized"):
        return stamp
    return Stamp(stamp.time, _offset_in_xmp(xmp, (suffix,), stamp.time))


def _iptc_stamps(iptc: IptcRecords) -> Iterator[Stamp]:
    for pair in _IPTC_TIMES:
        date, time = (_plain_text(v[0] if isinstance(v := iptc.get(key), list) and v else v) for key in pair)
        if stamp := read_stamp(f"{date}T{time}"):
            yield stamp


def _offset_by_universal(time: datetime, others: Iterable[Stamp]) -> float | None:
    """The offset of a local time of which another stamp in the file is the same time in UTC."""
    ahead = [time - stamp.time for stamp in others if stamp.utc_offset == 0]
    hours = (nearest_utc_offset(difference, timedelta(seconds=2)) for difference in ahead)
    return _first_known(*hours)


def nearest_utc_offset(ahead: timedelta, tolerance: timedelta = MAX_CLOCK_DIFFERENCE) -> float | None:
    """The offset from UTC [h] of some zone by which a clock is ahead; None where no zone has it.

    Args:
        ahead: local minus universal time.
        tolerance: up to which the clocks may differ.
    """
    hours = ahead / timedelta(hours=1)
    nearest = round(4 * hours) / 4
    return nearest if nearest in UTC_OFFSETS and abs(ahead - timedelta(hours=nearest)) <= tolerance else None


# The satellites' clock.

_LAST_YEAR_OF_EPOCHS = 1980  # which receivers without a fix show
_RATIONAL = r"\d+(?:\.\d*)?(?:/\d+)?"


def read_gps_time(
    gps: Tags, xmp: Mapping[str, str], local_time: datetime | None = None, longitude: float | None = None
) -> datetime | None:
    """The satellites' time in UTC, aware; None where it is unknown.

    A time of day without a date is of the day that makes the local time one of some zone.

    Args:
        gps: EXIF tags of the GPS directory.
        xmp: properties by namespace and name.
        local_time: naive, of the photo's clock.
        longitude: deg, positive east, of the place.
    """
    date = _gps_date(gps)
    clock = _gps_time_of_day(gps, date)
    if clock is not None and date is not None:
        return _datable(date + clock)
    if clock is not None and local_time is not None:
        return _gps_time_near(clock, local_time, 0.0 if longitude is None else longitude)
    in_xmp = xmp.get(f"{EXIF_NAMESPACE} GPSTimeStamp", "")
    if stamp := read_stamp(in_xmp):
        return _datable(to_utc(stamp.time, stamp.utc_offset or 0.0))
    tag = ExifTags.GPS
    texts: Tags = {tag.GPSTimeStamp: in_xmp, tag.GPSDateStamp: xmp.get(f"{EXIF_NAMESPACE} GPSDateStamp")}
    return read_gps_time(texts, {}, local_time, longitude) if in_xmp else None


def _gps_time_of_day(tags: Tags, date: datetime | None) -> timedelta | None:
    seconds = 0.0
    try:
        value = tags[ExifTags.GPS.GPSTimeStamp]
        is_text = isinstance(value, str | bytes)
        parts = [read_xmp_number(part) for part in re.findall(_RATIONAL, _plain_text(value))] if is_text else value
        hours, minutes = map(read_number, parts[:2])
        with suppress(*TAG_ERRORS):  # 0/0 where it is unknown
            seconds = read_number(parts[2])
    except TAG_ERRORS:
        return None
    is_epoch = date is not None and date.year <= _LAST_YEAR_OF_EPOCHS
    valid = hours or minutes or seconds or is_epoch  # many programs write 0, 0, 0 where the time is unknown
    if not (valid and 0 <= hours < 24 and 0 <= minutes < 60 and 0 <= seconds < 61):
        return None
    return timedelta(hours=hours, minutes=minutes, seconds=seconds)


def _gps_date(tags: Tags) -> datetime | None:
    text = _plain_text(tags.get(ExifTags.GPS.GPSDateStamp))
    if (parts := re.fullmatch(r"(\d{4})\D?(\d\d?)\D?(\d\d?)", text)) is None:
        return None
    year, month, day = map(int, parts.groups())
    with suppress(ValueError):
        return datetime(year, month, day, tzinfo=UTC)
    return None


def _gps_time_near(clock: timedelta, local_time: datetime, longitude: float) -> datetime:
    """The time of day in UTC on the day that makes the local time one of some zone, the longitude's if it can be."""
    midnight = local_time.replace(hour=0, minute=0, second=0, microsecond=0)
    times = [midnight + timedelta(days=day) + clock for day in (-1, 0, 1)]
    of_zones = [time for time in times if nearest_utc_offset(local_time - time) is not None] or times
    by_sun = local_time - timedelta(hours=longitude / 15.0)
    return min(of_zones, key=lambda time: abs(time - by_sun)).replace(tzinfo=UTC)


def _datable(time: datetime) -> datetime | None:
    return time if YEAR_RANGE[0] <= time.year <= YEAR_RANGE[1] else None

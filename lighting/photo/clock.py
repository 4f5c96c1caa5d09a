"""What a photo's clocks say: local time, its offset from UTC and the satellites' time, however programs write them."""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from PIL import ExifTags

from lighting.photo.sidecars import TAKEOUT_TIME
from lighting.photo.tags import (
    EXIF_NAMESPACE,
    PNG_CREATION_TIME,
    TAG_ERRORS,
    IptcRecords,
    Tags,
    read_number,
    read_text,
    read_xmp_number,
)
from lighting.photo.timestamps import (
    UTC_OFFSET_RANGE,
    YEAR_RANGE,
    Stamp,
    offset_in_text,
    plain_text,
    read_stamp,
    to_utc,
)

MAX_CLOCK_DIFFERENCE = timedelta(minutes=2)  # of two clocks that show one time

# Hours from UTC that clocks followed somewhere since there are digital cameras (time zone database of 2026).
_UTC_OFFSETS = (*range(-12, 15), -9.5, -8.5, -4.5, -3.5, -2.5, 3.5, 4.5, 5.5, 5.75, 6.5, 8.5, 8.75)
UTC_OFFSETS = frozenset(map(float, (*_UTC_OFFSETS, 9.5, 9.75, 10.5, 11.5, 12.75, 13.75)))


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
    others = [*others, *_iptc_stamps(iptc), *_takeout_stamps(xmp, exif)]
    written = [stamp for name in _XMP_WRITING_TIMES if (stamp := _xmp_stamp(xmp, name))]
    stamps = exif + others or list(_late_stamps(tags)) or ([] if _was_edited(tags, xmp) else written)
    if not stamps:
        return None
    time = stamps[0].time
    same = (stamp.utc_offset for stamp in (*stamps, *written) if _is_same_time(stamp.time, time))
    offset = next((hours for hours in same if hours is not None), None)
    if offset is None:
        offset = _first_known(_offset_by_universal(time, others), _offset_beside(xmp, time, is_located))
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
        yield Stamp(
            digitized.time, _first_known(digitized.utc_offset, _offset(tags, base.OffsetTimeDigitized, digitized))
        )


def _late_stamps(tags: Tags) -> Iterator[Stamp]:
    """The time at which the file was written, unless a program did it later than the camera."""
    base = ExifTags.Base
    if (written := read_stamp(tags.get(base.DateTime))) and not _was_edited(tags, {}):
        yield Stamp(written.time, _first_known(written.utc_offset, _offset(tags, base.OffsetTime, written)))


def _was_edited(tags: Tags, xmp: Mapping[str, str]) -> bool:
    """Whether a program wrote the file, and not the camera, whose software is a version or its own name."""
    base = ExifTags.Base
    software, make, model = (_text(tags, tag) for tag in (base.Software, base.Make, base.Model))
    names = [name.lower() for name in (make, model) if name]
    of_camera = bool(re.fullmatch(_FIRMWARE, software)) or any(software.lower().startswith(name) for name in names)
    by_camera = not software or (bool(names) and of_camera)
    return not by_camera or any(xmp.get(name, software) != software for name in _XMP_SOFTWARE)


def _offset_beside(xmp: Mapping[str, str], time: datetime, is_located: bool) -> float | None:
    """The offset that XMP holds without a time of its own; that of a later edit counts where no place is known."""
    spaces, times = (_EXIF_EX, EXIF_NAMESPACE), ("Original", "Digitized", *(() if is_located else ("",)))
    texts = (plain_text(xmp.get(f"{space} OffsetTime{which}")) for which in times for space in spaces)
    return _first_known(*(offset_in_text(text, time) for text in texts))


def _text(tags: Tags, tag: int) -> str:
    with suppress(*TAG_ERRORS):
        return read_text(tags[tag])
    return ""


def _offset_of_edit(tags: Tags, time: datetime, is_located: bool) -> float | None:
    """The offset of the time at which the file was written, which may have been another season's."""
    base = ExifTags.Base
    written = read_stamp(tags.get(base.DateTime))
    is_later = written is not None and abs(written.time - time) > MAX_CLOCK_DIFFERENCE
    return None if is_later and is_located else _offset(tags, base.OffsetTime, Stamp(time))


def _offset(tags: Tags, tag: int, stamp: Stamp) -> float | None:
    return offset_in_text(plain_text(tags.get(tag)), stamp.time)


def _time_zone_offset(tags: Tags) -> float | None:
    with suppress(*TAG_ERRORS):
        value = tags[_TIME_ZONE_OFFSET]
        hours = read_number(value[0] if isinstance(value, tuple | list) else value)
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
    texts = (plain_text(xmp.get(f"{space} OffsetTime{suffix}")) for space in (_EXIF_EX, EXIF_NAMESPACE))
    return Stamp(stamp.time, _first_known(*(offset_in_text(text, stamp.time) for text in texts)))


def _iptc_stamps(iptc: IptcRecords) -> Iterator[Stamp]:
    for pair in _IPTC_TIMES:
        date, time = (plain_text(v[0] if isinstance(v := iptc.get(key), list) and v else v) for key in pair)
        if stamp := read_stamp(f"{date}T{time}"):
            yield stamp


def _takeout_stamps(xmp: Mapping[str, str], exif: Sequence[Stamp]) -> Iterator[Stamp]:
    """The time of Google Takeout, unless it is a local time that Google took for UTC."""
    if (stamp := read_stamp(xmp.get(TAKEOUT_TIME))) and not any(stamp.time == other.time for other in exif):
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
        parts = [read_xmp_number(part) for part in re.findall(_RATIONAL, plain_text(value))] if is_text else value
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
    text = plain_text(tags.get(ExifTags.GPS.GPSDateStamp))
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

"""How a clip was taken, by the container's metadata and by the subtitles that DJI's drones write beside it.

Both are hostile input: whatever cannot be read, or cannot be true, counts as absent.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from lighting.geometry import Floats, wrap_azimuth
from lighting.photo.camera import heading_from_gimbal, vertical_fov_from_focal_length
from lighting.photo.clock import YEAR_RANGE
from lighting.photo.metadata import PhotoMetadata

QUICKTIME = "com.apple.quicktime."
LOCATION_TAGS = (f"{QUICKTIME}location.ISO6709", "location", "location-eng", "\xa9xyz")
LENS_TAGS = (f"{QUICKTIME}camera.focal_length.35mm_equivalent",)
HEADING_TAGS = (f"{QUICKTIME}direction.facing",)
FOCAL_LENGTHS = (8.0, 180.0)  # mm, as on 35 mm film, that a drone's lens may have
MAX_SUBTITLE_BYTES = 64_000_000  # bytes; an hour of DJI's at 30 frames a second is 30 million

_ISO6709 = re.compile(r"([+-]\d{1,2}(?:\.\d+)?)([+-]\d{1,3}(?:\.\d+)?)(?:[+-]\d+(?:\.\d+)?)?(?:CRS[^/]*)?/?")
_NUMBER = re.compile(r"(\w+)\s*:\s*([+-]?\d+(?:\.\d+)?)")
# longitude first, as older models write it
_GPS_PAIR = re.compile(r"\bGPS ?\(([+-]?\d+(?:\.\d+)?), ?([+-]?\d+(?:\.\d+)?)")
_START_TIME = re.compile(r"(\d+):(\d\d):(\d\d)[,.](\d{3})\s*-->")
_NO_DIGITAL_ZOOM = (0.0, 1.0, 10000.0)  # ratios: some models count ten-thousandths, and 0 says nothing
_CLOCK = re.compile(r"(\d{4})[-.](\d\d)[-.](\d\d) (\d\d):(\d\d):(\d\d)")


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


def _first_value(tags: Mapping[str, str], names: tuple[str, ...], read: Any) -> Any:
    values = (_try_read(read, tags[name]) for name in names if name in tags)
    return next((value for value in values if value is not None), None)


def _try_read(read: Any, text: str) -> Any:
    try:
        return read(text)
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return None


def _parse_iso6709(text: str) -> tuple[float, float] | None:
    """Latitude and longitude [deg] of ISO 6709 in decimal degrees, "+48.1173+011.5167+520/"."""
    parts = _ISO6709.fullmatch(text.strip())
    return None if parts is None else _valid_location(float(parts[1]), float(parts[2]))


def _valid_location(latitude: float, longitude: float) -> tuple[float, float] | None:
    nowhere = latitude == longitude == 0.0  # what recorders write that have no fix
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 and not nowhere else None


def _positive(text: str) -> float | None:
    value = float(text)
    return value if math.isfinite(value) and value > 0 else None


def _degrees(text: str) -> float | None:
    value = float(text)
    return value % 360.0 if math.isfinite(value) else None


def _with_recording_time(result: PhotoMetadata, tags: Mapping[str, str]) -> PhotoMetadata:
    """The same with the moment of recording: Apple's with its zone, else the container's, which is in UTC."""
    moment = _first_value(tags, (f"{QUICKTIME}creationdate", "creation_time"), _parse_moment)
    if moment is None:
        return result
    offset = moment.utcoffset().total_seconds() / 3600.0
    return replace(result, local_time=moment.replace(tzinfo=None), utc_offset=offset)


def _parse_moment(text: str) -> datetime | None:
    moment = datetime.fromisoformat(text.strip())
    aware = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    is_possible = max(YEAR_RANGE[0], 1904) < aware.year < YEAR_RANGE[1]  # QuickTime counts from 1904
    return aware if is_possible else None


def read_subtitles(clip: Path) -> str:
    """Read DJI's subtitle file of the same name as a clip; empty without one.

    Args:
        clip: the clip's file.
    """
    for suffix in (".SRT", ".srt"):
        file = clip.with_suffix(suffix)
        try:
            if file.is_file() and file.stat().st_size <= MAX_SUBTITLE_BYTES:
                return file.read_text(encoding="utf-8", errors="replace")
        except OSError:
            return ""
    return ""


def subtitle_metadata(text: str, width: int, height: int) -> tuple[PhotoMetadata, Gimbal]:
    """Read the metadata of DJI's first entry and the gimbal's angles of all; other subtitles say nothing.

    Args:
        text: of the subtitle file.
        width: pixels of the upright picture.
        height: pixels of the upright picture.
    """
    entries = [entry for block in re.split(r"\r?\n\s*\r?\n", text) if (entry := _parse_entry(block))]
    if not entries:
        return PhotoMetadata(), Gimbal()
    return _metadata_of_entries(entries, width, height), _make_gimbal(entries)


@dataclass(frozen=True)
class _Entry:
    """What one entry of DJI's subtitles says."""

    start: float  # s
    numbers: dict[str, float]  # by the names that DJI gives them
    focal_length: float | None  # mm, None for a crop
    clock: datetime | None  # local


def _parse_entry(block: str) -> _Entry | None:
    """What one entry says; None where it is not DJI's.

    A picture that is zoomed digitally is a crop, of which the focal length says nothing.
    """
    start = _START_TIME.search(block)
    texts = {name.lower(): value for name, value in _NUMBER.findall(block)}
    numbers = {name: float(value) for name, value in texts.items()}
    if position := _GPS_PAIR.search(block):
        numbers["longitude"], numbers["latitude"] = float(position[1]), float(position[2])
    if start is None or not {"latitude", "gb_yaw", "focal_len", "iso"} & set(numbers):
        return None
    hours, minutes, seconds, thousandths = map(int, start.groups())
    zoomed = numbers.get("dzoom_ratio", 1.0) not in _NO_DIGITAL_ZOOM
    clock = _CLOCK.search(block)
    focal_length = None if zoomed else _parse_focal_length(texts.get("focal_len", ""))
    moment = _try_read(_parse_local_time, clock[0]) if clock else None
    return _Entry(3600.0 * hours + 60.0 * minutes + seconds + thousandths / 1000.0, numbers, focal_length, moment)


def _parse_focal_length(text: str) -> float | None:
    """Millimetres of "24.00", of "24", and of "240", as models write it that count tenths; None for what cannot be."""
    value = float(text or 0.0)
    value = 0.1 * value if value >= 100.0 and "." not in text else value
    return value if FOCAL_LENGTHS[0] <= value <= FOCAL_LENGTHS[1] else None


def _parse_local_time(text: str) -> datetime:
    year, month, day, hour, minute, second = map(int, re.findall(r"\d+", text))
    return datetime(year, month, day, hour, minute, second)


def _metadata_of_entries(entries: list[_Entry], width: int, height: int) -> PhotoMetadata:
    location = next((p for e in entries if (p := _entry_location(e)) is not None), None)
    return replace(_lens_and_place(entries[0].focal_length, location, width, height), local_time=entries[0].clock)


def _entry_location(entry: _Entry) -> tuple[float, float] | None:
    longitude = entry.numbers.get("longitude", entry.numbers.get("longtitude"))  # as some models spell it
    if "latitude" not in entry.numbers or longitude is None:
        return None
    return _valid_location(entry.numbers["latitude"], longitude)


def _make_gimbal(entries: list[_Entry]) -> Gimbal:
    names = ("gb_yaw", "gb_pitch", "gb_roll")
    complete = [e for e in entries if set(names) <= set(e.numbers)]
    table = np.array([[e.start, *(e.numbers[name] for name in names)] for e in complete], dtype=np.float64)
    if not len(table) or np.any(np.diff(table[:, 0]) <= 0) or np.any(np.abs(table[:, 1:]) > 360.0):
        return Gimbal()
    time, yaw, pitch, roll = table.T
    heading = np.array([heading_from_gimbal(*angles) for angles in zip(pitch, roll, yaw, strict=True)])
    return Gimbal(time, heading, pitch, roll)


def merge_metadata(first: PhotoMetadata, second: PhotoMetadata) -> PhotoMetadata:
    """Merge two sources of metadata; a time or a location is taken whole.

    Args:
        first: what counts.
        second: what counts where `first` says nothing.
    """
    merged = second
    if first.local_time is not None or first.gps_time is not None:
        merged = replace(merged, local_time=first.local_time, utc_offset=first.utc_offset, gps_time=first.gps_time)
    if first.latitude is not None:
        merged = replace(merged, latitude=first.latitude, longitude=first.longitude)
    if first.heading is not None:
        merged = replace(merged, heading=first.heading, heading_reference=first.heading_reference)
    if first.vertical_fov is not None:
        merged = replace(merged, focal_length=first.focal_length, vertical_fov=first.vertical_fov)
    return merged

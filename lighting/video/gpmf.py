"""Time and place of GoPro's metadata track, in its format GPMF [1]: keys, types, sizes and values, one inside another.

Satellites' time is UTC, whatever the clip's own time is. A track is hostile: what cannot be read counts as absent.

References:
    [1] GPMF Introduction, github.com/gopro/gpmf-parser.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

SAMPLE_START = b"DEVC"  # with which a sample of the track begins

_NESTED = 0
_MAX_DEPTH = 4
_MIN_FIX = 2  # of GPSF and GPS9: 0 is none, 2 has no height, 3 has all
_MAX_DILUTION = 10.0  # of precision, beyond which a position is off by far
_EPOCH = datetime(2000, 1, 1, tzinfo=UTC)  # of the days in GPS9
_GPS9_SCALES = 9


@dataclass(frozen=True)
class GpsFix:
    """What satellites said in one sample."""

    time: datetime | None
    """UTC, aware; None where it is not told."""
    latitude: float
    """Deg, positive north."""
    longitude: float
    """Deg, positive east."""


def read_gps_fix(sample: bytes) -> GpsFix | None:
    """Read the first fix of one sample of the track; None where it has none, or cannot be read.

    Args:
        sample: the bytes of one packet.
    """
    try:
        return next((fix for stream in _streams(sample, 0) if (fix := _fix_of(stream)) is not None), None)
    except (ArithmeticError, LookupError, ValueError, struct.error):
        return None


def _items(data: bytes) -> Iterator[tuple[bytes, int, bytes]]:
    """The keys of a level, the codes of their kinds, and their values, which end at four bytes."""
    position = 0
    while position + 8 <= len(data):
        key, kind, size, count = struct.unpack_from(">4sBBH", data, position)
        end = position + 8 + size * count
        if key == b"\0\0\0\0" or end > len(data):
            return
        yield key, kind, data[position + 8 : end]
        position = -(-end // 4) * 4


def _streams(data: bytes, depth: int) -> Iterator[dict[bytes, bytes]]:
    """The keys of each stream, in order."""
    for key, kind, value in _items(data):
        if kind == _NESTED and depth < _MAX_DEPTH:
            if key == b"STRM":
                yield {name: values for name, _, values in _items(value)}
            else:
                yield from _streams(value, depth + 1)


def _fix_of(stream: dict[bytes, bytes]) -> GpsFix | None:
    if b"GPS9" in stream:
        return _gps9_fix(stream)
    if b"GPS5" not in stream:
        return None
    if b"GPSF" in stream and struct.unpack(">I", stream[b"GPSF"][:4])[0] < _MIN_FIX:
        return None
    if b"GPSP" in stream and struct.unpack(">H", stream[b"GPSP"][:2])[0] / 100.0 > _MAX_DILUTION:
        return None
    scales = struct.unpack(">5i", (stream[b"SCAL"] * 5)[:20])
    latitude, longitude = struct.unpack(">2i", stream[b"GPS5"][:8])
    text = stream.get(b"GPSU", b"").decode("ascii")  # yymmddhhmmss.sss
    time = datetime.strptime(text[:12], "%y%m%d%H%M%S").replace(tzinfo=UTC) if text.strip("\0 ") else None
    return _possible_fix(time, latitude / scales[0], longitude / scales[1])


def _gps9_fix(stream: dict[bytes, bytes]) -> GpsFix | None:
    """The fix of HERO11 and later, which write each number's time and quality beside it."""
    scales = struct.unpack(f">{_GPS9_SCALES}i", stream[b"SCAL"][: 4 * _GPS9_SCALES])
    raw = struct.unpack(">7i2H", stream[b"GPS9"][:32])
    latitude, longitude, _, _, _, days, seconds, dilution, fix = (r / s for r, s in zip(raw, scales, strict=True))
    if fix < _MIN_FIX or dilution > _MAX_DILUTION:
        return None
    time = _EPOCH + timedelta(days=days, seconds=seconds) if days > 0 else None
    return _possible_fix(time, latitude, longitude)


def _possible_fix(time: datetime | None, latitude: float, longitude: float) -> GpsFix | None:
    is_place = abs(latitude) <= 90.0 and abs(longitude) <= 180.0 and not latitude == longitude == 0.0
    return GpsFix(time, latitude, longitude) if is_place else None

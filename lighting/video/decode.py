"""A clip's frames by PyAV (FFmpeg), one after another: upright, their pixels square, as sRGB.

Each frame has its own time, so that a rate may vary. Damaged parts are left out and reported.

How the clip was taken is told by the container's metadata and by the subtitles that DJI's drones write beside it. Both
are hostile input: whatever cannot be read, or cannot be true, counts as absent.

HDR curves and their diffuse white are those of `lighting.color`. Primaries go from BT.2020 to BT.709 by the
matrix of Rec. BT.2087.
"""

import math
import os
import re
from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.color import (
    CHROMATICITIES,
    DECODE_CURVES,
    H273_CHROMATICITIES,
    Curve,
    chromaticities_to_rec709,
    srgb_bytes,
)
from lighting.errors import VideoError, require_extra
from lighting.geometry import Floats, shrink_size, wrap_azimuth
from lighting.photo.camera import heading_from_gimbal, vertical_fov_from_focal_length
from lighting.photo.clock import YEAR_RANGE
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import MAX_ASPECT, MIN_SIDE
from lighting.tracing import trace_step

# by the numbers of ITU-T H.273 for transfer characteristics; all others count as sRGB
TRANSFER_CURVES: dict[int, Curve] = {16: "pq", 18: "hlg"}

_FULL_SIGNAL = 65280  # 255 x 256, which libswscale makes of the largest signal where it converts to 16 bits

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


def _container_metadata(tags: Mapping[str, str], width: int, height: int) -> PhotoMetadata:
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


def _read_subtitles(clip: Path) -> str:
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


def _subtitle_metadata(text: str, width: int, height: int) -> tuple[PhotoMetadata, Gimbal]:
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


def _merge_metadata(first: PhotoMetadata, second: PhotoMetadata) -> PhotoMetadata:
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


def _to_srgb(coded: NDArray[np.uint16], curve: str, primaries: int) -> NDArray[np.uint8]:
    """8-bit sRGB (..., 3) of 16-bit coded values (..., 3), as PyAV has them, under `curve`, "hlg" or "pq"."""
    linear = _curve_table(curve).take(coded)
    matrix = chromaticities_to_rec709(H273_CHROMATICITIES.get(primaries, CHROMATICITIES))
    return srgb_bytes(linear if matrix is None else linear @ matrix.T)


@lru_cache(maxsize=2)
def _curve_table(curve: Curve) -> NDArray[np.float32]:
    return DECODE_CURVES[curve](np.minimum(np.arange(65536) / _FULL_SIGNAL, 1.0)).astype(np.float32)


# From a decoded picture to upright sRGB.

_AREA, _FULL_CHROMA = 0x20, 0x2000  # flags of libswscale
_SCALING = {  # by the form that is asked for
    "rgb24": _AREA | _FULL_CHROMA,  # else what is reduced is 2 levels too dark
    "rgb48le": _AREA,  # exact; with both flags, 4:2:0 that keeps its width turns blue
}
_MIN_HD_HEIGHT = 720  # rows from which a picture that names no colour matrix is taken for one of BT.709


def _display_size(picture: Any, aspect: float) -> tuple[int, int]:
    """Width and height of a decoded picture as it is to be shown: pixels made square, turned upright."""
    width, height = max(1, round(picture.width * aspect)), picture.height
    return (height, width) if _swaps_axes(_display_matrix(picture)) else (width, height)


def _upright_pixels(picture: Any, context: Any, side: int, aspect: float = 1.0) -> NDArray[np.uint8]:
    """sRGB (h, w, 3) of a picture that a codec's context decoded, its longer side at most `side` pixels."""
    width, height = max(1, round(picture.width * aspect)), picture.height
    curve, primaries = _curve_and_primaries(picture, context)
    pixels = _resize_picture(picture, *shrink_size(width, height, side), "rgb24" if curve is None else "rgb48le")
    pixels = pixels if curve is None else _to_srgb(pixels, curve, primaries)
    return _apply_display_matrix(pixels, _display_matrix(picture))


def _curve_and_primaries(picture: Any, context: Any) -> tuple[Curve | None, int]:
    """The curve of a picture, None for sRGB, and the number of its primaries; PyAV 14 to 16 has them of the codec."""
    source = picture if hasattr(picture, "color_trc") else context
    return TRANSFER_CURVES.get(int(source.color_trc)), int(source.color_primaries)


def _display_matrix(picture: Any) -> NDArray[np.int32]:
    """The container's matrix (2, 2) by which to show the picture: its rows are where right and down go, as (x, y)."""
    matrix = picture.side_data.get("DISPLAYMATRIX")
    if matrix is None:
        return np.eye(2, dtype=np.int32)
    return np.frombuffer(bytes(matrix), np.int32).reshape(3, 3)[:2, :2]


def _swaps_axes(matrix: NDArray[np.int32]) -> bool:
    """Whether the picture's rows are to be shown as columns."""
    return bool(np.abs(matrix[0, 1]) > np.abs(matrix[0, 0]))


def _apply_display_matrix(pixels: NDArray[np.uint8], matrix: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Pixels (h, w, 3) turned by whole quarters, and mirrored, as a matrix of `_display_matrix` says."""
    swapped = _swaps_axes(matrix)
    (right, down) = (matrix[1, 0], matrix[0, 1]) if swapped else (matrix[0, 0], matrix[1, 1])
    upright = pixels.transpose(1, 0, 2) if swapped else pixels
    return np.ascontiguousarray(upright[:: -1 if down < 0 else 1, :: -1 if right < 0 else 1])


def _resize_picture(picture: Any, width: int, height: int, pixel_format: str) -> NDArray[Any]:
    matrix = int(picture.colorspace)
    color_matrix = matrix if matrix in (1, 4, 5, 6, 7, 9) else 1 if picture.height >= _MIN_HD_HEIGHT else 5
    rgb_matrix = 1 if color_matrix == 5 else 5  # means nothing, but PyAV 14 to 16 reads the first where both differ
    scaling = _SCALING[pixel_format]
    resized = picture.reformat(width, height, pixel_format, color_matrix, rgb_matrix, interpolation=scaling)
    return np.asarray(resized.to_ndarray())


# The open clip.

FRAME_SIDE = 640  # pixels of a frame's longer side: what is tracked and shown to the network
DECODING_THREADS = 2  # that decode a clip
MAX_CLIP_PIXELS = 8192 * 4608  # of a picture: what cameras call 8K
_DURATION_TAG = re.compile(r"(\d{1,4}):(\d\d):(\d\d(?:\.\d+)?)")
_MIN_JUMP_BACK = 3.0  # frames by which times jump back between joined recordings; less is out of order
_MAX_TIME = 1e9  # s of a clip, 32 years, beyond which a frame's time is wrong
_MAX_MISSING_END = 0.75  # s that may be missing at the end of a whole clip

_FORMATS = (  # FFmpeg's names of what is read: each keeps all it shows in its one file
    *("apng", "asf", "avi", "dv", "flv", "gif", "ivf", "matroska", "mov", "mpeg", "mpegts", "mxf", "nut", "ogg"),
    *("dnxhd", "h263", "h264", "hevc", "av1", "m4v", "mjpeg", "mpegvideo", "obu", "vc1", "vvc", "yuv4mpegpipe"),
    *("aac", "aiff", "amr", "flac", "mp3", "wav"),  # to say that they hold only sound
)
_DECODER_OPTIONS = {"max_pixels": str(MAX_CLIP_PIXELS)}
_NO_METADATA_ERRORS = 19  # the first release of PyAV that takes no `metadata_errors`
_PLAYLIST_SUFFIXES = (".m3u8", ".m3u", ".ffconcat", ".mpd", ".ism", ".sdp", ".pls", ".asx", ".xspf", ".smil")
_PLAYLIST_START = re.compile(rb"(\xef\xbb\xbf)?\s*(#EXTM3U|ffconcat|\[playlist\]|v=0\s|<[?a-z])", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a clip."""

    index: int
    """Counted from 0, in the clip."""
    time: float
    """Seconds from the clip's first frame."""
    pixels: NDArray[np.uint8]
    """(h, w, 3) sRGB, upright."""


@dataclass(frozen=True)
class _ClipInfo:
    """What is known of a clip before its frames are read."""

    width: int  # of the upright picture, pixels
    height: int
    frame_rate: float  # mean, 1/s; 0 unknown
    duration: float  # s, of the pictures; 0 unknown
    curve: str  # "srgb", "hlg" or "pq"
    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    gimbal: Gimbal = field(default_factory=Gimbal)


class Clip:
    """An open clip; a context manager. `damage` tells, once the frames are read, what of it was lost."""

    def __init__(self, path: str | os.PathLike[str], side: int = FRAME_SIDE) -> None:
        """Open a clip and read its first frame.

        Args:
            path: a file that PyAV can read.
            side: pixels of a frame's longer side, at most.

        Raises:
            VideoError: it is no clip that can be read.
            MissingExtraError: PyAV is not installed.
            OSError: the file is missing or forbidden.
        """
        self.path, self.side, self.damage = Path(path), side, ""
        self._container = _open_container(self.path)
        try:
            self._stream = _video_stream(self._container)
            aspect = float(self._stream.sample_aspect_ratio or 1.0)
            self._aspect = aspect if 0.1 < aspect < 10.0 else 1.0  # how many times as wide as high a pixel is
            self._errors = 0  # packets that could not be decoded
            self._packet_ticks = 0  # duration of the last packet, in the stream's time base
            self._pictures = self._decode()
            self._first = self._decoded_first()
            self.info = self._describe()
        except BaseException:
            self._container.close()
            raise

    def __enter__(self) -> "Clip":
        return self

    def __exit__(self, *_: object) -> None:
        self._container.close()

    def frames(self, only: Container[int] | None = None) -> Iterator[Frame]:
        """Read the frames in the order in which they are shown; may be read once.

        Args:
            only: indices of the frames that are wanted; None is all.
        """
        start, last, lost, end = float(self._first.time or 0.0), -1.0, 0, 0.0
        shift = 0.0  # seconds by which times that begin again are shifted
        for index, picture in enumerate(self._decoded()):
            time = max(0.0, last + self._interval())
            if picture.time is not None:
                time = float(picture.time) - start
                shift = 0.0 if time > last else shift  # once they return, they were damaged: nothing was joined
                time += shift
            if time < last - _MIN_JUMP_BACK * self._interval() and not picture.is_corrupt:
                shift += last + self._interval() - time
                time = last + self._interval()
            if not last < time < _MAX_TIME or picture.is_corrupt:
                lost += 1
                continue
            last, end = time, time + _picture_duration(picture, self._packet_ticks)
            if only is None or index in only:
                with trace_step("decode"):
                    pixels = _upright_pixels(picture, self._stream.codec_context, self.side, self._aspect)
                yield Frame(index, time, pixels)
        self._note_damage(end, lost)

    def _note_damage(self, end: float, lost: int) -> None:
        """Write down what is missing; `end` is when [s] the last picture is over."""
        if self.info.duration - end > _MAX_MISSING_END + self._interval():
            self.damage = f"The clip ends after {end:.1f} of {self.info.duration:.1f} s: it is damaged or cut short."
        elif lost or self._errors:
            count = max(lost, self._errors)
            what = "1 damaged frame of the clip was" if count == 1 else f"{count} damaged frames of the clip were"
            self.damage = f"{what} left out."

    def _interval(self) -> float:
        return 1.0 / self.info.frame_rate if self.info.frame_rate else 1.0 / 30.0

    def _decoded_first(self) -> Any:
        first = self._next_picture()
        if first is None:
            raise VideoError("The clip has no frame that can be read: it is damaged, cut short or empty.")
        _check_size(first.width, first.height)
        return first

    def _decoded(self) -> Iterator[Any]:
        yield self._first
        while (picture := self._next_picture()) is not None:
            yield picture

    def _next_picture(self) -> Any:
        """The next picture, or None at the end."""
        with trace_step("decode"):
            return next(self._pictures, None)

    def _decode(self) -> Iterator[Any]:
        """Pictures as the file has them; packets that cannot be decoded are counted and left out."""
        import av

        packets = self._container.demux(self._stream)
        while True:
            try:
                packet = next(packets, None)
            except av.FFmpegError:
                self._errors += 1
                return
            if packet is None:
                return
            self._packet_ticks = packet.duration or self._packet_ticks
            try:
                yield from packet.decode()
            except (av.FFmpegError, ValueError):  # a codec that FFmpeg could not open is none that PyAV 19 knows
                self._errors += 1

    def _describe(self) -> _ClipInfo:
        stream, first = self._stream, self._first
        width, height = _display_size(first, self._aspect)
        tags = {**_readable(stream.metadata), **_readable(self._container.metadata)}
        subtitled, gimbal = _subtitle_metadata(_read_subtitles(self.path), width, height)
        metadata = _merge_metadata(subtitled, _container_metadata(tags, width, height))
        rate, curve = float(stream.average_rate or 0.0), _curve_and_primaries(first, stream.codec_context)[0] or "srgb"
        duration = _clip_duration(self._container, stream, float(first.time or 0.0))
        return _ClipInfo(width, height, rate, duration, curve, metadata, gimbal)


def local_address(path: Path) -> str:
    """Return the name by which FFmpeg takes a path for that file, whatever the name looks like.

    Else `http:...` is fetched, `concat:a|b` reads two other files, and `%d` stands for numbers.

    Args:
        path: of a file to read or to write.
    """
    return f"file:{path.absolute()}"


def _open_container(path: Path) -> Any:
    """The file by FFmpeg, which opens no other file and no connection for it."""
    av = require_extra("av", "Video needs PyAV", "all")
    _check_file(path)
    options = {"protocol_whitelist": "file", "format_whitelist": ",".join(_FORMATS), **_DECODER_OPTIONS}
    try:
        if int(av.__version__.split(".")[0]) < _NO_METADATA_ERRORS:
            return av.open(local_address(path), options=options, metadata_errors="replace")
        return av.open(local_address(path), options=options)
    except (av.FFmpegError, ValueError) as error:
        raise VideoError("The file is not a clip that can be read, or it is damaged or cut short.") from error


def _readable(tags: Mapping[str, str]) -> dict[str, str]:
    """Tags in which what is no UTF-8, which PyAV 19 leaves as lone surrogates, is replaced as by older ones."""
    return {name: value.encode("utf-8", "surrogateescape").decode("utf-8", "replace") for name, value in tags.items()}


def _check_file(path: Path) -> None:
    """Raise VideoError for what is no file of its own, OSError for one that is missing or forbidden."""
    if path.is_dir():
        raise VideoError("This is a folder; a clip is one file. Join frames to one first, with ffmpeg for example.")
    if path.exists() and not path.is_file():
        raise VideoError("This is a pipe or a device; a clip is a file.")
    with path.open("rb") as stream:
        start = stream.read(64)
    if path.suffix.lower() in _PLAYLIST_SUFFIXES or _PLAYLIST_START.match(start):
        raise VideoError("This is a playlist, which names other files; a clip is one file.")


def _video_stream(container: Any) -> Any:
    from av.stream import Disposition

    moving = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]  # not a song's cover
    if not moving:
        raise VideoError("The file has no moving picture, only sound or other data.")
    moving[0].codec_context.options = _DECODER_OPTIONS
    if moving[0].width:  # announced; a decoder counts for itself
        _check_pixel_count(moving[0].width, moving[0].height)
    moving[0].thread_type = "AUTO"
    moving[0].codec_context.thread_count = DECODING_THREADS
    return moving[0]


def _clip_duration(container: Any, stream: Any, start: float) -> float:
    """How long [s] the pictures last by what the file says, the first being shown at `start` [s]; 0 unknown."""
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if tag := _DURATION_TAG.fullmatch(stream.metadata.get("DURATION", "")):  # Matroska's, counted from 0
        return max(0.0, 3600.0 * float(tag[1]) + 60.0 * float(tag[2]) + float(tag[3]) - start)
    return (container.duration or 0) / 1e6 if len(container.streams) == 1 else 0.0  # sound may last longer


def _picture_duration(picture: Any, packet_ticks: int) -> float:
    """Seconds that a picture is shown; 0 unknown. PyAV 14 knows the last packet's duration alone."""
    return float(getattr(picture, "duration", packet_ticks) * (picture.time_base or 0))


def _check_pixel_count(width: int, height: int) -> None:
    """Raise VideoError for more pixels than a decoder, which holds up to 17 pictures, is given."""
    if width * height > MAX_CLIP_PIXELS:
        limit = f"the limit of {MAX_CLIP_PIXELS / 1e6:.0f} million"
        raise VideoError(f"The clip's pictures of {width} x {height} pixels are larger than {limit}.")


def _check_size(width: int, height: int) -> None:
    _check_pixel_count(width, height)
    if min(width, height) < MIN_SIDE or max(width, height) > MAX_ASPECT * min(width, height):
        raise VideoError(
            f"The clip is {width} x {height} pixels; each side needs at least {MIN_SIDE}, "
            f"and the longer at most {MAX_ASPECT} times the shorter."
        )

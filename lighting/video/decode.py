"""A clip's frames by PyAV (FFmpeg), one after another: upright, their pixels square, as sRGB.

Each frame has its own time, so that a rate may vary. Damaged parts are left out and reported.

HDR curves and their diffuse white are those of `lighting.color`. Primaries go from BT.2020 to BT.709 by the
matrix of Rec. BT.2087.
"""

import os
import re
from collections.abc import Container, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
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
from lighting.geometry import shrink_size
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import MAX_ASPECT, MIN_SIDE
from lighting.tracing import trace_step
from lighting.video.metadata import (
    MAX_SUBTITLE_BYTES,
    Gimbal,
    Subtitle,
    container_metadata,
    merge_metadata,
    read_subtitles,
    read_xml,
    subtitle_metadata,
    xml_metadata,
)

# by the numbers of ITU-T H.273 for transfer characteristics; all others count as sRGB
TRANSFER_CURVES: dict[int, Curve] = {16: "pq", 18: "hlg"}

_FULL_SIGNAL = 65280  # 255 x 256, which libswscale makes of the largest signal where it converts to 16 bits


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


def _upright_pixels(picture: Any, side: int, aspect: float = 1.0) -> NDArray[np.uint8]:
    """sRGB (h, w, 3) of a decoded picture, its longer side at most `side` pixels."""
    width, height = max(1, round(picture.width * aspect)), picture.height
    curve = TRANSFER_CURVES.get(int(picture.color_trc))
    pixels = _resize_picture(picture, *shrink_size(width, height, side), "rgb24" if curve is None else "rgb48le")
    pixels = pixels if curve is None else _to_srgb(pixels, curve, int(picture.color_primaries))
    return _apply_display_matrix(pixels, _display_matrix(picture))


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
    scaling = _SCALING[pixel_format]
    resized = picture.reformat(width, height, pixel_format, color_matrix, color_matrix, interpolation=scaling)
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
            last, end = time, time + _picture_duration(picture)
            if only is None or index in only:
                with trace_step("decode"):
                    pixels = _upright_pixels(picture, self.side, self._aspect)
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
            try:
                yield from packet.decode()
            except av.FFmpegError:
                self._errors += 1

    def _describe(self) -> _ClipInfo:
        stream, first = self._stream, self._first
        width, height = _display_size(first, self._aspect)
        tags = {**stream.metadata, **self._container.metadata}
        subtitled, gimbal = subtitle_metadata(self._subtitles(), width, height)
        metadata = merge_metadata(xml_metadata(read_xml(self.path)), container_metadata(tags, width, height))
        metadata = merge_metadata(subtitled, metadata)
        rate, curve = float(stream.average_rate or 0.0), TRANSFER_CURVES.get(int(first.color_trc), "srgb")
        duration = _clip_duration(self._container, stream, float(first.time or 0.0))
        return _ClipInfo(width, height, rate, duration, curve, metadata, gimbal)

    def _subtitles(self) -> list[Subtitle]:
        """The subtitles beside the clip, or else in it."""
        return read_subtitles(self.path) or (_track_subtitles(self.path) if self._container.streams.subtitles else [])


def _track_subtitles(path: Path) -> list[Subtitle]:
    """The subtitles inside a clip, of all its tracks of texts; those read so far where it is damaged."""
    import av

    subtitles: list[Subtitle] = []
    left = MAX_SUBTITLE_BYTES
    with suppress(av.FFmpegError), _open_container(path) as container:
        for stream in (s for s in container.streams if s.type != "subtitle"):
            with suppress(AttributeError):  # of older PyAV, which reads what is not wanted
                stream.discard = type(stream.discard).all
        for packet in container.demux(container.streams.subtitles):
            left -= packet.size
            if packet.pts is not None and packet.time_base and left >= 0:
                text = _subtitle_text(bytes(packet), packet.stream.codec_context.name)
                subtitles.append((float(packet.pts * packet.time_base), text))
    return subtitles


def _subtitle_text(data: bytes, codec: str) -> str:
    """The text of a packet; that of MP4 has its length before it and may have styles behind it."""
    if codec == "mov_text":
        data = data[2 : 2 + int.from_bytes(data[:2], "big")]
    return data.decode("utf-8", errors="replace")


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
        return av.open(local_address(path), options=options, metadata_errors="replace")
    except (av.FFmpegError, ValueError) as error:
        raise VideoError("The file is not a clip that can be read, or it is damaged or cut short.") from error


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


def _picture_duration(picture: Any) -> float:
    """Seconds that a picture says it is shown; 0 unknown."""
    return float(picture.duration * picture.time_base) if picture.duration and picture.time_base else 0.0


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

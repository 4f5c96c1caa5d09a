"""A clip's frames by PyAV (FFmpeg), one after another: upright, their pixels square, as sRGB.

Each frame has its own time, so that a rate may vary. Damaged parts are left out and reported.

HDR curves, cameras' logarithms and their diffuse white are those of `lighting.color`. A border is cut off, and
lettering is filled from around (framing.py). For that, some frames from all over the clip are looked at first.
"""

import os
import re
from collections.abc import Container, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import timedelta
from functools import lru_cache
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.color import (
    CHROMATICITIES,
    CODE_VALUE_CURVES,
    DECODE_CURVES,
    H273_CHROMATICITIES,
    LOG_CHROMATICITIES,
    Curve,
    chromaticities_to_rec709,
    srgb_bytes,
)
from lighting.errors import CodedWarning, VideoError, require_extra
from lighting.geometry import shrink_size
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import MAX_ASPECT, MIN_SIDE
from lighting.registration.features import import_opencv
from lighting.tracing import trace_step
from lighting.video.framing import (
    MIN_SAMPLE_LEVEL,
    SAMPLE_SIDE,
    ClipForm,
    fill_overlay,
    find_framing,
    looks_logarithmic,
)
from lighting.video.gpmf import SAMPLE_START, read_gps_fix
from lighting.video.metadata import (
    LOOKS_LOGARITHMIC,
    MAX_SUBTITLE_BYTES,
    Gimbal,
    Subtitle,
    container_metadata,
    find_log_curve,
    merge_metadata,
    read_subtitles,
    read_xml,
    subtitle_metadata,
    xml_metadata,
)

# by the numbers of ITU-T H.273 for transfer characteristics; all others count as sRGB
TRANSFER_CURVES: dict[int, Curve] = {16: "pq", 18: "hlg"}

_BLACK_CODE, _WHITE_CODE = 64, 940  # of 1023, of limited range
_FULL_SIGNAL = 65280  # 255 x 256, which libswscale makes of the largest signal where it converts to 16 bits


def _to_srgb(
    coded: NDArray[np.uint16], curve: Curve, primaries: int, *, is_full_range: bool = False
) -> NDArray[np.uint8]:
    """8-bit sRGB (..., 3) of 16-bit coded values (..., 3), as PyAV has them, under a curve.

    `primaries` are the numbers of H.273; of a logarithm they are its own.
    """
    linear = _curve_table(curve, is_full_range).take(coded)
    own = LOG_CHROMATICITIES.get(curve)
    matrix = chromaticities_to_rec709(own or H273_CHROMATICITIES.get(primaries, CHROMATICITIES))
    return srgb_bytes(linear if matrix is None else linear @ matrix.T)


@lru_cache(maxsize=4)
def _curve_table(curve: Curve, is_full_range: bool) -> NDArray[np.float32]:
    """Linear values (65536,) of what libswscale makes of a signal, which fills the range whatever the file's is."""
    signal = np.minimum(np.arange(65536) / _FULL_SIGNAL, 1.0)
    if curve in CODE_VALUE_CURVES and not is_full_range:
        signal = (_BLACK_CODE + (_WHITE_CODE - _BLACK_CODE) * signal) / 1023.0
    return DECODE_CURVES[curve](signal).astype(np.float32)


# From a decoded picture to upright sRGB.

_AREA, _FULL_CHROMA = 0x20, 0x2000  # flags of libswscale
_SCALING = {  # by the form that is asked for
    "rgb24": _AREA | _FULL_CHROMA,  # else what is reduced is 2 levels too dark
    "gbrp": _AREA | _FULL_CHROMA,  # the same in planes, in half the time; the same levels from half the height down
    "rgb48le": _AREA,  # exact; with both flags, 4:2:0 that keeps its width turns blue
}
_FULL_RANGE = 2  # of FFmpeg's numbers of color ranges
_MIN_HD_HEIGHT = 720  # rows from which a picture that names no color matrix is taken for one of BT.709


def _display_size(picture: Any, aspect: float) -> tuple[int, int]:
    """Width and height of a decoded picture as it is to be shown: pixels made square, turned upright."""
    width, height = max(1, round(picture.width * aspect)), picture.height
    return (height, width) if _swaps_axes(_display_matrix(picture)) else (width, height)


def _upright_pixels(
    picture: Any, context: Any, side: int, aspect: float, form: ClipForm, scaler: Any
) -> NDArray[np.uint8]:
    """sRGB (h, w, 3) of a picture that a codec's context decoded, its longer side at most `side` pixels.

    A border is cut off. PyAV's `scaler` of a clip has its filters ready.
    """
    width, height = max(1, round(picture.width * aspect)), picture.height
    if (crop := form.crop) is not None:
        shown = _display_size(picture, aspect)
        left, top, right, bottom = crop.pixels(*shown)
        side = round(side * max(shown) / max(right - left, bottom - top))
    stated, primaries = _curve_and_primaries(picture, context)
    curve = form.curve or stated
    size = shrink_size(width, height, side)
    eight_bits = "gbrp" if 2 * size[1] <= height else "rgb24"
    pixels = _resize_picture(picture, *size, eight_bits if curve == "srgb" else "rgb48le", scaler)
    if curve != "srgb":
        pixels = _to_srgb(pixels, curve, primaries, is_full_range=_is_full_range(picture, context))
    upright = _apply_display_matrix(pixels, _display_matrix(picture))
    if crop is None:
        return upright
    left, top, right, bottom = crop.pixels(upright.shape[1], upright.shape[0])
    return np.ascontiguousarray(upright[top:bottom, left:right])


def _is_full_range(picture: Any, context: Any) -> bool:
    """Whether code values fill the range, as in pictures that are not of luma and chroma."""
    name, source = picture.format.name, picture if hasattr(picture, "color_range") else context
    return int(source.color_range) == _FULL_RANGE or name.startswith("yuvj") or not name.startswith(("yuv", "nv", "p"))


def _curve_and_primaries(picture: Any, context: Any) -> tuple[Curve, int]:
    """The curve of a picture by itself, and the number of its primaries; PyAV 14 to 16 has them of the codec."""
    source = picture if hasattr(picture, "color_trc") else context
    return TRANSFER_CURVES.get(int(source.color_trc), "srgb"), int(source.color_primaries)


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


def _resize_picture(picture: Any, width: int, height: int, pixel_format: str, scaler: Any) -> NDArray[Any]:
    matrix = int(picture.colorspace)
    color_matrix = matrix if matrix in (1, 4, 5, 6, 7, 9) else 1 if picture.height >= _MIN_HD_HEIGHT else 5
    rgb_matrix = 1 if color_matrix == 5 else 5  # means nothing, but PyAV 14 to 16 reads the first where both differ
    scaling = _SCALING[pixel_format]
    resized = scaler.reformat(picture, width, height, pixel_format, color_matrix, rgb_matrix, interpolation=scaling)
    return _merge_planes(resized) if pixel_format == "gbrp" else np.asarray(resized.to_ndarray())


def _merge_planes(picture: Any) -> NDArray[np.uint8]:
    """Pixels (h, w, 3) of a picture of three planes; PyAV's own way takes several times as long."""
    rows = (np.frombuffer(plane, np.uint8).reshape(-1, plane.line_size) for plane in picture.planes)
    green, blue, red = (row[:, : picture.width] for row in rows)
    return np.asarray(import_opencv().merge([red, green, blue]))


# The open clip.

FRAME_SIDE = 640  # pixels of a frame's longer side: what is tracked and shown to the network
VIEW_SIDE = 1000  # pixels of the longer side of a frame that maps show
_DECODING_THREADS = 2  # that decode a clip
MAX_CLIP_PIXELS = 8192 * 4608  # of a picture: what cameras call 8K
_DURATION_TAG = re.compile(r"(\d{1,4}):(\d\d):(\d\d(?:\.\d+)?)")
_MIN_JUMP_BACK = 3.0  # frames by which times jump back between joined recordings; less is out of order
_MAX_TIME = 1e9  # s of a clip, 32 years, beyond which a frame's time is wrong
_MAX_KEPT = 4  # pictures; each takes as much memory as the file's frame
_SAMPLES = 10  # frames by which a border and lettering are found
_MAX_DECODED_GAP = 1.0  # s between them that are decoded rather than skipped
_MAX_SAMPLED_PICTURES = 400  # that are decoded for them
_MAX_FIX_SAMPLES = 3600  # of GoPro's track, one a second, in which a fix is sought
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
    curve: Curve
    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    gimbal: Gimbal = field(default_factory=Gimbal)
    warnings: tuple[CodedWarning, ...] = ()  # of its form


class Clip:
    """An open clip; a context manager. `damage` tells, once the frames are read, what of it was lost."""

    def __init__(
        self,
        path: str | os.PathLike[str],
        side: int = FRAME_SIDE,
        *,
        curve: Curve | None = None,
        form: ClipForm | None = None,
    ) -> None:
        """Open a clip and read its first frame.

        Args:
            path: a file that PyAV can read.
            side: pixels of a frame's longer side, at most.
            curve: by which the clip is coded; None: as its files say.
            form: that of another reader of the clip, which then tells no metadata; None: found here.

        Raises:
            VideoError: it is no clip that can be read.
            MissingExtraError: PyAV is not installed.
            OSError: the file is missing or forbidden.
        """
        self.path, self.side, self.damage = Path(path), side, ""
        self._container = _open_container(self.path)
        from av.video.reformatter import VideoReformatter

        try:
            self._stream = _video_stream(self._container)
            aspect = float(self._stream.sample_aspect_ratio or 1.0)
            self._aspect = aspect if 0.1 < aspect < 10.0 else 1.0  # how many times as wide as high a pixel is
            self._errors = 0  # packets that could not be decoded
            self._scaler = VideoReformatter()
            self._packet_ticks = 0  # duration of the last packet, in the stream's time base
            pictures = self._decode()
            if (first := next(pictures, None)) is None:
                raise VideoError("The clip has no frame that can be read: it is damaged, cut short or empty.")
            width, height = first.width, first.height
            _check_pixel_count(width, height)
            if min(width, height) < MIN_SIDE or max(width, height) > MAX_ASPECT * min(width, height):
                raise VideoError(
                    f"The clip is {width} x {height} pixels; each side needs at least {MIN_SIDE}, "
                    f"and the longer at most {MAX_ASPECT} times the shorter."
                )
            self._first = self._last = first
            self._pictures = chain([first], pictures)
            self._kept: dict[int, Any] = {}  # pictures by their frames' indices
            self.form = form or ClipForm(curve)
            self.info = self._describe() if form is None else self._shape()
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
        interval = 1.0 / (self.info.frame_rate or 30.0)
        shift = 0.0  # s by which times that begin again are shifted
        for index, picture in enumerate(self._pictures):
            time = max(0.0, last + interval)
            if picture.time is not None:
                time = float(picture.time) - start
                shift = 0.0 if time > last else shift  # once they return, they were damaged: nothing was joined
                time += shift
            if time < last - _MIN_JUMP_BACK * interval and not picture.is_corrupt:
                shift += last + interval - time
                time = last + interval
            if not last < time < _MAX_TIME or picture.is_corrupt:
                lost += 1
                continue
            ticks = getattr(picture, "duration", self._packet_ticks)  # PyAV 14 knows the last packet's alone
            last, end = time, time + float(ticks * (picture.time_base or 0))
            if only is None or index in only:
                self._last = picture
                yield Frame(index, time, self._frame_pixels(picture, self.side))
        if self.info.duration - end > _MAX_MISSING_END + interval:
            self.damage = f"The clip ends after {end:.1f} of {self.info.duration:.1f} s: it is damaged or cut short."
        elif count := max(lost, self._errors):
            what = "1 damaged frame of the clip was" if count == 1 else f"{count} damaged frames of the clip were"
            self.damage = f"{what} left out."

    def keep_picture(self, index: int) -> None:
        """Keep the picture of the frame that was read last, and few of those before.

        Args:
            index: of that frame.
        """
        self._kept = dict([*self._kept.items(), (index, self._last)][-_MAX_KEPT:])

    def kept_pixels(self, index: int) -> NDArray[np.uint8] | None:
        """Return a frame's pixels (h, w, 3) sRGB, its longer side VIEW_SIDE pixels; None where it is not kept.

        Args:
            index: of the frame.
        """
        picture = self._kept.get(index)
        return None if picture is None else self._frame_pixels(picture, VIEW_SIDE)

    def _frame_pixels(self, picture: Any, side: int) -> NDArray[np.uint8]:
        with trace_step("decode"):
            return fill_overlay(self._upright(picture, side), self.form.overlay)

    def _upright(self, picture: Any, side: int) -> NDArray[np.uint8]:
        return _upright_pixels(picture, self._stream.codec_context, side, self._aspect, self.form, self._scaler)

    def _decode(self) -> Iterator[Any]:
        """Pictures as the file has them; packets that cannot be read or decoded are counted and left out."""
        import av

        packets = self._container.demux(self._stream)  # ends at the first packet that cannot be read
        while True:
            with trace_step("decode"):
                try:
                    if (packet := next(packets, None)) is None:
                        return
                    self._packet_ticks = packet.duration or self._packet_ticks
                    pictures = packet.decode()
                except (av.FFmpegError, ValueError):  # a codec that FFmpeg could not open is none that PyAV 19 knows
                    self._errors += 1
                    continue
            yield from pictures

    def _shape(self) -> _ClipInfo:
        """What is known of the pictures alone."""
        width, height = _display_size(self._first, self._aspect)
        if (crop := self.form.crop) is not None:
            left, top, right, bottom = crop.pixels(width, height)
            width, height = right - left, bottom - top
        rate, context = float(self._stream.average_rate or 0.0), self._stream.codec_context
        curve = self.form.curve or _curve_and_primaries(self._first, context)[0]
        duration = _clip_duration(self._container, self._stream, float(self._first.time or 0.0))
        return _ClipInfo(width, height, rate, duration, curve)

    def _describe(self) -> _ClipInfo:
        """What is known of the clip, once its form is found."""
        tags = {**_readable(self._stream.metadata), **_readable(self._container.metadata)}
        in_clip = self._container.streams.subtitles
        subtitles = read_subtitles(self.path) or (_track_subtitles(self.path) if in_clip else [])
        xml = read_xml(self.path)
        warning: CodedWarning | None = None
        if not self.form.curve:
            curve, warning = find_log_curve(tags, subtitles, xml)
            self.form = ClipForm(curve)
        shape = self._shape()
        samples = self._samples(shape.duration)
        if self.form.curve is None and warning is None and shape.curve == "srgb" and looks_logarithmic(samples):
            warning = LOOKS_LOGARITHMIC
        self.form = find_framing(samples, (shape.width, shape.height), self.form.curve)
        shape = self._shape()
        size = shape.width, shape.height
        subtitled, gimbal = subtitle_metadata(subtitles, *size)
        metadata = merge_metadata(xml_metadata(xml), container_metadata(tags, *size))
        metadata = merge_metadata(subtitled, metadata)
        if self._container.streams.data:
            metadata = merge_metadata(_track_fix(self.path), metadata)
        warnings = self.form.warnings if warning is None else (warning, *self.form.warnings)
        return replace(shape, metadata=metadata, gimbal=gimbal, warnings=warnings)

    def _samples(self, duration: float) -> list[NDArray[np.uint8]]:
        """Frames from all over the clip, of the first one's size and not black."""
        pictures = chain([self._first], _sample_pictures(self.path, duration))
        first, *samples = (self._upright(picture, SAMPLE_SIDE) for picture in pictures)
        return [s for s in samples if s.shape == first.shape and s.max() > MIN_SAMPLE_LEVEL] or [first]


def _sample_pictures(path: Path, duration: float) -> Iterator[Any]:
    """Pictures at equal intervals over a clip of this duration [s; 0 unknown]; as many as can be read.

    Near ones are reached by decoding on, far ones by way of the key frame before them.
    """
    import av

    count = 0  # of pictures decoded
    with suppress(av.FFmpegError, ValueError), _open_container(path) as container:
        stream = _video_stream(container)
        pictures, start, time = container.decode(stream), None, -1.0
        for wanted in np.linspace(0.0, duration, _SAMPLES, endpoint=False).tolist():
            if start is not None and wanted - time > _MAX_DECODED_GAP:
                container.seek(round(1e6 * (start + wanted)))
                pictures = container.decode(stream)
            for picture in pictures:
                count += 1
                start = float(picture.time or 0.0) if start is None else start
                moment = float(picture.time or 0.0) - start
                if moment >= min(wanted, time + _MAX_DECODED_GAP) and moment > time:
                    time = moment
                    yield picture
                    break
                if count > _MAX_SAMPLED_PICTURES:
                    return


def _track_subtitles(path: Path) -> list[Subtitle]:
    """The subtitles inside a clip, of all its tracks of texts; those read so far where it is damaged."""
    subtitles: list[Subtitle] = []
    left = MAX_SUBTITLE_BYTES
    for packet in _packets(path, "subtitle"):
        left -= packet.size
        if packet.pts is not None and packet.time_base and left >= 0:
            text = _subtitle_text(bytes(packet), packet.stream.codec_context.name)
            subtitles.append((float(packet.pts * packet.time_base), text))
    return subtitles


def _track_fix(path: Path) -> PhotoMetadata:
    """Satellites' time at the clip's start and the place, by the first fix in GoPro's track; none without one."""
    packets = (p for p in _packets(path, "data") if p.pts is not None and p.time_base)
    for packet in islice(packets, _MAX_FIX_SAMPLES):
        data = bytes(packet)
        fix = read_gps_fix(data) if data.startswith(SAMPLE_START) else None
        if fix is not None:
            time = fix.time and fix.time - timedelta(seconds=float(packet.pts * packet.time_base))
            return PhotoMetadata(gps_time=time, latitude=fix.latitude, longitude=fix.longitude)
    return PhotoMetadata()


def _packets(path: Path, kind: str) -> Iterator[Any]:
    """The packets of a clip's streams of one kind, as PyAV calls it; those before the damage where there is some."""
    import av

    with suppress(av.FFmpegError, ValueError), _open_container(path) as container:
        wanted = [stream for stream in container.streams if stream.type == kind]
        for stream in (s for s in container.streams if s.type != kind):
            with suppress(AttributeError):  # of older PyAV, which reads what is not wanted
                stream.discard = type(stream.discard).all
        yield from container.demux(wanted)


def _subtitle_text(data: bytes, codec: str) -> str:
    """The text of a packet; that of MP4 has its length before it, that of ASS eight fields, and either has styles."""
    if codec == "mov_text":
        data = data[2 : 2 + int.from_bytes(data[:2], "big")]
    text = data.decode("utf-8", errors="replace")
    if codec in ("ass", "ssa"):
        text = text.split(",", 8)[-1].replace("\\N", "\n").replace("\\n", "\n")
    return text


def local_address(path: Path) -> str:
    """Return the name by which FFmpeg takes a path for that file, whatever the name looks like.

    Else `http:...` is fetched, `concat:a|b` reads two other files, and `%d` stands for numbers.

    Args:
        path: of a file to read or to write.
    """
    return f"file:{path.absolute()}"


def _open_container(path: Path) -> Any:
    """The file by FFmpeg, which opens no other file and no connection for it; OSError for one missing or forbidden."""
    av = require_extra("av", "Video needs PyAV", "all")
    if path.is_dir():
        raise VideoError("This is a folder; a clip is one file. Join frames to one first, with ffmpeg for example.")
    if path.exists() and not path.is_file():
        raise VideoError("This is a pipe or a device; a clip is a file.")
    with path.open("rb") as stream:
        start = stream.read(64)
    if path.suffix.lower() in _PLAYLIST_SUFFIXES or _PLAYLIST_START.match(start):
        raise VideoError("This is a playlist, which names other files; a clip is one file.")
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


def _video_stream(container: Any) -> Any:
    from av.stream import Disposition

    moving = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]  # not a song's cover
    if not moving:
        raise VideoError("The file has no moving picture, only sound or other data.")
    if moving[0].codec_context is None:
        raise VideoError("The file's moving picture has no codec that can be read, or it is damaged.")
    moving[0].codec_context.options = _DECODER_OPTIONS
    if moving[0].width:  # announced; a decoder counts for itself
        _check_pixel_count(moving[0].width, moving[0].height)
    moving[0].thread_type = "AUTO"
    moving[0].codec_context.thread_count = _DECODING_THREADS
    return moving[0]


def _clip_duration(container: Any, stream: Any, start: float) -> float:
    """How long [s] the pictures last by what the file says, the first being shown at `start` [s]; 0 unknown."""
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if tag := _DURATION_TAG.fullmatch(stream.metadata.get("DURATION", "")):  # Matroska's, counted from 0
        return max(0.0, 3600.0 * float(tag[1]) + 60.0 * float(tag[2]) + float(tag[3]) - start)
    return (container.duration or 0) / 1e6 if len(container.streams) == 1 else 0.0  # sound may last longer


def _check_pixel_count(width: int, height: int) -> None:
    """Raise VideoError for more pixels than a decoder, which holds up to 17 pictures, is given."""
    if width * height > MAX_CLIP_PIXELS:
        limit = f"the limit of {MAX_CLIP_PIXELS / 1e6:.0f} million"
        raise VideoError(f"The clip's pictures of {width} x {height} pixels are larger than {limit}.")

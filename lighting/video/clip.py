"""A clip's frames, upright and as sRGB, one after another; PyAV (FFmpeg) decodes them.

Each frame has its own time, so that a rate may vary. A damaged part is left out and told.
"""

import os
import re
from collections.abc import Container, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.errors import VideoError, require_extra
from lighting.photo import MAX_ASPECT, MAX_PIXELS, MIN_SIDE, PhotoFacts
from lighting.video.picture import shown_size, upright
from lighting.video.telemetry import Gimbal, container_facts, merged_facts, subtitle_facts, subtitles_beside
from lighting.video.transfer import CURVES

SIDE = 640  # pixels of a frame's longer side: what is tracked and shown to the network
THREADS = 2  # that decode a clip
_TAGGED = re.compile(r"(\d{1,4}):(\d\d):(\d\d(?:\.\d+)?)")
_BACK = 3.0  # frames by which times jump back where two recordings are joined; by less where they are out of order
_LONGEST = 1e9  # s of a clip, 32 years, beyond which a frame's time is wrong
_END = 0.75  # s that may be missing at the end of a whole clip


@dataclass(frozen=True, eq=False)
class Frame:
    """One picture of a clip."""

    index: int  # counted from 0, in the clip
    time: float  # s from the clip's first frame
    pixels: NDArray[np.uint8]  # (h, w, 3) sRGB, upright


@dataclass(frozen=True)
class ClipInfo:
    """What is known of a clip before its frames are read."""

    width: int  # of the upright picture, pixels
    height: int
    frame_rate: float  # mean, 1/s; 0 unknown
    duration: float  # s, of the pictures; 0 unknown
    curve: str  # "srgb", "hlg" or "pq"
    facts: PhotoFacts = field(default_factory=PhotoFacts)
    gimbal: Gimbal = field(default_factory=Gimbal)


class Clip:
    """An open clip; a context manager. `damage` tells, once the frames are read, what of it was lost."""

    def __init__(self, path: str | os.PathLike[str], side: int = SIDE) -> None:
        """Raises VideoError for what is not a clip that can be read, MissingExtraError without PyAV, OSError."""
        self.path, self.side, self.damage = Path(path), side, ""
        self._container = _opened(self.path)
        try:
            self._stream = _video_stream(self._container)
            self._stretch = _stretch(self._stream)
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
        """The frames in the order in which they are shown, or only those of some indices; may be read once."""
        start, last, lost, end = float(self._first.time or 0.0), -1.0, 0, 0.0
        jumped = 0.0  # seconds by which times that begin again are shifted
        for index, picture in enumerate(self._decoded()):
            time = max(0.0, last + self._interval())
            if picture.time is not None:
                time = float(picture.time) - start
                jumped = 0.0 if time > last else jumped  # once they return, they were damaged: nothing was joined
                time += jumped
            if time < last - _BACK * self._interval() and not picture.is_corrupt:
                jumped += last + self._interval() - time
                time = last + self._interval()
            if not last < time < _LONGEST or picture.is_corrupt:
                lost += 1
                continue
            last, end = time, time + _shown_for(picture)
            if only is not None and index not in only:
                continue
            yield Frame(index, time, upright(picture, self.side, self._stretch))
        self._tell(end, lost)

    def _tell(self, end: float, lost: int) -> None:
        """Write down what is missing; `end` is when [s] the last picture is over."""
        if self.info.duration - end > _END + self._interval():
            self.damage = f"The clip ends after {end:.1f} of {self.info.duration:.1f} s: it is damaged or cut short."
        elif lost or self._errors:
            count = max(lost, self._errors)
            what = "1 damaged frame of the clip was" if count == 1 else f"{count} damaged frames of the clip were"
            self.damage = f"{what} left out."

    def _interval(self) -> float:
        return 1.0 / self.info.frame_rate if self.info.frame_rate else 1.0 / 30.0

    def _decoded_first(self) -> Any:
        first = next(self._pictures, None)
        if first is None:
            raise VideoError("The clip has no frame that can be read: it is damaged, cut short or empty.")
        _check_size(first.width, first.height)
        return first

    def _decoded(self) -> Iterator[Any]:
        yield self._first
        yield from self._pictures

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

    def _describe(self) -> ClipInfo:
        stream, first = self._stream, self._first
        width, height = shown_size(first, self._stretch)
        metadata = {**stream.metadata, **self._container.metadata}
        subtitled, gimbal = subtitle_facts(subtitles_beside(self.path), width, height)
        return ClipInfo(
            width,
            height,
            float(stream.average_rate or 0.0),
            _duration(self._container, stream, float(first.time or 0.0)),
            CURVES.get(int(first.color_trc), "srgb"),
            merged_facts(subtitled, container_facts(metadata, width, height)),
            gimbal,
        )


def _opened(path: Path) -> Any:
    av = require_extra("av", "Video needs PyAV", "video")
    if path.is_dir():
        raise VideoError("This is a folder; a clip is one file. Join frames to one first, with ffmpeg for example.")
    with path.open("rb"):  # a missing or forbidden file is an OSError that names it
        pass
    try:
        return av.open(str(path), metadata_errors="replace")
    except (av.FFmpegError, ValueError) as error:
        raise VideoError("The file is not a clip that can be read, or it is damaged or cut short.") from error


def _video_stream(container: Any) -> Any:
    from av.stream import Disposition

    moving = [s for s in container.streams.video if not s.disposition & Disposition.attached_pic]  # not a song's cover
    if not moving:
        raise VideoError("The file has no moving picture, only sound or other data.")
    stream = moving[0]
    stream.thread_type = "AUTO"
    stream.codec_context.thread_count = THREADS
    return stream


def _duration(container: Any, stream: Any, start: float) -> float:
    """How long [s] the pictures last by what the file says, the first being shown at `start` [s]; 0 unknown."""
    if stream.duration:
        return float(stream.duration * stream.time_base)
    if tag := _TAGGED.fullmatch(stream.metadata.get("DURATION", "")):  # Matroska's, counted from 0
        return max(0.0, 3600.0 * float(tag[1]) + 60.0 * float(tag[2]) + float(tag[3]) - start)
    return (container.duration or 0) / 1e6 if len(container.streams) == 1 else 0.0  # sound may last longer


def _shown_for(picture: Any) -> float:
    """Seconds that a picture says it is shown; 0 unknown."""
    return float(picture.duration * picture.time_base) if picture.duration and picture.time_base else 0.0


def _check_size(width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        limit = f"the limit of {MAX_PIXELS / 1e6:g} million"
        raise VideoError(f"The clip's pictures of {width} x {height} pixels are larger than {limit}.")
    if min(width, height) < MIN_SIDE or max(width, height) > MAX_ASPECT * min(width, height):
        raise VideoError(
            f"The clip is {width} x {height} pixels; each side must have at least {MIN_SIDE}, "
            f"and one may be at most {MAX_ASPECT} times the other."
        )


def _stretch(stream: Any) -> float:
    """How many times as wide as high a pixel is."""
    ratio = float(stream.sample_aspect_ratio or 1.0)
    return ratio if 0.1 < ratio < 10.0 else 1.0

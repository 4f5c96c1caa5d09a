"""A process that decodes photos for another one: apart.py starts and stops it.

Requests and answers are pickles on stdin and stdout, each followed by the bytes of a photo or of its pixels. The
process ends with its stdin; where nobody waits any more, it does so at most a second after its photo took too long. It
logs nothing: what decoders print about a photo is nobody's business.
"""

import pickle
import sys
from dataclasses import dataclass
from typing import BinaryIO

from lighting.photo.memory import allowance
from lighting.photo.read import Photo, Source, read_photo
from lighting.processes import bound, ending_after, held, leave_signals, own_stdout

READY = "ready"


@dataclass(frozen=True)
class Request:
    """A photo to read: a path, or the number of bytes that follow; the limits of `read_photo`, and one of time."""

    source: str | int
    max_bytes: int
    max_pixels: int
    target: int | None
    seconds: float


@dataclass(frozen=True)
class Reply:
    """A photo without its pixels, which follow, and their shape; or the error that reading it raised."""

    photo: Photo | None = None
    shape: tuple[int, ...] = ()
    error: Exception | None = None


def main() -> None:
    """Answer requests until stdin ends."""
    leave_signals()
    requests, answers = sys.stdin.buffer, own_stdout()
    _one_thread()
    own = held()
    pickle.dump(READY, answers)
    answers.flush()
    while request := _next(requests):
        with ending_after(request.seconds):
            _answer(request, requests, answers, own)
            answers.flush()


def _next(requests: BinaryIO) -> Request | None:
    try:
        request: Request = pickle.load(requests)
    except EOFError:
        return None
    return request


def _answer(request: Request, requests: BinaryIO, answers: BinaryIO, own: int) -> None:
    source: Source = request.source if isinstance(request.source, str) else requests.read(request.source)
    try:
        size = len(source) if isinstance(source, bytes) else request.max_bytes
        bound(own + allowance(size, request.max_pixels, request.target))
        photo = read_photo(source, max_bytes=request.max_bytes, max_pixels=request.max_pixels, target=request.target)
    except Exception as error:
        pickle.dump(Reply(error=error), answers)
        return
    said = Photo(photo.pixels[:0], photo.width, photo.height, photo.format, photo.facts)
    pickle.dump(Reply(said, photo.pixels.shape), answers)
    answers.write(photo.pixels.data)


def _one_thread() -> None:
    """One thread per photo, since there is a decoder for each photo that is processed at a time."""
    from PIL import AvifImagePlugin

    AvifImagePlugin.DEFAULT_MAX_THREADS = 1
    try:
        from pillow_heif import options
    except ImportError:
        return
    options.DECODE_THREADS = 1

"""Decoding in a killable worker process.

Nothing in Python interrupts a decoder that runs, so only another process can be stopped. The processes are this one's,
whoever asks: each reads one photo at a time, and there are as many as photos were ever read at once.

Requests and answers are pickles on stdin and stdout, each followed by the bytes of a photo or of its pixels. The
process ends with its stdin; where nobody waits any more, it does so at most a second after its photo took too long. It
logs nothing: what decoders print about a photo is nobody's business.
"""

import atexit
import os
import pickle
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event, Timer
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

import lighting.runtime as runtime
from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo.reader import MAX_BYTES, MAX_PIXELS, TARGET, Photo, Source, memory_budget, read_bytes, read_photo

if TYPE_CHECKING:
    from subprocess import Popen

MAX_DECODE_SECONDS = 10.0  # for a photo: five times the slowest that `benchmarks.decoding` reads, on a busy CPU

_WORKER_CODE = "from lighting.photo.sandbox import serve_decoder; serve_decoder()"

_START_SECONDS = 300.0  # on a machine that is busy with other work
_PIPE = 1 << 20  # bytes that a pipe holds; Linux's usual sixteenth of it costs more switches between the processes
_ENVIRONMENT = {  # one heap, which keeps what it has: fresh memory costs more than decoding into it
    "MALLOC_MMAP_MAX_": str(1 << 16),  # glibc's own, since those of a caller could loosen the bound
    "MALLOC_TOP_PAD_": str(1 << 17),  # the same
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 25),
}
_READY = "ready"


@dataclass(frozen=True)
class DecodeRequest:
    """A photo to read, the limits of `read_photo`, and one of time."""

    source: str | int  # a path, or the number of bytes that follow
    max_bytes: int
    max_pixels: int
    target: int | None  # pixels
    seconds: float


@dataclass(frozen=True)
class _Reply:
    """A photo without its pixels, which follow, and their shape; or the error that reading it raised."""

    photo: Photo | None = None
    shape: tuple[int, ...] = ()
    error: Exception | None = None


def read_photo_isolated(
    source: str | os.PathLike[str] | bytes,
    *,
    max_bytes: int = MAX_BYTES,
    max_pixels: int = MAX_PIXELS,
    target: int | None = TARGET,
    seconds: float = MAX_DECODE_SECONDS,
) -> Photo:
    """What `read_photo` returns or raises, from another process.

    PhotoTooLargeError also where reading takes longer, or, on Linux, more memory than `memory_budget`. PhotoError also
    where a decoder crashes.

    Args:
        source: path or bytes.
        max_bytes: as in `read_photo`.
        max_pixels: as in `read_photo`.
        target: as in `read_photo`.
        seconds: that reading may take.
    """
    data = read_bytes(source, max_bytes) if isinstance(source, bytes) else b""
    size_or_path = len(source) if isinstance(source, bytes) else str(Path(source).absolute())
    with _borrow_decoder() as decoder:
        return decoder.read(DecodeRequest(size_or_path, max_bytes, max_pixels, target, seconds), data)


def start_decoder_pool(count: int) -> None:
    """Start processes, so that no photo waits for one; PhotoError where they do not start.

    Args:
        count: of processes that are ready afterwards, at least.
    """
    started = [DecoderProcess() for _ in range(count - len(_idle))]
    for decoder in started:
        decoder.start()
    for decoder in started:
        decoder.wait()
        _idle.append(decoder)


class DecoderProcess:
    """One process for one photo at a time."""

    def __init__(self) -> None:
        self._process: Popen[bytes] | None = None
        self._ready = False
        atexit.register(self.end)

    def read(self, request: DecodeRequest, data: bytes) -> Photo:
        """The photo of a request; raises as `read_photo_isolated`.

        Args:
            request: what to read.
            data: of the photo; empty where the request names a path.
        """
        try:
            self.prepare()
            answer = self._read_in_time(request, data)
        except BaseException:  # whatever it is, the process may be in the middle of an answer
            self.end()
            raise
        if isinstance(answer, Photo):
            return answer
        raise answer

    @property
    def pid(self) -> int:
        """The number of the process that runs."""
        return self._running.pid

    def prepare(self) -> None:
        """Have a process that takes requests; raises PhotoError where it does not start."""
        if self._process is None or self._process.poll() is not None:
            self.start()
        self.wait()

    def start(self) -> None:
        """Start the process, in place of one that ended, without waiting for it."""
        self.end()
        self._process = _start_process()

    def wait(self) -> None:
        """Wait until the process takes requests; raises PhotoError where it never does."""
        if self._ready:
            return
        with _alarm(_START_SECONDS, self._running):
            try:
                self._ready = pickle.load(_open_pipe(self._running.stdout)) == _READY
            except (EOFError, pickle.UnpicklingError) as error:
                raise PhotoError("The process that decodes photos does not start.") from error

    def end(self) -> None:
        """Kill the process if there is one."""
        process, self._process, self._ready = self._process, None, False
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # what was written and never read
                _open_pipe(stream).close()

    @property
    def _running(self) -> "Popen[bytes]":
        assert self._process
        return self._process

    def _read_in_time(self, request: DecodeRequest, data: bytes) -> Photo | Exception:
        """The photo or why there is none; a process that was killed or died is replaced."""
        answer: Photo | Exception | None = None
        death = suppress(EOFError, BrokenPipeError, pickle.UnpicklingError)
        helper = runtime.charge_helper(self.pid)
        with helper, _alarm(request.seconds, self._running) as expired, death:
            answer = _request_photo(self._running, request, data)
        if expired.is_set() or answer is None:
            self.start()
        if answer is not None:
            return answer
        if expired.is_set():
            return PhotoTooLargeError(f"The photo takes longer than {request.seconds:g} seconds to decode.")
        return PhotoError("The photo ended the process that decoded it.")


_idle: list[DecoderProcess] = []  # taken and given back by threads; both are single steps


@contextmanager
def _borrow_decoder() -> Iterator[DecoderProcess]:
    """A decoder that nobody else uses; a new one where all are in use."""
    try:
        decoder = _idle.pop()
    except IndexError:
        decoder = DecoderProcess()
    try:
        yield decoder
    finally:
        _idle.append(decoder)


def _request_photo(process: "Popen[bytes]", request: DecodeRequest, data: bytes) -> Photo | Exception:
    requests, answers = _open_pipe(process.stdin), _open_pipe(process.stdout)
    pickle.dump(request, requests)
    requests.write(data)
    requests.flush()
    answer: _Reply = pickle.load(answers)
    if answer.photo is None:
        return answer.error or EOFError()
    pixels = np.empty(answer.shape, dtype=np.uint8)
    if answers.readinto(pixels.data.cast("B")) < pixels.nbytes:
        raise EOFError
    return replace(answer.photo, pixels=pixels)


@contextmanager
def _alarm(seconds: float, process: "Popen[bytes]") -> Iterator[Event]:
    """Kill the process unless the block ends in time; the event says whether that happened."""
    expired = Event()

    def expire() -> None:
        expired.set()
        process.kill()

    timer = Timer(seconds, expire)
    timer.daemon = True
    timer.start()
    try:
        yield expired
    finally:
        timer.cancel()
        timer.join()


def _start_process() -> "Popen[bytes]":
    process = runtime.start_python(_WORKER_CODE, _ENVIRONMENT)
    if sys.platform == "linux":
        import fcntl

        for stream in (process.stdin, process.stdout):
            with suppress(OSError):  # where a user's pipes may hold less
                fcntl.fcntl(_open_pipe(stream), fcntl.F_SETPIPE_SZ, _PIPE)
    return process


def _open_pipe(stream: Any) -> Any:
    """A pipe of a process, which Popen may leave out."""
    assert stream is not None
    return stream


def serve_decoder() -> None:
    """Answer requests until stdin ends."""
    runtime.ignore_signals()
    requests, answers = sys.stdin.buffer, runtime.claim_stdout()
    _decode_in_one_thread()
    own = runtime.address_space_used()
    pickle.dump(_READY, answers)
    answers.flush()
    while request := _next_request(requests):
        with runtime.exit_after(request.seconds):
            _answer_request(request, requests, answers, own)
            answers.flush()


def _next_request(requests: BinaryIO) -> DecodeRequest | None:
    try:
        request: DecodeRequest = pickle.load(requests)
    except EOFError:
        return None
    return request


def _answer_request(request: DecodeRequest, requests: BinaryIO, answers: BinaryIO, own: int) -> None:
    source: Source = request.source if isinstance(request.source, str) else requests.read(request.source)
    try:
        size = len(source) if isinstance(source, bytes) else request.max_bytes
        runtime.limit_address_space(own + memory_budget(size, request.max_pixels, request.target))
        photo = read_photo(source, max_bytes=request.max_bytes, max_pixels=request.max_pixels, target=request.target)
    except Exception as error:
        pickle.dump(_Reply(error=error), answers)
        return
    pickle.dump(_Reply(replace(photo, pixels=photo.pixels[:0]), photo.pixels.shape), answers)
    answers.write(photo.pixels.data)


def _decode_in_one_thread() -> None:
    """One thread per photo, since each photo that is read at a time has a decoder."""
    from pi_heif import options
    from PIL import AvifImagePlugin

    AvifImagePlugin.DEFAULT_MAX_THREADS = options.DECODE_THREADS = 1

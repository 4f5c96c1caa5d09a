"""Decoding in a killable worker process that has given up files, connections and secrets.

Nothing in Python interrupts a decoder that runs, so only another process can be stopped. The processes are this one's,
whoever asks: each reads one photo at a time, and there are as many as photos were ever read at once.

Requests and answers are lines of JSON on stdin and stdout, each followed by the bytes of a photo or of its pixels.
Whoever takes over a decoder by a photo can answer nothing but a wrong photo: an answer is checked, and nothing in it is
run. The process ends with its stdin; where nobody waits any more, it does so at most a second after its photo took too
long. It logs nothing: what decoders print about a photo is nobody's business.
"""

import atexit
import codecs
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, is_dataclass, replace
from datetime import datetime
from enum import Enum
from functools import cache, partial
from importlib import import_module
from io import BufferedReader, BufferedWriter
from pathlib import Path
from threading import Event, Timer
from types import NoneType, UnionType
from typing import TYPE_CHECKING, BinaryIO, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

import lighting.runtime as runtime
from lighting.confinement import confine_process
from lighting.errors import (
    CodedWarning,
    ErrorCode,
    LightingError,
    ParameterError,
    PhotoError,
    PhotoTooLargeError,
    WarningCode,
    warning_code,
)
from lighting.fields import Json
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.pixels import MAX_KEPT_PIXELS
from lighting.photo.reader import (
    MAX_BYTES,
    MAX_PIXELS,
    TARGET,
    Photo,
    PhotoCrop,
    PhotoOrigin,
    memory_budget,
    modified,
    read_bytes,
    read_photo,
)
from lighting.photo.sidecars import read_sidecar
from lighting.tracing import trace_step

if TYPE_CHECKING:
    from subprocess import Popen

MAX_DECODE_SECONDS = 10.0  # for a photo: five times the slowest that `benchmarks.decoding` reads, on a busy CPU
_WORKER_CODE = "from lighting.photo.sandbox import _serve_decoder; _serve_decoder()"
_START_SECONDS = 300.0  # on a machine that is busy with other work
_PIPE = 1 << 20  # bytes that a pipe holds; Linux's usual sixteenth of it costs more switches between the processes
_ENVIRONMENT = {  # one heap, which keeps what it has: fresh memory costs more than decoding into it
    "MALLOC_MMAP_MAX_": str(1 << 16),  # glibc's own, since those of a caller could loosen the bound
    "MALLOC_TOP_PAD_": str(1 << 17),  # the same
    "MALLOC_MMAP_THRESHOLD_": str(1 << 25),
    "MALLOC_TRIM_THRESHOLD_": str(1 << 25),
}
_Record = TypeVar("_Record")
_hints: Callable[[type], dict[str, object]] = cache(get_type_hints)  # of a record, once

_READY = b"ready\n"
_MAX_HEADER = 1 << 16  # bytes of an answer before its pixels
_MODULES = (  # what Pillow and Python load when a photo first needs it
    *("AvifImagePlugin", "ImageCms", "IptcImagePlugin", "JpegImagePlugin", "MpoImagePlugin"),
    *("PngImagePlugin", "TiffImagePlugin", "WebPImagePlugin"),
)
_XML_ENCODINGS = ("ascii", "latin-1", "cp1252", "utf-16", "utf-32")
_ERRORS: Mapping[str, type[LightingError]] = {e.__name__: e for e in (PhotoError, PhotoTooLargeError, ParameterError)}


@dataclass(frozen=True)
class _DecodeRequest:
    """A photo to read, the limits of `read_photo`, and one of time."""

    size: int  # bytes of the photo, which follow
    max_bytes: int  # as in `read_photo`
    max_pixels: int  # as in `read_photo`
    target: int | None  # as in `read_photo`
    seconds: float  # over 0, that decoding may take
    sidecar: tuple[tuple[str, str], ...] = ()  # XMP of files beside the photo, which a worker cannot read


def read_photo_isolated(
    source: str | os.PathLike[str] | bytes,
    *,
    max_bytes: int = MAX_BYTES,
    max_pixels: int = MAX_PIXELS,
    target: int | None = TARGET,
    seconds: float = MAX_DECODE_SECONDS,
    sidecar: Mapping[str, str] | None = None,
) -> Photo:
    """What `read_photo` returns or raises, from another process.

    PhotoTooLargeError also where reading takes longer, or, on Linux, more memory than `memory_budget`. PhotoError also
    where a decoder crashes.

    Args:
        source: path, beside which sidecars may lie, or bytes.
        max_bytes: as in `read_photo`.
        max_pixels: as in `read_photo`.
        target: as in `read_photo`.
        seconds: that reading may take.
        sidecar: what `read_sidecar` returned; None: look beside a path.
    """
    file = None if isinstance(source, bytes) else Path(source).absolute()
    if file is not None and file.exists() and not (file.is_file() or file.is_dir()):
        raise PhotoError("This is a pipe or a device; a photo is a file.")  # which may never end
    changed = modified(file) if file is not None and file.is_file() else None
    data = read_bytes(source, max_bytes)
    if sidecar is None:
        sidecar = {} if isinstance(source, bytes) else read_sidecar(source)
    request = _DecodeRequest(len(data), max_bytes, max_pixels, target, seconds, tuple(sidecar.items()))
    try:
        decoder = _idle.pop()
    except IndexError:  # all are in use
        decoder = _DecoderProcess()
    try:
        with trace_step("decode"):
            photo = decoder.read(request, data)
    finally:
        _idle.append(decoder)
    reader = partial(read_photo_isolated, seconds=seconds)
    return replace(photo, source=PhotoOrigin(file or data, changed, max_bytes, max_pixels, reader))


def start_decoder_pool(count: int) -> None:
    """Start processes, so that no photo waits for one; PhotoError where they do not start.

    Args:
        count: of processes that are ready afterwards, at least.
    """
    started = [_DecoderProcess() for _ in range(count - len(_idle))]
    for decoder in started:
        decoder.start()
    for decoder in started:
        decoder.prepare()
        _idle.append(decoder)


class _DecoderProcess:
    """One process for one photo at a time."""

    def __init__(self) -> None:
        self._process: Popen[bytes] | None = None
        self._ready = False
        self._own_memory = 0  # bytes of address space, before the first photo
        atexit.register(self.end)

    def read(self, request: _DecodeRequest, data: bytes) -> Photo:
        """The photo of a request; raises as `read_photo_isolated`. A process that was killed or died is replaced."""
        answer: Photo | Exception | None = None
        death = suppress(EOFError, BrokenPipeError, TypeError, ValueError, RecursionError)  # or an answer that is none
        try:
            self.prepare()
            budget = memory_budget(len(data), request.max_pixels, request.target)
            helper = runtime.charge_helper(self.pid)
            with helper, _alarm(request.seconds, self._running) as expired, death:
                runtime.limit_address_space(self._own_memory + budget, self.pid)
                answer = _request_photo(self._running, request, data)
            if expired.is_set() or answer is None:
                self.start()
        except BaseException:  # whatever it is, the process may be in the middle of an answer
            self.end()
            raise
        if answer is None and expired.is_set():
            answer = PhotoTooLargeError(f"The photo takes longer than {request.seconds:g} seconds to decode.")
        answer = answer or PhotoError("The photo ended the process that decoded it.")
        if isinstance(answer, Exception):
            raise answer
        return answer

    @property
    def pid(self) -> int:
        """The number of the process that runs."""
        return self._running.pid

    def start(self) -> None:
        """Start the process, in place of one that ended, without waiting for it."""
        self.end()
        self._process = runtime.start_python(_WORKER_CODE, _ENVIRONMENT)
        if sys.platform == "linux":
            import fcntl

            for stream in _pipes(self._process):
                with suppress(OSError):  # where a user's pipes may hold less
                    fcntl.fcntl(stream, fcntl.F_SETPIPE_SZ, _PIPE)

    def prepare(self) -> None:
        """Have a process that takes requests; raises PhotoError where it does not start."""
        if self._process is None or self._process.poll() is not None:
            self.start()
        if self._ready:
            return
        with _alarm(_START_SECONDS, self._running):
            self._ready = _pipes(self._running)[1].readline(_MAX_HEADER) == _READY
        if not self._ready:
            raise PhotoError("The process that decodes photos does not start.")
        self._own_memory = runtime.address_space_used(self.pid)

    def end(self) -> None:
        """Kill the process if there is one."""
        process, self._process, self._ready = self._process, None, False
        if process is None:
            return
        process.kill()
        process.wait()
        for stream in _pipes(process):
            with suppress(OSError):  # what was written and never read
                stream.close()

    @property
    def _running(self) -> "Popen[bytes]":
        assert self._process
        return self._process


_idle: list[_DecoderProcess] = []  # taken and given back by threads; both are single steps


def _request_photo(process: "Popen[bytes]", request: _DecodeRequest, data: bytes) -> Photo | Exception:
    requests, answers = _pipes(process)
    requests.write(_json_line(asdict(request)))
    requests.write(data)
    requests.flush()
    line = answers.readline(_MAX_HEADER)
    if not line.endswith(b"\n"):
        raise EOFError
    header = json.loads(line)
    if "error" in header:
        failure = _parse_record(_Failure, header)
        if kind := _ERRORS.get(failure.error):
            return kind(failure.text, failure.field, failure.code)
        return RuntimeError(f"Decoding the photo failed: {failure.error}: {failure.text}")
    answer = _parse_record(_Decoded, header)
    if not (answer.rows > 0 < answer.columns and answer.rows * answer.columns <= MAX_KEPT_PIXELS):
        raise ValueError("no picture has this size")
    pixels = np.empty((answer.rows, answer.columns, 3), dtype=np.uint8)
    if answers.readinto(pixels.data.cast("B")) < pixels.nbytes:
        raise EOFError
    warnings = tuple(CodedWarning(*warning) for warning in answer.warnings)
    size = answer.width, answer.height
    return Photo(pixels, *size, answer.format, answer.metadata, answer.crop, answer.is_collage, warnings)


@dataclass(frozen=True)
class _Decoded:
    """An answer: a photo without its pixels, which follow."""

    rows: int
    columns: int
    width: int
    height: int
    format: str
    metadata: PhotoMetadata
    crop: PhotoCrop | None
    is_collage: bool
    warnings: tuple[tuple[str, WarningCode], ...]


@dataclass(frozen=True)
class _Failure:
    """An answer: the error that reading the photo raised."""

    error: str  # its class
    text: str
    field: str | None
    code: ErrorCode | None


def _json_line(record: Json) -> bytes:
    return json.dumps(record, default=_plain).encode() + b"\n"


def _plain(value: object) -> object:
    """What JSON has no word for, as metadata hold it."""
    return value.isoformat() if isinstance(value, datetime) else value.item() if isinstance(value, np.generic) else None


# Records of what another process says, which may be anybody's.


def _parse_record(kind: type[_Record], value: object) -> _Record:
    """A frozen dataclass of what JSON holds: numbers, texts, moments, enums, tuples, other records, and None.

    `value` is a dict of its fields. Raises ValueError where one is missing or unknown, TypeError or ValueError where a
    value is none of its field's type.
    """
    hints = _hints(kind)
    if not isinstance(value, dict) or value.keys() != hints.keys():
        raise ValueError(f"not the fields of {kind.__name__}")
    return kind(**{name: _parse(hint, value[name]) for name, hint in hints.items()})


def _parse(hint: object, value: object) -> object:
    if hint in (int, str, bool) and type(value) is hint:
        return value
    origin, parts = get_origin(hint), get_args(hint)
    if origin in (Union, UnionType):
        if value is None and NoneType in parts:
            return None
        (some,) = (part for part in parts if part is not NoneType)
        return _parse(some, value)
    if origin is tuple:
        if not isinstance(value, list):
            raise TypeError("not a list")
        parts = parts[:1] * len(value) if parts[1:] == (...,) else parts
        return tuple(_parse(part, one) for part, one in zip(parts, value, strict=True))
    if is_dataclass(hint) and isinstance(hint, type):
        return _parse_record(hint, value)
    if hint is float and isinstance(value, int | float) and type(value) is not bool and math.isfinite(value):
        return float(value)
    if hint is datetime and isinstance(value, str):
        return datetime.fromisoformat(value)
    if isinstance(hint, type) and issubclass(hint, Enum):
        return hint(value)
    raise TypeError(f"not of the type {hint}")


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


def _pipes(process: "Popen[bytes]") -> tuple[BufferedWriter, BufferedReader]:
    """Where requests go, and where answers come from."""
    assert isinstance(process.stdin, BufferedWriter)
    assert isinstance(process.stdout, BufferedReader)
    return process.stdin, process.stdout


def _serve_decoder() -> None:
    """Answer requests until stdin ends."""
    requests, answers = sys.stdin.buffer, runtime.begin_helper()
    _load_decoders()
    confine_process()
    sys.meta_path.clear()  # a module that was not loaded is then missing in one way, on every system
    answers.write(_READY)
    answers.flush()
    while line := requests.readline():
        request = _parse_record(_DecodeRequest, json.loads(line))
        with runtime.exit_after(request.seconds):
            _answer_request(request, requests.read(request.size), answers)
            answers.flush()


def _answer_request(request: _DecodeRequest, data: bytes, answers: BinaryIO) -> None:
    try:
        sidecar, limits = dict(request.sidecar), (request.max_bytes, request.max_pixels)
        photo = read_photo(data, max_bytes=limits[0], max_pixels=limits[1], target=request.target, sidecar=sidecar)
    except Exception as error:
        field, code = getattr(error, "field", None), getattr(error, "code", None)
        answers.write(_json_line(asdict(_Failure(type(error).__name__, str(error), field, code))))
        return
    warnings = tuple((str(warning), warning_code(warning)) for warning in photo.warnings)
    picture = photo.pixels.shape[0], photo.pixels.shape[1], photo.width, photo.height, photo.format
    decoded = _Decoded(*picture, photo.metadata, photo.crop, photo.is_collage, warnings)
    answers.write(_json_line(asdict(decoded)))
    answers.write(photo.pixels.data)


def _load_decoders() -> None:
    """Load all that reading a photo may need, since no file can be opened later.

    One thread per photo, since each photo that is read at a time has a decoder.
    """
    from pi_heif import options
    from PIL import AvifImagePlugin, Image

    AvifImagePlugin.DEFAULT_MAX_THREADS = options.DECODE_THREADS = 1
    Image.preinit()
    for name in _MODULES:
        import_module(f"PIL.{name}")
    for name in ("lighting.photo.formats", "xml.parsers.expat"):
        import_module(name)
    for encoding in _XML_ENCODINGS:
        codecs.lookup(encoding)

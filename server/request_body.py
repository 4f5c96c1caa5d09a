"""Uploads and JSON records."""

import json
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable
from contextlib import AbstractContextManager, asynccontextmanager
from dataclasses import dataclass
from typing import TypeVar

from anyio import CancelScope, current_time
from fastapi import Request
from fastapi.exceptions import RequestValidationError
from pydantic import ValidationError
from pydantic_core import from_json
from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from lighting.errors import ErrorCode, ParameterError
from lighting.records import MAX_RECORD_BYTES, Lighting, reject_duplicate_keys, unwrap_record
from lighting.validation import record_path
from server import problems
from server.problems import InvalidField, ProblemError
from server.schemas import LightingRecord

T = TypeVar("T")

FORM = "multipart/form-data"
JSON = "application/json"
PHOTO_TYPES = ("image/jpeg", "image/png", "image/webp", "image/heic", "image/heif", "image/tiff", "image/avif")
PHOTO_FIELD = "photo"
MAX_FIELDS = 16  # of a form; and of its files, where a request may bring fewer
GRACE = 5.0  # seconds in which a body may be slower than its least rate


def media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


@dataclass(frozen=True)
class Upload:
    """A file that was sent, and the name it has on the client's side, if that was said."""

    data: bytes
    name: str = ""


@dataclass(frozen=True)
class Limits:
    """What a body may be."""

    max_bytes: int
    seconds: float  # from its first byte to its last
    rate: int  # bytes per second, at least, after GRACE


class Body:
    """The body of a request; `arriving` counts it while it is received, or raises."""

    def __init__(self, request: Request, limits: Limits, arriving: Callable[[], AbstractContextManager[None]]) -> None:
        self.request = request
        self.limits = limits
        self._arriving = arriving
        self._deadline = CancelScope()

    async def photo(self, *also: str) -> bytes:
        """The bytes of one photo; raises ProblemError. `also` names further types, which the caller reads itself."""
        (upload,) = await self.photos(1, *also)
        return upload.data

    async def photos(self, most: int, *also: str) -> list[Upload]:
        """One to `most` photos; raises ProblemError."""
        self._refuse_coded()
        kind = media_type(self.request)
        if kind == FORM:
            return await self._in_time(lambda: self._photos_of_form(most))
        if kind in PHOTO_TYPES:
            return [Upload(await self._in_time(lambda: self._whole(self.limits.max_bytes)))]
        listed = ", ".join((FORM, *PHOTO_TYPES, *also))
        raise ProblemError(problems.UNSUPPORTED_TYPE, f"The body must be one of: {listed}.", {"Accept": listed})

    async def record(self) -> bytes:
        """The bytes of a JSON lighting record; raises ProblemError."""
        self._refuse_coded()
        return await self._in_time(lambda: self._whole(min(self.limits.max_bytes, MAX_RECORD_BYTES)))

    def _refuse_coded(self) -> None:
        """Raise ProblemError for a body that is compressed for its way here: it would be taken for a damaged photo."""
        coding = self.request.headers.get("content-encoding", "").strip().lower()
        if coding not in ("", "identity"):
            detail = "The body has a Content-Encoding; send it as it is, without one."
            raise ProblemError(problems.UNSUPPORTED_TYPE, detail, {"Accept-Encoding": "identity"})

    async def _in_time(self, reading: Callable[[], Awaitable[T]]) -> T:
        with self._arriving(), self._deadline:
            self._expect(0, current_time())
            return await reading()
        detail = f"The body must arrive within {self.limits.seconds:g} s and at {self.limits.rate} bytes per second."
        raise ProblemError(problems.TOO_SLOW, detail, {"Connection": "close"})

    def _expect(self, size: int, began: float) -> None:
        """After so many bytes, set the time until which the next ones must come."""
        self._deadline.deadline = began + min(self.limits.seconds, GRACE + size / self.limits.rate)

    async def _whole(self, limit: int) -> bytes:
        return b"".join([chunk async for chunk in self._chunks(limit)])

    async def _chunks(self, limit: int) -> AsyncGenerator[bytes, None]:
        announced = self.request.headers.get("content-length", "")
        _check(int(announced) if announced.isdecimal() else 0, limit)
        size, began = 0, current_time()
        async for chunk in self.request.stream():
            size += len(chunk)
            _check(size, limit)
            self._expect(size, began)
            yield chunk

    async def _photos_of_form(self, most: int) -> list[Upload]:
        async with self._form(most) as form:
            _refuse_others(form)
            fields = form.getlist(PHOTO_FIELD)
            files = [field for field in fields if isinstance(field, UploadFile)]
            if not 1 <= len(files) == len(fields):
                raise problems.invalid(
                    PHOTO_FIELD, "The form needs a file in this field and nothing else.", "form", ErrorCode.WRONG_TYPE
                )
            if len(files) > most:
                raise _too_many(most)
            return [Upload(await file.read(), file.filename or "") for file in files]

    @asynccontextmanager
    async def _form(self, most: int) -> AsyncIterator[FormData]:
        parser = _Form(
            self.request.headers,
            self._chunks(self.limits.max_bytes),
            max_files=max(most, MAX_FIELDS),
            max_fields=MAX_FIELDS,
        )
        parser.spool_max_size = self.limits.max_bytes + 1  # in memory, never on disk
        try:
            form = await parser.parse()
        except MultiPartException as error:
            if parser.crowded:
                raise _too_many(most) from error
            raise ProblemError(problems.UNREADABLE_BODY, f"The form cannot be read: {error.message}") from error
        try:
            yield form
        finally:
            await form.close()


class _Form(MultiPartParser):
    """A parser that refuses a form that ends early, and says whether one had more files than it reads."""

    ended = False

    @property
    def crowded(self) -> bool:
        return self._current_files > self.max_files

    def on_end(self) -> None:
        self.ended = True

    async def parse(self) -> FormData:
        form = await super().parse()
        if not self.ended:
            for file in self._files_to_close_on_error:
                file.close()
            raise MultiPartException("It is cut short.")
        return form


def _too_many(most: int) -> ProblemError:
    wanted = "One photo is" if most == 1 else f"At most {most} photos are"
    return problems.invalid(
        PHOTO_FIELD, f"{wanted} taken here, and the form holds more.", "form", ErrorCode.OUT_OF_RANGE
    )


def _refuse_others(form: FormData) -> None:
    """Raise ProblemError for fields that are no photo: parameters that were put there would do nothing."""
    names = [name for name in dict.fromkeys(form) if name != PHOTO_FIELD]
    detail = "The form takes no such field; files go into photo, and parameters into the URL, as in ?exif=false."
    if names:
        raise problems.all_invalid([InvalidField(name, "form", detail, ErrorCode.UNKNOWN) for name in names])


def _check(size: int, limit: int) -> None:
    if size > limit:
        raise ProblemError(problems.TOO_LARGE, f"The body is larger than the limit of {limit / 1e6:g} MB.")


# Lighting records that clients send.


def parse_record(data: bytes) -> Lighting:
    """The light in a JSON record, bare or in the line that `lighting estimate --json` printed.

    It is UTF-8, with or without a byte order mark, or UTF-16, as PowerShell redirects that line.
    Raises ProblemError for what is not JSON, a key given twice, an error, an answer about several photos and fields
    that do not fit each other, RequestValidationError for wrong fields.
    """
    try:
        text = data.decode(json.detect_encoding(data))
        from_json(text)  # refuses what is nested too deep, and half a surrogate pair
    except ValueError as error:
        raise ProblemError(problems.UNREADABLE_BODY, f"The body is not JSON: {error}.") from error
    try:
        content = unwrap_record(json.loads(text, object_pairs_hook=reject_duplicate_keys))
        return LightingRecord.model_validate(content).lighting()
    except ValidationError as error:
        found = error.errors(include_url=False)
        raise RequestValidationError([{**item, "loc": ("body", *item["loc"])} for item in found]) from error
    except ParameterError as error:
        named = error.renamed(record_path)
        raise problems.invalid(named.field or "body", str(named), "body", named.code) from error

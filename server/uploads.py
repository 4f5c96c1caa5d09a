"""Request bodies: photos as files of a form or as the body itself, or a lighting record. Nothing is written to disk."""

from collections.abc import AsyncGenerator, AsyncIterator, Awaitable
from contextlib import asynccontextmanager
from typing import TypeVar

from anyio import fail_after
from fastapi import Request
from starlette.datastructures import FormData, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from server import problems
from server.problems import ProblemError

T = TypeVar("T")

FORM = "multipart/form-data"
JSON = "application/json"
PHOTO_TYPES = ("image/jpeg", "image/png", "image/webp", "image/heic", "image/heif")
PHOTO_FIELD = "photo"
MAX_RECORD_BYTES = 100_000
MAX_FIELDS = 16


def media_type(request: Request) -> str:
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


class Body:
    """The body of a request, limited to `max_bytes` and to `seconds` of receiving it."""

    def __init__(self, request: Request, max_bytes: int, seconds: float) -> None:
        self.request = request
        self.max_bytes = max_bytes
        self.seconds = seconds

    async def photo(self, *also: str) -> bytes:
        """The bytes of one photo; raises ProblemError. `also` names further types, which the caller reads itself."""
        (data,) = await self.photos(1, *also)
        return data

    async def photos(self, most: int, *also: str) -> list[bytes]:
        """The bytes of one to `most` photos; raises ProblemError."""
        kind = media_type(self.request)
        if kind == FORM:
            return await self._in_time(self._photos_of_form(most))
        if kind in PHOTO_TYPES:
            return [await self._in_time(self._whole(self.max_bytes))]
        listed = ", ".join((FORM, *PHOTO_TYPES, *also))
        raise ProblemError(problems.UNSUPPORTED_TYPE, f"The body must be one of: {listed}.", {"Accept": listed})

    async def record(self) -> bytes:
        """The bytes of a JSON lighting record; raises ProblemError."""
        return await self._in_time(self._whole(min(self.max_bytes, MAX_RECORD_BYTES)))

    async def _in_time(self, reading: Awaitable[T]) -> T:
        try:
            with fail_after(self.seconds):
                return await reading
        except TimeoutError as error:
            detail = f"The body did not arrive within {self.seconds:g} seconds."
            raise ProblemError(problems.TOO_SLOW, detail, {"Connection": "close"}) from error

    async def _whole(self, limit: int) -> bytes:
        return b"".join([chunk async for chunk in self._chunks(limit)])

    async def _chunks(self, limit: int) -> AsyncGenerator[bytes, None]:
        announced = self.request.headers.get("content-length", "")
        _check(int(announced) if announced.isdecimal() else 0, limit)
        size = 0
        async for chunk in self.request.stream():
            size += len(chunk)
            _check(size, limit)
            yield chunk

    async def _photos_of_form(self, most: int) -> list[bytes]:
        async with self._form(most) as form:
            fields = form.getlist(PHOTO_FIELD)
            files = [field for field in fields if isinstance(field, UploadFile)]
            if not files or len(files) < len(fields):
                wanted = "one file" if most == 1 else f"1 to {most} files"
                raise problems.invalid(PHOTO_FIELD, f"The form needs {wanted} in this field and nothing else.")
            return [await file.read() for file in files]

    @asynccontextmanager
    async def _form(self, most: int) -> AsyncIterator[FormData]:
        parser = _Form(self.request.headers, self._chunks(self.max_bytes), max_files=most, max_fields=MAX_FIELDS)
        parser.spool_max_size = self.max_bytes + 1  # in memory, never on disk
        try:
            form = await parser.parse()
        except MultiPartException as error:
            raise ProblemError(problems.UNREADABLE_BODY, f"The form cannot be read: {error.message}") from error
        try:
            yield form
        finally:
            await form.close()


class _Form(MultiPartParser):
    """A parser that refuses a form that ends early."""

    ended = False

    def on_end(self) -> None:
        self.ended = True

    async def parse(self) -> FormData:
        form = await super().parse()
        if not self.ended:
            for file in self._files_to_close_on_error:
                file.close()
            raise MultiPartException("It is cut short.")
        return form


def _check(size: int, limit: int) -> None:
    if size > limit:
        raise ProblemError(problems.TOO_LARGE, f"The body is larger than the limit of {limit / 1e6:g} MB.")

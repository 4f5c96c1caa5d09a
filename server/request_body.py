"""The bodies of requests: uploaded photos and JSON lighting records, within limits of size and time."""

import json
from collections.abc import AsyncGenerator, Callable, Coroutine, Iterable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from anyio import CancelScope, current_time, open_file
from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import ValidationError
from pydantic_core import from_json
from starlette.datastructures import FormData, QueryParams, UploadFile
from starlette.formparsers import MultiPartException, MultiPartParser

from lighting.errors import ErrorCode, ParameterError
from lighting.fields import Json, record_path
from lighting.photo.formats import HEAD_BYTES, begins_as_photo
from lighting.record_json import MAX_RECORD_BYTES, reject_duplicate_keys, unwrap_record
from lighting.records import Lighting
from server import problems
from server.limits import PLACE_BYTES, ArrivingBody, client_of_request
from server.problems import FORM_PARAMETERS, FieldError, ProblemError, invalid_error
from server.schemas import LightingRecord

FORM_TYPE = "multipart/form-data"
JSON_TYPE = "application/json"
PHOTO_TYPES = ("image/jpeg", "image/png", "image/webp", "image/heic", "image/heif", "image/tiff", "image/avif")
PHOTO_FIELD, UPLOAD_FIELD = "photo", "file"
FILE_TYPES = ("application/zip", "application/octet-stream")  # of uploads of jobs, beside video/*
BINARY_SCHEMA = {"type": "string", "format": "binary"}
_PARAMETERS_SCHEMA = {"type": "string", "description": "any parameter of the URL, in the form instead"}
_MAX_FIELDS = 64  # of a form: more than any route has parameters
_MAX_FIELD_BYTES = 65_536  # of a parameter in a form
UPLOAD_GRACE = 5.0  # seconds in which a body may be slower than its minimum rate


def describe_body(name: str, schema: Json, file_types: Iterable[str], others: Json | None = None) -> Json:
    """A form with a file and parameters, or the file alone, as the OpenAPI document has a body.

    Args:
        name: of the file's field.
        schema: of that field.
        file_types: media types of a file that is the whole body.
        others: further content, by its media type.
    """
    fields = {"properties": {name: schema}, "additionalProperties": _PARAMETERS_SCHEMA}
    form = {"schema": {"type": "object", "required": [name], **fields}}
    files = {file_type: {"schema": BINARY_SCHEMA} for file_type in file_types}
    return {"requestBody": {"required": True, "content": {FORM_TYPE: form, **files, **(others or {})}}}


def media_type(request: Request) -> str:
    """The media type of a body, in lower case and without parameters; empty if there is none.

    Args:
        request: its headers name the type.
    """
    return request.headers.get("content-type", "").partition(";")[0].strip().lower()


def announced_size(request: Request) -> int:
    """The bytes of a body that its headers announce; 0 if they do not.

    Args:
        request: may have Content-Length.
    """
    length = request.headers.get("content-length", "")
    return int(length) if length.isdecimal() else 0


class _FormRequest(Request):
    """A request whose parameters may stand in its form as well as in its URL."""

    @property
    def query_params(self) -> QueryParams:
        """The parameters of the URL and, once the form has been read, those in it."""
        return QueryParams([*super().query_params.multi_items(), *self.scope.get(FORM_PARAMETERS, ())])


class FormRoute(APIRoute):
    """A route that takes its parameters from URL and form; a dependency reads the form before they are checked."""

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        handle = super().get_route_handler()

        async def handle_form(request: Request) -> Response:
            return await handle(_FormRequest(request.scope, request.receive))

        return handle_form


@dataclass(frozen=True)
class Upload:
    """An uploaded file."""

    data: bytes
    name: str = ""  # on the client's side; empty if unknown


@dataclass
class RequestBody:
    """The body of a request, to be read once."""

    request: Request
    max_bytes: int
    seconds: float  # from its first byte to its last, at most
    rate: int  # bytes per second, at least, after UPLOAD_GRACE
    admit: Callable[[ArrivingBody], AbstractContextManager[None]]
    """Counts the body, of which PLACE_BYTES have come, while it arrives; raises if there are too many."""
    size: int = 0  # bytes that have come
    _deadline: CancelScope = field(default_factory=CancelScope)
    _place: ExitStack = field(default_factory=ExitStack)
    _must_go: bool = False  # whether it gave its place to another

    def _give_way(self) -> None:
        self._must_go = True
        self._deadline.cancel()

    async def photo(self, *also: str) -> bytes:
        """The bytes of one photo.

        Args:
            also: further media types, which the caller reads, for the error's list.

        Raises:
            ProblemError: the body is of another type, too large, too slow or no photo.
        """
        (upload,) = await self.photos(1, *also)
        return upload.data

    async def photos(self, max_photos: int, *also: str) -> list[Upload]:
        """One to `max_photos` photos; otherwise like `photo`."""
        with self._within_limits():
            body_type = media_type(self.request)
            if body_type == FORM_TYPE:
                return await self._read_form(PHOTO_FIELD, max_photos)
            if body_type in PHOTO_TYPES:
                return [Upload(await self._read_all(self.max_bytes))]
            return [Upload(await self._read_photo(", ".join((FORM_TYPE, *PHOTO_TYPES, *also))))]

    async def save(self, path: Path) -> str:
        """Write the file of a form, or the whole body, to a new file; the name that the client gave it, or nothing.

        Args:
            path: of the new file.

        Raises:
            ProblemError: the body is of another type, too large or too slow, or the form has no one file.
        """
        with self._within_limits():
            body_type = media_type(self.request)
            if body_type == FORM_TYPE:
                (upload,) = await self._read_form(UPLOAD_FIELD, 1, path)
                return upload.name
            if body_type not in FILE_TYPES and not body_type.startswith("video/"):
                raise _unsupported_type(", ".join((FORM_TYPE, *FILE_TYPES, "video/*")), UPLOAD_FIELD)
            async with await open_file(path, "xb") as file:
                async for chunk in self._chunks(self.max_bytes):
                    await file.write(chunk)
            return ""

    async def record(self) -> bytes:
        """The bytes of a JSON lighting record; raises ProblemError."""
        with self._within_limits():
            return await self._read_all(min(self.max_bytes, MAX_RECORD_BYTES))

    @contextmanager
    def _within_limits(self) -> Iterator[None]:
        """Refuse a body that comes too slowly, or is compressed and would look like a damaged photo; ProblemError."""
        coding = self.request.headers.get("content-encoding", "").strip().lower()
        if coding not in ("", "identity"):
            raise ProblemError(problems.UNSUPPORTED_TYPE, headers={"Accept-Encoding": "identity"})
        with self._place, self._deadline:
            self._set_deadline(0, current_time())
            yield
            return
        if self._must_go:
            detail = "As many bodies are arriving as the service takes at once, and this one came most slowly."
            raise ProblemError(problems.BUSY, detail, {"Connection": "close"})
        detail = f"The body must arrive within {self.seconds:g} s and at {self.rate} bytes per second."
        raise ProblemError(problems.TOO_SLOW, detail, {"Connection": "close"})

    def _set_deadline(self, size: int, began: float) -> None:
        """After `size` bytes, set the time until which the next ones must come."""
        self._deadline.deadline = began + min(self.seconds, UPLOAD_GRACE + size / self.rate)

    async def _read_all(self, limit: int) -> bytes:
        return b"".join([chunk async for chunk in self._chunks(limit)])

    async def _read_photo(self, listed: str) -> bytes:
        """A body of another type that begins as a photo does; ProblemError for any other, before all of it has come."""
        data = bytearray()
        async for chunk in self._chunks(self.max_bytes):
            data += chunk
            if len(data) >= HEAD_BYTES and not begins_as_photo(bytes(data[:HEAD_BYTES])):
                break
        if not begins_as_photo(bytes(data[:HEAD_BYTES])):
            raise _unsupported_type(listed, PHOTO_FIELD)
        return bytes(data)

    async def _chunks(self, limit: int) -> AsyncGenerator[bytes, None]:
        _check_size(announced_size(self.request), limit)
        body, began = ArrivingBody(client_of_request(self.request), self._give_way), current_time()
        has_place = False
        async for chunk in self.request.stream():
            body.size += len(chunk)
            self.size = body.size
            _check_size(body.size, limit)
            self._set_deadline(body.size, began)
            if body.size >= PLACE_BYTES and not has_place:
                self._place.enter_context(self.admit(body))
                has_place = True
            yield chunk

    async def _read_form(self, name: str, max_files: int, path: Path | None = None) -> list[Upload]:
        """The files in a form's field, or the only one without its bytes, which go to a path."""
        limits = {"max_files": 1 if path else max(max_files, _MAX_FIELDS), "max_fields": _MAX_FIELDS}
        chunks = self._chunks(self.max_bytes)
        parser = _FormParser(self.request.headers, chunks, **limits, max_part_size=_MAX_FIELD_BYTES)
        parser.spool_max_size = self.max_bytes + 1  # in memory, never on disk
        parser.path = path
        try:
            form = await parser.parse()
        except MultiPartException as error:
            if parser.has_too_many_files:
                raise _too_many_files(max_files) from error
            raise ProblemError(problems.UNREADABLE_BODY, f"The form cannot be read: {error.message}") from error
        try:
            self._take_parameters(form, name)
            fields = form.getlist(name)
            files = [value for value in fields if isinstance(value, UploadFile)]
            if not 1 <= len(files) == len(fields):
                number = "one" if path else "a"
                detail = f"The form needs {number} file in this field, as `curl -F {name}=@FILE` sends it."
                raise invalid_error(FieldError(name, "form", detail, ErrorCode.WRONG_TYPE))
            if len(files) > max_files:
                raise _too_many_files(max_files)
            return [Upload(b"" if path else await file.read(), file.filename or "") for file in files]
        finally:
            await form.close()

    def _take_parameters(self, form: FormData, file_field: str) -> None:
        """Keep the form's texts as parameters; ProblemError for other files, and for what is given twice."""
        others = [(name, value) for name, value in form.multi_items() if name != file_field]
        parameters = [(name, value) for name, value in others if isinstance(value, str)]
        if files := {name for name, _ in others} - {name for name, _ in parameters}:
            detail = f"The form takes no such file; it belongs into the field {file_field}."
            raise invalid_error(*(FieldError(name, "form", detail, ErrorCode.UNKNOWN) for name in sorted(files)))
        problems.refuse_repeated([*self.request.query_params, *(name for name, _ in parameters)], "form")
        self.request.scope[FORM_PARAMETERS] = parameters


class _FormParser(MultiPartParser):
    """A parser that refuses a form that ends early, and knows whether one has too many files."""

    ended = False
    path: Path | None = None  # where the file goes; None keeps files in memory

    @property
    def has_too_many_files(self) -> bool:
        return self._current_files > self.max_files

    def on_headers_finished(self) -> None:
        super().on_headers_finished()
        if self.path and (upload := self._current_part.file):
            upload.file.close()
            upload.file = self._files_to_close_on_error[-1] = self.path.open("xb")  # type: ignore[call-overload]

    def on_end(self) -> None:
        self.ended = True

    async def parse(self) -> FormData:
        form = await super().parse()
        if not self.ended:
            for file in self._files_to_close_on_error:
                file.close()
            raise MultiPartException("It is cut short.")
        return form


def _too_many_files(max_photos: int) -> ProblemError:
    limit = "One photo is" if max_photos == 1 else f"At most {max_photos} photos are"
    hint = " POST /v1/lightings takes several." if max_photos == 1 else ""
    detail = f"{limit} taken here, and the form holds more.{hint}"
    return invalid_error(FieldError(PHOTO_FIELD, "form", detail, ErrorCode.OUT_OF_RANGE))


def _check_size(size: int, limit: int) -> None:
    if size > limit:
        raise ProblemError(problems.TOO_LARGE, f"The body is larger than the limit of {limit / 1e6:g} MB.")


def parse_record(data: bytes) -> Lighting:
    """The lighting in a JSON record.

    Args:
        data: the record, bare or as the line that `lighting estimate --json` prints. UTF-8, with or
            without a byte order mark, or UTF-16, as PowerShell redirects that line.

    Raises:
        ProblemError: not JSON, a key twice, an error, an answer about several photos, or fields that
            contradict each other.
        RequestValidationError: wrong fields.
    """
    try:
        text = data.decode(json.detect_encoding(data))
        from_json(text)  # refuses what is nested too deep, and half a surrogate pair
    except ValueError as error:
        raise ProblemError(problems.UNREADABLE_BODY, f"The body is not JSON: {error}.") from error
    try:
        content = unwrap_record(json.loads(text, object_pairs_hook=reject_duplicate_keys))
        return LightingRecord.model_validate(content).to_lighting()
    except ValidationError as error:
        errors = error.errors(include_url=False)
        raise RequestValidationError([{**item, "loc": ("body", *item["loc"])} for item in errors]) from error
    except ParameterError as error:
        renamed = error.renamed(record_path)
        raise invalid_error(FieldError(renamed.field or "body", "body", str(renamed), renamed.code)) from error


def _unsupported_type(listed: str, field: str) -> ProblemError:
    """The error for a body of another type than those that are listed, and how a form is sent."""
    detail = f"The body must be one of: {listed}. `curl -F {field}=@FILE` sends a form."
    return ProblemError(problems.UNSUPPORTED_TYPE, detail, {"Accept": listed})

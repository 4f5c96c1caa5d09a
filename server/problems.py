"""Errors as application/problem+json (RFC 9457): the kinds of problem, and which exception becomes which."""

import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from http import HTTPStatus
from typing import Any, Literal
from urllib.parse import quote

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import Scope

from lighting.errors import ErrorCode, LightingError, ParameterError, PhotoError, PhotoTooLargeError
from lighting.validation import parameter_name
from server.limits import BusyError, TooManyUploadsError

MEDIA_TYPE = "application/problem+json"
RETRY_SECONDS = "1"
MOST_ERRORS = 20  # that an answer names: a body of 64 kB can have 30,000

Place = Literal["query", "form", "body"]  # of a field: the URL, a form's parts, a JSON body

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Kind:
    """A kind of problem; `name` ends its `type`."""

    name: str
    status: int
    title: str

    @property
    def type(self) -> str:
        return f"tag:outdoor-lighting,2026:{self.name}"


UNREADABLE_PHOTO = Kind("unreadable-photo", 400, "The photo cannot be read")
UNREADABLE_BODY = Kind("unreadable-body", 400, "The body cannot be read")
MALFORMED = Kind("malformed-request", 400, "The request is not HTTP/1.1")
UNAUTHORISED = Kind("unauthorised", 401, "An API key is required")
FORBIDDEN = Kind("forbidden", 403, "The API key is wrong")
NOT_FOUND = Kind("not-found", 404, "There is no such route")
METHOD_NOT_ALLOWED = Kind("method-not-allowed", 405, "The method is not allowed here")
TOO_SLOW = Kind("too-slow", 408, "The request did not arrive in time")
REMOVED = Kind("removed", 410, "The route was removed")
TOO_LARGE = Kind("too-large", 413, "The body or the photo is too large")
UNSUPPORTED_TYPE = Kind("unsupported-type", 415, "The body is of a type that is not accepted")
INVALID = Kind("invalid", 422, "A parameter is missing, unknown or out of range")
TOO_MANY_REQUESTS = Kind("too-many-requests", 429, "The rate limit is reached")
TOO_MANY_UPLOADS = Kind("too-many-uploads", 429, "Too many uploads at once from one address")
HEADERS_TOO_LARGE = Kind("headers-too-large", 431, "The headers are too large")
GONE = Kind("client-gone", 499, "The client disconnected")
INTERNAL = Kind("internal", 500, "The service failed")
NOT_READY = Kind("not-ready", 503, "The network is not loaded yet")
BUSY = Kind("busy", 503, "The service is busy")

KINDS = (
    UNREADABLE_PHOTO,
    UNREADABLE_BODY,
    MALFORMED,
    UNAUTHORISED,
    FORBIDDEN,
    NOT_FOUND,
    METHOD_NOT_ALLOWED,
    TOO_SLOW,
    REMOVED,
    TOO_LARGE,
    UNSUPPORTED_TYPE,
    INVALID,
    TOO_MANY_REQUESTS,
    TOO_MANY_UPLOADS,
    HEADERS_TOO_LARGE,
    INTERNAL,
    NOT_READY,
    BUSY,
)
_WORDS = {  # plainer than pydantic's, by its name of the error
    "missing": (ErrorCode.MISSING, "is missing"),
    "extra_forbidden": (ErrorCode.UNKNOWN, "is not known here"),
    "literal_error": (ErrorCode.UNKNOWN, "must be {expected}"),
    "model_type": (ErrorCode.WRONG_TYPE, "must be a JSON object"),
    "dict_type": (ErrorCode.WRONG_TYPE, "must be a JSON object"),
    "list_type": (ErrorCode.WRONG_TYPE, "must be a list"),
    "string_type": (ErrorCode.WRONG_TYPE, "must be a text"),
    "too_short": (ErrorCode.OUT_OF_RANGE, "must have at least {min_length} values"),
    "too_long": (ErrorCode.OUT_OF_RANGE, "must have at most {max_length} values"),
}
_CODES = {  # of the checks of server/field_types.py and its like, by the name of the error
    "range": ErrorCode.OUT_OF_RANGE,
    "even": ErrorCode.OUT_OF_RANGE,
    "pair": ErrorCode.CONTRADICTION,
}
_REMOVED_ROUTES = {  # by path: what to use instead
    "/healthz": "GET /healthz was removed; ask GET /readyz, which answers the same, or GET /livez.",
    "/v1/stereo/plan": "GET /v1/stereo/plan was removed; run the command `lighting stereo plan`, which plans the same.",
}
_OF_STATUS = {kind.status: kind for kind in (NOT_FOUND, METHOD_NOT_ALLOWED)}


@dataclass(frozen=True)
class InvalidField:
    """What is wrong with one field, and for a number its range."""

    field: str
    place: Place
    detail: str
    code: str = ErrorCode.CONTRADICTION
    minimum: float | None = None
    maximum: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """The JSON, without a range where there is none."""
        return {name: value for name, value in vars(self).items() if value is not None}


class ProblemError(Exception):
    """Ends a request with a problem; `more` adds members to its body."""

    def __init__(self, kind: Kind, detail: str, headers: Mapping[str, str] | None = None, **more: Any) -> None:
        super().__init__(detail)
        self.kind, self.detail, self.headers, self.more = kind, detail, headers, more


def invalid(field: str, detail: str, place: Place = "query", code: ErrorCode = ErrorCode.CONTRADICTION) -> ProblemError:
    """A 422 about one field."""
    return all_invalid([InvalidField(field, place, detail, code)])


def all_invalid(errors: list[InvalidField]) -> ProblemError:
    """A 422 about several fields, each with its place and what is wrong with it; of very many the first."""
    named, others = errors[:MOST_ERRORS], len(errors) - MOST_ERRORS
    detail = "; ".join(f"{found.field}: {found.detail}" for found in named)
    listed = [found.to_dict() for found in named]
    return ProblemError(INVALID, detail + (f"; and {others} more" if others > 0 else ""), errors=listed)


def _response(request: Request, error: ProblemError) -> Response:
    """The answer with a problem, whose name the scope then holds for the log."""
    request.scope["problem"] = error.kind.name
    body = _body(error.kind, error.detail, quote(request.scope["path"]), request.scope.get("request_id", ""))
    return Response(_json({**body, **error.more}), error.kind.status, error.headers, MEDIA_TYPE)


def plain(kind: Kind, detail: str) -> bytes:
    """The JSON of a problem with a request that never became one."""
    return _json(_body(kind, detail, "", ""))


def _json(content: dict[str, Any]) -> bytes:
    """As UTF-8; half of a surrogate pair, which names in a form of a strange charset hold, becomes an escape."""
    return json.dumps(content, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "backslashreplace")


def _body(kind: Kind, detail: str, instance: str, request_id: str) -> dict[str, Any]:
    return {
        "type": kind.type,
        "title": kind.title,
        "status": kind.status,
        "detail": detail,
        "instance": instance,
        "request_id": request_id,
    }


def _problem_of(error: Exception) -> ProblemError:
    """The problem for an exception; an unexpected one becomes a 500 without internal details."""
    match error:
        case ProblemError():
            return error
        case RequestValidationError():
            return _invalid_request(error)
        case HTTPException():
            return _of_http_exception(error)
        case PhotoTooLargeError():
            return ProblemError(TOO_LARGE, str(error))
        case PhotoError():
            return ProblemError(UNREADABLE_PHOTO, str(error))
        case ParameterError():
            return _contradiction(error)
        case BusyError():
            return ProblemError(BUSY, str(error), {"Retry-After": RETRY_SECONDS})
        case TooManyUploadsError():
            detail = "Too many bodies are arriving from this address; send them one after another."
            return ProblemError(TOO_MANY_UPLOADS, detail, {"Retry-After": RETRY_SECONDS})
        case ClientDisconnect():
            return ProblemError(GONE, "The client disconnected.")
        case _:
            return ProblemError(INTERNAL, "An unexpected error occurred in the service.")


def _contradiction(error: ParameterError) -> ProblemError:
    """Parameters that are each right and do not fit each other or the photo."""
    named = error.renamed(parameter_name)
    if named.field is None:
        return ProblemError(INVALID, str(named))
    found = InvalidField(named.field, "query", str(named), named.code)
    return ProblemError(INVALID, str(named), errors=[found.to_dict()])


def _of_http_exception(error: HTTPException) -> ProblemError:
    phrase = HTTPStatus(error.status_code).phrase
    kind = _OF_STATUS.get(error.status_code) or Kind(phrase.lower().replace(" ", "-"), error.status_code, phrase)
    return ProblemError(kind, f"{kind.title}.", error.headers)


def _invalid_request(error: RequestValidationError) -> ProblemError:
    return all_invalid([_field_error(found) for found in error.errors()])


def _field_error(found: Mapping[str, Any]) -> InvalidField:
    """What pydantic found in one field.

    A check of several fields together names the one at fault as `field` of its context; our checks have a `code` there.
    """
    context = found.get("ctx", {})
    own = context.get("code") or _CODES.get(found["type"], ErrorCode.WRONG_TYPE)
    code, words = _WORDS.get(found["type"], (own, None))
    return InvalidField(
        field=context.get("field") or ".".join(str(part) for part in found["loc"][1:]) or str(found["loc"][0]),
        place=found["loc"][0],
        detail=found["msg"] if words is None else words.format(**context),
        code=code,
        minimum=context.get("minimum"),
        maximum=context.get("maximum"),
    )


def route_path(scope: Scope) -> str:
    """The path of a request without what a proxy takes away."""
    return str(scope["path"].removeprefix(scope.get("root_path", "")))


async def answer(request: Request, error: Exception) -> Response:
    """The answer to a request that ended with an error; unexpected errors are logged."""
    problem = _problem_of(error)
    if problem.kind is NOT_FOUND and (instead := _REMOVED_ROUTES.get(route_path(request.scope))):
        problem = ProblemError(REMOVED, instead)
    if problem.kind is METHOD_NOT_ALLOWED:
        problem.headers = _allowed(request, (problem.headers or {}).get("Allow", ""))
    if problem.kind is INTERNAL:
        log.error("request %s failed", request.scope.get("request_id"), exc_info=error)
    return _response(request, problem)


def _allowed(request: Request, told: str) -> dict[str, str]:
    """All methods of a path; the router tells only those of its first route, which do for the page, and never HEAD."""
    path = getattr(request.scope.get("route"), "path", "")
    methods = {method.upper() for method in request.app.openapi()["paths"].get(path, ())}
    methods = methods or set(told.replace(",", " ").split())
    also = {"HEAD"} if "GET" in methods else set()
    return {"Allow": ", ".join(sorted(methods | also))} if methods else {}


def documented(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """These statuses for the OpenAPI document of a route."""
    return {status: _documented([kind for kind in KINDS if kind.status == status]) for status in statuses}


def _documented(kinds: list[Kind]) -> dict[str, Any]:
    examples = {kind.name: {"value": _body(kind, f"{kind.title}.", "/v1", "4d1c0a6f5e2b7398")} for kind in kinds}
    content = {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": examples}
    return {"description": "; ".join(kind.title for kind in kinds), "content": {MEDIA_TYPE: content}}


def install(app: FastAPI) -> None:
    """Register the handler that answers errors with problems."""
    own = (ProblemError, LightingError, BusyError, TooManyUploadsError)
    for expected in (*own, HTTPException, RequestValidationError, ClientDisconnect):
        app.add_exception_handler(expected, answer)

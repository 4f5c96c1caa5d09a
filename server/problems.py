"""Errors as application/problem+json (RFC 9457): the kinds of problem, and which exception becomes which."""

import json
import logging
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from http import HTTPStatus
from typing import Annotated, Any, Literal
from urllib.parse import quote

from fastapi import Request, Response
from fastapi.exceptions import RequestValidationError
from pydantic import Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.types import Scope

from lighting.errors import FOREIGN_NAMES, ErrorCode, LightingError, ParameterError, PhotoError, PhotoTooLargeError
from lighting.fields import Json, parameter_name

MEDIA_TYPE = "application/problem+json"
_RETRY_SECONDS = "1"
MAX_ERRORS = 20  # that a response names: a body of 64 kB can have 30,000

FieldPlace = Literal["query", "form", "body"]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class ProblemKind:
    """A kind of problem; `name` ends its `type`."""

    name: str
    status: int
    title: str
    example: str = ""  # of a detail, which is that unless another is told
    meaning: str = ""  # when it is answered
    passes: bool = False  # whether clients are to try again after _RETRY_SECONDS

    @property
    def type(self) -> str:
        """The URI of this kind of problem."""
        return f"tag:outdoor-lighting,2026:{self.name}"


UNREADABLE_PHOTO = ProblemKind(
    "unreadable-photo",
    400,
    "The photo cannot be read",
    "The file is cut short or damaged.",
    "Not a photo, damaged, cut short, smaller than 32 pixels, or one side over 8 times the other.",
)
UNREADABLE_BODY = ProblemKind(
    "unreadable-body",
    400,
    "The body cannot be read",
    "The form cannot be read: It is cut short.",
    "Not JSON, an incomplete form, or more than 4,096 chunks of fewer than 64 bytes in the mean. "
    "For such chunks the connection is closed.",
)
MALFORMED = ProblemKind(
    "malformed-request",
    400,
    "The request is not HTTP/1.1",
    "Two headers say where the body ends.",
    "Not HTTP/1.1, or two headers say where the body ends. The connection is closed.",
)
UNAUTHORIZED = ProblemKind(
    "unauthorised",
    401,
    "An API key is required",
    "Send one of the service's API keys: Authorization: Bearer KEY.",
    "The service asks for an API key and got none.",
)
FORBIDDEN = ProblemKind(
    "forbidden",
    403,
    "The API key is wrong",
    "The service does not know this API key; ask its operator for one.",
    "The service does not know the API key.",
)
FOREIGN_ORIGIN = ProblemKind(
    "foreign-origin",
    403,
    "A web page of another origin is refused",
    "Web pages of other origins are refused; the operator can add this one to LIGHTING_CORS_ORIGINS.",
    "A web page of an origin outside `LIGHTING_CORS_ORIGINS` sends a form, "
    "or asks this machine's service for a picture.",
)
NOT_FOUND = ProblemKind(
    "not-found",
    404,
    "There is no such route",
    "There is no such route. Did you mean /v1/lighting? GET /docs lists all.",
    "No such path; `detail` names a similar one.",
)
METHOD_NOT_ALLOWED = ProblemKind(
    "method-not-allowed",
    405,
    "The method is not allowed here",
    "GET is not allowed here; allowed is POST.",
    "`Allow` names the methods of this path.",
)
UNKNOWN_JOB = ProblemKind(
    "unknown-job",
    404,
    "There is no such job",
    "This service has no such job; results are kept for a day.",
    "No such job, or it was deleted or is older than a day.",
)
NO_RESULT = ProblemKind(
    "no-result",
    409,
    "The job has no result",
    "The job is running; ask again.",
    "The job is not finished, or has failed; `detail` says which.",
)
TOO_SLOW = ProblemKind(
    "too-slow",
    408,
    "The request did not arrive in time",
    "The body must arrive within 60 s and at 10000 bytes per second.",
    "The body exceeded `LIGHTING_UPLOAD_SECONDS` or came slower than `LIGHTING_UPLOAD_RATE`. "
    "Or the headers exceeded `LIGHTING_HEADER_SECONDS`.",
)
REMOVED = ProblemKind(
    "removed",
    410,
    "The route was removed",
    "GET /healthz was removed; ask GET /readyz, which answers the same, or GET /livez.",
    "`detail` says what to use instead.",
)
TOO_LARGE = ProblemKind(
    "too-large",
    413,
    "The body or the photo is too large",
    "The body is larger than the limit of 64 MB.",
    "More bytes or pixels than the limits, or decoding needs more time or memory than it may.",
)
UNSUPPORTED_TYPE = ProblemKind(
    "unsupported-type",
    415,
    "The body is of a type that is not accepted",
    "The body has a Content-Encoding; send it as it is, without one.",
    "The body does not begin as a photo does, and its type is none that `Accept` names. "
    "A body with a `Content-Encoding` is none.",
)
BAD_RANGE = ProblemKind(
    "bad-range",
    416,
    "The file has no such range",
    "The Range header names no bytes of this file.",
    "`Range` cannot be read, or lies outside of the file; `Content-Range` says how long the file is.",
)
WRONG_HOST = ProblemKind(
    "wrong-host",
    421,
    "The service has another name",
    "This is not the service's name; its operator can add it to LIGHTING_HOSTS.",
    "The request names a host that is not in `LIGHTING_HOSTS`. "
    "Without that setting, on a loopback address, any name with a dot is one.",
)
INVALID = ProblemKind(
    "invalid",
    422,
    "A parameter is missing, unknown or out of range",
    "height: must be a number from 16 to 2048",
    "`errors` lists up to 20 fields, each with its `place` (`query`, `form` or `body`), range and `code`. "
    "Codes stay; sentences may change. A parameter or a key of JSON given twice is invalid, too.",
)
TOO_MANY_REQUESTS = ProblemKind(
    "too-many-requests",
    429,
    "The rate limit is reached",
    "The rate limit is reached; wait 12 s.",
    "`Retry-After` says how long to wait.",
)
TOO_MANY_UPLOADS = ProblemKind(
    "too-many-uploads",
    429,
    "Too many uploads at once from one client",
    "Too many bodies are arriving from this client; send them one after another.",
    "`LIGHTING_UPLOADS_PER_CLIENT` bodies are arriving from this client. Try again after `Retry-After` seconds.",
    passes=True,
)
SHARE_TAKEN = ProblemKind(
    "share-taken",
    429,
    "One client has its share of the service",
    "The queue is full, and this client has its share of it.",
    "This client has its share of the queue or of the answers that wait. Try again after `Retry-After` seconds.",
    passes=True,
)
HEADERS_TOO_LARGE = ProblemKind(
    "headers-too-large",
    431,
    "The headers are too large",
    "The request line and the headers may have 16384 bytes.",
    "Request line and headers exceed 16 KiB; the connection is closed.",
)
CLIENT_GONE = ProblemKind("client-gone", 499, "The client disconnected")
INTERNAL = ProblemKind(
    "internal",
    500,
    "The service failed",
    "An unexpected error occurred in the service.",
    "The details are in the log, under the `request_id`.",
)
NOT_READY = ProblemKind(
    "not-ready",
    503,
    "The network is not loaded yet",
    "The network is not loaded yet.",
    "The network is loading; try again after `Retry-After` seconds.",
    passes=True,
)
BUSY = ProblemKind(
    "busy",
    503,
    "The service is busy",
    "All workers are busy and the queue is full.",
    "The queue is full, this upload was the slowest of `LIGHTING_UPLOADS`, or the service shuts down. "
    "Try again after `Retry-After` seconds.",
    passes=True,
)

KINDS = tuple(kind for kind in list(globals().values()) if isinstance(kind, ProblemKind) and kind.meaning)
_DETAIL_BY_TYPE = {  # plainer than pydantic's, by pydantic's type of error
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
_REMOVED_ROUTES = {  # by path, or its beginning: what to use instead
    "/healthz": "GET /healthz was removed; ask GET /readyz, which answers the same, or GET /livez.",
    "/v1/stereo/plan": "GET /v1/stereo/plan was removed; run the command `lighting stereo plan`, which plans the same.",
    "/v2": "The routes of the Open Inference Protocol were removed; send the photo to POST /v1/lighting.",
}
_FOREIGN_ROUTES = {  # by the last part of a path, what does its work here
    **dict.fromkeys(("estimate", "predict", "analyze", "upload", "photo", "sun", "light"), "POST /v1/lighting"),
    **dict.fromkeys(("estimates", "batch"), "POST /v1/lightings"),
    **dict.fromkeys(("hdri", "hdr", "exr", "map", "sky", "render", "generate"), "POST /v1/envmap"),
    **dict.fromkeys(("video", "clip"), "POST /v1/jobs"),
    **dict.fromkeys(("health", "healthcheck", "live", "liveness", "ping", "status"), "GET /livez"),
    **dict.fromkeys(("ready", "readiness"), "GET /readyz"),
}
_UNLISTED_ROUTES = ("/", "/docs", "/openapi.json")  # that the OpenAPI document leaves out
_MIN_SIMILAR_LENGTH, _MAX_SIMILAR_LENGTH = 3, 64  # letters of a name for which a similar one is sought
FORM_PARAMETERS = "form_parameters"  # where a scope holds the names and values of parameters in a form


@dataclass(frozen=True)
class FieldError:  # without a docstring, which newer versions of pydantic put into the OpenAPI document
    field: str
    place: Annotated[FieldPlace, Field(description="where the field is: in the URL, the form or the body")]
    detail: str
    code: Annotated[
        str,
        Field(
            description="what is wrong, for programs: stable, unlike the sentence",
            json_schema_extra={"enum": [code.value for code in ErrorCode]},
        ),
    ]
    minimum: float | None = None
    maximum: float | None = None

    def to_dict(self) -> Json:
        """The JSON, without a range if the field has none."""
        return {name: value for name, value in vars(self).items() if value is not None}


_EXAMPLE_FIELD = FieldError(
    "height", "query", "must be a number from 16 to 2048", ErrorCode.OUT_OF_RANGE.value, minimum=16, maximum=2048
)


class ProblemError(Exception):
    """Ends a request with a problem, by its example unless a detail is told, and with the fields at fault."""

    def __init__(
        self,
        kind: ProblemKind,
        detail: str = "",
        headers: Mapping[str, str] | None = None,
        errors: Iterable[FieldError] = (),
    ) -> None:
        self.kind, self.detail, self.errors = kind, detail or kind.example, [error.to_dict() for error in errors]
        super().__init__(self.detail)
        self.headers = ({"Retry-After": _RETRY_SECONDS} if kind.passes else {}) | dict(headers or {})


EXPECTED_ERRORS = (ProblemError, LightingError, HTTPException, RequestValidationError, ClientDisconnect)


def invalid_error(*errors: FieldError) -> ProblemError:
    """A 422.

    Args:
        errors: one a field; the first MAX_ERRORS are named.
    """
    listed, others = errors[:MAX_ERRORS], len(errors) - MAX_ERRORS
    detail = "; ".join(f"{error.field}: {error.detail}" for error in listed)
    more = f"; and {others} more" if others > 0 else ""
    return ProblemError(INVALID, detail + more, errors=listed)


def refuse_repeated(names: Iterable[str], place: FieldPlace) -> None:
    """Raise ProblemError for names that are given more than once.

    Args:
        names: of parameters.
        place: where they are.
    """
    detail = "is given more than once"
    if repeated := [name for name, count in Counter(names).items() if count > 1]:
        raise invalid_error(*(FieldError(name, place, detail, ErrorCode.DUPLICATE) for name in repeated))


def problem_json(
    kind: ProblemKind, detail: str, request_id: str, instance: str = "", errors: Sequence[Json] = ()
) -> bytes:
    """The JSON of a problem; a lone surrogate, which a form of another charset can contain, becomes an escape.

    Args:
        kind: the kind of problem.
        detail: a sentence for people.
        request_id: of the header X-Request-ID.
        instance: the path of the request; empty for one that could not be parsed.
        errors: the fields at fault.
    """
    body = _body(kind, detail, request_id, instance, errors)
    return json.dumps(body, ensure_ascii=False, separators=(",", ":")).encode("utf-8", "backslashreplace")


def _body(kind: ProblemKind, detail: str, request_id: str, instance: str, errors: Sequence[Json]) -> Json:
    told = {"type": kind.type, "title": kind.title, "status": kind.status, "detail": detail}
    return {**told, "instance": instance, "request_id": request_id} | ({"errors": errors} if errors else {})


def _problem_of(request: Request, error: Exception) -> ProblemError:
    """The problem for an exception; an unexpected one becomes a 500 without internal details."""
    match error:
        case ProblemError():
            return error
        case RequestValidationError():
            schemas = _parameter_schemas(request)
            return invalid_error(*(_field_error(details, schemas) for details in error.errors()))
        case HTTPException():
            return _problem_of_http_exception(request, error)
        case PhotoTooLargeError():
            return ProblemError(TOO_LARGE, str(error))
        case PhotoError():
            return ProblemError(UNREADABLE_PHOTO, str(error))
        case ParameterError():  # parameters that are each right and do not fit each other or the photo
            told = error.renamed(parameter_name)
            wrong = [] if told.field is None else [FieldError(told.field, "query", str(told), told.code)]
            return ProblemError(INVALID, str(told), errors=wrong)
        case ClientDisconnect():
            return ProblemError(CLIENT_GONE, "The client disconnected.")
        case _:
            return ProblemError(INTERNAL)


def _problem_of_http_exception(request: Request, error: HTTPException) -> ProblemError:
    match error.status_code:
        case NOT_FOUND.status:
            path = f"{route_path(request.scope)}/"
            removed = (instead for route, instead in _REMOVED_ROUTES.items() if path.startswith(f"{route}/"))
            if instead := next(removed, ""):
                return ProblemError(REMOVED, instead)
            return ProblemError(NOT_FOUND, f"{NOT_FOUND.title}.{_route_hint(request)}")
        case METHOD_NOT_ALLOWED.status:
            allowed = _allowed_methods(request, (error.headers or {}).get("Allow", ""))
            detail = f"{request.method[:16]} is not allowed here; allowed is {allowed}."
            return ProblemError(METHOD_NOT_ALLOWED, detail, {"Allow": allowed})
        case status:
            phrase = HTTPStatus(status).phrase
            kind = ProblemKind(phrase.lower().replace(" ", "-"), status, phrase)
            return ProblemError(kind, f"{phrase}.", error.headers)


def _route_hint(request: Request) -> str:
    """What a client may have meant by a path that is no route."""
    path = route_path(request.scope)
    near = _FOREIGN_ROUTES.get(path.rstrip("/").rpartition("/")[2].lower())
    near = near or _find_similar(path, [*request.app.openapi()["paths"], *_UNLISTED_ROUTES])
    return (f" Did you mean {near}?" if near else "") + " GET /docs lists all."


def _parameter_schemas(request: Request) -> Mapping[str, Json]:
    """The schemas of the parameters that a request's route takes, by name."""
    path = getattr(request.scope.get("route"), "path", "")
    operation = request.app.openapi()["paths"].get(path, {}).get(request.method.lower(), {})
    return {parameter["name"]: parameter["schema"] for parameter in operation.get("parameters", ())}


def _find_similar(name: str, known: Iterable[str]) -> str:
    """The name that somebody probably meant; empty where none is like it."""
    if not _MIN_SIMILAR_LENGTH <= len(name) <= _MAX_SIMILAR_LENGTH:
        return ""
    names = [other for other in known if len(other) >= _MIN_SIMILAR_LENGTH]
    shortened = [other for other in names if name.startswith(other) or other.startswith(name)]
    return next(iter(get_close_matches(name, names, n=1) or shortened), "")


def _field_error(details: Mapping[str, Any], schemas: Mapping[str, Json]) -> FieldError:
    """One of pydantic's errors, in plainer words.

    A check of several fields names the one at fault as `field` of its context; our checks have a `code` there.
    """
    context = details.get("ctx", {})
    code, template = _DETAIL_BY_TYPE.get(details["type"], (context.get("code", ErrorCode.WRONG_TYPE), None))
    location, *path = details["loc"]
    field = context.get("field") or ".".join(map(str, path)) or str(location)
    hint = _parameter_hint(field, details, schemas) if location == "query" else ""
    return FieldError(
        field=field,
        place=location,
        detail=(details["msg"] if template is None else template.format(**context)) + hint,
        code=code,
        minimum=context.get("minimum"),
        maximum=context.get("maximum"),
    )


def _parameter_hint(name: str, details: Mapping[str, Any], schemas: Mapping[str, Json]) -> str:
    """What a client may have meant by a parameter that is not known, or by its value, or the values of one it lacks."""
    values = schemas.get(name, {}).get("enum", ())
    near = ""
    match details["type"]:
        case "extra_forbidden":
            meant = FOREIGN_NAMES.get(name, "")
            near = meant if meant in schemas else _find_similar(name, schemas)
        case "literal_error":
            near = _find_similar(str(details["input"]), values)
        case "missing" if values:
            return f"; it is one of {', '.join(values)}"
    return f"; did you mean {near}?" if near else ""


def route_path(scope: Scope) -> str:
    """The path of a request without the prefix that a proxy removes.

    Args:
        scope: ASGI's scope of an HTTP request.
    """
    return str(scope["path"].removeprefix(scope.get("root_path", "")))


async def problem_response(request: Request, error: Exception) -> Response:
    """The response to a request that ended with an error; unexpected errors are logged.

    Args:
        request: the request.
        error: any exception; what is not expected becomes a 500 without details.
    """
    problem = _problem_of(request, error)
    _locate_form_parameters(request, problem)
    if problem.kind is INTERNAL:
        log.error("request %s failed", request.scope.get("request_id"), exc_info=error)
    request.scope["problem"] = problem.kind.name  # for the log
    told = request.scope.get("request_id", ""), quote(request.scope["path"]), problem.errors
    body = problem_json(problem.kind, problem.detail, *told)
    return Response(body, problem.kind.status, problem.headers, MEDIA_TYPE)


def _locate_form_parameters(request: Request, problem: ProblemError) -> None:
    """Name the form, not the URL, as the location of a parameter that stood in it."""
    if not request.scope.get(FORM_PARAMETERS):
        return
    in_url = Request(request.scope).query_params  # an old name in the form is told as the new one
    for item in problem.errors:
        if item["place"] == "query" and item["field"] not in in_url:
            item["place"] = "form"


def _allowed_methods(request: Request, allow: str) -> str:
    """All methods of a path; the router's own header lists those of its first route alone, and never HEAD."""
    path = getattr(request.scope.get("route"), "path", "")
    methods = {method.upper() for method in request.app.openapi()["paths"].get(path, ())}
    methods = methods or set(allow.replace(",", " ").split())
    return ", ".join(sorted(methods | ({"HEAD"} if "GET" in methods else set())))


def problem_responses(*statuses: int) -> dict[int | str, Json]:
    """The documentation of a route's problems, for OpenAPI.

    Args:
        statuses: HTTP statuses of 400 and above.
    """
    responses: dict[int | str, Json] = {}
    for status in statuses:
        kinds = [kind for kind in KINDS if kind.status == status]
        examples = {kind.name: {"value": problem_example(kind)} for kind in kinds}
        content = {"schema": {"$ref": "#/components/schemas/Problem"}, "examples": examples}
        responses[status] = {"description": "; ".join(kind.title for kind in kinds), "content": {MEDIA_TYPE: content}}
    return responses


def problem_example(kind: ProblemKind) -> Json:
    """The body of a problem, as documentation shows it.

    Args:
        kind: the kind of problem.
    """
    errors = [_EXAMPLE_FIELD.to_dict()] if kind is INVALID else []
    return _body(kind, kind.example, "4d1c0a6f5e2b7398", "/v1/lighting", errors)

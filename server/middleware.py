"""Middleware (request id, access log, metrics, HEAD, errors, rest of a body), and the routes for operators."""

import asyncio
import logging
import re
import secrets
import time

from anyio import move_on_after
from fastapi import Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server import problems
from server.dependencies import Service
from server.limits import BusyError
from server.problems import route_path

_UNMEASURED_ROUTES = ("/livez", "/readyz", "/metrics", "/v2/health/live", "/v2/health/ready")
_SHUTDOWN_DETAIL = "The service shut down before this request was finished; send it again."
_UNMATCHED_ROUTE = "unmatched"  # label of requests that match no route
_LABELED_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")  # others are counted as one
SLICE_BYTES = 262_144  # of a body that are sent at once
DRAIN_SECONDS = 5.0  # for the rest of a body, as long as a connection that stays open is kept
_REQUEST_ID = re.compile(r"[\w.\-]{1,64}", re.ASCII)

access_log = logging.getLogger("server.access")


class _Middleware:
    """What lies around an ASGI app."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app


class AccessLogMiddleware(_Middleware):
    """Gives each request an id, counts and logs it.

    The log holds its route and the name of its problem, never its query, body or file names.
    """

    def __init__(self, app: ASGIApp, service: Service) -> None:
        super().__init__(app)
        self.service = service

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            return await self.app(scope, receive, send)
        start = time.perf_counter()
        request_id = scope["request_id"] = _request_id(Headers(scope=scope))
        scope["lighting_client"] = self.service.identify_client(scope)
        status = 0

        async def send_named(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers["X-Request-ID"] = request_id
                if self.service.model_name:
                    headers["Lighting-Model"] = self.service.model_name
                if self.service.ending:
                    headers["Connection"] = "close"
            await send(message)

        try:
            await self.app(scope, receive, send_named)
        finally:
            self._count(scope, status, time.perf_counter() - start)

    def _count(self, scope: Scope, status: int, seconds: float) -> None:
        route = _route_template(scope)
        if route in _UNMEASURED_ROUTES:
            return
        method = scope["method"] if scope["method"] in _LABELED_METHODS else "other"
        if refused := scope.get("refused"):  # by the connection, in the middle of the request
            status, scope["problem"] = refused.status, refused.name
        label = "any" if route == _UNMATCHED_ROUTE else method
        self.service.metrics.requests.labels(label, route, status).inc()
        self.service.metrics.latency.labels(route).observe(seconds)
        outcome = f"{status} {scope['problem']}" if scope.get("problem") else status
        access_log.info("%s %s %s %.0f ms id=%s", method, route, outcome, 1000 * seconds, scope["request_id"])


def is_unmeasured(scope: Scope) -> bool:
    """Whether a request is an operator's question, which is neither counted, logged nor traced.

    Args:
        scope: ASGI's scope of an HTTP request.
    """
    return route_path(scope) in _UNMEASURED_ROUTES


def _route_template(scope: Scope) -> str:
    """The template of a request's path; FastAPI's own route of the OpenAPI document names none, but an endpoint."""
    return str(getattr(scope.get("route"), "path", route_path(scope) if scope.get("endpoint") else _UNMATCHED_ROUTE))


def _request_id(headers: Headers) -> str:
    """The client's id if it is short and plain, else a new one."""
    client_id = headers.get("x-request-id", "")
    return client_id if _REQUEST_ID.fullmatch(client_id) else secrets.token_hex(8)


class ExceptionMiddleware(_Middleware):
    """Answers 500 without internal details for errors that nothing else handled, and logs them.

    A request that outlasts the time of a shutdown is answered 503.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        started = False

        async def send_noting_start(message: Message) -> None:
            nonlocal started
            started = started or message["type"] == "http.response.start"
            await send(message)

        try:
            await self.app(scope, receive, send_noting_start)
        except (Exception, asyncio.CancelledError) as error:
            if scope["type"] != "http" or started:
                raise
            problem = BusyError(_SHUTDOWN_DETAIL) if isinstance(error, asyncio.CancelledError) else error
            response = await problems.problem_response(Request(scope), problem)
            await response(scope, receive, send)


class HeadAsGetMiddleware(_Middleware):
    """Answers HEAD like GET, without the body."""

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_without_body(message: Message) -> None:
            await send({**message, "body": b""} if message["type"] == "http.response.body" else message)

        if scope["type"] != "http" or scope["method"] != "HEAD":
            return await self.app(scope, receive, send)
        inner = {**scope, "method": "GET"}
        try:
            await self.app(inner, receive, send_without_body)
        finally:
            scope.update({name: inner.get(name) for name in ("route", "endpoint", "problem")})


class DrainBodyMiddleware(_Middleware):
    """Reads and drops the rest of a body before a connection closes that the client wants closed after the answer.

    A connection that is closed with bytes unread takes its answer with it; one that stays open is read on anyway.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and _closes_connection(scope):
            await self._drain(scope, receive, send)
        else:
            await self.app(scope, receive, send)

    async def _drain(self, scope: Scope, receive: Receive, send: Send) -> None:
        unread = True

        async def receive_noting_end() -> Message:
            nonlocal unread
            message = await receive()
            unread = message.get("more_body", False)
            return message

        async def send_after_draining(message: Message) -> None:
            last = message["type"] == "http.response.body" and not message.get("more_body")
            if last and unread:
                await send({**message, "more_body": True})
                with move_on_after(DRAIN_SECONDS):
                    while unread:
                        await receive_noting_end()
                message = {"type": "http.response.body"}
            await send(message)

        await self.app(scope, receive_noting_end, send_after_draining)


class SliceMiddleware(_Middleware):
    """Sends large bodies in slices, each when the one before has been taken, so that other connections have their turn.

    The bytes of a body that are not yet sent stand in the scope, where the connection counts them.
    """

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_in_slices(message: Message) -> None:
            body = message.get("body", b"")
            for start in range(0, len(body) - SLICE_BYTES, SLICE_BYTES):
                scope["unsent_rest"] = len(body) - start - SLICE_BYTES
                await send({**message, "body": memoryview(body)[start : start + SLICE_BYTES], "more_body": True})
                await asyncio.sleep(0)  # sending waits only for a slow client, and a lost connection is noticed here
            if scope.pop("unsent_rest", 0):
                message = {**message, "body": memoryview(body)[-(len(body) % SLICE_BYTES or SLICE_BYTES) :]}
            await send(message)

        try:
            await self.app(scope, receive, send_in_slices)
        except asyncio.CancelledError:  # by a shutdown that waited long enough for a client
            if not scope.get("unsent_rest"):
                raise


def _closes_connection(scope: Scope) -> bool:
    """Whether the client wants its connection closed, and sends its body unasked."""
    headers = Headers(scope=scope)
    closes = scope["http_version"] == "1.0" or "close" in headers.get("connection", "").lower()
    return closes and "expect" not in headers

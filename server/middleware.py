"""Middleware: what browsers are told and refused, request id, access log, metrics, HEAD, errors, rest of a body."""

import asyncio
import logging
import re
import secrets
import time
from abc import ABC, abstractmethod
from urllib.parse import urlsplit

from anyio import move_on_after
from fastapi import FastAPI, Request
from starlette.datastructures import Headers, MutableHeaders
from starlette.middleware.cors import CORSMiddleware
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server import problems
from server.dependencies import Service
from server.problems import ProblemError, route_path
from server.responses import WARNINGS_HEADER
from server.settings import Settings, parse_address

_EXPOSED_HEADERS = ("ETag", "Location", "Retry-After", "X-Request-ID", "Lighting-Model", WARNINGS_HEADER)
_NO_FRAMES = "frame-ancestors 'none'"

_CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' blob: data:; worker-src 'self' blob:; font-src 'self'; manifest-src 'self'; "
    f"base-uri 'none'; form-action 'none'; {_NO_FRAMES}"
)

SECURITY_HEADERS = {
    "Content-Security-Policy": _CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}

_UNMEASURED_ROUTES = ("/livez", "/readyz", "/metrics")
_SHUTDOWN_DETAIL = "The service shut down before this request was finished; send it again."
_UNMATCHED_ROUTE = "unmatched"  # label of requests that match no route
_LABELED_METHODS = ("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS", "TRACE")  # others are counted as one
SLICE_BYTES = 262_144  # of a body that are sent at once
DRAIN_SECONDS = 5.0  # for the rest of a body, as long as a connection that stays open is kept
_REQUEST_ID = re.compile(r"[\w.\-]{1,64}", re.ASCII)

access_log = logging.getLogger("server.access")


def add_middleware(app: FastAPI, service: Service) -> None:
    """Wrap an app in its middleware, from the inside out.

    Args:
        app: with its routes.
        service: its settings, clients and metrics.
    """
    app.add_middleware(_ExceptionMiddleware)
    app.add_middleware(_HeadAsGetMiddleware)
    if service.settings.cors_origins:
        app.add_middleware(
            CORSMiddleware,
            allow_origins=service.settings.cors_origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "If-None-Match", "X-Request-ID"],
            expose_headers=_EXPOSED_HEADERS,
        )
    app.add_middleware(_BrowserGuardMiddleware, settings=service.settings)
    app.add_middleware(_AccessLogMiddleware, service=service)
    app.add_middleware(DrainBodyMiddleware)
    app.add_middleware(SliceMiddleware)


class _Middleware(ABC):
    """What lies around an ASGI app where it handles requests."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        handle = self._handle if scope["type"] == "http" else self.app
        await handle(scope, receive, send)

    @abstractmethod
    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None: ...


class _AccessLogMiddleware(_Middleware):
    """Gives each request an id and its answer the headers of all answers, counts and logs it.

    The log holds its route and the name of its problem, never its query, body or file names.

    Args:
        app: the ASGI app inside.
        service: its network, metrics, and the origins whose pages may show an answer in a frame.
    """

    def __init__(self, app: ASGIApp, service: Service) -> None:
        super().__init__(app)
        self.service = service
        self._headers = dict(SECURITY_HEADERS)
        if origins := service.settings.frame_origins:
            del self._headers["X-Frame-Options"]  # which can name no origin
            policy = _CONTENT_SECURITY_POLICY.replace(_NO_FRAMES, f"frame-ancestors {' '.join(origins)}")
            self._headers["Content-Security-Policy"] = policy

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        start = time.perf_counter()
        request_id = scope["request_id"] = _request_id(Headers(scope=scope))
        scope["lighting_client"] = self.service.identify_client(scope)
        status = 0

        async def send_named(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                headers = MutableHeaders(scope=message)
                headers.update(self._headers)
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


class _ExceptionMiddleware(_Middleware):
    """Answers 500 without internal details for errors that nothing else handled, and logs them.

    A request that outlasts the time of a shutdown is answered 503.
    """

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        started = False
        bad_range: ProblemError | None = None

        async def send_noting_start(message: Message) -> None:
            nonlocal started, bad_range
            if message["type"] == "http.response.start":
                bad_range = _find_bad_range(scope, message)
                started = bad_range is None
            if bad_range is None:
                await send(message)

        try:
            await self.app(scope, receive, send_noting_start)
            if bad_range:
                raise bad_range
        except (Exception, asyncio.CancelledError) as error:
            if started:
                raise
            told = error if isinstance(error, Exception) else ProblemError(problems.BUSY, _SHUTDOWN_DETAIL)
            response = await problems.problem_response(Request(scope), told)
            await response(scope, receive, send)


def _find_bad_range(scope: Scope, start: Message) -> ProblemError | None:
    """The problem where Starlette says in plain text that a file has no such range."""
    headers = Headers(raw=start["headers"])
    is_text = headers.get("content-type", "").startswith("text/plain")
    if not is_text or start["status"] not in (400, 416) or "range" not in Headers(scope=scope):
        return None
    length = {name: headers[name] for name in ("content-range",) if name in headers}
    return ProblemError(problems.BAD_RANGE, headers=length)


class _HeadAsGetMiddleware(_Middleware):
    """Answers HEAD like GET; the server leaves out the body."""

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        inner = {**scope, "method": "GET"} if scope["method"] == "HEAD" else scope
        try:
            await self.app(inner, receive, send)
        finally:
            scope.update({name: inner.get(name) for name in ("route", "endpoint", "problem")})


class DrainBodyMiddleware(_Middleware):
    """Reads and drops the rest of a body before a connection closes that the client wants closed after the answer.

    A connection that is closed with bytes unread takes its answer with it; one that stays open is read on anyway.
    """

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        closes, unread = _closes_connection(scope), True

        async def receive_noting_end() -> Message:
            nonlocal unread
            message = await receive()
            unread = message.get("more_body", False)
            return message

        async def send_after_draining(message: Message) -> None:
            last = message["type"] == "http.response.body" and not message.get("more_body")
            if closes and last and unread:
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

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
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


class _BrowserGuardMiddleware(_Middleware):
    """Refuses what a web page of somebody else would have the service do.

    Browsers send forms and load pictures across origins without asking first, and reach a local service by any name
    that a page's owner lets point to it (DNS rebinding).

    Args:
        app: the ASGI app inside.
        settings: the names of the service, the origins that may call, and the proxies that check names themselves.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        super().__init__(app)
        self.settings = settings

    async def _handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        headers, kind = Headers(scope=scope), None
        host = _host_name(headers.get("host", ""))
        if not self._is_own_name(scope, headers, host):
            kind = problems.WRONG_HOST
        elif "*" not in self.settings.cors_origins and self._is_foreign(scope, headers, host):
            kind = problems.FOREIGN_ORIGIN
        app = await problems.problem_response(Request(scope), ProblemError(kind)) if kind else self.app
        await app(scope, receive, send)

    def _is_own_name(self, scope: Scope, headers: Headers, host: str) -> bool:
        """Whether a request names a host that no stranger can let point here: an address, or one of the service's."""
        if "." not in host or parse_address(host) or host.endswith(".localhost"):
            return True  # nobody outside can have a name without a dot
        if host in self.settings.hosts:
            return True
        peer = scope.get("state", {}).get("peer") or (scope.get("client") or ("",))[0]
        if "x-forwarded-for" in headers and self.settings.is_trusted_proxy(peer):
            return not (self.settings.hosts and _is_loopback(peer))  # a browser of this machine could say so itself
        return not self.settings.hosts and not _is_loopback((scope.get("server") or ("",))[0])

    def _is_foreign(self, scope: Scope, headers: Headers, host: str) -> bool:
        """Whether another origin's page asks for work; where it says so only in part, on this machine alone."""
        origin, site = headers.get("origin", ""), headers.get("sec-fetch-site", "")
        if site == "same-origin" or origin in self.settings.cors_origins:
            return False
        if scope["method"] not in ("GET", "HEAD", "OPTIONS"):
            return bool(origin) and _netloc(urlsplit(origin).netloc) != _netloc(headers.get("host", ""))
        if scope["method"] == "OPTIONS" or not problems.route_path(scope).startswith("/v1/"):
            return False
        navigated = headers.get("sec-fetch-mode") == "navigate" and headers.get("sec-fetch-dest") == "document"
        return site in ("cross-site", "same-site") and not navigated and _is_loopback(host)


def _netloc(text: str) -> str:
    """Host and port in lower case, without the port of http or https."""
    text = text.lower()
    return text.removesuffix(":80").removesuffix(":443")


def _host_name(host: str) -> str:
    """The host of a Host header in lower case, without its port, brackets and a dot at its end."""
    name = host.lower()
    if name.startswith("["):
        return name[1:].partition("]")[0]
    return name.partition(":")[0].removesuffix(".")


def _is_loopback(host: str) -> bool:
    if address := parse_address(host):
        return address.is_loopback
    return host == "localhost" or host.endswith(".localhost")

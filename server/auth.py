"""API keys, rate limits, and what browsers are told and refused."""

import hmac
import time
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from hashlib import sha256
from ipaddress import ip_address
from math import ceil
from typing import Annotated
from urllib.parse import urlsplit

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from limits import RateLimitItem
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter
from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server import problems
from server.limits import GROUP_SHARES, Client, client_of_request
from server.problems import ProblemError
from server.settings import Settings

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


class SecurityHeadersMiddleware:
    """Adds SECURITY_HEADERS to every response.

    Args:
        app: the ASGI app inside.
        frame_origins: whose pages may show a response in a frame; empty: nobody's.
    """

    def __init__(self, app: ASGIApp, frame_origins: Sequence[str] = ()) -> None:
        self.app = app
        self._headers = dict(SECURITY_HEADERS)
        if frame_origins:
            del self._headers["X-Frame-Options"]  # which can name no origin
            policy = _CONTENT_SECURITY_POLICY.replace(_NO_FRAMES, f"frame-ancestors {' '.join(frame_origins)}")
            self._headers["Content-Security-Policy"] = policy

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(self._headers)
            await send(message)

        await self.app(scope, receive, with_headers)


class BrowserGuardMiddleware:
    """Refuses what a web page of somebody else would have the service do.

    Browsers send forms and load pictures across origins without asking first, and reach a local service by any name
    that a page's owner lets point to it (DNS rebinding).

    Args:
        app: the ASGI app inside.
        settings: the names of the service, the origins that may call, and the proxies that check names themselves.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self.settings = settings

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        error = self._find_error(scope, Headers(scope=scope)) if scope["type"] == "http" else None
        app = self.app if error is None else await problems.problem_response(Request(scope), error)
        await app(scope, receive, send)

    def _find_error(self, scope: Scope, headers: Headers) -> ProblemError | None:
        host = _host_name(headers.get("host", ""))
        if not self._is_own_name(scope, headers, host):
            return ProblemError(problems.WRONG_HOST, problems.WRONG_HOST.example)
        if "*" not in self.settings.cors_origins and self._is_foreign(scope, headers, host):
            detail = "Web pages of other origins are refused; the operator can add this one to LIGHTING_CORS_ORIGINS."
            return ProblemError(problems.FOREIGN_ORIGIN, detail)
        return None

    def _is_own_name(self, scope: Scope, headers: Headers, host: str) -> bool:
        """Whether a request names a host that no stranger can let point here: an address, or one of the service's."""
        if "." not in host or _is_address(host) or host.endswith(".localhost"):
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


def _is_address(host: str) -> bool:
    try:
        ip_address(host)
    except ValueError:
        return False
    return True


def _is_loopback(host: str) -> bool:
    if _is_address(host):
        address = ip_address(host)
        return bool((getattr(address, "ipv4_mapped", None) or address).is_loopback)
    return host == "localhost" or host.endswith(".localhost")


class ApiKeys:
    """API keys, stored as digests; without keys everybody may call."""

    def __init__(self, keys: Iterable[str]) -> None:
        self._digests = [sha256(key.encode()).digest() for key in keys]

    def __bool__(self) -> bool:
        return bool(self._digests)

    def find(self, key: str) -> int | None:
        """The number of a key, from 0; None if it is none of them. The time does not depend on the key.

        Args:
            key: what a client sent.
        """
        digest = sha256(key.encode()).digest()
        equal = [hmac.compare_digest(digest, valid) for valid in self._digests]
        return equal.index(True) if any(equal) else None


class RateLimiter:
    """Rate limits for each client, in requests; larger groups of addresses have larger ones."""

    def __init__(self, limits: list[RateLimitItem]) -> None:
        self.limits = limits
        self._windows = MovingWindowRateLimiter(MemoryStorage())

    def __bool__(self) -> bool:
        return bool(self.limits)

    def seconds_to_wait(self, client: Client) -> int:
        """Seconds until the client may send another request; if 0, this request is counted.

        Args:
            client: who asks.
        """
        windows = [
            (type(limit)(limit.amount * share, limit.multiples, limit.namespace), group)
            for limit in self.limits
            for group, share in zip(client.groups, GROUP_SHARES, strict=False)
        ]
        waits = [self._reset_seconds(limit, group) for limit, group in windows if not self._windows.test(limit, group)]
        if not waits:
            for limit, group in windows:
                self._windows.hit(limit, group)
        return max(waits, default=0)

    def _reset_seconds(self, limit: RateLimitItem, group: str) -> int:
        return max(1, round(self._windows.get_window_stats(limit, group).reset_time - time.time()))


class CpuLimiter:
    """Limits for each client, in seconds of processor time that its requests took.

    Args:
        limits: their amounts are seconds.
        clock: seconds.
    """

    _PARTS = 60  # of a window, each with one sum

    def __init__(self, limits: list[RateLimitItem], clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self._clock = clock
        self._sums: dict[tuple[int, str], deque[tuple[int, float]]] = {}  # by limit and group: part, and seconds in it
        self._purged = clock()

    def __bool__(self) -> bool:
        return bool(self.limits)

    def charge(self, client: Client, seconds: float) -> None:
        """Count what a request took.

        Args:
            client: who asked.
            seconds: of processor time.
        """
        for number, limit in enumerate(self.limits):
            part = self._part(limit)
            for group in client.groups:
                sums = self._sums.setdefault((number, group), deque())
                before = sums.pop()[1] if sums and sums[-1][0] == part else 0.0
                sums.append((part, before + seconds))
        self._purge()

    def seconds_to_wait(self, client: Client) -> int:
        """Seconds until the client may send another request.

        Args:
            client: who asks.
        """
        groups = list(zip(client.groups, GROUP_SHARES, strict=False))
        return max((self._wait(n, group, share) for n in range(len(self.limits)) for group, share in groups), default=0)

    def _wait(self, number: int, group: str, share: int) -> int:
        """Seconds until the oldest sums have left the window, so that the rest is less than the limit."""
        limit = self.limits[number]
        oldest = self._part(limit) - self._PARTS
        sums = [entry for entry in self._sums.get((number, group), ()) if entry[0] > oldest]
        excess = sum(seconds for _, seconds in sums) - limit.amount * share
        last = None
        for part, seconds in sums:
            if excess < 0:
                break
            excess -= seconds
            last = part
        return 0 if last is None else self._seconds_until(limit, last)

    def _seconds_until(self, limit: RateLimitItem, part: int) -> int:
        """Seconds until a part leaves the window, rounded up."""
        length = limit.get_expiry() / self._PARTS
        return max(1, ceil((part + self._PARTS) * length - self._clock()))

    def _part(self, limit: RateLimitItem) -> int:
        return int(self._clock() / limit.get_expiry() * self._PARTS)

    def _purge(self) -> None:
        """Forget, now and then, the sums of which nothing counts any more."""
        longest = max((limit.get_expiry() for limit in self.limits), default=0)
        if self._clock() - self._purged > longest:
            self._purged = self._clock()
            for number, limit in enumerate(self.limits):
                first = self._part(limit) - self._PARTS
                for key in [k for k, sums in self._sums.items() if k[0] == number and sums[-1][0] <= first]:
                    del self._sums[key]


_bearer = HTTPBearer(auto_error=False, description="One of the service's API keys")
Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


async def require_api_key(request: Request, credentials: Credentials) -> None:
    """Refuse a request without a valid API key.

    Args:
        request: its app holds the service with the valid keys.
        credentials: the bearer token; None if there is none.

    Raises:
        ProblemError: 401 without a key, 403 with a wrong one.
    """
    challenge = {"WWW-Authenticate": "Bearer"}
    if credentials is None or not credentials.credentials:
        detail = "Send one of the service's API keys: Authorization: Bearer KEY."
        raise ProblemError(problems.UNAUTHORIZED, detail, challenge)
    if request.app.state.service.keys.find(credentials.credentials) is None:
        raise ProblemError(
            problems.FORBIDDEN, "The service does not know this API key; ask its operator for one.", challenge
        )


async def enforce_rate_limit(request: Request) -> None:
    """Refuse a request that exceeds its client's limits in requests or processor time.

    Args:
        request: its app holds the service with the limits.

    Raises:
        ProblemError: 429, with the seconds to wait.
    """
    service, client = request.app.state.service, client_of_request(request)
    wait = service.cpu_limiter.seconds_to_wait(client) or service.rate_limiter.seconds_to_wait(client)
    if wait:
        detail = f"The rate limit is reached; wait {wait} s."
        raise ProblemError(problems.TOO_MANY_REQUESTS, detail, {"Retry-After": str(wait)})

"""API keys, rate limits, and security headers for browsers."""

import hmac
import time
from collections.abc import Iterable
from hashlib import sha256
from ipaddress import ip_address, ip_network
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from limits import RateLimitItem
from limits.storage import MemoryStorage
from limits.strategies import MovingWindowRateLimiter
from starlette.datastructures import MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from server import problems
from server.problems import ProblemError

_CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' blob: data:; "
    "connect-src 'self' blob: data:; worker-src 'self' blob:; font-src 'self'; manifest-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
SECURITY_HEADERS = {
    "Content-Security-Policy": _CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
}


class SecurityHeadersMiddleware:
    """Adds SECURITY_HEADERS to every response."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(SECURITY_HEADERS)
            await send(message)

        await self.app(scope, receive, with_headers)


class ApiKeys:
    """API keys, stored as digests; without keys everybody may call."""

    def __init__(self, keys: Iterable[str]) -> None:
        self._digests = [sha256(key.encode()).digest() for key in keys]

    def __bool__(self) -> bool:
        return bool(self._digests)

    def is_valid(self, key: str) -> bool:
        """Whether the key is one of them, in a time that does not depend on the key."""
        digest = sha256(key.encode()).digest()
        return sum(hmac.compare_digest(digest, valid) for valid in self._digests) > 0


class RateLimiter:
    """Rate limits for each client."""

    def __init__(self, limits: list[RateLimitItem]) -> None:
        self.limits = limits
        self._windows = MovingWindowRateLimiter(MemoryStorage())

    def __bool__(self) -> bool:
        return bool(self.limits)

    def seconds_to_wait(self, client: str) -> int:
        """Seconds until the client may send another request; if 0, this request is counted."""
        waits = [self._reset_seconds(limit, client) for limit in self.limits if not self._windows.test(limit, client)]
        if not waits:
            for limit in self.limits:
                self._windows.hit(limit, client)
        return max(waits, default=0)

    def _reset_seconds(self, limit: RateLimitItem, client: str) -> int:
        return max(1, round(self._windows.get_window_stats(limit, client).reset_time - time.time()))


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
    if not request.app.state.service.keys.is_valid(credentials.credentials):
        raise ProblemError(problems.FORBIDDEN, "The API key that was sent is none of the service's.", challenge)


async def enforce_rate_limit(request: Request) -> None:
    """Refuse a request that exceeds its client's rate limit.

    Args:
        request: its app holds the service with the limits.

    Raises:
        ProblemError: 429, with the seconds to wait.
    """
    wait = request.app.state.service.rate_limiter.seconds_to_wait(client_address(request))
    if wait:
        detail = f"The rate limit is reached; wait {wait} s."
        raise ProblemError(problems.TOO_MANY_REQUESTS, detail, {"Retry-After": str(wait)})


def client_address(request: Request) -> str:
    """The address by which a client is identified: an IPv4 address, or the /64 network of an IPv6 address.

    Args:
        request: its client is the one that a trusted proxy names.

    Returns:
        "unknown" for what is no IP address.
    """
    host = request.client.host if request.client else ""
    if host.count(":") == 1:  # some proxies append the port
        host = host.partition(":")[0]
    try:
        address = ip_address(host)
    except ValueError:
        return "unknown"
    address = getattr(address, "ipv4_mapped", None) or address
    return str(ip_network((address, 64), strict=False) if address.version == 6 else address)

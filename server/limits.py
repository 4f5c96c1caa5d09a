"""Who asks, a client by its API key or its address; and limits on what clients may use, in all and each.

Those are requests, processor time, uploads, answers that wait to be taken, and connections.
"""

import hmac
import logging
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from hashlib import sha256
from ipaddress import IPv4Address, IPv6Network
from math import ceil
from typing import NamedTuple, Protocol, TypeVar

from limits import RateLimitItem
from starlette.requests import HTTPConnection

from server import problems
from server.problems import ProblemError
from server.settings import parse_address

K = TypeVar("K")

_PREFIXES = (64, 56, 48)  # bits of an IPv6 address: a network, a home, a site
GROUP_SHARES = (1, 2, 3)  # what a client's groups may have, as multiples of a client's share
_NAT64 = IPv6Network("64:ff9b::/96")  # its last 32 bits are an IPv4 address (RFC 6052)
_LOCAL_NAT64 = IPv6Network("64:ff9b:1::/48")  # each of its addresses is an IPv4 one's (RFC 8215)
PLACE_BYTES = 65_536  # of a body that have come when it takes a place
_UNSENT_SHARE = 0.25  # of the bytes of answers that may wait, for one client
BACKLOG = 32  # connections that are accepted in one iteration of the event loop
_SPARE_FILES = 4 * BACKLOG + 32  # of the process that are no connections, or not yet counted as such
_BROWSER_CONNECTIONS = 8  # of one client, as browsers open; more may be refused when there are too many in all
_FILES_PER_WORKER = 8  # pipes of the processes that decode and match
_LOG_SECONDS = 60.0  # between two lines about connections

log = logging.getLogger(__name__)


class Client(NamedTuple):
    """Who asks, by the groups whose shares it uses: itself first, then what it is a part of."""

    groups: tuple[str, ...]


UNKNOWN = Client(("unknown",))


@lru_cache(maxsize=4096)
def client_of_address(host: str) -> Client:
    """The client at an address.

    Args:
        host: an IP address, with or without a port.

    Returns:
        One group for IPv4, also where IPv6 maps or translates it (NAT64); else of IPv6 the /64, /56 and /48 networks;
        UNKNOWN for what is no address.
    """
    address = parse_address(host.partition(":")[0] if host.count(":") == 1 else host)  # some proxies append the port
    if address is None:
        return UNKNOWN
    if address in _NAT64:
        address = IPv4Address(int(address) & 0xFFFFFFFF)
    if isinstance(address, IPv4Address) or address in _LOCAL_NAT64:
        return Client((str(address),))
    value = int(address)
    return Client(tuple(str(IPv6Network((value >> 128 - bits << 128 - bits, bits))) for bits in _PREFIXES))


def client_of_key(number: int) -> Client:
    """The client that has an API key.

    Args:
        number: of the key, from 0.
    """
    return Client((f"key {number}",))


def client_of_request(request: HTTPConnection) -> Client:
    """The client that the access log's middleware noted.

    Args:
        request: a request that has come through it.
    """
    client: Client = request.scope.get("lighting_client", UNKNOWN)
    return client


def load_of_shares(sums: Mapping[str, float], client: Client, more: float, part: float = 1.0) -> float:
    """A client's sum, or, where that is more, a larger group's, divided by that group's share.

    Args:
        sums: by group.
        client: any.
        more: to be counted in addition.
        part: of each sum that counts, 0 to 1.
    """
    groups = zip(client.groups, GROUP_SHARES, strict=False)
    return max((sums.get(group, 0.0) * part + more) / share for group, share in groups)


class Tally:
    """Sums by client; each counts for all the groups of its client."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._clients: dict[Client, float] = {}

    def add(self, client: Client, amount: float) -> None:
        """Add to a client's sum; one that comes back to 0 is forgotten.

        Args:
            client: any.
            amount: of either sign.
        """
        for group in client.groups:
            _add(self._sums, group, amount)
        _add(self._clients, client, amount)

    def load(self, client: Client, more: float = 0.0) -> float:
        """A client's sum, or, where that is more, a larger group's, divided by that group's share.

        Args:
            client: any.
            more: to be counted in addition.
        """
        return load_of_shares(self._sums, client, more)

    def __len__(self) -> int:
        return len(self._clients)


def _add(sums: dict[K, float], key: K, amount: float) -> None:
    sums[key] = sums.get(key, 0.0) + amount
    if not sums[key]:
        del sums[key]


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
    """Limits for each client, in requests or in seconds of processor time; larger groups of addresses have larger ones.

    Unlike the library `limits`, which reads them, it counts by a clock that nobody sets.

    Args:
        limits: what may be used in which time.
        clock: seconds.
    """

    _PARTS = 60  # of a window, each with one sum

    def __init__(self, limits: Sequence[RateLimitItem], clock: Callable[[], float] = time.monotonic) -> None:
        self.limits = limits
        self._clock = clock
        self._sums: dict[tuple[int, str], dict[int, float]] = {}  # by limit and group, of each part of a window
        self._purged = clock()

    def __bool__(self) -> bool:
        return bool(self.limits)

    def charge(self, client: Client, amount: float) -> None:
        """Count what a client used.

        Args:
            client: who asked.
            amount: requests or seconds.
        """
        for number, limit in enumerate(self.limits):
            for group in client.groups:
                _add(self._sums.setdefault((number, group), {}), self._part(limit), amount)
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
        oldest, length = self._part(limit) - self._PARTS, limit.get_expiry() / self._PARTS
        sums = [item for item in self._sums.get((number, group), {}).items() if item[0] > oldest]
        excess, wait = sum(amount for _, amount in sums) - limit.amount * share, 0
        for part, amount in sums:
            if excess < 0:
                break
            excess -= amount
            wait = max(1, ceil((part + self._PARTS) * length - self._clock()))
        return wait

    def _part(self, limit: RateLimitItem) -> int:
        return int(self._clock() / limit.get_expiry() * self._PARTS)

    def _purge(self) -> None:
        """Forget, now and then, the sums of which nothing counts any more."""
        longest = max((limit.get_expiry() for limit in self.limits), default=0)
        if self._clock() - self._purged > longest:
            self._purged = self._clock()
            oldest = [self._part(limit) - self._PARTS for limit in self.limits]
            for (number, group), sums in list(self._sums.items()):
                for part in [part for part in sums if part <= oldest[number]]:
                    del sums[part]
                if not sums:
                    del self._sums[number, group]


@dataclass(eq=False)
class ArrivingBody:
    """A body that is arriving."""

    client: Client
    give_way: Callable[[], None]  # ends its request
    size: int = 0  # bytes that have come
    began: float = field(default_factory=time.monotonic)

    def rate(self) -> float:
        """Bytes per second so far."""
        return self.size / max(time.monotonic() - self.began, 1e-6)


class UploadLimiter:
    """Limits the bodies that are arriving, in all and from each client; they occupy no worker.

    A body takes a place when PLACE_BYTES have come. When all are taken, the slowest body gives way.
    """

    def __init__(self, max_uploads: int, max_per_client: int) -> None:
        self.max_uploads = max_uploads
        self.max_per_client = max_per_client
        self._bodies: set[ArrivingBody] = set()
        self._held = Tally()

    @property
    def count(self) -> int:
        """Bodies that have a place."""
        return len(self._bodies)

    @contextmanager
    def count_upload(self, body: ArrivingBody) -> Iterator[None]:
        """Count a body until the end of the block.

        Args:
            body: of which PLACE_BYTES have come.

        Raises:
            ProblemError: 429, its client has as many places as it may; 503, all are taken, by faster ones.
        """
        if self._held.load(body.client, 1) > self.max_per_client:
            raise ProblemError(problems.TOO_MANY_UPLOADS)
        if self.count >= self.max_uploads:
            slowest = min((body, *self._bodies), key=ArrivingBody.rate)
            if slowest is body:
                detail = "As many bodies are arriving as the service takes at once, and all come faster."
                raise ProblemError(problems.BUSY, detail)
            self._discard(slowest)
            slowest.give_way()
        self._bodies.add(body)
        self._held.add(body.client, 1)
        try:
            yield
        finally:
            self._discard(body)

    def _discard(self, body: ArrivingBody) -> None:
        if body in self._bodies:
            self._bodies.remove(body)
            self._held.add(body.client, -1)


class _OpenConnection(Protocol):
    """A connection that may have to give way."""

    def give_way(self) -> None:
        """End at once."""


class _UnsentAnswer(_OpenConnection, Protocol):
    """A connection whose client has not taken all of an answer."""

    def unsent_bytes(self) -> int:
        """Bytes that wait."""

    def seconds_left(self) -> float:
        """Seconds until all is taken, at the mean speed so far."""

    def drop_answer(self) -> None:
        """End the connection, and say so in the log."""


class PendingResponses:
    """Limits the bytes of responses that wait for their clients; used in the event loop's thread alone."""

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes = max_bytes
        self._waiting: dict[_UnsentAnswer, Client] = {}

    def add(self, answer: _UnsentAnswer, client: Client) -> None:
        """Count this connection's bytes until it is discarded.

        Args:
            answer: the connection.
            client: whose share the bytes use.
        """
        self._waiting[answer] = client

    def discard(self, answer: _UnsentAnswer) -> None:
        """Count this connection no more."""
        self._waiting.pop(answer, None)

    @property
    def size(self) -> int:
        """Bytes that wait."""
        return sum(answer.unsent_bytes() for answer in self._waiting)

    def check(self, client: Client) -> None:
        """Make room for a further response; while there is none, the answer that is taken most slowly is dropped.

        Args:
            client: who would get it.

        Raises:
            ProblemError: 429, _UNSENT_SHARE of the bytes wait for this client.
        """
        if not self._waiting:
            return
        sizes = Tally()
        for answer, owner in self._waiting.items():
            sizes.add(owner, answer.unsent_bytes())
        if sizes.load(client) >= _UNSENT_SHARE * self.max_bytes:
            detail = "Many bytes of answers wait for this client to take them."
            raise ProblemError(problems.SHARE_TAKEN, detail)
        while self._waiting and self.size >= self.max_bytes:
            slowest = max(self._waiting, key=lambda answer: answer.seconds_left())
            self.discard(slowest)
            slowest.drop_answer()

    def drop_all(self) -> None:
        """Drop all answers that wait for their clients, as at the end of a shutdown's time."""
        if self._waiting:
            log.info("dropped %d answers that their clients did not take in time", len(self._waiting))
        for answer in list(self._waiting):
            answer.give_way()


class ConnectionLimiter:
    """Limits the open connections, in all and of each client.

    When there are too many in all, a client that has over twice its part of them gets no further one. Greedy clients
    would drive out one another's connections, which takes much time. For others the one on which nothing has been asked
    for longest gives way: of those that never asked anything first. A connection asks something when a request and
    PLACE_BYTES of its body, or all, have come.

    Args:
        maximum: in all.
        max_per_client: of one client.
    """

    def __init__(self, maximum: int, max_per_client: int) -> None:
        self.maximum = maximum
        self.max_per_client = max_per_client
        self._clients: dict[_OpenConnection, Client | None] = {}
        self._silent: dict[_OpenConnection, None] = {}  # those that never asked anything, the oldest first
        self._idle: dict[_OpenConnection, None] = {}  # those that have nothing to do since an answer
        self._held = Tally()
        self._ended = 0  # since the last line of the log
        self._logged = -_LOG_SECONDS

    @property
    def count(self) -> int:
        """Open connections."""
        return len(self._clients)

    def open(self, connection: _OpenConnection, client: Client | None) -> bool:
        """Count a connection; False if there is no room for it.

        Args:
            connection: a new one.
            client: whose share it uses; None for a proxy, which has no share.
        """
        if client and self.refuses(client):
            return False
        if self.count >= self.maximum:
            self._log()
            quiet = next(iter(self._silent or self._idle), None)
            if quiet is None:
                return False
            self.close(quiet)
            quiet.give_way()
        self._clients[connection] = client
        self._silent[connection] = None
        if client:
            self._held.add(client, 1)
        return True

    def refuses(self, client: Client) -> bool:
        """Whether a client gets no further connection, which the log says.

        Args:
            client: whose share the connection would use.
        """
        load = self._held.load(client, 1)
        greedy = load > _BROWSER_CONNECTIONS and load * len(self._held) > 2 * self.maximum
        refused = load > self.max_per_client or (greedy and self.count >= self.maximum)
        if refused:
            self._log()
        return refused

    def note_request(self, connection: _OpenConnection) -> None:
        """Something has been asked on this connection: it does not give way."""
        self._silent.pop(connection, None)
        self._idle.pop(connection, None)

    def note_answer(self, connection: _OpenConnection) -> None:
        """All that was asked has been answered."""
        if connection in self._clients:
            self._silent.pop(connection, None)
            self._idle[connection] = None

    def close(self, connection: _OpenConnection) -> None:
        """Count a connection no more."""
        if connection not in self._clients:
            return
        client = self._clients.pop(connection)
        self.note_request(connection)
        if client:
            self._held.add(client, -1)

    def _log(self) -> None:
        """Count a connection that is ended or refused, and say so once a minute."""
        self._ended += 1
        if time.monotonic() - self._logged >= _LOG_SECONDS:
            log.warning("too many connections: %d ended or refused, %d open", self._ended, self.count)
            self._ended, self._logged = 0, time.monotonic()


def raise_file_limit() -> None:
    """Let this process open as many files as the system lets it."""
    if sys.platform == "win32":
        return
    import resource

    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


def count_possible_connections(workers: int) -> int:
    """The connections for which this process can open files, beside what else it needs.

    Args:
        workers: requests processed at the same time.
    """
    if sys.platform == "win32":
        return sys.maxsize
    import resource

    soft, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY:
        return sys.maxsize
    return max(soft - _SPARE_FILES - _FILES_PER_WORKER * workers, 8)

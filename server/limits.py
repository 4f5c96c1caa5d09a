"""Concurrency, uploads and pending answers."""

from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

from anyio import CancelScope, CapacityLimiter, create_task_group, to_thread
from starlette.requests import ClientDisconnect
from starlette.types import Receive

# The limit on CPU work: a fixed number of requests run, a fixed number wait, and any further one is refused.

T = TypeVar("T")


class BusyError(Exception):
    """There is no room for a request now; the message says of what."""

    def __init__(self, message: str = "All workers are busy and the queue is full.") -> None:
        super().__init__(message)


class Limiter:
    """Runs requests in a fixed number of threads; they are admitted when their bodies have arrived."""

    def __init__(self, places: int, queue: int) -> None:
        self.places = places
        self.capacity = places + queue
        self.admitted = 0
        self._threads = CapacityLimiter(places)

    @property
    def running(self) -> int:
        return self._threads.borrowed_tokens

    @property
    def waiting(self) -> int:
        return self.admitted - self.running

    @property
    def full(self) -> bool:
        return self.admitted >= self.capacity

    @contextmanager
    def admission(self) -> Iterator[None]:
        """Count as running or waiting until the end of the block; raises BusyError if the queue is full."""
        if self.full:
            raise BusyError
        self.admitted += 1
        try:
            yield
        finally:
            self.admitted -= 1

    async def run(self, receive: Receive, work: Callable[[], T]) -> T:
        """Run `work` in a thread as soon as one is free; raises ClientDisconnect if the client disconnects.

        Waiting work is then dropped; running work stops at its next call of anyio.from_thread.check_cancelled.
        """
        return await _unless_gone(receive, lambda: to_thread.run_sync(work, limiter=self._threads))


async def _unless_gone(receive: Receive, work: Callable[[], Awaitable[T]]) -> T:
    try:
        async with create_task_group() as tasks:
            tasks.start_soon(_cancel_when_gone, receive, tasks.cancel_scope)
            result = await work()
            tasks.cancel_scope.cancel()
            return result
    except ExceptionGroup as group:
        raise group.exceptions[0] from None
    raise ClientDisconnect


async def _cancel_when_gone(receive: Receive, scope: CancelScope) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
    scope.cancel()


# The bodies that are arriving: they take none of the places for work, and are limited in all and by client.


class TooManyUploadsError(Exception):
    """One client sends as many bodies at once as it may."""


class UploadLimiter:
    """Counts the bodies under way, in all and from each client's address."""

    def __init__(self, most: int, most_of_a_client: int) -> None:
        self.most = most
        self.most_of_a_client = most_of_a_client
        self._of: Counter[str] = Counter()

    @property
    def count(self) -> int:
        return self._of.total()

    @property
    def full(self) -> bool:
        return self.count >= self.most

    @contextmanager
    def one_of(self, client: str) -> Iterator[None]:
        """Count a body until the end of the block; raises CrowdedError or BusyError where there are too many."""
        if self._of[client] >= self.most_of_a_client:
            raise TooManyUploadsError
        if self.full:
            raise BusyError("As many bodies are arriving as the service takes at once.")
        self._of[client] += 1
        try:
            yield
        finally:
            self._of[client] -= 1
            self._of += Counter()  # forgets who sends nothing


# The answers that their clients have not taken yet: they take no place for work, and are limited in bytes.


class _Sender(Protocol):
    """What is counted of a connection's transport."""

    def get_write_buffer_size(self) -> int: ...


class PendingResponses:
    """Counts the bytes that wait in connections; to be used in the event loop's thread alone."""

    def __init__(self, most: int) -> None:
        self.most = most
        self._waiting: set[_Sender] = set()

    def add(self, transport: _Sender) -> None:
        """Count what this connection holds until it is discarded."""
        self._waiting.add(transport)

    def discard(self, transport: _Sender) -> None:
        self._waiting.discard(transport)

    @property
    def size(self) -> int:
        return sum(transport.get_write_buffer_size() for transport in self._waiting)

    @property
    def full(self) -> bool:
        return self.size >= self.most

    def check(self) -> None:
        """Raise BusyError where no further answer may be made."""
        if self.full:
            raise BusyError("As many bytes of answers as the service keeps wait for clients to take them.")

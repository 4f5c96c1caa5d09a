"""Limits on concurrent work, on uploads and on responses that wait for their clients."""

from collections import Counter
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Protocol, TypeVar

from anyio import CancelScope, CapacityLimiter, create_task_group, to_thread
from starlette.requests import ClientDisconnect
from starlette.types import Receive

T = TypeVar("T")


class BusyError(Exception):
    """There is no room for a request now; the message names the limit."""

    def __init__(self, message: str = "All workers are busy and the queue is full.") -> None:
        super().__init__(message)


class WorkLimiter:
    """Runs a fixed number of requests in threads; a fixed number waits, and further ones are refused."""

    def __init__(self, workers: int, queue: int) -> None:
        self.workers = workers
        self.capacity = workers + queue
        self.admitted = 0
        self._threads = CapacityLimiter(workers)

    @property
    def running(self) -> int:
        """Requests that occupy a thread."""
        return self._threads.borrowed_tokens

    @property
    def waiting(self) -> int:
        """Admitted requests that wait for a thread."""
        return self.admitted - self.running

    @property
    def full(self) -> bool:
        """Whether the next request would be refused."""
        return self.admitted >= self.capacity

    @contextmanager
    def admission(self) -> Iterator[None]:
        """Count a request until the end of the block; raises BusyError if the queue is full."""
        if self.full:
            raise BusyError
        self.admitted += 1
        try:
            yield
        finally:
            self.admitted -= 1

    async def run(self, receive: Receive, work: Callable[[], T]) -> T:
        """Run work in a thread as soon as one is free.

        Args:
            receive: ASGI's channel, which tells that the client disconnects.
            work: on a disconnect it is dropped while it waits; while it runs, it stops at its next
                call of anyio.from_thread.check_cancelled.

        Raises:
            ClientDisconnect: the client disconnected.
        """
        return await _run_unless_disconnected(receive, lambda: to_thread.run_sync(work, limiter=self._threads))


async def _run_unless_disconnected(receive: Receive, work: Callable[[], Awaitable[T]]) -> T:
    try:
        async with create_task_group() as tasks:
            tasks.start_soon(_cancel_on_disconnect, receive, tasks.cancel_scope)
            result = await work()
            tasks.cancel_scope.cancel()
            return result
    except ExceptionGroup as group:
        raise group.exceptions[0] from None
    raise ClientDisconnect


async def _cancel_on_disconnect(receive: Receive, scope: CancelScope) -> None:
    while (await receive())["type"] != "http.disconnect":
        pass
    scope.cancel()


class TooManyUploadsError(Exception):
    """One client sends more bodies at once than it may."""


class UploadLimiter:
    """Limits the bodies that are arriving, in all and from each client; they occupy no worker."""

    def __init__(self, max_uploads: int, max_per_client: int) -> None:
        self.max_uploads = max_uploads
        self.max_per_client = max_per_client
        self._by_client: Counter[str] = Counter()

    @property
    def count(self) -> int:
        """Bodies that are arriving."""
        return self._by_client.total()

    @property
    def full(self) -> bool:
        """Whether the next body would be refused."""
        return self.count >= self.max_uploads

    @contextmanager
    def count_upload(self, client: str) -> Iterator[None]:
        """Count a body until the end of the block; raises TooManyUploadsError or BusyError if there are too many."""
        if self._by_client[client] >= self.max_per_client:
            raise TooManyUploadsError
        if self.full:
            raise BusyError("As many bodies are arriving as the service takes at once.")
        self._by_client[client] += 1
        try:
            yield
        finally:
            self._by_client[client] -= 1
            self._by_client += Counter()  # drops clients without uploads


class _Transport(Protocol):
    """The part of a connection's transport that is counted."""

    def get_write_buffer_size(self) -> int: ...


class PendingResponses:
    """Limits the bytes of responses that wait for their clients; used in the event loop's thread alone."""

    def __init__(self, max_bytes: int) -> None:
        self.max_bytes = max_bytes
        self._waiting: set[_Transport] = set()

    def add(self, transport: _Transport) -> None:
        """Count this connection's bytes until it is discarded."""
        self._waiting.add(transport)

    def discard(self, transport: _Transport) -> None:
        """Count this connection no more."""
        self._waiting.discard(transport)

    @property
    def size(self) -> int:
        """Bytes that wait."""
        return sum(transport.get_write_buffer_size() for transport in self._waiting)

    @property
    def full(self) -> bool:
        """Whether no further response may be made."""
        return self.size >= self.max_bytes

    def check(self) -> None:
        """Raise BusyError if no further response may be made."""
        if self.full:
            raise BusyError("As many bytes of answers as the service keeps wait for clients to take them.")

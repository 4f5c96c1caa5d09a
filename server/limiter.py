"""The limit on CPU work: a fixed number of requests run, a fixed number wait, and any further one is refused."""

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from anyio import CancelScope, CapacityLimiter, create_task_group, to_thread
from starlette.requests import ClientDisconnect
from starlette.types import Receive

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

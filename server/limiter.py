"""One limit on CPU work: so many requests run, so many wait, the next is refused at once."""

from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import TypeVar

from anyio import CancelScope, CapacityLimiter, create_task_group, to_thread
from starlette.requests import ClientDisconnect
from starlette.types import Receive

T = TypeVar("T")


class BusyError(Exception):
    """Every place is taken and the queue is full."""


class Limiter:
    """Places for requests, which run in threads; one is admitted before its body is read, which bounds the bodies."""

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

    @contextmanager
    def admission(self) -> Iterator[None]:
        """Hold one of the places or waiting places; raises BusyError when there is none."""
        if self.admitted >= self.capacity:
            raise BusyError
        self.admitted += 1
        try:
            yield
        finally:
            self.admitted -= 1

    async def run(self, receive: Receive, work: Callable[[], T]) -> T:
        """What `work` returns, from a thread, when its turn comes; ClientDisconnect once the client has gone.

        Work that waits is dropped then; work that runs stops where it calls anyio.from_thread.check_cancelled.
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

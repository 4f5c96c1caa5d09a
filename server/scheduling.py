"""Work in turn by client: a fixed number of threads, a bounded queue, and the processor time that each client used.

A client is charged what its requests took lately, and what those are expected to take that wait and run. The next free
thread goes to the client with the least (fair queueing). While short requests wait, long ones begin at intervals, in
which they use no more of the threads than their clients are of all clients. Where there are several threads, a short
request has one more beside long ones: no processor rests, and a photo waits for no map. When the queue is full, a
client with fewer requests in it takes the place of the newest one of the client that demands most. A client's only
request waits beyond the queue, as long as the bodies that wait fit into it and their work is done soon. After that, one
that takes much less takes another's place.
"""

import time
from collections.abc import Awaitable, Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import NamedTuple, TypeVar

from anyio import CancelScope, CapacityLimiter, Event, create_task_group, to_thread
from starlette.requests import ClientDisconnect
from starlette.types import Receive

import lighting.runtime as runtime
from server import problems
from server.limits import UNKNOWN, Client, Tally, load_of_shares
from server.problems import ProblemError

_T = TypeVar("_T")

HALF_LIFE = 20.0  # seconds after which processor time counts half
_LONG_SECONDS = 0.1  # of processor time, which a photo's estimate stays under, as every short request
MORE = 1.2  # times the mean processor time of the clients, beyond which one uses more than its share
_MUCH_MORE = 1.5  # times as much processor time as another client, so that one makes room for it
_RECENT_SECONDS = 10.0  # that a client counts as present after its last work
_QUEUE_SECONDS = 30.0  # of work for each thread, up to which requests wait beyond the queue
_FIRST_SECONDS = 1.0  # of processor time that a route is expected to take before it has been measured
_LEARNING_RATE = 0.2  # of a route's expected processor time
_FORGET_SECONDS = 300.0  # after which clients that used as good as nothing are forgotten
_NO_SECONDS = 1e-6  # of processor time


class CpuUsage:
    """The processor time that clients used lately; it counts half after HALF_LIFE.

    Args:
        clock: seconds.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._seconds: dict[str, float] = {}  # by group, as they counted at the origin; later ones count more
        self._origin = clock()

    def add(self, client: Client, seconds: float, at: float | None = None) -> None:
        """Charge a client.

        Args:
            client: any.
            seconds: of either sign.
            at: the clock's time at which it counted fully; None is now.
        """
        now = self._clock()
        if now - self._origin > _FORGET_SECONDS:
            self._move_origin(now)
        counted = seconds * _decay(self._origin - (now if at is None else at))
        for group in client.groups:
            self._seconds[group] = self._seconds.get(group, 0.0) + counted

    def load(self, client: Client, more: float = 0.0, now: float | None = None) -> float:
        """Seconds that a client used, or, where that is more, a larger group divided by its share.

        Args:
            client: any.
            more: seconds to be counted in addition.
            now: the clock's time, at which clients are compared; None reads it.
        """
        now = self._clock() if now is None else now
        return load_of_shares(self._seconds, client, more, _decay(now - self._origin))

    def _move_origin(self, now: float) -> None:
        """Let all count from now, and forget those that used as good as nothing."""
        decay = _decay(now - self._origin)
        counted = {group: seconds * decay for group, seconds in self._seconds.items()}
        self._seconds = {group: seconds for group, seconds in counted.items() if abs(seconds) > _NO_SECONDS}
        self._origin = now


def _decay(seconds: float) -> float:
    """The part that counts of processor time so long ago."""
    return float(0.5 ** (seconds / HALF_LIFE))


@dataclass(eq=False)
class _Job:
    """An admitted request."""

    client: Client
    route: str
    expected: float  # seconds of processor time, charged while it waits and runs
    charged: float  # the clock's time of that
    size: int = 0  # bytes of its body, which it holds while it waits
    turn: Event = field(default_factory=Event)  # set when it may run, or has to go
    started: bool = False
    evicted: bool = False
    began: float = 0.0  # the clock's time at which it got a thread
    had_more: bool = False  # requests than the client for which it was evicted
    seconds: float | None = None  # that it took; None before it has run
    succeeded: bool = False


class _Demand(NamedTuple):
    """What a client demands; counts and sums are divided by its share."""

    requests: float  # that run or wait
    length: float  # seconds of processor time that the request in question is expected to take
    seconds: float  # of processor time, used lately and to be used by all

    def exceeds(self, other: "_Demand") -> bool:
        """Whether it has to make room for another: it has more requests, or as many and this one takes much more."""
        if self.requests != other.requests:
            return self.requests > other.requests and other.seconds <= _MUCH_MORE * self.seconds
        if self.length > max(_LONG_SECONDS, _MUCH_MORE * other.length):
            return True
        return self.length >= other.length and self.seconds > _MUCH_MORE * other.seconds


class WorkLimiter:
    """Runs a fixed number of requests in threads; a fixed number waits, and of further ones each client's only one.

    Args:
        workers: threads; of several, short requests have one more beside long ones.
        queue: requests that may wait in addition.
        max_bytes: of a body. Clients' only requests wait beyond the queue while it has room for their bodies; with 0
            none does.
        charge: is told the processor time [s] of each request's client after its work; None tells nobody.
        clock: seconds.
        short: routes that are never long.
    """

    def __init__(
        self,
        workers: int,
        queue: int,
        charge: Callable[[Client, float], None] | None = None,
        clock: Callable[[], float] = time.monotonic,
        max_bytes: int = 0,
        short: Iterable[str] = (),
    ) -> None:
        self.workers = workers
        self.capacity = workers + queue
        self._queue_bytes = queue * max_bytes
        self.usage = CpuUsage(clock)
        self._charge = charge
        self._clock = clock
        self._held = Tally()
        self._jobs: set[_Job] = set()  # that run or wait
        self._waiting: list[_Job] = []
        self._running: list[_Job] = []
        self._short = tuple(short)
        self._expected = dict.fromkeys(self._short, _LONG_SECONDS)  # processor time [s] by route
        self._long_from = clock()  # the time from which a long request may begin while short ones wait
        self._last: dict[Client, float] = {}  # when a client's work last began or ended, if that is recent
        self._spare = 1 if workers > 1 else 0  # threads for short requests beside long ones
        self._threads = CapacityLimiter(workers + self._spare)

    @property
    def admitted(self) -> int:
        """Requests that run or wait."""
        return len(self._jobs)

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
        """Whether the next request of a new client would be refused."""
        least = min(self._expected.values(), default=_FIRST_SECONDS)
        return not self._has_room(_Demand(1.0, least, least), 0)

    def check(self, client: Client, route: str = "", size: int = 0) -> None:
        """Raise what `admission` would raise now.

        Args:
            client: who asks.
            route: of the request.
            size: bytes of its body.
        """
        if not self._has_room(self._demand(client, route), size):
            raise self._refusal(client)

    @contextmanager
    def admission(self, client: Client = UNKNOWN, route: str = "", size: int = 0) -> Iterator[_Job]:
        """Count a request until the end of the block.

        Args:
            client: who asks.
            route: requests of one route are expected to take the same time.
            size: bytes of its body.

        Raises:
            ProblemError: 503, the queue is full; 429, and this client uses more than others in it.
        """
        if self.admitted >= self.capacity:
            self._make_room(client, route, size)
        job = _Job(client, route, self._expect(route), self._clock(), size)
        self.usage.add(client, job.expected)
        self._held.add(client, 1)
        self._jobs.add(job)
        try:
            yield job
        finally:
            self._release(job)

    def _release(self, job: _Job) -> None:
        """Count a request no more, and charge what it took in place of what was expected."""
        if job in self._jobs:
            self._jobs.remove(job)
            self._held.add(job.client, -1)
            self.usage.add(job.client, -job.expected, job.charged)
            self.usage.add(job.client, job.seconds or 0.0)

    def _has_room(self, demand: _Demand, size: int) -> bool:
        """Whether a request is taken, perhaps though the queue is full."""
        is_free = self.admitted < self.capacity or self._fits_beyond(demand, size)
        return is_free or self._find_greediest(demand) is not None

    def _make_room(self, client: Client, route: str, size: int) -> None:
        """Send away a waiting request, or let this one wait beyond the queue; raises if neither is right."""
        demand = self._demand(client, route)
        greediest, fits = self._find_greediest(demand), self._fits_beyond(demand, size)
        if greediest and (not fits or self._held.load(greediest.client) > demand.requests):
            self._evict(greediest, demand)
        elif not fits:
            raise self._refusal(client)

    def _fits_beyond(self, demand: _Demand, size: int) -> bool:
        """Whether a request may wait beyond the queue: it is its client's only one, and bodies and work are few."""
        if demand.requests > 1:
            return False
        waiting = [job for job in self._jobs if not job.started]
        seconds = sum(self._expect(job.route) for job in waiting) + demand.length
        bodies = sum(job.size for job in waiting) + size
        return bodies < self._queue_bytes and seconds <= _QUEUE_SECONDS * self.workers

    def _evict(self, job: _Job, demand: _Demand) -> None:
        """Send away a waiting request for another with a demand."""
        job.had_more = self._held.load(job.client) > demand.requests
        self._waiting.remove(job)
        self._release(job)
        job.evicted = True
        job.turn.set()

    def _demand(self, client: Client, route: str) -> "_Demand":
        """What a client would have with one more request."""
        length = self._expect(route)
        return _Demand(self._held.load(client, 1), length, self.usage.load(client, length))

    def _find_greediest(self, demand: "_Demand") -> _Job | None:
        """The newest waiting request of the client that demands most, of those that exceed a demand."""
        now, newest = self._clock(), dict[tuple[Client, str], _Job]()
        for job in reversed(self._waiting):
            newest.setdefault((job.client, job.route), job)
        demands = {
            job: _Demand(held, self._expect(job.route), self.usage.load(job.client, now=now))
            for job in newest.values()
            if (held := self._held.load(job.client)) >= demand.requests
        }
        jobs = [job for job in demands if demands[job].exceeds(demand)]
        return max(jobs, key=demands.__getitem__, default=None)

    def _refusal(self, client: Client) -> ProblemError:
        """Why a client is refused: it has its share of the queue, or uses more time than others, or there are many."""
        clients = {client, *(job.client for job in (*self._waiting, *self._running))}
        now = self._clock()
        share = sum(self.usage.load(other, now=now) for other in clients) / len(clients)
        many = self._held.load(client) >= max(1.0, self.capacity / len(clients))
        if many or self.usage.load(client, now=now) > MORE * share:
            return ProblemError(problems.SHARE_TAKEN)
        return ProblemError(problems.BUSY)

    async def run(self, job: _Job, receive: Receive, work: Callable[[], _T]) -> _T:
        """Run work in a thread in the client's turn.

        Args:
            job: what `admission` yielded.
            receive: ASGI's channel, which tells that the client disconnects.
            work: on a disconnect it is dropped while it waits; while it runs, it stops at its next
                call of anyio.from_thread.check_cancelled.

        Raises:
            ClientDisconnect: the client disconnected.
            ProblemError: 429 or 503, the queue has filled meanwhile.
        """
        return await _run_unless_disconnected(receive, lambda: self._run_in_turn(job, work))

    async def _run_in_turn(self, job: _Job, work: Callable[[], _T]) -> _T:
        self._waiting.append(job)
        self._start_jobs()
        try:
            await job.turn.wait()
            if job.evicted:
                taken = ProblemError(problems.SHARE_TAKEN, "The queue is full, and others use less.")
                raise taken if job.had_more else ProblemError(problems.BUSY)
            return await to_thread.run_sync(partial(_measure, job, work), limiter=self._threads)
        finally:
            self._finish(job)

    def _finish(self, job: _Job) -> None:
        if job in self._waiting:
            self._waiting.remove(job)
        if job.started:
            self._running.remove(job)
            self._note(job)
            if self._is_long(job):
                self._pause_long_jobs(job, job.began, self._clock() - job.began)
            self._start_jobs()

    def _note(self, job: _Job) -> None:
        """Learn and charge what a request took."""
        self._last[job.client] = self._clock()
        if job.seconds is None:
            return
        if job.succeeded:  # others, as with a damaged photo, say nothing of the next
            before = self._expected.get(job.route, job.seconds)
            self._expected[job.route] = before + _LEARNING_RATE * (job.seconds - before)
        if self._charge:
            self._charge(job.client, job.seconds)

    def _start_jobs(self) -> None:
        while job := self._next_job():
            self._waiting.remove(job)
            self._running.append(job)
            job.started = True
            self._last[job.client] = job.began = self._clock()
            if self._is_long(job):
                self._pause_long_jobs(job, max(job.began, self._long_from), self._expect(job.route))
            job.turn.set()

    def _next_job(self) -> _Job | None:
        """The waiting request that may begin, of the client that used least, of the long ones or of the short ones."""
        now, free = self._clock(), self.workers - len(self._running)
        spare = self._spare if any(map(self._is_long, self._running)) else 0
        short = [job for job in self._waiting if not self._is_long(job)] if free + spare > 0 else []
        rests = free <= 0 or (short and now < self._long_from)
        long = [] if rests else [job for job in self._waiting if self._is_long(job)]
        return min(long or short, key=lambda job: self.usage.load(job.client, now=now), default=None)

    def _is_long(self, job: _Job) -> bool:
        """Whether a request takes longer than _LONG_SECONDS, or on a slow machine than those that are to be short."""
        return self._expect(job.route) > max([_LONG_SECONDS, *map(self._expect, self._short)])

    def _pause_long_jobs(self, job: _Job, began: float, seconds: float) -> None:
        """Set when the next long request may begin while short ones wait.

        Args:
            job: a long one.
            began: the clock's time.
            seconds: for which it has a thread.
        """
        long = {job.client, *(other.client for other in self._waiting if self._is_long(other))}
        since = self._clock() - _RECENT_SECONDS
        self._last = {client: last for client, last in self._last.items() if last > since}
        clients = self._last.keys() | long | {other.client for other in self._waiting}
        self._long_from = max(self._long_from, began + seconds * len(clients) / (len(long) * self.workers))

    def _expect(self, route: str) -> float:
        return self._expected.get(route, _FIRST_SECONDS)


def _measure(job: _Job, work: Callable[[], _T]) -> _T:
    """Do the work, and note its processor time, whether it succeeds or not."""
    began = runtime.thread_seconds()
    try:
        result = work()
        job.succeeded = True
        return result
    finally:
        job.seconds = runtime.thread_seconds() - began


async def _run_unless_disconnected(receive: Receive, work: Callable[[], Awaitable[_T]]) -> _T:
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

"""Worker processes that share a list of items; a worker that dies is replaced."""

import os
import signal
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from typing import Generic, TypeVar

from lighting.errors import BatchError
from lighting.processes import ONE_THREAD

Result = TypeVar("Result")
Work = Callable[[str], Result]

PATIENCE = 5.0  # seconds that workers have to finish their item when the batch ends

_AHEAD = 2  # items that a worker holds, so that it never waits for the next one
_ATTEMPTS = 2  # workers that an item may kill before it is given up
_READY = "ready"


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    items: deque[str] = field(default_factory=deque)  # the item in work and the next ones; empty until it is prepared


@dataclass
class _Share(Generic[Result]):
    """The items still to do, those to retry, how many workers each has killed, and the workers."""

    items: Iterator[str]
    prepare: Callable[[], Work[Result]]
    again: deque[str] = field(default_factory=deque)
    losses: Counter[str | None] = field(default_factory=Counter)  # None before a worker was prepared
    team: list[_Worker] = field(default_factory=list)


def work_through(
    items: Iterable[str], prepare: Callable[[], Work[Result]], workers: int
) -> Iterator[tuple[str, Result | None]]:
    """Each item with its result, in the order in which they are finished, each exactly once.

    Every process calls `prepare` once, and calls the function that it returns for each item; `prepare` and the results
    are pickled. An item whose process dies is retried in a new process; if that dies too, its result is None. An
    exception in a worker ends the batch and is raised here. Raises BatchError if two processes die while they start.
    """
    share = _Share(iter(items), prepare)
    try:
        share.team += [_start(prepare) for _ in range(workers)]
        while share.team:
            for connection in wait([worker.connection for worker in share.team]):
                worker = next(w for w in share.team if w.connection is connection)
                yield from _heard(worker, share)
    finally:
        _dismiss(share.team)


def _heard(worker: _Worker, share: _Share[Result]) -> Iterator[tuple[str, Result | None]]:
    """The worker's finished item with its result. The worker gets its next items, or is replaced if it died."""
    try:
        answer = worker.connection.recv()
    except (EOFError, OSError):
        yield from _bury(worker, share)
        return
    if isinstance(answer, Exception):
        raise answer
    item = worker.items.popleft() if worker.items else None
    _give(worker, share)
    if item is not None:
        yield item, answer


def _give(worker: _Worker, share: _Share[Result]) -> None:
    """Send the worker its next items, or dismiss it if none are left. A dead worker is noticed by `_heard`."""
    while len(worker.items) < _AHEAD:
        item = share.again.popleft() if share.again else next(share.items, None)
        if item is None:
            break
        worker.items.append(item)
        with suppress(OSError):
            worker.connection.send(item)
    if not worker.items:
        share.team.remove(worker)
        _dismiss([worker])


def _bury(worker: _Worker, share: _Share[Result]) -> Iterator[tuple[str, None]]:
    """Replace a worker that died; the items that it had not begun are retried."""
    share.team.remove(worker)
    _dismiss([worker])
    item = worker.items.popleft() if worker.items else None
    share.again += worker.items
    share.losses[item] += 1
    blamed = share.losses[item] >= _ATTEMPTS
    if item is None and blamed:
        raise BatchError(f"A worker process died while it started (exit status {worker.process.exitcode}).")
    share.team.append(_start(share.prepare))
    if item is None:
        return
    if blamed:
        yield item, None
    else:
        share.again.append(item)


def _start(prepare: Callable[[], Work[Result]]) -> _Worker:
    context = get_context("spawn")  # the same on every system, and safe in a process with threads
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, prepare), daemon=True)
    with _interrupts_held():
        process.start()
    theirs.close()
    return _Worker(process, ours)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C waits while a process starts, which inherits that: one that imports would end with a traceback.

    The mask is inherited but holds for one thread alone: Ctrl-C that reaches another, one of numpy's, is kept back.
    """
    if sys.platform == "win32":
        yield
        return
    with _interrupts_kept_back():
        ensure_running()  # the first process would start it, and with that let Ctrl-C through again
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _interrupts_kept_back() -> Iterator[None]:
    """Ctrl-C in the block, whichever thread gets it, comes after the block; only the main thread can do that."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or before is None:
        yield
        return
    caught: list[int] = []
    signal.signal(signal.SIGINT, lambda number, _: caught.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if caught:
        signal.raise_signal(signal.SIGINT)


def _dismiss(team: list[_Worker]) -> None:
    """Close the connections, upon which workers exit after their current item; kill those that take too long."""
    for worker in team:
        worker.connection.close()
    for worker in team:
        worker.process.join(PATIENCE)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


def _serve(connection: Connection, prepare: Callable[[], Work[Result]]) -> None:
    """What a worker process runs. It ignores Ctrl-C, which its parent process handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(ONE_THREAD)
    try:
        answer: object = _READY
        work = prepare()
        while True:
            connection.send(answer)
            answer = work(connection.recv())
    except (EOFError, ConnectionError):
        return
    except Exception as error:
        with suppress(OSError):  # the parent process may have ended
            connection.send(error)

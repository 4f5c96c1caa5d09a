"""Worker processes on one machine.

The output folder holds `batch.json`, the settings; `lighting.jsonl`, one line per photo in the order in which they were
finished; and, if maps are asked for, `NAME.exr` under each photo's own relative name. The same batch started again
resumes an interrupted one and retries the photos that failed.
"""

import errno
import json
import os
import signal
import sys
import threading
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import Generic, TypeVar

from lighting.batch.job import (
    SETTINGS,
    BatchJob,
    MapOptions,
    PhotoLight,
    check_settings,
    estimate_or_error,
    job_settings,
    load_worker_estimator,
    write_photo_map,
)
from lighting.batch.results import JOURNAL, TABLE, Journal, check_table, has_lights, open_journal
from lighting.errors import BatchError, EnvironmentMapError
from lighting.files.atomic import atomic_write, stale_temporaries
from lighting.records import json_line
from lighting.runtime import ONE_THREAD

# Worker processes that share a list of items; a worker that dies is replaced.

Result = TypeVar("Result")
Work = Callable[[str], Result]

EXIT_SECONDS = 5.0  # seconds that workers have to finish their item when the batch ends

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


def _map_in_processes(
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
                yield from _on_result(worker, share)
    finally:
        _dismiss(share.team)


def _on_result(worker: _Worker, share: _Share[Result]) -> Iterator[tuple[str, Result | None]]:
    """The worker's finished item with its result. The worker gets its next items, or is replaced if it died."""
    try:
        answer = worker.connection.recv()
    except (EOFError, OSError):
        yield from _on_worker_death(worker, share)
        return
    if isinstance(answer, Exception):
        raise answer
    item = worker.items.popleft() if worker.items else None
    _assign(worker, share)
    if item is not None:
        yield item, answer


def _assign(worker: _Worker, share: _Share[Result]) -> None:
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


def _on_worker_death(worker: _Worker, share: _Share[Result]) -> Iterator[tuple[str, None]]:
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
        worker.process.join(EXIT_SECONDS)
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


# A batch on one machine, in a process per CPU.

WORKER_DIED = "The process that worked on this photo ended, twice."
MAP_NAME_ERRORS = {  # why the system takes no map of a photo's name, where that is so of this photo alone
    errno.ENAMETOOLONG: "The photo's name is too long for a map of that name.",
    errno.EISDIR: "A folder in the results has the name of the photo's map.",
}


@contextmanager
def open_batch(job: BatchJob, *, overwrite: bool = False) -> Iterator[Journal]:
    """The journal of a job, with the results of an interrupted run; `overwrite` discards them.

    Raises BatchError if the folder holds results of another job that are not discarded (or of Ray, which never are), or
    is a file, or another process is writing to it.
    """
    out = Path(job.out)
    if out.exists() and not out.is_dir():
        raise BatchError(f"{job.out} is a file; the results need a folder.")
    if overwrite:
        check_table(out)
    out.mkdir(parents=True, exist_ok=True)
    asked = job_settings(job)
    if not overwrite:
        found = out / SETTINGS
        check_settings(found.read_bytes() if found.exists() else None, asked, _has_results(out), job.out)
    with open_journal(out / JOURNAL) as journal:
        if overwrite:
            journal.clear()
            (out / TABLE).unlink(missing_ok=True)
        with atomic_write(out / SETTINGS) as path:
            path.write_text(json.dumps(asked, indent=2) + "\n")
        yield journal


def _has_results(out: Path) -> bool:
    """Whether a folder holds the light of a photo, by either engine, or, without settings, any line."""
    journal, parts = out / JOURNAL, out / TABLE
    if parts.is_dir() and any(parts.iterdir()):
        return True
    if not journal.exists():
        return False
    with journal.open("rb") as lines:
        return has_lights(lines) if (out / SETTINGS).exists() else any(lines)


def run_pool(job: BatchJob, names: Sequence[str], journal: Journal, workers: int) -> Iterator[str]:
    """Process the photos that are not in the journal, in `workers` processes; yields the name of each finished one."""
    missing = [name for name in names if name not in journal.done]
    _tidy(job, missing)
    for name, result in _map_in_processes(missing, partial(_prepare, job), min(workers, len(missing))):
        line, failed = result or (json_line(name, WORKER_DIED), True)
        journal.append(name, line, failed=failed)
        yield name


def _tidy(job: BatchJob, names: Sequence[str]) -> None:
    """Remove what killed runs left unfinished under temporary names: the batch that holds the journal is alone here."""
    files = {Path(job.out, name) for name in (SETTINGS, JOURNAL, TABLE)}
    folders = {name.rpartition("/")[0] for name in names} if job.maps else set()
    maps = {Path(job.out, folder, "map.exr") for folder in folders}
    own = (file for file in files | maps if not file.is_symlink())  # a link may lead to where others write
    for path in (left for file in own for left in stale_temporaries(file)):
        path.unlink(missing_ok=True)


def _prepare(job: BatchJob) -> Callable[[str], tuple[str, bool]]:
    """Load the network; returns a function from a photo's name to its line of JSON and whether the photo failed."""
    estimator, given = load_worker_estimator(job)

    def work(name: str) -> tuple[str, bool]:
        answer = estimate_or_error(estimator, Path(job.source, name), given, job.maps)
        if isinstance(answer, str):
            return json_line(name, answer), True
        if job.maps and (objection := _write_map(Path(job.out, f"{name}.exr"), answer, job.maps)):
            return json_line(name, objection), True
        return json_line(name, answer.lighting), False

    return work


def _write_map(path: Path, answer: PhotoLight, maps: MapOptions) -> str | None:
    """Write a map, or say why the system takes none of that name; raises EnvironmentMapError for other failures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        write_photo_map(path, answer, maps)
    except EnvironmentMapError as error:
        if isinstance(error.__cause__, OSError) and error.__cause__.errno in MAP_NAME_ERRORS:
            return MAP_NAME_ERRORS[error.__cause__.errno]
        raise
    return None

"""A batch on one machine, in a process per CPU.

The output folder holds the settings in `batch.json`. `lighting.jsonl` has one line per photo, in the order in which
they were finished. If maps are asked for, each is `NAME.exr` under its photo's own relative name. The same batch
started again resumes an interrupted one and retries the photos that failed.
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
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from multiprocessing.resource_tracker import ensure_running
from pathlib import Path
from typing import TypeVar

from lighting.batch import job as jobs
from lighting.batch.results import JOURNAL, SETTINGS, TABLE, Journal, check_table, has_lights, open_journal
from lighting.errors import BatchError, EnvironmentMapError
from lighting.files import escape_undecodable, is_own_map, stale_temporaries, write_file
from lighting.record_json import json_line
from lighting.runtime import ONE_BLAS_THREAD, ONE_THREAD, keep_memory
from lighting.tracing import Step, listen_to_steps, report_step

Result = TypeVar("Result")
Work = Callable[[str], Result]

EXIT_SECONDS = 5.0  # seconds that workers have to finish their item when the batch ends

WORKER_DIED = "The process that worked on this photo ended, twice."
MAP_NAME_ERRORS = {  # why the system takes no map of a photo's name, where that is so of this photo alone
    errno.ENAMETOOLONG: "The photo's name is too long for a map of that name.",
    errno.EISDIR: "A folder in the results has the name of the photo's map.",
}

FOREIGN_MAP = "A file in the results has the name of the photo's map, and is none."

_ATTEMPTS = 2  # workers that an item may kill before it is given up
_READY = "ready"
_STALE_SECONDS = 3600.0  # since a temporary file was last written to


@contextmanager
def open_batch(job: jobs.BatchJob, *, overwrite: bool = False) -> Iterator[Journal]:
    """Open the journal of a job, with the results of an interrupted run.

    Args:
        job: the batch.
        overwrite: discard those results.

    Raises:
        BatchError: the folder holds results of another job that are not discarded, or of Ray, which never are; or it
            is a file, or another process writes to it.
    """
    out = Path(job.out)
    if out.exists() and not out.is_dir():
        raise BatchError(f"{job.out} is a file; the results need a folder.")
    if overwrite:
        check_table(out)
    out.mkdir(parents=True, exist_ok=True)
    settings, file = jobs.job_settings(job), out / SETTINGS
    if not overwrite:
        jobs.check_settings(file.read_bytes() if file.exists() else None, settings, _has_results(out), job.out)
    with open_journal(out / JOURNAL) as journal:
        if overwrite:
            journal.clear()
            (out / TABLE).unlink(missing_ok=True)
        write_file(file, (json.dumps(settings, indent=2) + "\n").encode())
        yield journal


def _has_results(out: Path) -> bool:
    """Whether a folder holds the light of a photo, by either engine, or, without settings, any line or table."""
    journal, parts = out / JOURNAL, out / TABLE
    if (parts.is_dir() and any(parts.iterdir())) or (parts.is_file() and not (out / SETTINGS).exists()):
        return True
    if not journal.exists():
        return False
    with journal.open("rb") as lines:
        return has_lights(lines) if (out / SETTINGS).exists() else any(lines)


def run_pool(job: jobs.BatchJob, names: Sequence[str], journal: Journal, workers: int) -> Iterator[str]:
    """Process the photos that are not in the journal; yields the name of each finished one.

    Args:
        job: the batch.
        names: of photos, relative to its folder.
        journal: open.
        workers: number of processes.
    """
    missing = [name for name in names if escape_undecodable(name) not in journal.names]
    _remove_temporaries(job, missing)
    for name, result in _map_in_processes(missing, partial(_prepare, job), min(workers, len(missing))):
        written = escape_undecodable(name)
        line, failed, steps = result or (json_line(written, WORKER_DIED), True, [])
        for step in steps:
            report_step(step)
        journal.append(written, line, failed=failed)
        yield name


def _remove_temporaries(job: jobs.BatchJob, names: Sequence[str]) -> None:
    """Remove what killed runs left unfinished under temporary names, unless a running command may be writing it."""
    files = {Path(job.out, name) for name in (SETTINGS, JOURNAL, TABLE)}
    folders = {name.rpartition("/")[0] for name in names} if job.maps else set()
    maps = {Path(job.out, folder, job.maps.file_name("map")) for folder in folders} if job.maps else set()
    targets = (file for file in files | maps if not file.is_symlink())  # a link may lead to where others write
    now = Path(job.out, SETTINGS).stat().st_mtime  # just written; by the clock that gave the others their times
    for path in (temporary for file in targets for temporary in stale_temporaries(file)):
        with suppress(FileNotFoundError):  # its command has ended
            if path.lstat().st_mtime < now - _STALE_SECONDS:
                path.unlink()


def _prepare(job: jobs.BatchJob) -> Callable[[str], tuple[str, bool, list[Step]]]:
    """Load the network; returns a function from a photo's name to its line of JSON, whether it failed, and steps."""
    estimator = jobs.load_worker_estimator(job)

    def work(name: str) -> tuple[str, bool]:
        answer = jobs.estimate_or_error(estimator, Path(job.source, name), job, name=name)
        written = escape_undecodable(name)
        if isinstance(answer, str):
            return json_line(written, escape_undecodable(answer)), True
        if job.maps and (sentence := _write_map(Path(job.out, job.maps.file_name(name)), answer, job.maps)):
            return json_line(written, sentence), True
        return json_line(written, answer.lighting, answer.probe, crop=answer.crop), False

    def timed(name: str) -> tuple[str, bool, list[Step]]:
        steps: list[Step] = []
        with listen_to_steps(steps.append):
            return *work(name), steps

    return timed


def _write_map(path: Path, answer: jobs.PhotoLight, maps: jobs.MapOutput) -> str | None:
    """Write a map, or say why there can be none of that name; raises EnvironmentMapError for other failures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        if path.is_file() and not is_own_map(path.open("rb")):
            return FOREIGN_MAP
        assert answer.rendered is not None
        answer.rendered.write(path, maps.file)
    except (EnvironmentMapError, OSError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if isinstance(cause, OSError) and cause.errno in MAP_NAME_ERRORS:
            return MAP_NAME_ERRORS[cause.errno]
        raise
    return None


@dataclass
class _Worker:
    process: BaseProcess
    connection: Connection
    item: str | None = None  # in work; None until it is prepared


def _map_in_processes(
    items: Iterable[str], prepare: Callable[[], Work[Result]], workers: int
) -> Iterator[tuple[str, Result | None]]:
    """Each item with its result, in the order in which they are finished, each exactly once.

    Every process calls `prepare` once, and calls the function that it returns for each item; `prepare` and the results
    are pickled. An item whose process dies is retried in a new process; if that dies too, its result is None. An
    exception in a worker ends the batch and is raised here. Raises BatchError if two processes die while they start.
    """
    todo, running = deque(items), list[_Worker]()
    deaths = Counter[str | None]()  # of workers, by the item that they worked on; None before they were prepared
    try:
        running += [_start(prepare) for _ in range(workers)]
        while running:
            for connection in wait([worker.connection for worker in running]):
                worker = next(w for w in running if w.connection is connection)
                item = worker.item
                try:
                    answer, died = worker.connection.recv(), False
                except (EOFError, OSError):
                    answer, died = None, True
                if isinstance(answer, Exception):
                    raise answer
                if died or not _assign(worker, todo):
                    running.remove(worker)
                    _dismiss([worker])
                if died:
                    deaths[item] += 1
                    if item is None and deaths[item] == _ATTEMPTS:
                        status = worker.process.exitcode
                        raise BatchError(f"A worker process died while it started (exit status {status}).")
                    running.append(_start(prepare))
                if died and item is not None and deaths[item] < _ATTEMPTS:
                    todo.appendleft(item)
                elif item is not None:
                    yield item, answer
    finally:
        _dismiss(running)


def _assign(worker: _Worker, todo: deque[str]) -> bool:
    """Send the worker its next item; False if none is left. That it died is noticed when its answer is read."""
    worker.item = todo.popleft() if todo else None
    if worker.item is None:
        return False
    with suppress(OSError):
        worker.connection.send(worker.item)
    return True


def _start(prepare: Callable[[], Work[Result]]) -> _Worker:
    context = get_context("spawn")  # the same on every system, and safe in a process with threads
    parent_end, worker_end = context.Pipe()
    process = context.Process(target=_serve, args=(worker_end, prepare), daemon=True)
    with _block_interrupts():
        process.start()
    worker_end.close()
    return _Worker(process, parent_end)


@contextmanager
def _block_interrupts() -> Iterator[None]:
    """Ctrl-C waits while a process starts, which inherits that: one that imports would end with a traceback.

    The mask is inherited but holds for one thread alone: Ctrl-C that reaches another, one of numpy's, is kept back.
    """
    if sys.platform == "win32":
        yield
        return
    with _defer_interrupts():
        ensure_running()  # the first process would start it, and with that let Ctrl-C through again
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            yield
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _defer_interrupts() -> Iterator[None]:
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


def _dismiss(workers: list[_Worker]) -> None:
    """Close the connections, upon which workers exit after their current item; kill those that take too long."""
    for worker in workers:
        worker.connection.close()
    for worker in workers:
        worker.process.join(EXIT_SECONDS)
        if worker.process.is_alive():
            worker.process.kill()
            worker.process.join()


def _serve(connection: Connection, prepare: Callable[[], Work[Result]]) -> None:
    """What a worker process runs. It ignores Ctrl-C, which its parent process handles."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.environ.update(ONE_THREAD)
    keep_memory()
    try:
        with ONE_BLAS_THREAD:  # once for all photos: each time costs a search among the libraries of the process
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

"""Jobs: one at a time, in turn by client, each in a process of its own within bounds of time and disk.

On disk they are a table in SQLite that survives a restart, and a folder for each job.
"""

import json
import logging
import secrets
import shutil
import sqlite3
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from subprocess import Popen
from typing import IO

from anyio import CancelScope, Event, get_cancelled_exc_class, move_on_after, sleep, to_thread

from lighting.records import Json
from lighting.runtime import process_seconds, start_python
from server.job_kinds import RESULT_FILE
from server.limits import BusyError, Client, ShareTakenError, Tally
from server.settings import PREFIX, SettingsError
from server.tracing import JobSpan, RequestTracer

RESULT_SECONDS = 86_400.0  # for which a job's result is kept
_CLIENT_PARTS = 4  # one client may have the fourth part of the places
_MAX_ATTEMPTS = 2  # a job that was twice at work when the service died is not tried again
_TABLE_FILE, _LOCK_FILE = "jobs.sqlite", "lock"
_COLUMNS = "id, client, request, state, created, ended, attempts, error, code, warnings"
_CREATE = f"CREATE TABLE IF NOT EXISTS jobs ({_COLUMNS}, PRIMARY KEY (id))"


class JobState(StrEnum):
    """Where a job is on its way."""

    QUEUED = "queued"
    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(frozen=True)
class StoredJob:
    """A row of the table."""

    id: str
    client: Client
    request: Json
    state: JobState = JobState.QUEUED
    created: float = 0.0  # s since 1970
    ended: float | None = None
    attempts: int = 0  # that began and did not end
    error: str = ""
    code: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def expires(self) -> float | None:
        """When a job that has ended is forgotten, s since 1970."""
        return None if self.ended is None else self.ended + RESULT_SECONDS


class JobStore:
    """The jobs of one service; used in the event loop's thread alone.

    Args:
        folder: exists; no other service uses it.
        places: jobs that are kept at a time, those that have ended included.

    Raises:
        SettingsError: the folder cannot be used, or another service uses it.
    """

    def __init__(self, folder: Path, places: int) -> None:
        self.folder = folder
        self.places = places
        self._arriving = Tally()
        try:
            self._lock = _lock_folder(folder)
            self._table = sqlite3.connect(folder / _TABLE_FILE, isolation_level=None, check_same_thread=False)
            self._table.execute("PRAGMA journal_mode=WAL")
            self._table.execute(_CREATE)
            self._recover()
        except (OSError, sqlite3.Error) as error:
            raise SettingsError(f"{PREFIX}JOBS_FOLDER: {folder} cannot be used: {error}.") from error

    def _recover(self) -> None:
        """Queue again what was at work, unless that happened twice; remove folders that belong to no job."""
        reason = "The service ended twice while it worked on this."
        for job in self.all_jobs():
            if job.state is JobState.RUNNING:
                if job.attempts >= _MAX_ATTEMPTS:
                    self.end(job.id, error=reason, code="failed")
                else:
                    self._set(job.id, state=JobState.QUEUED)
        known = {job.id for job in self.all_jobs()}
        for path in self.folder.iterdir():
            if path.is_dir() and path.name not in known:
                shutil.rmtree(path, ignore_errors=True)

    def close(self) -> None:
        """Let another service use the folder."""
        self._table.close()
        self._lock.close()

    @contextmanager
    def reserve_place(self, client: Client) -> Iterator[str]:
        """A place for a job whose upload arrives, and its folder; without `add` in the block, both are gone after it.

        Args:
            client: who asks.

        Yields:
            The number of the job, which nobody can guess.

        Raises:
            ShareTakenError: this client has its share of the places.
            BusyError: all places are taken.
        """
        held = Tally()
        jobs = self.all_jobs()
        for holder in (*(job.client for job in jobs), *self._arriving):
            held.add(holder, 1)
        if held.load(client, 1) > max(1, self.places // _CLIENT_PARTS):
            raise ShareTakenError("This client has its share of the jobs; delete one that has ended.")
        if len(jobs) + len(self._arriving) >= self.places:
            raise BusyError("All places for jobs are taken.")
        number = secrets.token_urlsafe(16)
        self._arriving.add(client, 1)
        self.path(number).mkdir()
        try:
            yield number
        finally:
            self._arriving.add(client, -1)
            if self.find(number) is None:
                shutil.rmtree(self.path(number), ignore_errors=True)

    def path(self, number: str) -> Path:
        """The folder of a job."""
        return self.folder / number

    def add(self, job: StoredJob) -> None:
        """Queue a job whose upload has come."""
        values = (job.id, json.dumps(job.client.groups), json.dumps(job.request), job.state, time.time())
        self._table.execute(f"INSERT INTO jobs ({_COLUMNS}) VALUES (?, ?, ?, ?, ?, NULL, 0, '', '', '[]')", values)

    def find(self, number: str) -> StoredJob | None:
        """A job; None where there is none of this number."""
        row = self._table.execute(f"SELECT {_COLUMNS} FROM jobs WHERE id = ?", (number,)).fetchone()
        return _job_of(row) if row else None

    def all_jobs(self) -> list[StoredJob]:
        """All jobs, the oldest first."""
        rows = self._table.execute(f"SELECT {_COLUMNS} FROM jobs ORDER BY created, rowid").fetchall()
        return [_job_of(row) for row in rows]

    def begin(self, job: StoredJob) -> None:
        """Note that a job is worked on, with nothing left of an earlier attempt."""
        self._set(job.id, state=JobState.RUNNING, attempts=job.attempts + 1)
        self._clean(job.id, keep=job.request["upload"])

    def requeue(self, job: StoredJob) -> None:
        """Queue a job again that a shutdown stopped, as if it had not begun."""
        self._set(job.id, state=JobState.QUEUED, attempts=job.attempts)

    def end(self, number: str, *, warnings: tuple[str, ...] = (), error: str = "", code: str = "") -> None:
        """Note that a job has ended; of its folder the result alone is kept, where it did not fail."""
        self._clean(number, keep="" if error else RESULT_FILE)
        state = JobState.FAILED if error else JobState.FINISHED
        self._set(number, state=state, ended=time.time(), warnings=json.dumps(warnings), error=error, code=code)

    def remove(self, number: str) -> None:
        """Forget a job and delete its files."""
        self._table.execute("DELETE FROM jobs WHERE id = ?", (number,))
        shutil.rmtree(self.path(number), ignore_errors=True)

    def remove_expired(self) -> None:
        """Forget the jobs that ended RESULT_SECONDS ago."""
        for job in self.all_jobs():
            if job.expires is not None and job.expires <= time.time():
                self.remove(job.id)

    def _set(self, number: str, **values: object) -> None:
        names = ", ".join(f"{name} = ?" for name in values)
        self._table.execute(f"UPDATE jobs SET {names} WHERE id = ?", (*values.values(), number))

    def _clean(self, number: str, keep: str) -> None:
        for path in self.path(number).iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path, ignore_errors=True)
            elif path.name != keep:
                with suppress(OSError):
                    path.unlink()


def _job_of(row: tuple[object, ...]) -> StoredJob:
    number, client, request, state, created, ended, attempts, error, code, warnings = row
    return StoredJob(
        str(number),
        Client(tuple(json.loads(str(client)))),
        json.loads(str(request)),
        JobState(str(state)),
        float(str(created)),
        None if ended is None else float(str(ended)),
        int(str(attempts)),
        str(error),
        str(code),
        tuple(json.loads(str(warnings))),
    )


def _lock_folder(folder: Path) -> IO[bytes]:
    """The open lock of a folder, which ends with the process; OSError if another process has it."""
    lock = (folder / _LOCK_FILE).open("wb")
    if sys.platform != "win32":
        import fcntl

        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            lock.close()
            raise OSError("another service uses it") from None
    return lock


_WORKER = "from server.job_kinds import run_worker; run_worker()"
_POLL_SECONDS = 0.25  # between two looks at the process at work
_SWEEP_SECONDS = 60.0  # between two looks for jobs that are to be forgotten
_MAX_LINE = 1 << 16  # bytes of a line that the process writes
_DISK_ERROR, _TIME_ERROR = "The job needs more disk than it may have.", "The job took longer than it may."
_CRASH_ERROR = "The job's process died: it needed too much memory, or its upload is damaged."
_INTERNAL_ERROR = "An unexpected error occurred in the job."

log = logging.getLogger(__name__)


@dataclass
class _Worker:
    """A process at work, and what it has said so far."""

    process: "Popen[bytes]"
    span: JobSpan | None  # None: the job is not traced
    progress: float = 0.0
    outcome: Json = field(default_factory=dict)
    listener: threading.Thread = field(init=False)

    def begin(self, request: Json) -> None:
        """Send the request, and listen from now on."""
        assert self.process.stdin is not None
        with suppress(BrokenPipeError), self.process.stdin as stdin:
            stdin.write(json.dumps(request).encode())
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def end(self) -> None:
        """End the process, and wait until all that it wrote is read."""
        self.process.kill()
        self.process.wait()
        self.listener.join()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def _listen(self) -> None:
        """Read what the process writes, to its end."""
        assert self.process.stdout is not None
        while line := self.process.stdout.readline(_MAX_LINE):
            try:
                content = json.loads(line)
                if "progress" in content:
                    self.progress = float(content["progress"])
                elif "step" in content:
                    self._trace(content["step"])
                else:
                    self.outcome = dict(content)
            except (ValueError, TypeError):  # of a process that somebody has taken over
                continue

    def _trace(self, step: object) -> None:
        if self.span is not None:
            self.span.add_step(step)


class JobRunner:
    """Works on the queued jobs of a store.

    Args:
        store: the jobs.
        max_bytes: of a job's folder.
        seconds: that a job may take.
        load: how much processor time a client used lately; the one with the least comes next.
        charge: is told the processor time [s] that a client's job took.
        tracer: traces jobs; None: none is traced.
    """

    def __init__(
        self,
        store: JobStore,
        max_bytes: int,
        seconds: float,
        load: Callable[[Client], float],
        charge: Callable[[Client, float], None],
        tracer: RequestTracer | None = None,
    ) -> None:
        self.store = store
        self.max_bytes = max_bytes
        self.seconds = seconds
        self._load = load
        self._charge = charge
        self._tracer = tracer
        self._current: tuple[str, _Worker] | None = None
        self._news = Event()

    def submit(self, job: StoredJob) -> None:
        """Queue a job whose upload lies in its folder."""
        self.store.add(job)
        self._news.set()

    def progress(self, job: StoredJob) -> float:
        """The part of a job that is done, 0 to 1."""
        if job.state is JobState.FINISHED:
            return 1.0
        return self._current[1].progress if self._current and self._current[0] == job.id else 0.0

    async def remove(self, number: str) -> None:
        """Stop a job, if it is at work, and forget it."""
        if self._current and self._current[0] == number:
            self._current[1].process.kill()
        self.store.remove(number)

    async def run(self) -> None:
        """Work until this is cancelled."""
        while True:
            self.store.remove_expired()
            if job := self._next():
                await self._carry_out(job)
                continue
            self._news = Event()
            with move_on_after(_SWEEP_SECONDS):
                await self._news.wait()

    def _next(self) -> StoredJob | None:
        jobs = [job for job in self.store.all_jobs() if job.state is JobState.QUEUED]
        return min(jobs, key=lambda job: self._load(job.client), default=None)

    async def _carry_out(self, job: StoredJob) -> None:
        if self._tracer is None:
            await self._run_worker(job)
            return
        waited = max(time.time() - job.created, 0.0)
        span = self._tracer.begin_job(job.request["kind"], waited, job.request.get("trace", {}))
        try:
            await self._run_worker(job, span)
        finally:
            now = self.store.find(job.id)
            span.end(now.state.value if now else "deleted", now.code if now else "")

    async def _run_worker(self, job: StoredJob, span: JobSpan | None = None) -> None:
        self.store.begin(job)
        worker = _Worker(start_python(_WORKER), span)
        self._current = job.id, worker
        folder = self.store.path(job.id).resolve()
        settings = {"folder": str(folder), "max_bytes": self.max_bytes, "traced": span is not None}
        worker.begin({**job.request, **settings})
        try:
            error = await self._watch(job.client, worker.process, folder)
        except get_cancelled_exc_class():  # the service shuts down
            self.store.requeue(job)
            raise
        finally:
            self._current = None
            with CancelScope(shield=True):
                await to_thread.run_sync(worker.end)
        if self.store.find(job.id):  # else it was deleted meanwhile
            self._end(job, worker.outcome, error)
        else:
            self.store.remove(job.id)  # what the process wrote since

    async def _watch(self, client: Client, process: "Popen[bytes]", folder: Path) -> str:
        """Wait for the end of a job's process; why it has to end, or nothing."""
        began, charged = time.monotonic(), 0.0
        while process.poll() is None:
            await sleep(_POLL_SECONDS)
            used = process_seconds(process.pid) or charged
            self._charge(client, used - charged)
            charged = used
            if time.monotonic() - began > self.seconds:
                return _TIME_ERROR
            if await to_thread.run_sync(_folder_size, folder) > self.max_bytes:
                return _DISK_ERROR
        return ""

    def _end(self, job: StoredJob, outcome: Json, error: str) -> None:
        kind = job.request["kind"]
        if "log" in outcome:
            log.error("job of kind %s failed:\n%s", kind, outcome["log"])
        if not error and "warnings" in outcome and (self.store.path(job.id) / RESULT_FILE).is_file():
            self.store.end(job.id, warnings=tuple(map(str, outcome["warnings"])))
        else:
            told = str(outcome.get("error") or (_INTERNAL_ERROR if "log" in outcome else _CRASH_ERROR))
            self.store.end(job.id, error=error or told, code=str(outcome.get("code", "failed")))
        log.info("job of kind %s %s", kind, "failed" if error or "warnings" not in outcome else "finished")


def _folder_size(folder: Path) -> int:
    """The bytes of all files in a folder, some of which may vanish meanwhile."""
    size = 0
    for path in folder.rglob("*"):
        with suppress(OSError):
            size += path.lstat().st_size
    return size

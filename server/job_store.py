"""Jobs on disk: a table in SQLite that survives a restart, and a folder for each job."""

import json
import secrets
import shutil
import sqlite3
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import IO

from lighting.records import Json
from server.identity import Client, Tally
from server.job_kinds import RESULT_FILE
from server.limits import BusyError, ShareTakenError
from server.settings import PREFIX, SettingsError

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

"""Jobs on disk: a folder for each with its record and its files, which survive a restart.

They lie in a folder of their own, `lighting-jobs`, below the operator's. In it the program deletes what it writes by
name, and says so in the log: a job's record, result and `work`, where its process makes files. All else is left alone.
"""

import json
import logging
import os
import re
import secrets
import shutil
import sqlite3
import stat
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, closing, suppress
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import IO, Annotated, Any, TypeVar

from anyio import CancelScope, CapacityLimiter, to_thread
from pydantic import Field, TypeAdapter

from lighting.errors import describe_error
from lighting.fields import Json
from server import problems
from server.job_kinds import JOB_KINDS, RESULT_FILE, UPLOAD_STEM
from server.limits import Client, Tally
from server.problems import ProblemError
from server.settings import PREFIX, SettingsError

_T = TypeVar("_T")

JOBS_FOLDER = "lighting-jobs"
RESULT_SECONDS = 86_400.0  # for which a job's result is kept
MAX_ATTEMPTS = 2  # a job that was so often at work when the service died is not tried again
_GRACE_SECONDS = 3600.0  # that a result stays after a start, whatever the clock says
_CLIENT_PARTS = 4  # one client may have the fourth part of the places
_RECORD_FILE, _PART_FILE, _LOCK_FILE, _WORK_FOLDER = "job.json", "job.json.part", "lock", "work"
_OLD_TABLE = "jobs.sqlite"  # of versions up to 0.2.0, beside whose folders it lay
_OLD_FILES = re.compile(rf"{UPLOAD_STEM}(\.[A-Za-z0-9]{{1,5}})?|photos|out|result\.part|{re.escape(RESULT_FILE)}")
_NAME = re.compile(r"[\w-]{22}", re.ASCII)  # as secrets.token_urlsafe(16) makes it
_MAX_TIME = 1e11  # s since 1970, which a date can hold with a day added

log = logging.getLogger(__name__)

_Time = Annotated[float, Field(ge=0, le=_MAX_TIME, allow_inf_nan=False)]


class JobState(StrEnum):
    """Where a job is on its way."""

    QUEUED = "queued"
    RUNNING = "running"
    FINISHED = "finished"
    FAILED = "failed"


@dataclass(frozen=True)
class StoredJob:
    """A job's record."""

    id: str
    client: Client
    request: Json  # with its `kind`, one of JOB_KINDS, and the name of its `upload`
    state: JobState = JobState.QUEUED
    created: _Time = 0.0  # s since 1970
    ended: _Time | None = None
    attempts: Annotated[int, Field(ge=0)] = 0  # that began and did not end
    error: str = ""
    code: str = ""
    warnings: tuple[str, ...] = ()

    @property
    def expires(self) -> float | None:
        """When a job that has ended is forgotten, s since 1970."""
        return None if self.ended is None else self.ended + RESULT_SECONDS


_RECORD = TypeAdapter(StoredJob)


class JobStore:
    """The jobs of one service. Its records are in memory, for the event loop's thread; a thread writes them to disk.

    Args:
        folder: of the operator; no other service uses it.
        places: jobs that are kept at a time, those that have ended included.

    Raises:
        SettingsError: the folder cannot be used, or another service uses it.
    """

    def __init__(self, folder: Path, places: int) -> None:
        self.folder = folder / JOBS_FOLDER
        self.places = places
        self._jobs: dict[str, StoredJob] = {}
        self._forget_at: dict[str, float] = {}  # of jobs that have ended, by the monotonic clock
        self._arriving: dict[str, Client] = {}
        self._unwritten: set[str] = set()  # jobs that have ended, whose record no disk took
        self._disk = CapacityLimiter(1)  # one thread: records are written in turn
        try:
            self.folder.mkdir(mode=0o700, exist_ok=True)
            self._lock = _lock_folder(self.folder)
            if (folder / _OLD_TABLE).is_file():
                with _lock_folder(folder):
                    _take_over(folder, self.folder)
            for path in sorted(self.folder.iterdir()):
                self._load(path)
        except OSError as error:
            raise SettingsError(f"{PREFIX}JOBS_FOLDER: {folder} cannot be used: {describe_error(error)}") from error

    def _load(self, path: Path) -> None:
        """Take a job into memory; queue it again if it was at work, unless that happened too often."""
        if path.name == _LOCK_FILE:
            return
        try:
            if not _NAME.fullmatch(path.name) or path.is_symlink():
                raise ValueError("it is none of a job's.")
            if set(_list_names(path)) <= {_WORK_FOLDER, _PART_FILE}:
                _delete_job(path, "its upload had not come")
                return
            job = _check_job(_RECORD.validate_json((path / _RECORD_FILE).read_bytes()), path.name)
            if job.state is JobState.RUNNING and job.attempts < MAX_ATTEMPTS:
                job = replace(job, state=JobState.QUEUED)
            elif job.state is JobState.RUNNING:
                reason = "The service ended twice while it worked on this."
                job = replace(job, state=JobState.FAILED, ended=time.time(), error=reason, code="failed")
                _end_job(path, job)
            self._keep(job)
        except (OSError, ValueError) as error:
            log.warning("%s is left alone: %s", path, _in_one_line(error))

    def close(self) -> None:
        """Let another service use the folder."""
        self._lock.close()

    def path(self, number: str) -> Path:
        """The folder of a job."""
        return self.folder / number

    def work_folder(self, number: str) -> Path:
        """The folder in which a job's process works, with its upload."""
        return self.path(number) / _WORK_FOLDER

    def find(self, number: str) -> StoredJob | None:
        """A job; None where there is none of this number."""
        return self._jobs.get(number)

    def all_jobs(self) -> list[StoredJob]:
        """All jobs, the oldest first."""
        return sorted(self._jobs.values(), key=lambda job: job.created)

    @asynccontextmanager
    async def reserve_place(self, client: Client) -> AsyncIterator[str]:
        """A folder for a job whose upload arrives; without `add` in the block, it is gone after it.

        Args:
            client: who asks.

        Yields:
            The number of the job, which nobody can guess.

        Raises:
            ProblemError: 429, this client has its share of the places; 503, all are taken.
            OSError: the disk takes no more.
        """
        number = secrets.token_urlsafe(16)
        await self.sweep()
        self._find_yielding(client)
        self._arriving[number] = client
        try:
            await self._on_disk(_make_job, self.path(number))
            yield number
        finally:
            self._arriving.pop(number, None)
            if number not in self._jobs:
                with CancelScope(shield=True):
                    await self._delete(number, "it was not submitted")

    async def add(self, job: StoredJob) -> None:
        """Queue a job whose upload has come; others give way to it. Raises as `reserve_place`."""
        job = replace(job, created=time.time())
        await self._on_disk(_write_record, self.path(job.id), job)
        del self._arriving[job.id]
        yielding = []
        while other := self._find_yielding(job.client):
            yielding.append(self._jobs.pop(other.id))
        self._keep(job)
        for other in yielding:
            await self._delete(other.id, "it gave way to another client's")

    def _find_yielding(self, client: Client) -> StoredJob | None:
        """The job that gives way to a new one; None where a place is free. Raises as `reserve_place`.

        Of one client those that failed give way. Of all, those do first, then those that finished, then the newest that
        waits; each time of the client with most. None waits in vain for a client that has as many.
        """
        jobs, held = self.all_jobs(), Tally()
        for holder in (*(job.client for job in jobs), *self._arriving.values()):
            held.add(holder, 1)
        mine = held.load(client, 1)
        failed = [job for job in jobs if job.state is JobState.FAILED]
        if mine > max(1, self.places // _CLIENT_PARTS):
            failed = [job for job in failed if not set(job.client.groups).isdisjoint(client.groups)]
            if not failed:
                detail = "This client has its share of the jobs; delete one that has ended."
                raise ProblemError(problems.SHARE_TAKEN, detail)
        elif len(jobs) < self.places:
            return None
        waiting = [j for j in reversed(jobs) if j.state is JobState.QUEUED and held.load(j.client) > mine]
        candidates = failed or [job for job in jobs if job.state is JobState.FINISHED] or waiting
        if not candidates:
            raise ProblemError(problems.BUSY, "All places for jobs are taken.")
        return max(candidates, key=lambda job: held.load(job.client))

    async def begin(self, job: StoredJob) -> StoredJob | None:
        """Note that a job is worked on, with nothing left of an earlier attempt.

        Returns None if it was deleted meanwhile, or has failed since its files are gone. Raises OSError.
        """
        begun = replace(job, state=JobState.RUNNING, attempts=job.attempts + 1)
        try:
            await self._on_disk(_begin_job, self.path(job.id), begun)
        except FileNotFoundError:
            await self.end(job.id, error="The job's files are gone.", code="failed")
            return None
        return self._keep(begun) if job.id in self._jobs else None

    async def requeue(self, job: StoredJob) -> None:
        """Queue a job again, as it was before it began."""
        if job.id in self._jobs:
            self._keep(job)
            with suppress(FileNotFoundError):
                await self._on_disk(_write_record, self.path(job.id), job)

    async def take_result(self, number: str) -> bool:
        """Take the result out of the folder of a job's process; whether there is one."""
        return await self._on_disk(_take_result, self.path(number))

    async def end(self, number: str, *, warnings: tuple[str, ...] = (), error: str = "", code: str = "") -> None:
        """Note that a job has ended; of its files the result alone is kept. Raises OSError."""
        if job := self._jobs.get(number):
            state = JobState.FAILED if error else JobState.FINISHED
            await self._write_ended(
                replace(job, state=state, ended=time.time(), warnings=warnings, error=error, code=code)
            )
        else:
            await self._delete(number, "it was deleted while it was at work")

    async def remove(self, number: str, reason: str) -> None:
        """Forget a job and delete its files.

        Args:
            number: of the job.
            reason: for the log.
        """
        self._jobs.pop(number, None)
        await self._delete(number, reason)

    async def sweep(self) -> None:
        """Forget jobs whose result was kept long enough, and those whose folder somebody removed. Raises OSError."""
        now = time.monotonic()
        for number, until in list(self._forget_at.items()):
            if number not in self._jobs:
                del self._forget_at[number]
            elif until <= now:
                await self.remove(number, "its result was kept for a day")
        known = list(self._jobs)
        present = set(await self._on_disk(_list_names, self.folder))
        for number in known:
            if number not in present:
                self._forget_removed(number)
        for number in list(self._unwritten):
            self._unwritten.remove(number)
            if job := self._jobs.get(number):
                await self._write_ended(job)

    async def _write_ended(self, job: StoredJob) -> None:
        """Write the record of a job that has ended; where the disk takes none, memory holds it until a later sweep."""
        try:
            await self._on_disk(_end_job, self.path(job.id), job)
        except FileNotFoundError:
            self._forget_removed(job.id)
        except OSError:
            self._unwritten.add(job.id)
            raise
        finally:
            if job.id in self._jobs:
                self._keep(job)

    def _forget_removed(self, number: str) -> None:
        if self._jobs.pop(number, None):
            log.warning("job %s is forgotten: somebody removed its folder", number)

    async def _delete(self, number: str, reason: str) -> None:
        await self._on_disk(_delete_job, self.path(number), reason)

    async def _on_disk(self, work: Callable[..., _T], *arguments: Any) -> _T:
        """What the disk's thread does; the event loop never waits for a disk."""
        return await to_thread.run_sync(work, *arguments, limiter=self._disk)

    def _keep(self, job: StoredJob) -> StoredJob:
        """Hold a record in memory.

        A result's day is counted by a clock that nobody sets. After a start the clock on the wall says how much of it
        is left, and may shorten it to _GRACE_SECONDS.
        """
        self._jobs[job.id] = job
        if job.expires is not None and job.id not in self._forget_at:
            left = min(job.expires - time.time(), RESULT_SECONDS)
            self._forget_at[job.id] = time.monotonic() + max(left, _GRACE_SECONDS)
        return job


def _check_job(job: StoredJob, name: str) -> StoredJob:
    """A record of this folder; ValueError for another's, and for one that no version wrote."""
    request = job.request
    if job.id != name or not _NAME.fullmatch(name) or not job.client.groups:
        raise ValueError("its record is another's.")
    if request.get("kind") not in JOB_KINDS or not _OLD_FILES.fullmatch(str(request.get("upload"))):
        raise ValueError("its record says no work.")
    if (job.ended is None) is (job.state in (JobState.FINISHED, JobState.FAILED)):
        raise ValueError("its record contradicts itself.")
    return job


def _list_names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()] if folder.exists() else []


def _make_job(path: Path) -> None:
    path.parent.mkdir(mode=0o700, exist_ok=True)  # somebody may have removed it
    (path / _WORK_FOLDER).mkdir(parents=True)


def _begin_job(path: Path, job: StoredJob) -> None:
    """Clear a job's folder of all but its upload, and write its record."""
    upload = path / _WORK_FOLDER / job.request["upload"]
    upload.stat()  # which raises where it is gone
    for other in upload.parent.iterdir():
        if other.name != upload.name:
            _remove_tree(other)
    _write_record(path, job)


def _take_result(path: Path) -> bool:
    result = path / _WORK_FOLDER / RESULT_FILE
    try:
        regular = stat.S_ISREG(result.lstat().st_mode)  # a link would lead whoever reads it out of the folder
    except FileNotFoundError:
        return False
    if regular:
        result.replace(path / RESULT_FILE)
    return regular


def _end_job(path: Path, job: StoredJob) -> None:
    """Delete what a job worked with, and write its record."""
    _remove_tree(path / _WORK_FOLDER)
    _write_record(path, job)


def _write_record(path: Path, job: StoredJob) -> None:
    part = path / _PART_FILE
    with part.open("wb") as file:
        file.write(_RECORD.dump_json(job))
        file.flush()
        os.fsync(file.fileno())
    part.replace(path / _RECORD_FILE)


def _delete_job(path: Path, reason: str) -> None:
    """Delete what the program writes into a job's folder, and the folder unless somebody else put something there."""
    if not path.is_dir():
        return
    try:
        _remove_tree(path / _WORK_FOLDER)
        for name in (RESULT_FILE, _PART_FILE, _RECORD_FILE):
            (path / name).unlink(missing_ok=True)
        path.rmdir()
        log.info("removed job %s: %s", path.name, reason)
    except OSError as error:
        log.warning("%s is not removed: %s", path, describe_error(error))


def _remove_tree(path: Path) -> None:
    """Delete a file, a link, or a folder with all in it, also where its process took the rights to it away."""
    if path.is_symlink() or not path.is_dir():
        path.unlink(missing_ok=True)
        return
    path.chmod(0o700)
    for parent, folders, _ in os.walk(path):  # which enters a folder after the block, and no link
        for folder in (Path(parent, name) for name in folders):
            if not folder.is_symlink():
                folder.chmod(0o700)
    shutil.rmtree(path)


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


def _in_one_line(error: Exception) -> str:
    return " ".join(describe_error(error).split())[:300]


def _take_over(old: Path, new: Path) -> None:
    """Move the jobs of an earlier version's table to folders of their own; what is damaged stays, and is logged.

    Args:
        old: the operator's folder, with the table and a folder for each job.
        new: where jobs lie now.
    """
    columns = "id, client, request, state, created, ended, attempts, error, code, warnings"
    try:
        with closing(sqlite3.connect(old / _OLD_TABLE, timeout=1.0)) as table:
            rows = table.execute(f"SELECT {columns} FROM jobs").fetchall()
    except (sqlite3.Error, ValueError) as error:
        log.warning("%s is left alone: %s", old / _OLD_TABLE, error)
        return
    taken = [_take_over_job(old, new, dict(zip(columns.split(", "), row, strict=True))) for row in rows]
    if all(taken):
        for name in (_OLD_TABLE, f"{_OLD_TABLE}-wal", f"{_OLD_TABLE}-shm"):
            (old / name).unlink(missing_ok=True)
        log.info("took over %d jobs of an earlier version, and removed %s", len(rows), old / _OLD_TABLE)


def _take_over_job(old: Path, new: Path, row: dict[str, Any]) -> bool:
    """Move a job; whether there was nothing wrong with it."""
    source, target = old / str(row["id"]), new / str(row["id"])
    if _NAME.fullmatch(source.name) and not source.exists():
        return True  # somebody removed it, or it was taken over
    try:
        values = {name: json.loads(row[name]) for name in ("client", "request", "warnings")}
        job = _check_job(_RECORD.validate_python({**row, **values, "client": (values["client"],)}), source.name)
        if source.is_symlink() or not all(_OLD_FILES.fullmatch(path.name) for path in source.iterdir()):
            raise ValueError("it holds files that are none of a job's.")
        target.mkdir(exist_ok=True)
        _write_record(target, job)
        if job.ended is None:
            source.replace(target / _WORK_FOLDER)
            return True
        if job.state is JobState.FINISHED:
            (source / RESULT_FILE).replace(target / RESULT_FILE)
        _remove_tree(source)
        return True
    except (OSError, ValueError, TypeError, RecursionError) as error:
        log.warning("%s is left alone: %s", source, _in_one_line(error))
        return False

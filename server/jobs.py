"""Long jobs at work: one at a time, in turn by client, each in a process of its own within bounds of time and disk.

Nothing that a job, its process or the disk does ends the runner: a turn that fails is logged in a line, and the next
one comes.
"""

import json
import logging
import os
import threading
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from subprocess import Popen
from typing import Annotated, Any

from anyio import CancelScope, Event, get_cancelled_exc_class, move_on_after, sleep, to_thread
from pydantic import BaseModel, Field, ValidationError

from lighting.errors import ErrorCode
from lighting.fields import Json
from lighting.runtime import process_seconds, start_python
from server.job_kinds import MAX_WARNINGS, MAX_WORDS
from server.job_store import MAX_ATTEMPTS, JobState, JobStore, StoredJob
from server.limits import Client
from server.tracing import JobSpan, RequestTracer

_WORKER = "from server.job_kinds import run_worker; run_worker()"
_POLL_SECONDS = 0.25  # between two looks at the process at work
_SWEEP_SECONDS = 60.0  # between two looks for jobs that are to be forgotten
_PAUSE_SECONDS = 2.0  # after a turn that failed
_SILENT_SECONDS = 150.0  # after which the runner, who says more often that it lives, stands still
_MAX_LINE = 1 << 16  # bytes of a line that the process writes
_MIN_FILE_BYTES = 4096  # that a file counts at least, so that nobody makes very many
_MAX_LOG = 4000  # letters of a traceback
_DISK_ERROR, _TIME_ERROR = "The job needs more disk than it may have.", "The job took longer than it may."
_CRASH_ERROR = "The job's process died: it needed too much memory, or its upload is damaged."
_INTERNAL_ERROR = "An unexpected error occurred in the job."

log = logging.getLogger(__name__)

_Words = Annotated[str, Field(max_length=MAX_WORDS)]


class _Answer(BaseModel):
    """A line of a job's process, which somebody may have taken over."""

    progress: Annotated[float, Field(ge=0, le=1)] | None = None
    step: list[Any] | None = None
    warnings: Annotated[list[_Words], Field(max_length=MAX_WARNINGS)] | None = None
    error: _Words = ""
    code: ErrorCode | None = None
    log: str = ""


@dataclass
class _Worker:
    """A process at work, and what it has said so far."""

    process: "Popen[bytes]"
    span: JobSpan | None  # None: the job is not traced
    progress: float = 0.0
    outcome: _Answer = field(default_factory=_Answer)
    listener: threading.Thread | None = None

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
        if self.listener:
            self.listener.join()
        assert self.process.stdout is not None
        self.process.stdout.close()

    def _listen(self) -> None:
        """Read what the process writes, to its end."""
        assert self.process.stdout is not None
        while line := self.process.stdout.readline(_MAX_LINE):
            with suppress(ValidationError):
                self._take(_Answer.model_validate_json(line))

    def _take(self, answer: _Answer) -> None:
        if answer.progress is not None:
            self.progress = answer.progress
        elif answer.step is None:
            self.outcome = answer
        elif self.span is not None:
            self.span.add_step(answer.step)


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
        self._fault = ""  # of the last turn
        self._alive = time.monotonic()  # when the runner last did anything

    @property
    def fault(self) -> str:
        """Why no job is worked on, though some may wait; empty where all is well."""
        silent = time.monotonic() - self._alive
        return f"nothing has happened for {silent:.0f} s" if silent > _SILENT_SECONDS else self._fault

    async def submit(self, job: StoredJob) -> None:
        """Queue a job whose upload lies in its folder; raises as `JobStore.add`."""
        await self.store.add(job)
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
        await self.store.remove(number, "its client deleted it")

    async def run(self) -> None:
        """Work until this is cancelled."""
        while True:
            self._alive = time.monotonic()
            try:
                await self._take_turn()
            except Exception as error:
                self._note(error)
                await sleep(_PAUSE_SECONDS)

    def _note(self, error: Exception) -> None:
        """Log why a turn failed, in one line, unless the one before failed so."""
        fault = f"{error.strerror or 'a system error'}" if isinstance(error, OSError) else "an unexpected error"
        if fault != self._fault:
            frame = traceback.extract_tb(error.__traceback__)[-1]
            log.error("jobs stand still: %r at %s:%s", error, frame.filename, frame.lineno)
        self._fault = fault

    async def _take_turn(self) -> None:
        """Work on the next job, or wait for one."""
        await self.store.sweep()
        if job := self._next():
            await self._carry_out(job)
            self._fault = ""
            return
        self._fault = ""
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
        if (begun := await self.store.begin(job)) is None:
            return
        try:
            worker, error = await self._work(begun, span)
        except get_cancelled_exc_class():  # the service shuts down
            with CancelScope(shield=True):
                await self.store.requeue(job)
            raise
        except Exception:  # of this job, or of the system: it is tried again as often as after a crash of the service
            if begun.attempts < MAX_ATTEMPTS:
                await self.store.requeue(replace(begun, state=JobState.QUEUED))
            else:
                await self.store.end(job.id, error=_INTERNAL_ERROR, code="failed")
            raise
        await self._end(job, worker.outcome, error)

    async def _work(self, job: StoredJob, span: JobSpan | None) -> tuple[_Worker, str]:
        """The process that worked on a job, when it has ended, and why it had to, or nothing."""
        worker = _Worker(await to_thread.run_sync(start_python, _WORKER), span)
        self._current = job.id, worker
        try:
            folder = self.store.work_folder(job.id).resolve()
            settings = {"folder": str(folder), "max_bytes": self.max_bytes, "traced": span is not None}
            worker.begin({**job.request, **settings})
            return worker, await self._watch(job.client, worker.process, folder)
        finally:
            self._current = None
            with CancelScope(shield=True):
                await to_thread.run_sync(worker.end)

    async def _watch(self, client: Client, process: "Popen[bytes]", folder: Path) -> str:
        """Wait for the end of a job's process; why it has to end, or nothing."""
        began, charged = time.monotonic(), 0.0
        while process.poll() is None:
            await sleep(_POLL_SECONDS)
            self._alive = time.monotonic()
            used = process_seconds(process.pid) or charged
            self._charge(client, used - charged)
            charged = used
            if time.monotonic() - began > self.seconds:
                return _TIME_ERROR
            if await to_thread.run_sync(_folder_size, folder) > self.max_bytes:
                return _DISK_ERROR
        return ""

    async def _end(self, job: StoredJob, outcome: _Answer, error: str) -> None:
        kind = job.request["kind"]
        if outcome.log:
            log.error("job of kind %s failed: %r", kind, outcome.log[-_MAX_LOG:])
        if not error and outcome.warnings is not None and await self.store.take_result(job.id):
            await self.store.end(job.id, warnings=tuple(outcome.warnings))
            log.info("job of kind %s finished", kind)
            return
        told = outcome.error or (_INTERNAL_ERROR if outcome.log else _CRASH_ERROR)
        code = outcome.code.value if outcome.code and not error else "failed"
        await self.store.end(job.id, error=error or told, code=code)
        log.info("job of kind %s failed", kind)


def _folder_size(folder: Path) -> int:
    """The bytes of all files and folders in a folder, some of which may vanish meanwhile."""
    size = 0
    for parent, folders, names in os.walk(folder):
        for name in (*folders, *names):
            with suppress(OSError):
                size += max(Path(parent, name).lstat().st_size, _MIN_FILE_BYTES)
    return size

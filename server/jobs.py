"""Jobs at work: one at a time, in turn by client, each in a process of its own within bounds of time and disk."""

import json
import logging
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from subprocess import Popen

from anyio import CancelScope, Event, get_cancelled_exc_class, move_on_after, sleep, to_thread

from lighting.records import Json
from lighting.runtime import process_seconds, start_python
from server.identity import Client
from server.job_kinds import RESULT_FILE
from server.job_store import JobState, JobStore, StoredJob
from server.tracing import JobSpan, RequestTracer

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

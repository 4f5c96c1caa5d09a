"""CPU count, malloc tuning, helper processes for work that may have to be stopped: nothing interrupts C code."""

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from subprocess import Popen

# The variables by which libraries of arrays use one thread, in a process that starts with them.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

_MAX_SECONDS = 86400.0  # seconds that a process goes on where nobody ends it, whatever the limit
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_KEPT = 1 << 28  # bytes of free memory that the process keeps
_BUFFER = 1 << 25  # bytes; larger blocks are requested from the system each time; glibc allows no larger limit
_helped = threading.local()  # `seconds` of the processes that worked for a thread


def start_python(code: str, environment: Mapping[str, str] | None = None) -> "Popen[bytes]":
    """Start Python with this package, one thread for arrays, and pipes to its stdin and from its stdout.

    Args:
        code: what it runs.
        environment: variables to add to this process's; None adds none.
    """
    from subprocess import PIPE, Popen

    root = str(Path(__file__).parents[1])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    variables = {**os.environ, **ONE_THREAD, "MALLOC_ARENA_MAX": "1", **(environment or {}), "PYTHONPATH": path}
    return Popen([sys.executable, "-P", "-c", code], stdin=PIPE, stdout=PIPE, env=variables)


def thread_seconds() -> float:
    """Return the processor time [s] of this thread and of the processes that worked for it."""
    return time.thread_time() + getattr(_helped, "seconds", 0.0)


@contextmanager
def charge_helper(pid: int) -> Iterator[None]:
    """Count the processor time of another process during the block as this thread's, for `thread_seconds`.

    Of a process that has ended, or whose time the system does not say, the time of the block counts.

    Args:
        pid: of a process that works for this thread alone.
    """
    began, before = time.monotonic(), _process_seconds(pid)
    try:
        yield
    finally:
        after = _process_seconds(pid)
        took = time.monotonic() - began if before is None or after is None else after - before
        _helped.seconds = getattr(_helped, "seconds", 0.0) + took


def _process_seconds(pid: int) -> float | None:
    """The processor time of a process; its clock has this number on Linux (clock_getcpuclockid(3) makes it)."""
    if sys.platform != "linux":
        return None
    try:
        return time.clock_gettime(~pid << 3 | 2)
    except OSError:
        return None


def ignore_signals() -> None:
    """Ignore what ends a terminal's or a service's processes together: this one ends with the process that uses it."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if number := getattr(signal, name, None):  # Windows has no SIGHUP
            signal.signal(number, signal.SIG_IGN)


@contextmanager
def exit_after(seconds: float) -> Iterator[None]:
    """End this process a second after the block took its time, should nobody be left to do so; not on Windows.

    Args:
        seconds: that the block may take.
    """
    if sys.platform == "win32":
        yield
        return
    signal.setitimer(signal.ITIMER_REAL, min(seconds, _MAX_SECONDS) + 1)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)


def claim_stdout() -> BinaryIO:
    """Return the stream of answers; what libraries print on stdout and stderr goes nowhere from now on."""
    answers = os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    return answers


def address_space_used() -> int:
    """Return the bytes of address space that this process has taken; 0 where the system does not say."""
    if sys.platform != "linux":
        return 0
    return int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def limit_address_space(size: int) -> None:
    """Let this process take no more address space; the limit is Linux's.

    Args:
        size: bytes.
    """
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (size, resource.getrlimit(resource.RLIMIT_AS)[1]))


def keep_memory() -> None:
    """Reuse freed memory, in one heap for all threads; only where the C library is glibc.

    By itself glibc takes each large buffer from the system and gives it back, in one heap per thread; taking fresh
    pages costs as much as filling them.
    """
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep:  # musl has none
        for option, value in ((_M_ARENA_MAX, 1), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)


def available_cpus() -> int:
    """Return the number of CPUs that this process may use; in a container it can be smaller than the machine's."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1

"""CPU count, malloc tuning, helper processes for work that may have to be stopped: nothing interrupts C code."""

import ctypes
import os
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

if TYPE_CHECKING:
    from subprocess import Popen

# The variables by which libraries of arrays use one thread, in a process that starts with them.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

# What a helper process needs of the environment: where Python and libraries lie, and how names are spelled. Keys and
# passwords, which services are given in it, are none of its business.
_KEPT_VARIABLES = (
    *("HOME", "LANG", "LC_ALL", "LC_CTYPE", "LD_LIBRARY_PATH", "DYLD_LIBRARY_PATH", "PATH"),
    *("PYTHONDONTWRITEBYTECODE", "PYTHONHOME", "PYTHONNOUSERSITE", "PYTHONPYCACHEPREFIX", "PYTHONUSERBASE"),
    *("PYTHONUTF8", "APPDATA", "SYSTEMROOT", "USERPROFILE"),
)
_KEPT_PREFIXES = ("MKL_", "NPY_", "OMP_", "OPENBLAS_", "OPENCV_")  # how arrays are computed: helpers answer alike
_MAX_SECONDS = 86400.0  # seconds that a process goes on where nobody ends it, whatever the limit
_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_KEPT = 1 << 28  # bytes of free memory that the process keeps
_MARGIN = 1 << 20  # bytes, by which a block is smaller than those that are requested from the system
_BUFFER = 1 << 25  # bytes; larger blocks are requested from the system each time; glibc allows no larger limit
_helped = threading.local()  # `seconds` of the processes that worked for a thread


def start_python(code: str, environment: Mapping[str, str] | None = None) -> "Popen[bytes]":
    """Start Python with this package, one thread for arrays, and pipes to its stdin and from its stdout.

    Of this process's environment it has only what finds Python and its libraries.

    Args:
        code: what it runs.
        environment: variables to add; None adds none.
    """
    from subprocess import PIPE, Popen

    root = str(Path(__file__).parents[1])
    path = os.pathsep.join(filter(None, (root, os.environ.get("PYTHONPATH"))))
    names = [name for name in os.environ if name in _KEPT_VARIABLES or name.startswith(_KEPT_PREFIXES)]
    kept = {name: os.environ[name] for name in names}
    variables = {**kept, **ONE_THREAD, "MALLOC_ARENA_MAX": "1", **(environment or {}), "PYTHONPATH": path}
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
    began, before = time.monotonic(), process_seconds(pid)
    try:
        yield
    finally:
        after = process_seconds(pid)
        took = time.monotonic() - began if before is None or after is None else after - before
        _helped.seconds = getattr(_helped, "seconds", 0.0) + took


def process_seconds(pid: int) -> float | None:
    """Return the processor time [s] of a process; None where the system does not say, or it has ended.

    Its clock has this number on Linux (clock_getcpuclockid(3) makes it).

    Args:
        pid: of the process.
    """
    if sys.platform != "linux":
        return None
    try:
        return time.clock_gettime(~pid << 3 | 2)
    except OSError:
        return None


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


def begin_helper() -> BinaryIO:
    """Make this process one that answers another, and return the stream of its answers.

    What libraries print on stdout and stderr goes nowhere from now on. What ends a terminal's or a service's processes
    together is ignored: this one ends with the process that uses it.
    """
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        if number := getattr(signal, name, None):  # Windows has no SIGHUP
            signal.signal(number, signal.SIG_IGN)
    answers = os.fdopen(os.dup(1), "wb")
    with Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), 1)
        os.dup2(nowhere.fileno(), 2)
    return answers


def address_space_used(pid: int | None = None) -> int:
    """Return the bytes of address space that a process has taken; 0 where the system does not say.

    Args:
        pid: of the process; None is this one.
    """
    if sys.platform != "linux":
        return 0
    return int(Path(f"/proc/{pid or 'self'}/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")


def limit_address_space(size: int, pid: int | None = None) -> None:
    """Let a process take no more address space; the limit is Linux's.

    Args:
        size: bytes.
        pid: of the process, whose limit may be set again; None is this one, whose limit may only become less.
    """
    if sys.platform == "linux":
        import resource

        hard = resource.prlimit(pid or 0, resource.RLIMIT_AS)[1]
        size = size if hard == resource.RLIM_INFINITY else min(size, hard)
        resource.prlimit(pid or 0, resource.RLIMIT_AS, (size, hard if pid else size))


def keep_memory() -> None:
    """Reuse freed memory, in one heap for all threads; only where the C library is glibc.

    By itself glibc takes each large buffer from the system and gives it back, in one heap per thread; taking fresh
    pages costs as much as filling them. What other heaps than the first have at their end, they never give back.
    """
    if keep := _glibc_function("mallopt"):
        for option, value in ((_M_ARENA_MAX, 1), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)


def reserve_heap(blocks: int) -> None:
    """Let the heap grow at once, after `keep_memory`, and not by single pages while it is used.

    What is reserved takes no memory before it is written, and then in large pages, for which NumPy asks the system.

    Args:
        blocks: to reserve, of nearly 32 MiB each.
    """
    import numpy as np

    with suppress(MemoryError):
        _ = [np.empty(_BUFFER - _MARGIN, np.uint8) for _ in range(blocks)]


def return_memory() -> None:
    """Give the system back what no heap uses, before one thread needs far more than another left; only glibc can."""
    if trim := _glibc_function("malloc_trim"):
        trim(0)


def _glibc_function(name: str) -> Any:
    """A function of glibc; None where the C library is another, as musl."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None


def available_cpus() -> int:
    """Return the number of CPUs that this process may use; in a container it can be smaller than the machine's."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class _BlasLimit:
    """The products of matrices of this process, on one thread while anybody needs that; threads may share it."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._users = 0
        self._limits: Any = None
        self.is_given = False  # by the environment, before numpy was imported

    def __enter__(self) -> None:
        if self.is_given:
            return
        with self._lock:
            if not self._users:
                _take_blas_control()
                self._limits = _blas_libraries().limit(limits=1)
            self._users += 1

    def __exit__(self, *_: object) -> None:
        if self.is_given:
            return
        with self._lock:
            self._users -= 1
            if not self._users:
                _take_blas_control()
                self._limits.restore_original_limits()


@cache
def _blas_libraries() -> Any:
    """What limits the library by which NumPy multiplies matrices: found once, since the search takes 2 ms."""
    from threadpoolctl import ThreadpoolController

    import_module("numpy")  # which loads it
    return ThreadpoolController().select(user_api="blas")


def _take_blas_control() -> None:
    """Let this thread change the limit; from threadpoolctl 3.8 on only the first thread that did may change it."""
    from threadpoolctl import OpenBLASController

    if clear := getattr(OpenBLASController, "clear_controlling_thread", None):
        clear(force=True)


# Within `with ONE_BLAS_THREAD:`, sums have one order, and so one last digit, however many processors there are. It is
# that of the commands for one photo.
ONE_BLAS_THREAD = _BlasLimit()

"""CPU count, malloc tuning, helper processes for work that may have to be stopped: nothing interrupts C code.

System calls of Linux confine a process: Landlock and a filter of system calls. Landlock's numbers are the same on every
processor [1]. The filter is for processors whose numbers are listed here [2].

References:
    [1] landlock(7), landlock_create_ruleset(2), landlock_restrict_self(2).
    [2] seccomp(2); the kernel's arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h.
"""

import ctypes
import os
import signal
import struct
import sys
import threading
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
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
_SET_NO_NEW_PRIVILEGES = 38  # of prctl(2)
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # system calls of Landlock
_GET_VERSION, _PATH_BENEATH = 1, 1  # flag of the first, and the kind of rule of the second

# Rights that a ruleset handles, and so denies where it grants none, by the version of Landlock that brought them.
_FILE_RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15}  # number of rights to files, folders, links and programs
_MOST_FILE_RIGHTS = 16  # from version 5 on, which added those to devices
_NETWORK_RIGHTS, _NETWORK_VERSION = 0b11, 4  # to listen and to connect by TCP
_SCOPES, _SCOPE_VERSION = 0b11, 6  # abstract sockets and signals of other processes
_EXECUTE, _READ = 0b1, 0b1100  # rights to programs, and to files and folders
_READ_AND_WRITE = _READ | 0b100_0001_1011_0010  # with making, changing and removing both
_OF_FILES = 0b1100_0000_0000_0111  # the rights that a rule about a file may grant
_CAPABILITY_VERSION, _OPEN_ANY = 0x20080522, 0b110  # of capset(2); CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH
_DEVICES = ("/dev/null", "/dev/urandom")
_SYSTEM_FOLDERS = ("/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/etc/localtime", "/proc", "/sys/devices/system")

_SET_FILTER, _FILTER_MODE = 22, 2  # of prctl(2)
_ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}  # numbers of the processors that a filter knows
_DENIED_CALLS = {  # socket, ptrace, process_vm_readv and _writev, io_uring_setup
    "x86_64": (41, 101, 310, 311, 425),
    "aarch64": (198, 117, 270, 271, 425),
}
_PROCESS_CALLS = {  # execve, execveat, fork, vfork, socketpair, kill
    "x86_64": (59, 322, 57, 58, 53, 62),
    "aarch64": (221, 281, 199, 129),  # it has neither fork nor vfork
}
_CLONE = {"x86_64": 56, "aarch64": 220}
_CLONE3, _CLONE_THREAD = 435, 0x10000  # the newer call, whose flags no filter sees, and the flag for a thread
_X32_CALLS = 0x40000000  # x86_64's second set of calls begins here; aarch64 has none so high
_ALLOW, _KILL, _NOT_PERMITTED, _NOT_IMPLEMENTED = 0x7FFF0000, 0x80000000, 0x50001, 0x50026
_MAX_TASKS = 1 << 14  # of the process's user: libde265 starts a thread for each HEIC, and others' threads count
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


def confine_process() -> None:
    """Give up, for good, what Linux can take away from this process; elsewhere nothing.

    What reads hostile bytes may be made to do whatever its process may do. Linux older than 5.13, or without Landlock,
    leaves the limits on resources alone, some of which bind only what is no superuser.

    All must be loaded that will be needed, and no other thread may run. What is open stays open. Nothing more can be
    opened, no program and no process started, no other process reached.
    """
    if sys.platform != "linux":
        return
    import resource

    library = ctypes.CDLL(None)
    if library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0:  # without it, Landlock is for superusers
        _restrict_by_landlock(library)
        _filter_calls(library, os.uname().machine)
    _limit_tasks()
    for limit in (resource.RLIMIT_NOFILE, resource.RLIMIT_FSIZE, resource.RLIMIT_CORE):
        resource.setrlimit(limit, (0, 0))


def confine_to_folder(folder: Path, readable: Iterable[Path] = (), *, processes: bool = False) -> None:
    """Give up, for good, all files but a folder's, and the network, as far as Linux can take them away.

    Python, its modules, system libraries and what the system says of itself stay readable: modules may be loaded later.
    No other thread may run. What is open stays open, and what this process starts is confined, too.

    Args:
        folder: in which files may be read, written, made and removed.
        readable: further files or folders.
        processes: whether programs and processes may be started. Without, the process is alone.
    """
    if sys.platform != "linux":
        return
    library = ctypes.CDLL(None)
    if library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0:
        _drop_capabilities(library)
        python = (sys.prefix, sys.base_prefix, *filter(None, sys.path), str(Path(__file__).parents[1]))
        paths = [*map(Path, (*python, *_SYSTEM_FOLDERS)), *readable]
        rights = dict.fromkeys(paths, _READ | _EXECUTE * processes)
        rights |= {Path(path): _READ_AND_WRITE for path in _DEVICES}
        _restrict_by_landlock(library, {**rights, folder: _READ_AND_WRITE})
        _filter_calls(library, os.uname().machine, processes=processes)
    _limit_tasks()


def _drop_capabilities(library: ctypes.CDLL) -> None:
    """Give up what a superuser may do, as reading other processes' secrets, but for opening files."""
    header, sets = struct.pack("=Ii", _CAPABILITY_VERSION, 0), ctypes.create_string_buffer(24)
    if library.capget(header, sets) == 0:
        effective, permitted, *_ = struct.unpack("=6I", sets)
        library.capset(header, struct.pack("=6I", effective & _OPEN_ANY, permitted & _OPEN_ANY, 0, 0, 0, 0))


def _limit_tasks() -> None:
    """Bound the processes and threads of this process's user."""
    import resource

    tasks = resource.getrlimit(resource.RLIMIT_NPROC)[1]
    tasks = _MAX_TASKS if tasks == resource.RLIM_INFINITY else min(tasks, _MAX_TASKS)
    resource.setrlimit(resource.RLIMIT_NPROC, (tasks, tasks))


def _restrict_by_landlock(library: ctypes.CDLL, rights: Mapping[Path, int] | None = None) -> None:
    """Deny all that this kernel's Landlock can deny, but for the rights to paths; nothing where it has none."""
    version = library.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _GET_VERSION)
    if version < 1:
        return
    handled = [(1 << _FILE_RIGHTS.get(version, _MOST_FILE_RIGHTS)) - 1]
    handled += [_NETWORK_RIGHTS] if version >= _NETWORK_VERSION else []
    handled += [_SCOPES] if version >= _SCOPE_VERSION else []
    ruleset = struct.pack(f"={len(handled)}Q", *handled)
    descriptor = library.syscall(_CREATE_RULESET, ruleset, ctypes.c_size_t(len(ruleset)), 0)
    if descriptor >= 0:
        for path, granted in (rights or {}).items():
            _grant_rights(library, descriptor, path, granted & handled[0])
        library.syscall(_RESTRICT_SELF, descriptor, 0)
        os.close(descriptor)


def _grant_rights(library: ctypes.CDLL, ruleset: int, path: Path, rights: int) -> None:
    """Add rights to a path to a ruleset of Landlock; nothing where there is no such path."""
    try:
        target = os.open(path, os.O_PATH | os.O_CLOEXEC)
    except OSError:
        return
    allowed = rights if path.is_dir() else rights & _OF_FILES
    library.syscall(_ADD_RULE, ruleset, _PATH_BENEATH, struct.pack("=Qi", allowed, target), 0)
    os.close(target)


def _filter_calls(library: ctypes.CDLL, machine: str, *, processes: bool = False) -> None:
    """Deny sockets and reaching into other processes, and, unless processes may be started, programs and processes.

    Nothing where the calls are not known.
    """
    if machine not in _ARCHITECTURES or struct.calcsize("P") != 8:
        return
    architecture = _ARCHITECTURES[machine]
    denied = _DENIED_CALLS[machine] + (() if processes else _PROCESS_CALLS[machine])
    load, equal, at_least, any_bit, give = 0x20, 0x15, 0x35, 0x45, 0x06
    program = [
        (load, 0, 0, 4), (equal, 1, 0, architecture), (give, 0, 0, _KILL),
        (load, 0, 0, 0), (at_least, 0, 1, _X32_CALLS), (give, 0, 0, _NOT_PERMITTED),
        *(step for call in denied for step in ((equal, 0, 1, call), (give, 0, 0, _NOT_PERMITTED))),
    ]  # fmt: skip
    program += [] if processes else [
        (equal, 0, 1, _CLONE3), (give, 0, 0, _NOT_IMPLEMENTED),  # the C library then takes the older one
        (equal, 0, 3, _CLONE[machine]), (load, 0, 0, 16), (any_bit, 1, 0, _CLONE_THREAD), (give, 0, 0, _NOT_PERMITTED),
    ]  # fmt: skip
    program += [(give, 0, 0, _ALLOW)]
    steps = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in program))
    library.prctl(_SET_FILTER, _FILTER_MODE, struct.pack("@HP", len(program), ctypes.addressof(steps)), 0, 0)


def keep_memory(heaps: int = 1) -> None:
    """Reuse freed memory, in few heaps for all threads; only where the C library is glibc.

    By itself glibc takes each large buffer from the system and gives it back, in one heap per thread; taking fresh
    pages costs as much as filling them.

    Args:
        heaps: 1 takes the least memory; with 2, a thread that loads a network does not wait for one that imports.
    """
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep:  # musl has none
        for option, value in ((_M_ARENA_MAX, heaps), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)


def reserve_heap(blocks: int) -> None:
    """Let the heap of this thread grow at once, after `keep_memory`, and not by single pages while it is used.

    What is reserved takes no memory before it is written, and then in large pages, for which NumPy asks the system.

    Args:
        blocks: to reserve, of nearly 32 MiB each.
    """
    import numpy as np

    with suppress(MemoryError):
        _ = [np.empty(_BUFFER - _MARGIN, np.uint8) for _ in range(blocks)]


def return_memory() -> None:
    """Give the system back what no heap uses, before one thread needs far more than another left; only glibc can."""
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    if trim:
        trim(0)


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
        from threadpoolctl import threadpool_limits

        with self._lock:
            if not self._users:
                _take_blas_control()
                self._limits = threadpool_limits(1, user_api="blas")
            self._users += 1

    def __exit__(self, *_: object) -> None:
        if self.is_given:
            return
        with self._lock:
            self._users -= 1
            if not self._users:
                _take_blas_control()
                self._limits.restore_original_limits()


def _take_blas_control() -> None:
    """Let this thread change the limit; from threadpoolctl 3.8 on only the first thread that did may change it."""
    from threadpoolctl import OpenBLASController

    if clear := getattr(OpenBLASController, "clear_controlling_thread", None):
        clear(force=True)


# Within `with ONE_BLAS_THREAD:`, sums have one order, and so one last digit, however many processors there are. It is
# that of the commands for one photo.
ONE_BLAS_THREAD = _BlasLimit()

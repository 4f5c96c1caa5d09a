"""What Linux can take away from a process for good: Landlock, a filter of system calls (seccomp), limits, capabilities.

What reads hostile bytes may be made to do whatever its process may do. Landlock's numbers are the same on every
processor [1]. The filter is for 64-bit processors whose numbers are listed here [2]. Where the kernel lacks one, the
others hold.

References:
    [1] landlock(7), landlock_create_ruleset(2), landlock_restrict_self(2).
    [2] seccomp(2); the kernel's arch/x86/entry/syscalls/syscall_64.tbl and include/uapi/asm-generic/unistd.h.
"""

import ctypes
import errno
import os
import struct
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

_SET_NO_NEW_PRIVILEGES = 38  # of prctl(2)
_CREATE_RULESET, _ADD_RULE, _RESTRICT_SELF = 444, 445, 446  # system calls of Landlock
_GET_VERSION, _PATH_BENEATH = 1, 1  # flag of the first, and the kind of rule of the second

# Rights that a ruleset handles, and so denies where it grants none, by the version of Landlock that brought them.
_FILE_RIGHTS = {1: 13, 2: 14, 3: 15, 4: 15}  # number of rights to files, folders, links and programs
_MOST_FILE_RIGHTS = 16  # from version 5 on, which added those to devices
_NETWORK_RIGHTS, _NETWORK_VERSION = 0b11, 4  # to listen and to connect by TCP
_SCOPES, _SCOPE_VERSION = 0b11, 6  # abstract sockets and signals of other processes
_EXECUTE, _LIST, _READ = 0b1, 0b1000, 0b1100  # rights to programs, to names in folders, and to these and files
_READ_AND_WRITE = _READ | 0b100_0001_1011_0010  # with making, changing and removing both
_OF_FILES = 0b1100_0000_0000_0111  # the rights that a rule about a file may grant
_CAPABILITY_VERSION, _OPEN_ANY = 0x20080522, 0b110  # of capset(2); CAP_DAC_OVERRIDE and CAP_DAC_READ_SEARCH
_DEVICES = ("/dev/null", "/dev/urandom")
_SYSTEM_FOLDERS = ("/usr", "/lib", "/lib64", "/etc/ld.so.cache", "/etc/localtime", "/proc", "/sys/devices/system")
_MAX_TASKS = 1 << 14  # of the process's user: libde265 starts a thread for each HEIC, and others' threads count

_SET_FILTER, _FILTER_MODE = 22, 2  # of prctl(2)
_ARCHITECTURES = {"x86_64": 0xC000003E, "aarch64": 0xC00000B7}  # numbers of the processors that a filter knows
_X32_CALLS = 0x40000000  # x86_64's second set of calls begins here; aarch64 has none so high
_ALLOW, _KILL, _FAIL = 0x7FFF0000, 0x80000000, 0x50000  # verdicts; the last is added to an error number
_NOT_PERMITTED, _NOT_IMPLEMENTED = _FAIL | errno.EPERM, _FAIL | errno.ENOSYS
_CLONE_THREAD = 0x10000  # flag of clone(2)
_CLONE3 = 435  # the newer call, whose flags no filter sees; without it the C library takes the older one
_SET_SIGNAL_TARGET = (8, 10, 15)  # F_SETOWN, F_SETSIG and F_SETOWN_EX of fcntl(2)
_LAST_KNOWN_CALL = 450  # a C library does without what is newer where the kernel lacks it

# Numbers of system calls on x86_64 and aarch64; None: it has none.
_Calls = dict[str, tuple[int, int | None]]
_DECODER_CALLS: _Calls = {  # all that a process needs to decode, with all that it loads loaded
    "read": (0, 63), "write": (1, 64), "readv": (19, 65), "writev": (20, 66), "lseek": (8, 62), "close": (3, 57),
    "fstat": (5, 80), "futex": (202, 98), "mmap": (9, 222), "munmap": (11, 215), "mremap": (25, 216), "brk": (12, 214),
    "mprotect": (10, 226), "madvise": (28, 233), "rt_sigaction": (13, 134), "rt_sigprocmask": (14, 135),
    "rt_sigreturn": (15, 139), "sigaltstack": (131, 132), "setitimer": (38, 103), "restart_syscall": (219, 128),
    "clock_gettime": (228, 113), "clock_getres": (229, 114), "clock_nanosleep": (230, 115), "nanosleep": (35, 101),
    "gettimeofday": (96, 169), "sched_yield": (24, 124), "sched_getaffinity": (204, 123), "getrandom": (318, 278),
    "getpid": (39, 172), "gettid": (186, 178), "set_robust_list": (273, 99), "rseq": (334, 293), "exit": (60, 93),
    "exit_group": (231, 94),
}  # fmt: skip
_DENIED_CALLS: _Calls = {  # which reach other processes and the network
    "socket": (41, 198), "ptrace": (101, 117), "process_vm_readv": (310, 270), "process_vm_writev": (311, 271),
    "process_madvise": (440, 440), "process_mrelease": (448, 448), "io_uring_setup": (425, 425), "kcmp": (312, 272),
    "pidfd_open": (434, 434), "pidfd_getfd": (438, 438), "pidfd_send_signal": (424, 424), "tkill": (200, 130),
    "rt_sigqueueinfo": (129, 138), "rt_tgsigqueueinfo": (297, 240), "setpriority": (141, 140), "ioprio_set": (251, 30),
    "sched_setaffinity": (203, 122), "sched_setscheduler": (144, 119), "sched_setparam": (142, 118),
    "sched_setattr": (314, 274), "migrate_pages": (256, 238), "move_pages": (279, 239), "shmget": (29, 194),
    "msgget": (68, 186), "semget": (64, 190), "mq_open": (240, 180), "perf_event_open": (298, 241), "bpf": (321, 280),
    "add_key": (248, 217), "request_key": (249, 218), "keyctl": (250, 219), "userfaultfd": (323, 282),
    "unshare": (272, 97), "setns": (308, 268), "mount": (165, 40), "umount2": (166, 39), "chroot": (161, 51),
    # and files that Landlock does not keep from all its versions
    "chmod": (90, None), "fchmodat": (268, 53), "chown": (92, None), "lchown": (94, None), "fchownat": (260, 54),
    "setxattr": (188, 5), "lsetxattr": (189, 6), "removexattr": (197, 14), "lremovexattr": (198, 15),
    "utime": (132, None), "utimes": (235, None), "futimesat": (261, None), "utimensat": (280, 88),
    "truncate": (76, 45), "open_by_handle_at": (304, 265),
}  # fmt: skip
_PROCESS_CALLS: _Calls = {  # further ones, where no programs and processes are needed
    "execve": (59, 221), "execveat": (322, 281), "fork": (57, None), "vfork": (58, None), "socketpair": (53, 199),
    "kill": (62, 129),
}  # fmt: skip
_CONDITIONAL_CALLS: _Calls = {  # whose verdict depends on an argument
    "prlimit64": (302, 261), "fcntl": (72, 25), "tgkill": (234, 131), "clone": (56, 220),
}  # fmt: skip
_Step = tuple[int, int, int, int]  # of a filter: operation, steps to jump if true, if false, and a number
_LOAD, _EQUAL, _AT_LEAST, _ANY_BIT, _GIVE = 0x20, 0x15, 0x35, 0x45, 0x06  # operations


def confine_process() -> None:
    """Give up, for good, what Linux can take away from this process; elsewhere nothing.

    All must be loaded that will be needed, and no other thread may run. What is open stays open. Nothing more can be
    opened, no program and no process started, no other process reached.
    """
    if sys.platform != "linux":
        return
    import resource

    library = ctypes.CDLL(None)
    is_unprivileged = library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0  # without it, the rest is for superusers
    if is_unprivileged:
        _drop_capabilities(library, 0)
        _restrict_by_landlock(library)
    _limit_tasks()
    for limit in (resource.RLIMIT_NOFILE, resource.RLIMIT_FSIZE, resource.RLIMIT_CORE):
        resource.setrlimit(limit, (0, 0))
    if is_unprivileged:
        _filter_calls(library, _decoder_filter)


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
    _limit_tasks()
    if library.prctl(_SET_NO_NEW_PRIVILEGES, 1, 0, 0, 0) == 0:
        _drop_capabilities(library, _OPEN_ANY)
        use = _READ | _EXECUTE * processes
        rights = _python_rights(use) | dict.fromkeys([*map(Path, _SYSTEM_FOLDERS), *readable], use)
        rights |= {Path(path): _READ_AND_WRITE for path in _DEVICES}
        _restrict_by_landlock(library, {**rights, folder: _READ_AND_WRITE})
        _filter_calls(library, lambda machine: _folder_filter(machine, processes=processes))


def describe_confinement() -> str:
    """Return what this system can take away from a process that decodes, in words."""
    if sys.platform != "linux":
        return "nothing on this system but keys in the environment"
    library = ctypes.CDLL(None, use_errno=True)
    library.prctl(_SET_FILTER, _FILTER_MODE, None, 0, 0)  # no filter: the error tells whether the kernel takes one
    has_filter = _has_numbers(os.uname().machine) and ctypes.get_errno() == errno.EFAULT
    version = _landlock_version(library)
    landlock = f"Landlock {version}" if version > 0 else "no Landlock"
    return f"limits on resources, {'a' if has_filter else 'no'} filter of system calls, {landlock}"


def _python_rights(use: int) -> dict[Path, int]:
    """Rights to use Python and its modules; of a checkout of this package its modules, and the names beside them."""
    folders = list(map(Path, filter(None, sys.path)))
    rights = dict.fromkeys([Path(sys.prefix), Path(sys.base_prefix), *folders], use)
    files = (file for folder in folders for file in folder.glob("*.dist-info/METADATA") if file.is_symlink())
    rights |= {file.resolve().parents[1]: use for file in files}  # installed as links to a cache
    root = Path(__file__).parents[1]
    if (root / "pyproject.toml").is_file():
        rights |= {path: _LIST for path in rights if path.resolve() == root.resolve()}  # Python looks through the names
        rights |= {root / "lighting": use, root / "server": use}
    return rights


def _drop_capabilities(library: ctypes.CDLL, kept: int) -> None:
    """Give up what a superuser may do, as reading other processes' secrets, but for some capabilities' bits."""
    header, sets = struct.pack("=Ii", _CAPABILITY_VERSION, 0), ctypes.create_string_buffer(24)
    if library.capget(header, sets) == 0:
        effective, permitted, *_ = struct.unpack("=6I", sets)
        library.capset(header, struct.pack("=6I", effective & kept, permitted & kept, 0, 0, 0, 0))


def _limit_tasks() -> None:
    """Bound the processes and threads of this process's user."""
    import resource

    tasks = resource.getrlimit(resource.RLIMIT_NPROC)[1]
    tasks = _MAX_TASKS if tasks == resource.RLIM_INFINITY else min(tasks, _MAX_TASKS)
    resource.setrlimit(resource.RLIMIT_NPROC, (tasks, tasks))


def _landlock_version(library: ctypes.CDLL) -> int:
    """Of this kernel's Landlock; under 1 where it has none, or it is switched off."""
    return int(library.syscall(_CREATE_RULESET, None, ctypes.c_size_t(0), _GET_VERSION))


def _restrict_by_landlock(library: ctypes.CDLL, rights: Mapping[Path, int] | None = None) -> None:
    """Deny all that this kernel's Landlock can deny, but for the rights to paths; nothing where it has none."""
    version = _landlock_version(library)
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


# The filter of system calls.


def _has_numbers(machine: str) -> bool:
    """Whether the numbers of a processor's calls are known."""
    return machine in _ARCHITECTURES and struct.calcsize("P") == 8


def _filter_calls(library: ctypes.CDLL, make_filter: Callable[[str], list[_Step]]) -> None:
    """Filter this process's calls; nothing where their numbers are not known."""
    machine = os.uname().machine
    if not _has_numbers(machine):
        return
    program = make_filter(machine)
    steps = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *step) for step in program))
    library.prctl(_SET_FILTER, _FILTER_MODE, struct.pack("@HP", len(program), ctypes.addressof(steps)), 0, 0)


def _decoder_filter(machine: str) -> list[_Step]:
    """A filter that permits what decoding needs, and nothing else."""
    plain = dict.fromkeys(_numbers(machine, _DECODER_CALLS), _ALLOW)
    calls = {**plain, _CLONE3: _NOT_IMPLEMENTED}
    newer = [(_AT_LEAST, 0, 1, _LAST_KNOWN_CALL + 1), (_GIVE, 0, 0, _NOT_IMPLEMENTED)]
    steps = [*_begin_filter(machine), *_verdicts(calls), *_conditions(machine, "tgkill", "clone"), *newer]
    return [*steps, (_GIVE, 0, 0, _NOT_PERMITTED)]


def _folder_filter(machine: str, *, processes: bool) -> list[_Step]:
    """A filter that denies what reaches other processes, and programs and processes unless they are needed."""
    denied = dict.fromkeys(_numbers(machine, _DENIED_CALLS), _NOT_PERMITTED)
    conditions = ["fcntl"]
    if not processes:
        denied |= dict.fromkeys(_numbers(machine, _PROCESS_CALLS), _NOT_PERMITTED) | {_CLONE3: _NOT_IMPLEMENTED}
        conditions += ["prlimit64", "tgkill", "clone"]
    steps = [*_begin_filter(machine), *_verdicts(denied), *_conditions(machine, *conditions)]
    return [*steps, (_GIVE, 0, 0, _ALLOW)]


def _begin_filter(machine: str) -> list[_Step]:
    """Steps that end a process of another processor's calls, and load the number of the call."""
    return [
        (_LOAD, 0, 0, 4), (_EQUAL, 1, 0, _ARCHITECTURES[machine]), (_GIVE, 0, 0, _KILL),
        (_LOAD, 0, 0, 0), (_AT_LEAST, 0, 1, _X32_CALLS), (_GIVE, 0, 0, _NOT_PERMITTED),
    ]  # fmt: skip


def _numbers(machine: str, calls: _Calls) -> list[int]:
    column = list(_ARCHITECTURES).index(machine)
    return [number for call in calls.values() if (number := call[column]) is not None]


def _verdicts(by_call: Mapping[int, int]) -> Iterator[_Step]:
    for call, verdict in by_call.items():
        yield from ((_EQUAL, 0, 1, call), (_GIVE, 0, 0, verdict))


def _conditions(machine: str, *names: str) -> Iterator[_Step]:
    """Steps about calls whose arguments count; each ends the filter or leaves the number of the call loaded."""
    conditions = {  # which argument counts, operation and values, the verdict if one of them fits, and the other one
        "prlimit64": (0, _EQUAL, (0,), _ALLOW, _NOT_PERMITTED),  # of this process, not of another
        "tgkill": (0, _EQUAL, (os.getpid(),), _ALLOW, _NOT_PERMITTED),
        "clone": (0, _ANY_BIT, (_CLONE_THREAD,), _ALLOW, _NOT_PERMITTED),  # a thread, not a process
        "fcntl": (1, _EQUAL, _SET_SIGNAL_TARGET, _NOT_PERMITTED, _ALLOW),  # signals to another process
    }
    for name, call in zip(names, _numbers(machine, {name: _CONDITIONAL_CALLS[name] for name in names}), strict=True):
        argument, operation, values, verdict, otherwise = conditions[name]
        tests = [(operation, len(values) - i, 0, value) for i, value in enumerate(values)]
        yield from ((_EQUAL, 0, 3 + len(values), call), (_LOAD, 0, 0, 16 + 8 * argument), *tests)
        yield from ((_GIVE, 0, 0, otherwise), (_GIVE, 0, 0, verdict))

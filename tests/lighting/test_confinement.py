"""What a confined process can do no more: by trial here, and by its filter's own steps for both processors."""

import ctypes
import os
import re
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import lighting.confinement as confinement
from lighting.confinement import describe_confinement

ROOT = Path(__file__).parents[2]
HEADERS = {
    "x86_64": Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h"),
    "aarch64": Path("/usr/include/asm-generic/unistd.h"),
}
CALLS = confinement._DENIED_CALLS | confinement._PROCESS_CALLS | confinement._CONDITIONAL_CALLS
NUMBERS = {machine: {name: call[i] for name, call in CALLS.items()} for i, machine in enumerate(HEADERS)}
ALLOW, NOT_PERMITTED, NOT_IMPLEMENTED, KILL = 0x7FFF0000, 0x50001, 0x50026, 0x80000000

ATTEMPT = """
import ctypes, encodings.idna, fcntl, os, resource, signal, socket, struct, sys, _thread
import lighting.confinement as confinement
target, numbers = {target}, {numbers}
library = ctypes.CDLL(None, use_errno=True)
if hasattr(library, "gnu_get_libc_version"):
    ctypes.CDLL("libgcc_s.so.1")  # which glibc loads when a thread of C ends
def call(name, *arguments):
    if library.syscall(numbers[name], *arguments) < 0:
        raise OSError(ctypes.get_errno(), name)
def attempt(act):
    try:
        act()
        return "works"
    except (OSError, ValueError):
        return "denied"
def fork():
    if os.fork() == 0:
        os._exit(0)
queued = struct.pack("iiiiII", 0, 0, -1, 0, target, 0) + bytes(104)
others = {{  # all without effect on the target, or with one that it had already
    "signal": lambda: os.kill(target, 0),
    "tkill": lambda: call("tkill", target, 0),
    "tgkill": lambda: call("tgkill", target, target, 0),
    "queue": lambda: call("rt_sigqueueinfo", target, 0, queued),
    "pidfd": lambda: call("pidfd_open", target, 0),
    "limit": lambda: resource.prlimit(target, resource.RLIMIT_CORE, (0, 0)),
    "priority": lambda: os.setpriority(os.PRIO_PROCESS, target, 0),
    "affinity": lambda: os.sched_setaffinity(target, os.sched_getaffinity(target)),
    "owner": lambda: fcntl.fcntl(1, fcntl.F_SETOWN, target),
    "trace": lambda: call("ptrace", 16, target, 0, 0),
    "secrets": lambda: open(f"/proc/{{target}}/environ").close(),
}}
"""

PROBE = """
if {drop}:
    os.setgroups([]), os.setgid(65534), os.setuid(65534)
if {without} == "landlock":
    confinement._restrict_by_landlock = lambda library: None
if {without} == "filter":
    confinement._filter_calls = lambda library, make: None
confinement.confine_process()
probes = {{
    **others,
    "read": lambda: open(os.devnull),
    "write": lambda: open("{folder}/new", "w"),
    "chmod": lambda: os.chmod("{folder}/file", 0o666),
    "times": lambda: os.utime("{folder}/file"),
    "stat": lambda: os.stat("{folder}/file"),
    "truncate": lambda: os.truncate("{folder}/file", 0),
    "rename": lambda: os.rename("{folder}/file", "{folder}/other"),
    "unlink": lambda: os.unlink("{folder}/file"),
    "mkdir": lambda: os.mkdir("{folder}/made"),
    "tcp": lambda: socket.create_connection(("127.0.0.1", {port})),
    "udp": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
    "pair": socket.socketpair,
    "program": lambda: os.execv("/bin/true", ["true"]),
    "process": fork,
    "raised": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (9, 9)),
    "thread": lambda: _thread.start_new_thread(int, ()),
    "own signal": lambda: signal.pthread_kill(_thread.get_ident(), 0),
}}
for name, act in probes.items():
    print(attempt(act), name)
"""


@pytest.fixture
def target() -> Iterator[int]:
    """A process that does nothing, for attempts on it."""
    process = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    yield process.pid
    process.kill()
    process.communicate()


def outcomes(code: str, target: int, **values: object) -> tuple[set[str], set[str]]:
    """What works and what is denied."""
    whole = (ATTEMPT + code).format(target=target, numbers=NUMBERS[os.uname().machine], **values)
    done = subprocess.run([sys.executable, "-c", whole], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    found = [line.split(" ", 1) for line in done.stdout.splitlines()]
    works, denied = ({name for outcome, name in found if outcome == kind} for kind in ("works", "denied"))
    return works, denied


def landlock() -> int:
    return confinement._landlock_version(ctypes.CDLL(None))


@pytest.mark.skipif(sys.platform != "linux", reason="Linux's")
@pytest.mark.parametrize("drop", [False, True])
@pytest.mark.parametrize("without", ["", "landlock", "filter"])
def test_what_a_confined_process_cannot_do(tmp_path: Path, target: int, drop: bool, without: str) -> None:
    """The filter denies all of it alone; Landlock and limits deny what SECURITY.md says of them."""
    if drop and os.getuid():
        pytest.skip("nobody but root can become another user")
    tmp_path.chmod(0o777)
    (tmp_path / "file").write_text("the user's")
    if drop:
        os.chown(tmp_path / "file", 65534, 65534)
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        works, denied = outcomes(PROBE, target, drop=drop, without=repr(without), folder=tmp_path, port=port)
    assert len(works | denied) == 28
    allowed = {"thread", "own signal"}  # a decoder of HEIC starts a thread
    if without == "filter":
        allowed |= {"process", "limit", "priority", "affinity", "pidfd", "owner", "chmod", "times", "stat"}
        allowed |= set() if landlock() >= 6 else {"signal", "tkill", "tgkill", "queue"}
        allowed |= set() if landlock() >= 3 else {"truncate"}
    assert {"thread", "own signal"} <= works <= allowed
    assert (tmp_path / "file").read_text() == "the user's"


CONFINED_TO_FOLDER = """
from pathlib import Path
folder = Path({folder!r})
confinement.confine_to_folder(folder / "job", [folder / "model"], processes={processes})
def change():
    (folder / "job" / "new").mkdir()
    (folder / "job" / "new" / "a").write_text("x")
    (folder / "job" / "new" / "a").replace(folder / "job" / "new" / "b")
    (folder / "job" / "new" / "b").unlink()
    (folder / "job" / "new").rmdir()
def start_program():
    arguments, root = [sys.executable, "-P", "-c", "import lighting"], str(Path(confinement.__file__).parents[1])
    if os.waitpid(os.posix_spawn(sys.executable, arguments, {{"PYTHONPATH": root}}), 0)[1]:
        raise OSError("it cannot import the package")
probes = {{
    **others,
    "change": change,
    "model": lambda: (folder / "model").read_bytes(),
    "module": lambda: __import__("lighting.stereo.solver"),
    "write model": lambda: (folder / "model").write_bytes(b"y"),
    "read beside": lambda: (folder / "secret").read_bytes(),
    "write beside": lambda: (folder / "other").write_bytes(b"y"),
    "passwords": lambda: Path("/etc/passwd").read_bytes(),
    "network": socket.socket,
    "chmod": lambda: (folder / "secret").chmod(0o644),
    "times": lambda: os.utime(folder / "secret"),
    "truncate": lambda: os.truncate(folder / "secret", 0),
    "unlink": lambda: os.unlink(folder / "secret"),
    "clone": lambda: (Path(confinement.__file__).parents[1] / "pyproject.toml").read_bytes(),
    "thread": lambda: _thread.start_new_thread(int, ()),
    "program": start_program,
}}
for name, act in probes.items():
    print(attempt(act), name)
"""


@pytest.mark.skipif(sys.platform != "linux" or landlock() < 1, reason="Landlock's")
@pytest.mark.parametrize("processes", [False, True])
def test_what_a_process_confined_to_a_folder_can_do(tmp_path: Path, target: int, processes: bool) -> None:
    """Whoever may start processes may signal them, and, before Landlock 6, others."""
    (tmp_path / "job").mkdir()
    for name in ("model", "secret"):
        (tmp_path / name).write_text("x")
    works, denied = outcomes(CONFINED_TO_FOLDER, target, folder=str(tmp_path), processes=processes)
    assert len(works | denied) == 26
    expected = {"change", "model", "module", "thread"}
    expected |= {"program", "limit"} if processes else set()  # of the decoders that it starts
    expected |= {"signal", "tgkill"} if processes and landlock() < 6 else set()
    assert works == expected


def test_of_a_checkout_a_job_reads_the_modules_alone_and_lists_the_names_beside_them(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for installed in (False, True):
        root = tmp_path / str(installed)
        (root / "lighting").mkdir(parents=True)
        if not installed:
            (root / "pyproject.toml").touch()
        monkeypatch.setattr(confinement, "__file__", str(root / "lighting" / "confinement.py"))
        monkeypatch.setattr(sys, "path", [str(root), str(tmp_path / "other")])
        rights = confinement._python_rights(0b1101)
        assert rights[tmp_path / "other"] == 0b1101
        assert rights[root] == (0b1101 if installed else 0b1000)  # the right to list alone
        assert ({root / "lighting", root / "server"} <= set(rights)) != installed


@pytest.mark.skipif(os.name != "posix", reason="links need rights elsewhere")
def test_a_job_reads_modules_that_are_installed_as_links(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As by uv's `--link-mode symlink`."""
    (stored := tmp_path / "cache" / "a" / "numpy.dist-info").mkdir(parents=True)
    (listed := tmp_path / "site-packages" / "numpy.dist-info").mkdir(parents=True)
    (stored / "METADATA").touch()
    (listed / "METADATA").symlink_to(stored / "METADATA")
    monkeypatch.setattr(sys, "path", [str(listed.parent)])
    assert confinement._python_rights(0b1101)[stored.parent.resolve()] == 0b1101


def run_filter(program: list[tuple[int, int, int, int]], machine: str, call: int, *arguments: int) -> int:
    """The verdict of a filter about a call: what the kernel's interpreter of such programs does."""
    architecture = confinement._ARCHITECTURES[machine]
    data = struct.pack("<iIQ6Q", call, architecture, 0, *arguments, *[0] * (6 - len(arguments)))
    step = loaded = 0
    while True:
        operation, if_true, if_false, value = program[step]
        match operation:
            case 0x06:
                return value
            case 0x20:
                (loaded,) = struct.unpack_from("<I", data, value)
                step += 1
            case 0x15 | 0x35 | 0x45:
                holds = {0x15: loaded == value, 0x35: loaded >= value, 0x45: bool(loaded & value)}[operation]
                step += 1 + (if_true if holds else if_false)


@pytest.mark.parametrize("machine", HEADERS)
def test_the_filter_of_a_decoder_permits_a_list(machine: str) -> None:
    program, column = confinement._decoder_filter(machine), list(HEADERS).index(machine)
    allowed = {call[column] for call in confinement._DECODER_CALLS.values()}
    clone, tgkill = (confinement._CONDITIONAL_CALLS[name][column] or 0 for name in ("clone", "tgkill"))
    for call in range(600):
        expected = ALLOW if call in allowed else NOT_IMPLEMENTED if call == 435 or call > 450 else NOT_PERMITTED
        assert run_filter(program, machine, call) == expected, call
    assert run_filter(program, machine, clone, 0x3D0F00) == ALLOW  # as the C library starts a thread
    assert run_filter(program, machine, clone, 0x1200011) == NOT_PERMITTED  # and as it forks
    assert run_filter(program, machine, tgkill, os.getpid(), 1, 6) == ALLOW
    assert run_filter(program, machine, tgkill, os.getppid(), 1, 6) == NOT_PERMITTED
    other = next(name for name in HEADERS if name != machine)
    assert run_filter(program, other, 0) == KILL
    assert run_filter(program, machine, 0x40000000) == NOT_PERMITTED


@pytest.mark.parametrize("machine", HEADERS)
@pytest.mark.parametrize("processes", [False, True])
def test_the_filter_of_a_folder_denies_what_reaches_others(machine: str, processes: bool) -> None:
    program, column = confinement._folder_filter(machine, processes=processes), list(HEADERS).index(machine)
    listed = confinement._DENIED_CALLS | ({} if processes else confinement._PROCESS_CALLS)
    denied = {call[column] for call in listed.values()}
    prlimit, fcntl, tgkill, clone = (call[column] or 0 for call in confinement._CONDITIONAL_CALLS.values())
    for call in set(range(600)) - {prlimit, fcntl, tgkill, clone, 435}:
        assert run_filter(program, machine, call) == (NOT_PERMITTED if call in denied else ALLOW), call
    assert run_filter(program, machine, prlimit, 0, 9) == ALLOW
    assert [run_filter(program, machine, fcntl, 1, command) for command in (1, 8, 10, 15, 1030)] == [
        *(ALLOW, NOT_PERMITTED, NOT_PERMITTED, NOT_PERMITTED, ALLOW)
    ]
    alone = ALLOW if processes else NOT_PERMITTED
    assert run_filter(program, machine, prlimit, os.getpid(), 9) == alone
    assert run_filter(program, machine, tgkill, os.getppid()) == alone
    assert run_filter(program, machine, clone, 0x1200011) == alone
    assert run_filter(program, machine, 435) == (ALLOW if processes else NOT_IMPLEMENTED)


@pytest.mark.parametrize("machine", HEADERS)
def test_the_numbers_are_the_kernel_s(machine: str) -> None:
    if not HEADERS[machine].is_file():
        pytest.skip("the kernel's headers are not installed")
    text, column = HEADERS[machine].read_text(), list(HEADERS).index(machine)
    known = {name: int(number) for name, number in re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", text)}
    for name, call in (CALLS | confinement._DECODER_CALLS | {"clone3": (435, 435)}).items():
        assert known.get(name) == call[column], name


@pytest.mark.skipif(sys.platform != "linux", reason="Linux's")
def test_what_a_system_can_take_away_is_told() -> None:
    assert re.fullmatch(
        r"limits on resources, (a|no) filter of system calls, (Landlock \d+|no Landlock)", describe_confinement()
    )

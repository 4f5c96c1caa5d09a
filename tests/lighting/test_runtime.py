"""The number of CPUs and threads, and what helper processes may do."""

import ctypes
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
import threadpoolctl

import lighting.runtime as runtime
from lighting.runtime import available_cpus, start_python


def test_a_container_may_have_fewer_than_the_machine(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3, 5}, raising=False)
    assert available_cpus() == 2


def test_elsewhere_all_count(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert available_cpus() == 1


PROBE = """
import ctypes, os, resource, socket, sys, _thread
import lighting.runtime as runtime
if {drop}:
    os.setgroups([]), os.setgid(65534), os.setuid(65534)
if {without} == "landlock":
    runtime._restrict_by_landlock = lambda library: None
if {without} == "filter":
    runtime._filter_calls = lambda library, machine: None
runtime.confine_process()
def attempt(act):
    try:
        act()
        return "works"
    except (OSError, ValueError):
        return "denied"
parent = os.getppid()
def trace():
    if ctypes.CDLL(None).ptrace(16, parent, 0, 0) != 0:
        raise OSError
def fork():
    if os.fork() == 0:
        os._exit(0)
probes = {{
    "read": lambda: open(os.devnull),
    "write": lambda: open("{folder}/new", "w"),
    "secrets": lambda: open(f"/proc/{{parent}}/environ"),
    "tcp": lambda: socket.create_connection(("127.0.0.1", {port})),
    "udp": lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM),
    "pair": socket.socketpair,
    "program": lambda: os.execv("/bin/true", ["true"]),
    "process": fork,
    "signal": lambda: os.kill(parent, 0),
    "trace": trace,
    "raised": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (9, 9)),
    "thread": lambda: _thread.start_new_thread(int, ()),
}}
for name, act in probes.items():
    print(name, attempt(act))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Linux's")
@pytest.mark.parametrize("drop", [False, True])
@pytest.mark.parametrize("without", ["", "landlock", "filter"])
def test_what_a_confined_process_cannot_do(tmp_path: Path, drop: bool, without: str) -> None:
    """Each of the two does most of it without the other, for kernels that lack one."""
    if drop and os.getuid():
        pytest.skip("nobody but root can become another user")
    with socket.create_server(("127.0.0.1", 0)) as server:
        code = PROBE.format(drop=drop, without=repr(without), folder=tmp_path, port=server.getsockname()[1])
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    found = dict(line.split() for line in done.stdout.splitlines())
    assert len(found) == 12, done.stderr
    works = {name for name, outcome in found.items() if outcome == "works"}
    allowed = {"thread"}  # a decoder of HEIC starts one
    allowed |= set() if drop or os.getuid() else {"raised"}  # a superuser's own limits
    allowed |= {"process"} if without == "filter" else set()
    assert works <= allowed


CONFINED_TO_FOLDER = """
import os, socket, sys
from pathlib import Path
import lighting.runtime as runtime
folder = Path({folder!r})
runtime.confine_to_folder(folder / "job", [folder / "model"], processes={processes})
def attempt(act):
    try:
        act()
        return "works"
    except OSError:
        return "denied"
def change():
    (folder / "job" / "new").mkdir()
    (folder / "job" / "new" / "a").write_text("x")
    (folder / "job" / "new" / "a").replace(folder / "job" / "new" / "b")
    (folder / "job" / "new" / "b").unlink()
    (folder / "job" / "new").rmdir()
probes = {{
    "change": change,
    "model": lambda: (folder / "model").read_bytes(),
    "module": lambda: __import__("lighting.stereo.solver"),
    "write model": lambda: (folder / "model").write_bytes(b"y"),
    "read beside": lambda: (folder / "secret").read_bytes(),
    "write beside": lambda: (folder / "other").write_bytes(b"y"),
    "passwords": lambda: Path("/etc/passwd").read_bytes(),
    "secrets": lambda: Path(f"/proc/{{os.getppid()}}/environ").read_bytes(),
    "network": socket.socket,
    "signal": lambda: os.kill(os.getppid(), 0),
    "program": lambda: os.waitpid(os.posix_spawn(sys.executable, [sys.executable, "-c", ""], {{}}), 0),
}}
for name, act in probes.items():
    print(attempt(act), name)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="Landlock's")
@pytest.mark.parametrize("processes", [False, True])
def test_what_a_process_confined_to_a_folder_can_do(tmp_path: Path, processes: bool) -> None:
    if ctypes.CDLL(None).syscall(444, None, ctypes.c_size_t(0), 1) < 1:
        pytest.skip("this kernel's Landlock is switched off")
    (tmp_path / "job").mkdir()
    for name in ("model", "secret"):
        (tmp_path / name).write_text("x")
    code = CONFINED_TO_FOLDER.format(folder=str(tmp_path), processes=processes)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    works = {line.removeprefix("works ") for line in done.stdout.splitlines() if line.startswith("works ")}
    assert works == {"change", "model", "module"} | ({"program"} if processes else set()), done
    assert len(done.stdout.splitlines()) == 11


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_a_helper_process_has_no_secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("LIGHTING_API_KEYS", "AWS_SECRET_ACCESS_KEY", "SOMEBODYS_PASSWORD"):
        monkeypatch.setenv(name, "secret")
    process = start_python("import os; print(sorted(os.environ.items()))", {"MORE": "1"})
    text = process.communicate()[0].decode()
    assert "secret" not in text
    assert "('MORE', '1')" in text


def test_a_helper_process_computes_as_this_one_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    process = start_python("import os; print(os.environ['OPENBLAS_CORETYPE'], os.environ['OPENBLAS_NUM_THREADS'])")
    assert process.communicate()[0].decode().split() == ["Haswell", "1"]


def test_products_of_matrices_run_on_one_thread_while_anybody_needs_that() -> None:
    def threads() -> list[int]:
        return [pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"]

    before = threads()
    with runtime.ONE_BLAS_THREAD:
        assert set(threads()) <= {1}
        with runtime.ONE_BLAS_THREAD:
            assert set(threads()) <= {1}
        assert set(threads()) <= {1}
    assert threads() == before


def test_any_thread_may_ask_for_one_thread_and_be_the_last_that_needed_it() -> None:
    code = """
import numpy
from threading import Thread
from threadpoolctl import threadpool_info
from lighting.runtime import ONE_BLAS_THREAD
def threads(): return {library["num_threads"] for library in threadpool_info() if library["user_api"] == "blas"}
def run(work):
    thread = Thread(target=work)
    thread.start()
    thread.join()
before, seen = threads(), []
with ONE_BLAS_THREAD:
    pass
def work():
    with ONE_BLAS_THREAD:
        seen.append(threads())
run(work)
ONE_BLAS_THREAD.__enter__()
run(ONE_BLAS_THREAD.__exit__)
print(before, seen, threads())
"""
    environment = {**os.environ, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.split() == ["{2}", "[{1}]", "{2}"]


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_what_is_reserved_takes_no_memory() -> None:
    code = """
import numpy
from pathlib import Path
from lighting.runtime import keep_memory, reserve_heap
def pages(): return [int(count) for count in Path("/proc/self/statm").read_text().split()[:2]]
keep_memory()
before = pages()
reserve_heap(2)
print(*(now - then for now, then in zip(pages(), before)))
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60)
    reserved, taken = (4096 * int(pages) for pages in done.stdout.split())
    assert reserved > 2 * 30 * 2**20
    assert taken < 4 * 2**20

"""The number of CPUs and threads, and helper processes."""

import os
import subprocess
import sys

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

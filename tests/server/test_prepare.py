"""The process before numpy: its threads and its memory, in a process of its own because both are said only once."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

FAULTS = """
import resource, sys, threading
from server.process import prepare
if sys.argv[1] == "prepared":
    prepare()
import numpy as np
def work():
    for _ in range(20):
        np.ones(2_000_000)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
thread = threading.Thread(target=work)
thread.start()
thread.join()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def run(code: str, *arguments: str, **environment: str) -> str:
    kept = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, env=kept | environment, capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.strip()


@pytest.mark.parametrize(("given", "threads"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_one_thread_unless_the_operator_says_otherwise(given: dict[str, str], threads: str) -> None:
    code = "import os; from server.process import prepare; prepare(); print(os.environ['OMP_NUM_THREADS'])"
    assert run(code, **given) == threads


def test_nothing_imports_numpy_before() -> None:
    assert run("import sys, server.__main__; print('numpy' in sys.modules)") == "False"


@pytest.mark.parametrize(("cpus", "threads"), [(1, "0"), (2, "2")])
def test_several_cpus_share_the_compression_of_a_map(cpus: int, threads: str) -> None:
    code = "import OpenEXR, sys; from server.process import share_compression; share_compression(int(sys.argv[1]))"
    assert run(f"{code}; print(OpenEXR.global_thread_count())", str(cpus)) == threads


@pytest.mark.skipif(sys.platform != "linux", reason="needs glibc's mallopt")
def test_buffers_are_used_again() -> None:
    """16 MB arrays made one after another in a thread fault their pages in once, not every time."""
    assert int(run(FAULTS, "prepared")) < int(run(FAULTS, "as it comes")) / 2

"""Threads and memory, in processes of their own because both are set only once per process."""

import os
import subprocess
import sys

import pytest

pytestmark = pytest.mark.slow

KEPT = """
import sys
from pathlib import Path
from server.process import prepare
if sys.argv[1] == "prepared":
    prepare()
import numpy as np
def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
before = resident()
buffers = [np.ones(1_000_000) for _ in range(20)]
del buffers
print((resident() - before) // 1_000_000)
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


@pytest.mark.skipif(sys.platform != "linux", reason="needs glibc's mallopt")
def test_the_buffers_of_photos_stay_with_the_process() -> None:
    """Of 20 buffers of 8 MB."""
    assert int(run(KEPT, "prepared")) > 120
    assert int(run(KEPT, "as it comes")) < 40

"""The process that decodes: it says nothing of photos, ends with who asks, and survives damaged photos."""

import random
import signal
import subprocess
import sys

import pytest

from benchmarks.fuzz import changed, fuzz, seeds
from lighting.photo.apart import Decoder
from lighting.photo.decoder import Request
from tests.conftest import encode, scene
from tests.processes import wait_until_ended

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def test_it_ends_with_the_process_that_asks() -> None:
    code = (
        "from lighting.photo.apart import Decoder; import os; "
        "d = Decoder(); d.prepare(); print(d.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    wait_until_ended(int(done.stdout))


def test_with_nobody_left_it_ends_when_its_photo_takes_too_long() -> None:
    """A photo that would take a minute, of which the process that asked does not wait for the end."""
    code = (
        "import os, threading; from lighting.photo import apart; from lighting.photo.apart import Decoder; "
        "from lighting.photo.decoder import Request; "
        "apart.CODE = 'import time, lighting.photo.decoder as d; d.read_photo = lambda *_, **__: time.sleep(60); ' "
        "+ apart.CODE; d = Decoder(); d.prepare(); print(d.pid, flush=True); "
        "threading.Timer(0.5, os.kill, (os.getpid(), 9)).start(); d.read(Request(1, 10, 10, 448, 1), b'x')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr  # else it had its answer
    wait_until_ended(int(done.stdout))


def test_it_prints_nothing_about_a_photo(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encode(scene(64, 48), "TIFF", compression="tiff_lzw")
    data = whole[:100] + b"\xff" * 500 + whole[600:]
    decoder = Decoder()
    try:
        with pytest.raises(Exception, match="damaged"):
            decoder.read(Request(len(data), 10**6, 10**6, 448, 60), data)
    finally:
        decoder.end()
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_damaged_photos_neither_end_it_nor_hold_it() -> None:
    """A short run of `python -m benchmarks.fuzz`."""
    report = fuzz(seeds(), random.Random(0), lambda count: count < 250, None)
    assert report.bad == 0, str(report)
    assert report.counts["read"] > 50
    assert report.counts["refused"] > 50


def test_the_same_seed_changes_alike() -> None:
    known = [encode(scene(32, 32)), encode(scene(32, 32), "PNG")]
    first, second = (
        [changed(known[i % 2], known, chance) for i in range(50)] for chance in (random.Random(3), random.Random(3))
    )
    assert first == second
    assert len(set(first)) > 40

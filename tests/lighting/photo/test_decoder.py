"""The process that decodes: it says nothing of photos, ends with who asks, and survives damaged photos."""

import random
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.fuzz import changed, fuzz, seeds
from lighting.photo.apart import Decoder
from lighting.photo.decoder import Request
from tests.conftest import encode, scene

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


def test_it_ends_with_the_process_that_asks() -> None:
    code = (
        "from lighting.photo.apart import Decoder; import os; "
        "d = Decoder(); d.prepare(); print(d.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    pid = int(done.stdout)
    state = Path(f"/proc/{pid}/stat")
    for _ in range(1000):
        if not state.exists() or state.read_text().rpartition(")")[2].split()[0] == "Z":
            return
        subprocess.run(["sleep", "0.01"], check=True)
    raise AssertionError("it goes on")


def test_it_prints_nothing_about_a_photo(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encode(scene(64, 48), "TIFF", compression="tiff_lzw")
    data = whole[:100] + b"\xff" * 500 + whole[600:]
    decoder = Decoder()
    try:
        with pytest.raises(Exception, match="damaged"):
            decoder.read(Request(len(data), 10**6, 10**6, 448), data, 60)
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

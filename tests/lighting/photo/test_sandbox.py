"""Tests of sandbox."""

import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from benchmarks.fuzz import changed, fuzz, seeds
from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo import sandbox
from lighting.photo.reader import TARGET, read_photo
from lighting.photo.sandbox import DecodeRequest, DecoderProcess, read_photo_isolated, start_decoder_pool
from tests.conftest import encode, munich, scene
from tests.helpers.processes import wait_until_ended

GOOD = encode(scene(640, 480), exif=munich())
LARGE = encode(scene(4000, 3000), "PNG", compress_level=1)


@pytest.fixture(scope="module")
def decoder() -> Iterator[DecoderProcess]:
    made = DecoderProcess()
    yield made
    made.end()


def request(data: bytes, max_pixels: int = 20_000_000, seconds: float = 60) -> DecodeRequest:
    return DecodeRequest(len(data), 10**8, max_pixels, TARGET, seconds)


def test_the_photo_is_the_same(tmp_path: Path) -> None:
    expected = read_photo(GOOD, target=200)
    (tmp_path / "a.jpg").write_bytes(GOOD)
    for source in (GOOD, tmp_path / "a.jpg", str(tmp_path / "a.jpg")):
        photo = read_photo_isolated(source, target=200)
        assert np.array_equal(photo.pixels, expected.pixels)
        assert (photo.width, photo.height, photo.format, photo.metadata) == (640, 480, "JPEG", expected.metadata)


def test_errors_are_the_same(tmp_path: Path) -> None:
    for data in (b"", b"text", GOOD[:5000], encode(scene(640, 480), "GIF")):
        with pytest.raises(PhotoError) as here:
            read_photo(data)
        with pytest.raises(PhotoError, match="^" + str(here.value).split("(")[0]):
            read_photo_isolated(data)
    with pytest.raises(PhotoTooLargeError, match="larger than the limit"):
        read_photo_isolated(GOOD, max_bytes=100)
    with pytest.raises(PhotoTooLargeError, match="million pixels"):
        read_photo_isolated(GOOD, max_pixels=1000)
    with pytest.raises(FileNotFoundError) as absent:
        read_photo_isolated(tmp_path / "absent.jpg")
    assert absent.value.filename == str(tmp_path / "absent.jpg")


def test_what_takes_too_long_is_stopped_and_the_next_photo_is_read(decoder: DecoderProcess) -> None:
    decoder.prepare()
    before = decoder.pid
    began = time.monotonic()
    with pytest.raises(PhotoTooLargeError, match=r"longer than 0\.01 seconds to decode"):
        decoder.read(request(LARGE, seconds=0.01), LARGE)
    assert time.monotonic() - began < 5
    assert decoder.read(request(GOOD), GOOD).width == 640
    assert decoder.pid != before


@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_what_takes_too_much_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process with so little allowance that 12 megapixels do not fit."""
    frugal = "import lighting.photo.sandbox as d; d.memory_budget = lambda size, *_: size + 2 * 10**7; "
    monkeypatch.setattr(sandbox, "_WORKER_CODE", frugal + sandbox._WORKER_CODE)
    small = DecoderProcess()
    try:
        with pytest.raises(PhotoTooLargeError, match="needs more memory than its limit"):
            small.read(request(LARGE, 10**8), LARGE)
        assert small.read(request(GOOD), GOOD).width == 640
    finally:
        small.end()


def test_a_process_that_ends_is_replaced(decoder: DecoderProcess) -> None:
    decoder.prepare()
    before = decoder.pid
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    assert decoder.read(request(GOOD), GOOD).width == 640
    assert decoder.pid != before


def test_a_photo_that_ends_the_process_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    fatal = "import os, lighting.photo.sandbox as d; d.read_photo = lambda *_, **__: os._exit(9); "
    mortal = DecoderProcess()
    with monkeypatch.context() as context:
        context.setattr(sandbox, "_WORKER_CODE", fatal + sandbox._WORKER_CODE)
        mortal.prepare()
    try:
        with pytest.raises(PhotoError, match=r"^The photo ended the process that decoded it\.$"):
            mortal.read(request(GOOD), GOOD)
        assert mortal.read(request(GOOD), GOOD).width == 640
    finally:
        mortal.end()


def test_threads_read_at_once() -> None:
    start_decoder_pool(2)
    with ThreadPoolExecutor(3) as pool:
        assert [photo.width for photo in pool.map(read_photo_isolated, [GOOD] * 12)] == [640] * 12


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_ends_with_the_process_that_asks() -> None:
    code = (
        "from lighting.photo.sandbox import DecoderProcess; import os; "
        "d = DecoderProcess(); d.prepare(); print(d.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    wait_until_ended(int(done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_with_nobody_left_it_ends_when_its_photo_takes_too_long() -> None:
    """A photo that would take a minute, of which the process that asked does not wait for the end."""
    code = (
        "import os, threading; from lighting.photo import sandbox; from lighting.photo.sandbox import DecoderProcess; "
        "from lighting.photo.sandbox import DecodeRequest; "
        "sandbox._WORKER_CODE = 'import time, lighting.photo.sandbox as d; ' "
        "'d.read_photo = lambda *_, **__: time.sleep(60); ' "
        "+ sandbox._WORKER_CODE; d = DecoderProcess(); d.prepare(); print(d.pid, flush=True); "
        "threading.Timer(0.5, os.kill, (os.getpid(), 9)).start(); d.read(DecodeRequest(1, 10, 10, 448, 1), b'x')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr  # else it had its answer
    wait_until_ended(int(done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_prints_nothing_about_a_photo(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encode(scene(64, 48), "TIFF", compression="tiff_lzw")
    data = whole[:100] + b"\xff" * 500 + whole[600:]
    decoder = DecoderProcess()
    try:
        with pytest.raises(Exception, match="damaged"):
            decoder.read(DecodeRequest(len(data), 10**6, 10**6, 448, 60), data)
    finally:
        decoder.end()
    assert capfd.readouterr() == ("", "")


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.slow
def test_damaged_photos_neither_end_it_nor_hold_it() -> None:
    """A short run of `python -m benchmarks.fuzz`."""
    report = fuzz(seeds(), random.Random(0), lambda count: count < 250, None)
    assert report.bad == 0, str(report)
    assert report.counts["read"] > 50
    assert report.counts["refused"] > 50


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_the_same_seed_changes_alike() -> None:
    known = [encode(scene(32, 32)), encode(scene(32, 32), "PNG")]
    first, second = (
        [changed(known[i % 2], known, chance) for i in range(50)] for chance in (random.Random(3), random.Random(3))
    )
    assert first == second
    assert len(set(first)) > 40

"""Photos in a process of their own: the same answers, and nothing that a photo does holds a place for long."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo import TARGET, apart, read_photo
from lighting.photo.apart import Decoder, read_apart, start_decoders
from lighting.photo.decoder import Request
from tests.conftest import encode, munich, scene

GOOD = encode(scene(640, 480), exif=munich())
LARGE = encode(scene(4000, 3000), "PNG", compress_level=1)


@pytest.fixture(scope="module")
def decoder() -> Iterator[Decoder]:
    made = Decoder()
    yield made
    made.end()


def request(data: bytes, max_pixels: int = 20_000_000, seconds: float = 60) -> Request:
    return Request(len(data), 10**8, max_pixels, TARGET, seconds)


def test_the_photo_is_the_same(tmp_path: Path) -> None:
    expected = read_photo(GOOD, target=200)
    (tmp_path / "a.jpg").write_bytes(GOOD)
    for source in (GOOD, tmp_path / "a.jpg", str(tmp_path / "a.jpg")):
        photo = read_apart(source, target=200)
        assert np.array_equal(photo.pixels, expected.pixels)
        assert (photo.width, photo.height, photo.format, photo.facts) == (640, 480, "JPEG", expected.facts)


def test_errors_are_the_same(tmp_path: Path) -> None:
    for data in (b"", b"text", GOOD[:5000], encode(scene(640, 480), "GIF")):
        with pytest.raises(PhotoError) as here:
            read_photo(data)
        with pytest.raises(PhotoError, match="^" + str(here.value).split("(")[0]):
            read_apart(data)
    with pytest.raises(PhotoTooLargeError, match="larger than the limit"):
        read_apart(GOOD, max_bytes=100)
    with pytest.raises(PhotoTooLargeError, match="million pixels"):
        read_apart(GOOD, max_pixels=1000)
    with pytest.raises(FileNotFoundError) as absent:
        read_apart(tmp_path / "absent.jpg")
    assert absent.value.filename == str(tmp_path / "absent.jpg")


def test_what_takes_too_long_is_stopped_and_the_next_photo_is_read(decoder: Decoder) -> None:
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
    frugal = "import lighting.photo.decoder as d; d.allowance = lambda size, *_: size + 2 * 10**7; "
    monkeypatch.setattr(apart, "CODE", frugal + apart.CODE)
    small = Decoder()
    try:
        with pytest.raises(PhotoTooLargeError, match="needs more memory than its limit"):
            small.read(request(LARGE, 10**8), LARGE)
        assert small.read(request(GOOD), GOOD).width == 640
    finally:
        small.end()


def test_a_process_that_ends_is_replaced(decoder: Decoder) -> None:
    decoder.prepare()
    before = decoder.pid
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    assert decoder.read(request(GOOD), GOOD).width == 640
    assert decoder.pid != before


def test_a_photo_that_ends_the_process_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    fatal = "import os, lighting.photo.decoder as d; d.read_photo = lambda *_, **__: os._exit(9); "
    mortal = Decoder()
    with monkeypatch.context() as context:
        context.setattr(apart, "CODE", fatal + apart.CODE)
        mortal.prepare()
    try:
        with pytest.raises(PhotoError, match=r"^The photo ended the process that decoded it\.$"):
            mortal.read(request(GOOD), GOOD)
        assert mortal.read(request(GOOD), GOOD).width == 640
    finally:
        mortal.end()


def test_threads_read_at_once() -> None:
    start_decoders(2)
    with ThreadPoolExecutor(3) as pool:
        assert [photo.width for photo in pool.map(read_apart, [GOOD] * 12)] == [640] * 12

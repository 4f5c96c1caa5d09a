"""Tests of sandbox."""

import json
import os
import pickle
import random
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import Field, asdict, fields
from datetime import datetime, timedelta, timezone
from io import BufferedReader, BufferedWriter, BytesIO
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageOps

from benchmarks.fuzz import changed, fuzz, seeds
from lighting.errors import ErrorCode, ParameterError, PhotoError, PhotoTooLargeError, warning_code
from lighting.photo import sandbox
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.reader import TARGET, Photo, read_photo
from lighting.photo.sandbox import _DecodeRequest, _DecoderProcess, read_photo_isolated, start_decoder_pool
from tests.conftest import encode, munich, scene
from tests.helpers.processes import wait_until_ended

EXAMPLES = Path(__file__).parents[3] / "examples"
GOOD = encode(scene(640, 480), exif=munich())
LARGE = encode(scene(4000, 3000), "PNG", compress_level=1)


@pytest.fixture(scope="module")
def decoder() -> Iterator[_DecoderProcess]:
    made = _DecoderProcess()
    yield made
    made.end()


def request(data: bytes, max_pixels: int = 20_000_000, seconds: float = 60) -> _DecodeRequest:
    return _DecodeRequest(len(data), 10**8, max_pixels, TARGET, seconds)


def test_the_photo_is_the_same(tmp_path: Path) -> None:
    expected = read_photo(GOOD, target=200)
    (tmp_path / "a.jpg").write_bytes(GOOD)
    for source in (GOOD, tmp_path / "a.jpg", str(tmp_path / "a.jpg")):
        photo = read_photo_isolated(source, target=200)
        assert np.array_equal(photo.pixels, expected.pixels)
        assert (photo.width, photo.height, photo.format, photo.metadata) == (640, 480, "JPEG", expected.metadata)


def bordered() -> bytes:
    """A photo between black bars."""
    return encode(ImageOps.expand(_example("wide_street").resize((480, 270)), (0, 45), "black"))


def collage() -> bytes:
    whole = Image.new("RGB", (610, 300), "white")
    for left, name in ((0, "garden_noon"), (310, "snow_field")):
        whole.paste(_example(name).resize((300, 300)), (left, 0))
    return encode(whole)


def _example(name: str) -> Image.Image:
    with Image.open(EXAMPLES / f"{name}.jpg") as image:
        return image.convert("RGB")


@pytest.mark.parametrize(("picture", "code"), [(bordered, "border"), (collage, "collage")])
def test_nothing_of_a_photo_gets_lost(picture: Callable[[], bytes], code: str) -> None:
    data = picture()
    expected, photo = read_photo(data), read_photo_isolated(data)
    for field in fields(Photo):
        if field.name != "source":  # by which this process would decode it after all
            assert np.array_equal(getattr(photo, field.name), getattr(expected, field.name)), field.name
    assert photo.source is not None
    assert [warning_code(warning) for warning in photo.warnings] == [code]


def test_what_lies_beside_a_photo_is_read_too(tmp_path: Path) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(encode(scene(640, 480)))
    takeout = {"photoTakenTime": {"timestamp": "1717259400"}, "geoData": {"latitude": 48.14, "longitude": 11.58}}
    (tmp_path / "a.jpg.supplemental-metadata.json").write_text(json.dumps(takeout), encoding="utf-8")
    metadata = read_photo_isolated(path).metadata
    assert metadata == read_photo(path).metadata
    assert metadata.latitude == pytest.approx(48.14)
    assert read_photo_isolated(path.read_bytes()).metadata.latitude is None


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


def test_what_takes_too_long_is_stopped_and_the_next_photo_is_read(decoder: _DecoderProcess) -> None:
    decoder.prepare()
    before = decoder.pid
    began = time.monotonic()
    with pytest.raises(PhotoTooLargeError, match=r"longer than 0\.01 seconds to decode"):
        decoder.read(request(LARGE, seconds=0.01), LARGE)
    assert time.monotonic() - began < 30
    assert decoder.read(request(GOOD), GOOD).width == 640
    assert decoder.pid != before


@pytest.mark.skipif(sys.platform != "linux", reason="the bound is Linux's")
def test_what_takes_too_much_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A process with so little allowance that 12 megapixels do not fit."""
    monkeypatch.setattr(sandbox, "memory_budget", lambda size, *_: size + 2 * 10**7)
    small = _DecoderProcess()
    try:
        with pytest.raises(PhotoTooLargeError, match="needs more memory than its limit"):
            small.read(request(LARGE, 10**8), LARGE)
        assert small.read(request(GOOD), GOOD).width == 640
    finally:
        small.end()


def test_a_process_that_ends_is_replaced(decoder: _DecoderProcess) -> None:
    decoder.prepare()
    before = decoder.pid
    os.kill(before, signal.SIGKILL)
    os.waitid(os.P_PID, before, os.WEXITED | os.WNOWAIT)
    assert decoder.read(request(GOOD), GOOD).width == 640
    assert decoder.pid != before


def test_a_photo_that_ends_the_process_fails_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    fatal = "import os, lighting.photo.sandbox as d; d.read_photo = lambda *_, **__: os._exit(9); "
    mortal = _DecoderProcess()
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
        "from lighting.photo.sandbox import _DecoderProcess; import os; "
        "d = _DecoderProcess(); d.prepare(); print(d.pid, flush=True); os.kill(os.getpid(), 9)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    wait_until_ended(int(done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_with_nobody_left_it_ends_when_its_photo_takes_too_long() -> None:
    """A photo that would take a minute, of which the process that asked does not wait for the end."""
    code = (
        "import os, threading; from lighting.photo import sandbox; from lighting.photo.sandbox import _DecoderProcess; "
        "from lighting.photo.sandbox import _DecodeRequest; "
        "sandbox._WORKER_CODE = 'import time, lighting.photo.sandbox as d; ' "
        "'d.read_photo = lambda *_, **__: time.sleep(60); ' "
        "+ sandbox._WORKER_CODE; d = _DecoderProcess(); d.prepare(); print(d.pid, flush=True); "
        "threading.Timer(0.5, os.kill, (os.getpid(), 9)).start(); d.read(_DecodeRequest(1, 10, 10, 448, 1), b'x')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr  # else it had its answer
    wait_until_ended(int(done.stdout))


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_prints_nothing_about_a_photo(capfd: pytest.CaptureFixture[str]) -> None:
    whole = encode(scene(64, 48), "TIFF", compression="tiff_lzw")
    data = whole[:100] + b"\xff" * 500 + whole[600:]
    decoder = _DecoderProcess()
    try:
        with pytest.raises(Exception, match="damaged"):
            decoder.read(_DecodeRequest(len(data), 10**6, 10**6, 448, 60), data)
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


# What a decoder that somebody took over can do.


def answer_of(reply: bytes) -> Photo | Exception:
    """What is made of those bytes of a decoder."""
    process: Any = SimpleNamespace(stdin=BufferedWriter(BytesIO()), stdout=BufferedReader(BytesIO(reply)))
    return sandbox._request_photo(process, request(GOOD), GOOD)


ANSWER: dict[str, Any] = {
    "rows": 1, "columns": 2, "width": 64, "height": 32, "format": "JPEG", "metadata": asdict(PhotoMetadata()),
    "crop": None, "is_collage": False, "warnings": [],
}  # fmt: skip


def test_a_true_answer_is_taken() -> None:
    photo = answer_of(json.dumps(ANSWER).encode() + b"\nabcdef")
    assert isinstance(photo, Photo)
    assert photo.pixels.tobytes() == b"abcdef"
    assert (photo.width, photo.height, photo.metadata) == (64, 32, PhotoMetadata())


@pytest.mark.parametrize(
    "change",
    [
        {"rows": 60_000, "columns": 60_000}, {"rows": -1, "columns": -6}, {"rows": 1.5}, {"rows": True}, {"format": 3},
        {"more": 1}, {"metadata": {}}, {"metadata": asdict(PhotoMetadata()) | {"heading": float("nan")}},
        {"metadata": asdict(PhotoMetadata()) | {"latitude": "north"}}, {"error": "PhotoError"},
        {"metadata": asdict(PhotoMetadata()) | {"local_time": "yesterday"}},
        {"metadata": asdict(PhotoMetadata()) | {"heading_reference": "up"}}, {"crop": {"left": 1}}, {"crop": "all"},
        {"is_collage": 1}, {"warnings": ["Bars."]}, {"warnings": [{"text": "Bars.", "code": "bars"}]},
    ],
)  # fmt: skip
def test_an_answer_is_checked(change: dict[str, Any]) -> None:
    with pytest.raises((TypeError, ValueError)):
        answer_of(json.dumps(ANSWER | change).encode() + b"\nabcdef")


@pytest.mark.parametrize(
    "reply", [b"", b"{", b"x" * (1 << 17), b"[" * 60_000 + b"\n", json.dumps(ANSWER).encode() + b"\nabc"]
)
def test_half_an_answer_is_none(reply: bytes) -> None:
    with pytest.raises((EOFError, ValueError, RecursionError)):
        answer_of(reply)


def test_errors_keep_their_kinds() -> None:
    failure = {"error": "ParameterError", "text": "No.", "field": "target", "code": "wrong-type"}
    error = answer_of(json.dumps(failure).encode() + b"\n")
    assert isinstance(error, ParameterError)
    assert (str(error), error.field, error.code) == ("No.", "target", ErrorCode.WRONG_TYPE)
    other = answer_of(json.dumps(failure | {"error": "SystemExit", "code": None}).encode() + b"\n")
    assert type(other) is RuntimeError


class _Trap:
    """Creates a file when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.path,)


def test_nothing_in_an_answer_is_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    trap = pickle.dumps(_Trap(tmp_path / "run"), 0) + b"\n"
    lying = f"import lighting.photo.sandbox as d; d._answer_request = lambda r, data, out, own: out.write({trap!r}); "
    decoder = _DecoderProcess()
    with monkeypatch.context() as context:
        context.setattr(sandbox, "_WORKER_CODE", lying + sandbox._WORKER_CODE)
        decoder.prepare()
    try:
        with pytest.raises(PhotoError, match="ended the process that decoded it"):
            decoder.read(request(GOOD), GOOD)
        assert decoder.read(request(GOOD), GOOD).width == 640
    finally:
        decoder.end()
    assert not list(tmp_path.iterdir())


def test_metadata_come_as_they_are() -> None:
    moment = datetime(2024, 6, 1, 9, 10, tzinfo=timezone(timedelta(hours=2)))
    values: dict[Any, Any] = {"datetime | None": moment, "float | None": 0.1 + 0.2, "str | None": "a \u00e4"}
    values["HeadingReference | None"] = "true"
    metadata = PhotoMetadata(**{f.name: values.get(_annotation(f), f.default) for f in fields(PhotoMetadata)})
    record = json.loads(sandbox._json_line(asdict(metadata)))
    assert sandbox._parse_record(PhotoMetadata, record) == metadata
    assert all(record[field.name] is not None for field in fields(PhotoMetadata) if _annotation(field) in values)


def _annotation(field: Field[Any]) -> str:
    return str(field.type).replace("datetime.datetime", "datetime").replace("lighting.photo.metadata.", "")


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_it_has_given_up_what_it_does_not_need(decoder: _DecoderProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIGHTING_API_KEYS", "secret")
    decoder.start()
    decoder.prepare()
    process = Path("/proc", str(decoder.pid))
    assert b"LIGHTING" not in (process / "environ").read_bytes()
    status = dict(line.split(":\t", 1) for line in (process / "status").read_text().splitlines())
    assert status["NoNewPrivs"] == "1"
    assert status["Seccomp"] == "2" or os.uname().machine not in ("x86_64", "aarch64")
    limits = (process / "limits").read_text()
    for name in ("Max open files", "Max file size", "Max core file size"):
        assert re.search(rf"^{name} +0 +0 ", limits, re.MULTILINE)
    assert re.search(r"^Max processes +\d+ +\d+ ", limits, re.MULTILINE)


@pytest.mark.skipif(sys.platform != "linux" or os.getuid() != 0, reason="nobody but root can become another user")
def test_every_kind_is_read_by_who_is_no_superuser(monkeypatch: pytest.MonkeyPatch) -> None:
    """HEIC's decoder starts a thread, and no module can be loaded once the process is confined."""
    humble = "import os, resource, lighting.photo.sandbox as s; c = s.confine_process; "
    humble += "s.confine_process = lambda: (os.setgroups([]), os.setgid(65534), os.setuid(65534), c()); "
    monkeypatch.setattr(sandbox, "_WORKER_CODE", humble + sandbox._WORKER_CODE)
    monkeypatch.setattr("lighting.runtime.limit_address_space", lambda *_: None)  # of another user's process
    decoder = _DecoderProcess()
    try:
        for data in seeds():
            expected = read_photo(data)
            photo = decoder.read(request(data), data)
            assert np.array_equal(photo.pixels, expected.pixels)
            assert (photo.format, photo.metadata) == (expected.format, expected.metadata)
    finally:
        decoder.end()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="POSIX")
def test_a_pipe_is_no_photo(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.jpg")
    with pytest.raises(PhotoError, match="a pipe or a device"):
        read_photo_isolated(tmp_path / "a.jpg")

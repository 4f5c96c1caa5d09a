"""How the process of a command starts."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from lighting.errors import ModelError
from lighting.model import Model, packaged_model
from lighting.onnx_session import packaged_network
from lighting.start import silence_libraries, start_network
from tests.helpers.processes import LIGHTING, run_command

STARTED = """
import gc, os, sys
from lighting.start import prepare_process
prepare_process(sys.argv[1])
print(os.environ.get("OPENBLAS_NUM_THREADS"), gc.get_threshold()[0] > 10_000, "numpy" in sys.modules)
"""


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(
    ("command", "said"),
    [("envmap", "1 True False"), ("render", "1 True False"), ("batch", "1 False False"), ("", "1 False False")],
)
def test_commands_are_made_ready(command: str, said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert python(STARTED, command).stdout.strip() == said


def test_what_the_user_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert python(STARTED, "envmap").stdout.startswith("3 ")


@pytest.mark.parametrize("command", ["", "info", "batch", "render", "serve"])
def test_the_network_is_not_loaded_where_a_command_seldom_needs_it(command: str) -> None:
    assert start_network(command) is None


@pytest.mark.slow
@pytest.mark.parametrize("command", ["estimate", "envmap", "preview", "scene"])
def test_the_network_of_one_photo_is_loaded_once(command: str) -> None:
    started = start_network(command)
    assert started
    session = started.take()
    assert session is not None
    model = Model.from_session(session, packaged_model())
    assert model.spec.name == "outdoor"
    assert started.take() is None


def test_what_keeps_the_network_from_loading_is_said_when_it_is_needed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lighting.checksum.DATA_FOLDER", tmp_path)
    assert start_network("estimate") is None
    with pytest.raises(ModelError, match="it holds 0"):
        packaged_network(tmp_path, "outdoor")


@pytest.mark.slow
def test_the_command_answers_by_the_network_that_began_to_load(photo_path: Path) -> None:
    """The same line as by the same file given as another network, which loads later."""
    early = run_command("estimate", photo_path, "--json")
    late = run_command("estimate", photo_path, "--json", "--model", packaged_model())
    assert early.returncode == 0
    assert json.loads(early.stdout)["lighting"]["model"]["name"] == "outdoor"
    assert early.stdout == late.stdout


ENDED = """
import atexit, sys
from lighting.start import exit_now
class Loud:
    def __del__(self):
        sys.stderr.write("taken apart")
loud = Loud()
loud.itself = loud
atexit.register(print, "called")
print("said", end=" ")
if sys.argv[1] == "watched":
    sys.setprofile(lambda *_: None)
exit_now(3)
print("still here")
"""
INTERRUPTED = """
import os, signal, sys, threading
from lighting.cli import photos
from lighting.fusion.user_input import UserInput
from lighting.model import Model
signal.signal(signal.SIGINT, signal.default_int_handler)
Model.predict = lambda *_: threading.Event().wait()
class Lost:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)
        sum(range(10))
photos.estimate_alone(sys.argv[1], UserInput(), None, lambda: Lost() and None)
"""


def test_it_ends_at_once_with_its_status_and_what_was_said() -> None:
    done = python(ENDED, "alone")
    assert (done.returncode, done.stdout, done.stderr) == (3, "said called\n", "")


def test_a_profiler_sees_the_end() -> None:
    done = python(ENDED, "watched")
    assert (done.returncode, "still here" in done.stdout) == (0, True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_what_cannot_be_written_fails_as_ever(record_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "lighting", "render", str(record_path), "-o", "-", "--height", "32"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60, check=False)
    assert done.returncode == 1
    assert b"No space left" in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_whole_map_goes_through_a_pipe(record_path: Path, tmp_path: Path) -> None:
    written = run_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "256")
    piped = run_command("render", record_path, "-o", "-", "--height", "256")
    assert (written.returncode, piped.returncode) == (0, 0)
    assert piped.stdout == (tmp_path / "a.exr").read_bytes()
    assert LIGHTING.model_name.encode() in piped.stdout


def test_an_interrupt_that_python_would_lose_ends_the_process(photo_path: Path) -> None:
    """An exception in __del__ is lost, and the network would be waited for without end."""
    ended = python(INTERRUPTED, str(photo_path))
    assert (ended.returncode, ended.stdout, ended.stderr) == (1, "", "\nAborted!\n")


def closed(redirection: str, *arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """A command of a shell that closes a stream of it."""
    command = ["sh", "-c", f'exec "$@" {redirection}', "sh", sys.executable, "-m", "lighting", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
def test_an_answer_for_a_closed_stdout_is_an_error(record_path: Path, tmp_path: Path) -> None:
    for arguments in (["info", record_path], ["--version"]):
        done = closed(">&-", *arguments)
        assert (done.returncode, done.stderr) == (1, "Error: There is no stdout to write to, it is closed.\n")
    done = closed(">&-", "render", record_path, "-o", tmp_path / "a.exr", "--height", "16")
    assert (done.returncode, done.stderr) == (0, "Sky only: the place needs the photo (--photo PHOTO).\n")
    done = closed(">&-", "render", record_path, "-o", "-")
    assert done.returncode == 2
    assert done.stderr.endswith("There is no stdout to write to, it is closed.\n")


@pytest.mark.skipif(os.name != "posix", reason="needs a POSIX shell")
def test_a_closed_stderr_changes_nothing_else(photo_path: Path, network: Path) -> None:
    done = closed("2>&-", "estimate", photo_path, photo_path, "--model", network)
    assert (done.returncode, len(done.stdout.splitlines())) == (0, 2)
    assert closed("<&- 2>&-", "estimate", "-").returncode == 1


def chatter(words: str) -> None:
    """Print as Python does, and as a library in C."""
    sys.stdout.write(words)
    os.write(2, words.encode())


def fail_silently() -> None:
    with silence_libraries():
        chatter("early")
        raise ValueError("failed")


def test_nothing_is_printed_until_the_end_even_of_a_failure(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(ValueError, match="failed"):
        fail_silently()
    chatter("later")
    assert tuple(capfd.readouterr()) == ("later", "later")


def test_a_closed_stderr_stays_closed(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("sys.stderr", None)
    with silence_libraries():
        chatter("to another file")
    assert tuple(capfd.readouterr()) == ("", "to another file")

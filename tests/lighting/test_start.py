"""How the process of a command starts."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import lighting.start as start_module
from lighting.errors import ModelError
from lighting.model import Model, packaged_model
from lighting.start import start_network, started_session
from tests.helpers.processes import run_command

STARTED = """
import gc, os, sys
from lighting.start import prepare_process
prepare_process(sys.argv[1:])
print(os.environ.get("OPENBLAS_NUM_THREADS"), gc.get_threshold()[0] > 10_000, "numpy" in sys.modules)
"""


def python(code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["envmap", "a.jpg"], "1 True False"),
        (["--debug", "render", "a.json"], "1 True False"),
        (["batch", "a", "b"], "None False False"),
        (["stereo", "normals"], "None False False"),
    ],
)
def test_brief_commands_alone_are_made_ready(arguments: list[str], said: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    assert python(STARTED, *arguments).stdout.strip() == said


def test_what_the_user_set_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    assert python(STARTED, "envmap").stdout.startswith("3 ")


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["--help"],
        ["info", "PHOTO"],
        ["batch", "PHOTO", "out"],
        ["estimate", "--help", "PHOTO"],
        ["estimate", "PHOTO", "PHOTO"],
        ["envmap", "PHOTO", "PHOTO", "-o", "maps/"],
        ["estimate", "PHOTO", "--model=other.onnx"],
        ["scene", "PHOTO", "--lighting", "light.json"],
    ],
)
def test_the_network_is_not_loaded_where_no_single_photo_needs_it(arguments: list[str], photo_path: Path) -> None:
    start_network([str(photo_path) if argument == "PHOTO" else argument for argument in arguments])
    assert started_session() is None


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ["estimate", "PHOTO"],
        ["estimate", "no\0name"],
        ["envmap", "PHOTO", "-o", "PHOTO"],  # as an output that there is already
        ["scene", "PHOTO", "--for", "usd", "-o", "folder"],
    ],
)
def test_the_network_of_one_photo_is_loaded_once(arguments: list[str], photo_path: Path) -> None:
    start_network([str(photo_path) if argument == "PHOTO" else argument for argument in arguments])
    model = Model.from_session(started_session(), packaged_model())
    assert model.spec.name == "outdoor"
    assert started_session() is None


def test_what_keeps_the_network_from_loading_is_said_when_it_is_needed(
    photo_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(start_module, "_DATA", tmp_path)
    start_network(["estimate", str(photo_path)])
    with pytest.raises(ModelError, match="it holds 0"):
        started_session()


@pytest.mark.slow
def test_the_command_answers_by_the_network_that_began_to_load(photo_path: Path) -> None:
    """The same line as by the same file given as another network, which loads later."""
    early = run_command("estimate", photo_path, "--json")
    late = run_command("estimate", photo_path, "--json", "--model", packaged_model())
    assert early.returncode == 0
    assert json.loads(early.stdout)["lighting"]["model"]["name"] == "outdoor"
    assert early.stdout == late.stdout

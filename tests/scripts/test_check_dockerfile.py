"""The checks of the image, on small folders and processes of this machine."""

import os
import sys
from pathlib import Path

import pytest

from scripts.check_dockerfile import BrokenPromiseError, _children, _resident, _step, check_layer, expect, healthy
from scripts.dockerfile import UnsupportedError, read_stages


@pytest.fixture
def layer(tmp_path: Path) -> Path:
    package = tmp_path / "opt/venv/lib/python3.11/site-packages/numpy"
    package.mkdir(parents=True)
    (package / "core.so").write_bytes(bytes(3_000_000))
    return tmp_path


def test_a_small_layer_keeps_every_promise(layer: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_layer(layer)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "   numpy 3 MB"
    assert [line.startswith("ok: ") for line in lines[1:]] == [True] * 3


@pytest.mark.parametrize(
    ("file", "promise"), [("opt/venv/bin/gcc", "no compiler"), ("home/notes.txt", "nothing in it but /opt/venv")]
)
def test_what_does_not_belong_in_the_layer_is_named(layer: Path, file: str, promise: str) -> None:
    (layer / file).parent.mkdir(parents=True, exist_ok=True)
    (layer / file).write_text("#")
    with pytest.raises(BrokenPromiseError, match=f"^not kept: {promise}"):
        check_layer(layer)


def test_a_broken_promise_ends_the_check() -> None:
    expect(True, "all is well")
    with pytest.raises(BrokenPromiseError, match="not kept: all is well"):
        expect(False, "all is well")


def test_health_is_the_status_of_the_probe() -> None:
    assert healthy([sys.executable, "-c", ""])
    assert not healthy([sys.executable, "-c", "raise SystemExit(1)"])


def test_a_stage_without_an_entrypoint_is_named() -> None:
    (stage,) = read_stages('FROM base\nCMD ["true"]\n')
    assert _step(stage, "CMD").argv == ["true"]
    with pytest.raises(UnsupportedError, match="has no ENTRYPOINT"):
        _step(stage, "ENTRYPOINT")


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads Linux's /proc")
def test_processes_are_read_from_proc() -> None:
    assert _resident(os.getpid()) > 1_000_000
    assert _children(2**22 + 1) == []

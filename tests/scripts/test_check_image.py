"""The checks of the image, on small folders and processes of this machine."""

import os
import sys
from pathlib import Path

import pytest

from scripts.check_image import BrokenPromiseError, Image, _children, _resident, check_layer, expect, healthy, main


@pytest.fixture
def base(tmp_path: Path) -> Path:
    (tmp_path / "base" / "usr").mkdir(parents=True)
    (tmp_path / "base" / "usr" / "gcc").write_bytes(bytes(1_000_000))
    return tmp_path / "base"


@pytest.fixture
def files(base: Path) -> Path:
    root = base.parent / "image"
    package = root / "opt/venv/lib/python3.11/site-packages/numpy"
    package.mkdir(parents=True)
    (package / "core.so").write_bytes(bytes(3_000_000))
    (root / "usr").mkdir()
    (root / "usr" / "gcc").write_bytes(bytes(1_000_000))
    return root


def test_a_small_layer_keeps_every_promise(base: Path, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_layer(base, files)
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == ["   4 MB with its base; numpy 3 MB", "ok: the image is 3 MB over its base, under 350"]
    assert [line.startswith("ok: ") for line in lines[1:]] == [True] * 3


@pytest.mark.parametrize(
    ("file", "promise"), [("opt/venv/bin/gcc", "no compiler"), ("home/notes.txt", "nothing in it but /opt/venv")]
)
def test_what_does_not_belong_in_the_layer_is_named(base: Path, files: Path, file: str, promise: str) -> None:
    (files / file).parent.mkdir(parents=True, exist_ok=True)
    (files / file).write_text("#")
    with pytest.raises(BrokenPromiseError, match=f"^not kept: {promise}"):
        check_layer(base, files)


def test_a_broken_promise_ends_the_check() -> None:
    expect(True, "all is well")
    with pytest.raises(BrokenPromiseError, match="not kept: all is well"):
        expect(False, "all is well")


def test_a_command_runs_as_the_images_user_without_capabilities() -> None:
    image = Image(Path("/view"), ["A=1", "LIGHTING_PORT=80"], "/work", "7:8", ["env", "serve"], ["true"])
    command = image.command(["lighting"])
    assert command[:3] == ["chroot", "/view", "setpriv"]
    assert {"--reuid=7", "--regid=8", "--clear-groups", "--no-new-privs", "--bounding-set=-all"} <= set(command)
    assert command[-7:] == ["env", "-i", "-C", "/work", "A=1", "LIGHTING_PORT=80", "lighting"]
    assert image.port == 80


def test_health_is_the_status_of_the_probe() -> None:
    assert healthy([sys.executable, "-c", ""])
    assert not healthy([sys.executable, "-c", "raise SystemExit(1)"])


def test_a_machine_that_cannot_build_skips_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(sys, "argv", ["check_image", str(tmp_path / "cache")])
    monkeypatch.setattr("tempfile.mkdtemp", lambda: str(tmp_path / "space"))
    (tmp_path / "space").mkdir()
    main()
    assert capsys.readouterr().out == "skipped: no image can be built here: it needs root\n"
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads Linux's /proc")
def test_processes_are_read_from_proc() -> None:
    assert _resident(os.getpid()) > 1_000_000
    assert _children(2**22 + 1) == []

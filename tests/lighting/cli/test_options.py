"""Options that several commands share."""

from pathlib import Path

import pytest

from lighting.files import COMPRESSIONS
from tests.lighting.cli.runners import error_of, run, terminal


@pytest.mark.parametrize("command", [["envmap"], ["render"], ["preview"]], ids=lambda c: c[0])
def test_a_bad_output_is_refused_before_any_work(command: list[str], tmp_path: Path) -> None:
    """The input does not exist either, and nobody got as far as looking."""
    (tmp_path / "folder.png").mkdir()
    for name, sentence in (
        ("a.gif", "must end in "),
        ("a", "must end in "),
        ("folder.png", "is a folder."),
        ("absent/a.png", "There is no folder "),
    ):
        result = run(*command, "absent.jpg", "-o", tmp_path / name)
        assert sentence in error_of(result, 2)


@pytest.mark.parametrize("value", ["0", "15", "33", "14", "4098", "-512", "1e3", "nan", ""])
def test_a_bad_height_is_wrong_usage(value: str, tmp_path: Path) -> None:
    assert run("render", "absent.json", "-o", tmp_path / "a.exr", "--height", value).exit_code == 2


@pytest.mark.parametrize("value", ["nan", "inf", "-inf", "north"])
def test_a_bad_yaw_is_wrong_usage(value: str, tmp_path: Path) -> None:
    assert run("render", "absent.json", "-o", tmp_path / "a.exr", "--yaw", value).exit_code == 2


def test_a_terminal_is_spared_binary_data(network: Path, photo_path: Path) -> None:
    status, shown = terminal("envmap", photo_path, "-o", "-", "--model", network, stdout_too=True)
    assert status == 2
    assert b"Binary data needs a file or a pipe, not a terminal." in shown


def test_help_names_every_compression() -> None:
    shown = run("render", "--help").stdout
    assert all(name in shown for name in COMPRESSIONS)


def test_a_bad_or_idle_compression_is_wrong_usage(tmp_path: Path) -> None:
    bad = run("render", "absent.json", "-o", tmp_path / "a.exr", "--compression", "dwaa")
    assert "'dwaa' is not one of zip, zip-exact, " in error_of(bad, 2)
    idle = run("render", "absent.json", "-o", tmp_path / "a.hdr", "--compression", "pxr24")
    assert "--compression goes with .exr alone." in error_of(idle, 2)

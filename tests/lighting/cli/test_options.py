"""Options that several commands share."""

from pathlib import Path

import pytest

from lighting.files import COMPRESSIONS
from tests.lighting.cli.runners import error_of, run, terminal


@pytest.mark.parametrize("command", [["envmap"], ["render"], ["preview"]], ids=lambda c: c[0])
def test_a_bad_output_is_refused_before_any_work(command: list[str], tmp_path: Path) -> None:
    """The input does not exist either, and nobody got as far as looking."""
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "device.png").symlink_to("/dev/null")
    for name, sentence in (
        ("a.gif", "must end in "),
        ("a", "must end in "),
        ("folder.png", "is a folder."),
        ("device.png", "is a pipe or a device, not a file."),
        ("absent/a.png", "There is no folder "),
    ):
        result = run(*command, "absent.jpg", "-o", tmp_path / name)
        assert sentence in error_of(result, 2)


@pytest.mark.parametrize("name", ["", "-"])
@pytest.mark.parametrize(
    "command",
    [
        ["batch", "."],
        ["scene", "absent.jpg", "--for", "gltf", "-o"],
        ["video", "absent.mp4", "-o"],
        ["stereo", "normals", ".", "-o"],
        ["probe", "merge", "lighting.jsonl", "--lens", "ball", "-o"],
    ],
    ids=lambda c: c[0],
)
def test_results_go_to_a_folder_that_has_a_name(
    command: list[str], name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """An empty name, as an unset variable of a shell, would be the current folder, and --overwrite empty that."""
    monkeypatch.chdir(tmp_path)
    Path("lighting.jsonl").write_text("a day's work\n")
    overwrite = [] if command[0] == "probe" else ["--overwrite"]
    result = run(*command, name, *overwrite)
    assert ("stdout" if name else "is empty.") in error_of(result, 2)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [("lighting.jsonl", "a day's work\n")]


@pytest.mark.parametrize(
    "options",
    [
        ["envmap", "absent.jpg", "-o"],
        ["preview", "absent.jpg", "-o"],
        ["envmap", "absent.jpg", "-o", "a.exr", "--preview"],
        ["scene", "absent.jpg", "--for", "gltf", "-o", "out", "--lighting"],
        ["estimate", "absent.jpg", "--model"],
    ],
    ids=lambda options: f"{options[0]} {options[-1]}",
)
def test_a_file_that_an_option_names_has_a_name(options: list[str]) -> None:
    assert error_of(run(*options, ""), 2).endswith(": the name of the file is empty.")


@pytest.mark.parametrize("command", [["estimate", "absent.jpg", "--fit", "time"]], ids=lambda c: c[2])
def test_a_removed_option_says_what_there_is_instead(command: list[str]) -> None:
    name = command[2]
    assert f"{name} was removed: --together with time and place says" in error_of(run(*command), 2)
    assert name not in run(command[0], "--help").stdout


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
    assert "'dwaa' is not known; it must be one of zip, pxr24, none." in error_of(bad, 2)
    removed = run("render", "absent.json", "-o", tmp_path / "a.exr", "--compression", "piz")
    assert "'piz' was removed; none changes no value either." in error_of(removed, 2)
    idle = run("render", "absent.json", "-o", tmp_path / "a.hdr", "--compression", "pxr24")
    assert "--compression goes with .exr alone." in error_of(idle, 2)

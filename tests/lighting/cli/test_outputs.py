"""What commands write: where to, and what is never replaced."""

import json
from pathlib import Path

import numpy as np
import pytest

from lighting.cli.outputs import MAPS, choose_folder, open_command
from lighting.files.exr import read_exr, read_exr_attributes
from lighting.scene import EXPORTERS
from tests.conftest import encode, scene
from tests.helpers.processes import error_of, invoke_command

SMALL = ("--height", "16")


@pytest.mark.parametrize(("name", "magic"), [("a.exr", b"v/1\x01"), ("a.HDR", b"#?RADIANCE"), ("a.png", b"\x89PNG")])
def test_envmap_writes_by_suffix(network: Path, photo_path: Path, tmp_path: Path, name: str, magic: bytes) -> None:
    result = invoke_command("envmap", photo_path, "-o", tmp_path / name, "--height", "64", "--model", network)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / name).read_bytes().startswith(magic)
    summary, written = result.stdout.splitlines()
    assert f"{summary}\n" == invoke_command("estimate", photo_path, "--model", network).stdout
    assert written.startswith(f"Wrote {tmp_path / name}.")
    assert {p.name for p in tmp_path.iterdir()} == {"photo.jpg", name}


def test_inputs_are_never_overwritten(network: Path, tmp_path: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(encode(scene(96, 64), "PNG"))
    (tmp_path / "link.png").symlink_to(photo)
    for output in (photo, tmp_path / "link.png", tmp_path / ".." / tmp_path.name / "photo.png"):
        for command in ("envmap", "preview"):
            text = error_of(invoke_command(command, photo, "-o", output, "--model", network), 2)
            assert text == "The input and the outputs must be different files."
    same = tmp_path / "a.png"
    error_of(invoke_command("envmap", photo, "-o", same, "--preview", same, "--model", network), 2)
    error_of(invoke_command("envmap", photo, "-o", "-", "--preview", "-", "--model", network), 2)
    assert photo.read_bytes() == encode(scene(96, 64), "PNG")


def test_a_write_that_fails_is_one_sentence_and_leaves_nothing(
    record_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "a.exr")

    monkeypatch.setattr(Path, "replace", full)
    assert "No space left on device" in error_of(
        invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "16")
    )
    assert [p.name for p in tmp_path.iterdir()] == ["lighting.json"]


@pytest.fixture
def other_path(photo_path: Path) -> Path:
    path = photo_path.with_name("other.jpg")
    path.write_bytes(photo_path.read_bytes())
    return path


def test_results_lie_beside_the_photo_unless_a_name_is_stated(network: Path, photo_path: Path) -> None:
    arguments = [photo_path, "--model", network, "-q"]
    assert invoke_command("envmap", *arguments, *SMALL).exit_code == 0
    assert invoke_command("scene", *arguments, "--for", "usd", *SMALL).exit_code == 0
    made = {path.name for path in photo_path.parent.iterdir()} - {photo_path.name}
    assert made == {"photo.exr", "photo-usd"}


def test_a_record_is_rendered_beside_it(record_path: Path) -> None:
    assert invoke_command("render", record_path, *SMALL).exit_code == 0
    assert read_exr(record_path.with_suffix(".exr"))[0].shape == (16, 32, 3)


@pytest.mark.parametrize("command", ["envmap", "render", "preview"])
def test_no_file_is_replaced_unasked(command: str, photo_path: Path, record_path: Path, tmp_path: Path) -> None:
    output = tmp_path / "there.png"
    output.write_text("a day's work")
    source = record_path if command == "render" else photo_path
    sentence = error_of(invoke_command(command, source, "-o", output))
    assert sentence == f"{output} is there already; --overwrite replaces it."
    assert output.read_text() == "a day's work"
    if command == "render":
        assert invoke_command(command, source, "-o", output, "--overwrite", *SMALL).exit_code == 0
        assert output.read_bytes().startswith(b"\x89PNG")


def test_neither_is_the_preview_beside_a_map(photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("a day's work")
    arguments = ["envmap", photo_path, "-o", tmp_path / "a.exr", "--preview", tmp_path / "a.png"]
    assert "--overwrite replaces it." in error_of(invoke_command(*arguments))
    assert not (tmp_path / "a.exr").exists()


def test_a_preview_is_no_folder(photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "a.png").mkdir()
    arguments = ["envmap", photo_path, "-o", tmp_path / "a.exr", "--preview", tmp_path / "a.png"]
    assert "a.png is a folder." in error_of(invoke_command(*arguments), 2)
    assert not (tmp_path / "a.exr").exists()


def test_several_photos_go_to_a_folder(network: Path, photo_path: Path, other_path: Path, tmp_path: Path) -> None:
    maps = tmp_path / "maps"
    result = invoke_command("envmap", photo_path, other_path, "-o", f"{maps}/", *SMALL, "--model", network)
    assert result.exit_code == 0, result.output
    assert {path.name for path in maps.iterdir()} == {"photo.exr", "other.exr"}
    first, second, last = result.stdout.splitlines()
    assert (first.startswith(f"{photo_path}: sun "), second.startswith(f"{other_path}: sun ")) == (True, True)
    assert last.startswith(f"Wrote {maps / 'photo.exr'} and {maps / 'other.exr'}. Open photo.exr: ")


def test_one_photo_goes_to_a_folder_too(network: Path, photo_path: Path, tmp_path: Path) -> None:
    result = invoke_command("envmap", photo_path, "-o", f"{tmp_path}/maps/", *SMALL, "--model", network, "-q")
    assert (result.exit_code, result.output) == (0, "")
    assert (tmp_path / "maps" / "photo.exr").is_file()


def test_several_scenes_have_a_folder_each(network: Path, photo_path: Path, other_path: Path, tmp_path: Path) -> None:
    arguments = ["--for", "usd", "-o", tmp_path / "scenes", *SMALL, "--model", network, "-q"]
    assert invoke_command("scene", photo_path, other_path, *arguments).exit_code == 0
    assert {path.name for path in (tmp_path / "scenes").iterdir()} == {"photo", "other"}
    assert "--overwrite replaces the scene in it." in error_of(
        invoke_command("scene", photo_path, other_path, *arguments)
    )


def test_a_bad_photo_does_not_stop_the_maps_of_others(network: Path, photo_path: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.jpg"
    bad.write_bytes(b"bad")
    arguments = ["-o", f"{tmp_path}/maps/", *SMALL, "--model", network, "--json"]
    result = invoke_command("envmap", bad, photo_path, *arguments)
    assert result.exit_code == 1
    first, second = map(json.loads, result.stdout.splitlines())
    assert set(first) == {"file", "error"}
    assert set(second) == {"file", "output", "lighting"}
    header = read_exr_attributes(tmp_path / "maps" / "photo.exr")["light_probe.coefficients"]
    assert np.ravel(second["lighting"]["light_probe"]["coefficients"]) == pytest.approx(header, rel=1e-3, abs=1e-6)
    assert second["output"] == str(tmp_path / "maps" / "photo.exr")
    sentence, count = result.stderr.splitlines()
    assert sentence.startswith(f"Error: {bad}: This is a text")
    assert count == "1 of 2 photos failed."
    assert [path.name for path in (tmp_path / "maps").iterdir()] == ["photo.exr"]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["-o", "all.exr"], "Several photos need a folder: -o FOLDER/, not all.exr."),
        (["-o", "-"], "Several photos need a folder: -o FOLDER/."),
        (["-o", "photo.jpg"], "Several photos need a folder: -o FOLDER/, and photo.jpg is a file."),
        (["-o", "none/maps"], "There is no folder "),
        (["--preview", "a.png"], "--preview is of one photo; `lighting preview` draws those of several."),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_no_folder_for_several_photos_is_refused(
    arguments: list[str], sentence: str, photo_path: Path, other_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(photo_path.parent)
    assert sentence in error_of(invoke_command("envmap", photo_path.name, other_path.name, *arguments), 2)


def test_photos_of_one_name_would_be_one_file(photo_path: Path, tmp_path: Path) -> None:
    twin = tmp_path / "photo.png"
    twin.write_bytes(photo_path.read_bytes())
    arguments = ["envmap", photo_path, twin, "-o", f"{tmp_path}/maps/"]
    assert "Two outputs would be one file" in error_of(invoke_command(*arguments), 2)


def test_stdin_needs_a_name_for_its_result() -> None:
    assert "stdin needs an output: -o FILE, or -o - for stdout." in error_of(invoke_command("envmap", "-"), 2)
    assert "stdin needs an output: -o FOLDER." in error_of(invoke_command("scene", "-", "--for", "usd"), 2)


def test_json_and_a_file_do_not_share_stdout(photo_path: Path) -> None:
    assert "--json and the file would both go to stdout." in error_of(
        invoke_command("envmap", photo_path, "-o", "-", "--json"), 2
    )


def test_the_last_line_says_how_to_open_what_was_written(record_path: Path, tmp_path: Path) -> None:
    file = tmp_path / "a.hdr"
    result = invoke_command("render", record_path, "-o", file, *SMALL)
    assert result.stdout.splitlines()[-1] == f"Wrote {file}. Open it: {open_command(str(file))}"
    assert EXPORTERS["blender"].opening_command("my scene") == "blender --python 'my scene/scene.py'"
    assert all(tool.opened_by.format(file="a", folder="b") for tool in EXPORTERS.values())


def test_a_default_is_beside_its_source() -> None:
    assert MAPS.beside("day/IMG_1.HEIC") == Path("day/IMG_1.exr")
    assert choose_folder("day/shot.mp4", None, "-lighting") == "day/shot-lighting"
    assert choose_folder("day/shot.mp4", "out", "-lighting") == "out"

"""`lighting scene`: what it writes, and how it refuses."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from PIL import Image

from lighting.envmap.render import render
from lighting.files.exr import read_exr
from lighting.record_json import record_with_coefficients
from lighting.scene import EXPORTERS, RECORD, Exporter
from tests.helpers.predictions import without_probe
from tests.helpers.processes import error_of, invoke_command
from tests.helpers.scenes import LIGHT


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "lighting.json"
    path.write_text(json.dumps(LIGHT.to_dict()))
    return path


def test_the_command_estimates_the_light(network: Path, photo_path: Path, tmp_path: Path) -> None:
    result = invoke_command("scene", photo_path, "--for", "mitsuba", "-o", tmp_path / "out", "--model", network)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith(str(photo_path))
    record = json.loads((tmp_path / "out" / "lighting.json").read_text())
    assert record["model"]["name"] == "tiny"
    with Image.open(tmp_path / "out" / "plate.png") as plate:
        assert plate.size == (320, 240)


def test_the_map_shows_the_place_unless_the_sky_alone_is_wanted(
    lit_network: Path, photo_path: Path, tmp_path: Path
) -> None:
    arguments: list[str | Path] = ["scene", photo_path, "--for", "mitsuba", "--height", "32", "--model", lit_network]
    for folder, flags in (("place", []), ("sky", ["--no-surroundings"])):
        assert invoke_command(*arguments, *flags, "-o", tmp_path / folder).exit_code == 0
    place, sky = (read_exr(tmp_path / folder / "environment.exr") for folder in ("place", "sky"))
    assert sky[1] is not None
    assert sky[0] == pytest.approx(render(sky[1], 32, disc=False), rel=1e-3)
    assert place[0] != pytest.approx(sky[0], rel=1e-2)


def test_the_command_takes_a_record_in_place_of_an_estimate(
    photo_path: Path, record_path: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    result = invoke_command(
        "scene", photo_path, "--for", "usd", "--lighting", record_path, "-o", out, "-q", "--up-axis", "z"
    )
    assert (result.exit_code, result.output) == (0, "")
    assert without_probe(json.loads((out / "lighting.json").read_text())) == record_with_coefficients(LIGHT)
    assert 'upAxis = "Z"' in (out / "scene.usda").read_text()


def test_warnings_of_the_light_are_on_stderr(photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text(json.dumps(replace(LIGHT, warnings=("It was night.",)).to_dict()))
    arguments: list[str | Path] = ["scene", photo_path, "--for", "usd", "--lighting", tmp_path / "l.json"]
    assert invoke_command(*arguments, "-o", tmp_path / "a").stderr == f"Warning: {photo_path}: It was night.\n"
    assert invoke_command(*arguments, "-o", tmp_path / "b", "-q").stderr == ""


def test_an_object_that_the_picture_does_not_show_has_a_warning(photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "l.json").write_text(json.dumps(replace(LIGHT, camera_elevation=40.0).to_dict()))
    result = invoke_command(
        "scene", photo_path, "--for", "usd", "--lighting", tmp_path / "l.json", "-o", tmp_path / "a"
    )
    assert result.stderr.startswith(f"Warning: {photo_path}: The object would stand")


@pytest.mark.parametrize(
    ("output", "sentence"),
    [
        ("lighting.json", "is a file; a scene is a folder."),
        ("none/out", "There is no folder"),
        (".", "is not empty; --overwrite replaces the scene in it."),
    ],
)
def test_a_folder_that_must_not_be_written_is_one_sentence(
    photo_path: Path, record_path: Path, tmp_path: Path, output: str, sentence: str
) -> None:
    before = sorted(tmp_path.iterdir())
    arguments: list[str | Path] = [
        "scene",
        photo_path,
        "--for",
        "usd",
        "--lighting",
        record_path,
        "-o",
        tmp_path / output,
    ]
    assert sentence in error_of(invoke_command(*arguments))
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--for", "Blendr"], "Did you mean blender?"),
        (["--for", "maya"], f"'maya' is not one of {', '.join(map(repr, EXPORTERS))}."),
        (["--for", "gltf", "--up-axis", "Y"], "--up-axis goes with --for usd."),
        (["--for", "usd", "--sun", "40,25", "--no-sun"], "choose one."),
        (["--for", "usd", "--height", "4098"], "height is 4098; it must be an even number from 16 to 4096."),
    ],
)
def test_wrong_usage_is_one_sentence(photo_path: Path, tmp_path: Path, arguments: list[str], sentence: str) -> None:
    assert sentence in error_of(invoke_command("scene", photo_path, "-o", tmp_path / "out", *arguments), 2)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["plate.png", "lit_ground.png"])
def test_a_scene_never_replaces_the_photo(photo_path: Path, record_path: Path, tmp_path: Path, name: str) -> None:
    """A plate of 16 bits became one of 8, without its metadata."""
    shot = tmp_path / "shot"
    shot.mkdir()
    photo = photo_path.rename(shot / name)
    before = photo.read_bytes()
    again = tmp_path / "again.png"
    again.symlink_to(photo)
    arguments: list[str | Path] = ["--lighting", record_path, "-o", shot, "--overwrite", "-q"]
    for named in (photo, again):
        said = error_of(invoke_command("scene", named, *arguments, "--for", "usd"), 2)
        assert said == f"The scene would replace {named}; choose another folder."
    assert invoke_command("scene", photo, *arguments, "--for", "gltf").exit_code == 0
    assert sorted(path.name for path in shot.iterdir()) == sorted([name, "scene.glb"])
    assert photo.read_bytes() == before


@pytest.mark.parametrize("tool", [tool for tool, entry in EXPORTERS.items() if RECORD in entry.files])
def test_a_scene_never_replaces_the_record_that_it_reads(photo_path: Path, record_path: Path, tool: str) -> None:
    """What is not written into a scene's record was lost, such as the file's own notes."""
    before = record_path.read_bytes()
    arguments: list[str | Path] = ["scene", photo_path, "--for", tool, "--lighting", record_path]
    said = error_of(invoke_command(*arguments, "-o", record_path.parent, "--overwrite"), 2)
    assert said == f"The scene would replace {record_path}; choose another folder."
    assert record_path.read_bytes() == before


@pytest.mark.parametrize("own", ["photo", "record"])
def test_a_scene_of_an_added_tool_replaces_no_input(
    photo_path: Path, record_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: str
) -> None:
    replaced = {"photo": photo_path, "record": record_path}[own]
    toy = Exporter(lambda _scene: {replaced.name: b"toy"}, label="A toy", files=(replaced.name,))
    monkeypatch.setitem(EXPORTERS, "toy", toy)
    before = replaced.read_bytes()
    arguments: list[str | Path] = ["scene", photo_path, "--for", "toy", "--lighting", record_path, "--overwrite"]
    assert f"would replace {replaced}" in error_of(invoke_command(*arguments, "-o", replaced.parent), 2)
    assert replaced.read_bytes() == before
    assert invoke_command(*arguments, "-o", tmp_path / "elsewhere", "-q").exit_code == 0
    assert (tmp_path / "elsewhere" / replaced.name).read_text() == "toy"


def test_a_bad_photo_is_one_sentence(tmp_path: Path, record_path: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"no photo")
    result = invoke_command(
        "scene", tmp_path / "bad.jpg", "--for", "usd", "--lighting", record_path, "-o", tmp_path / "out"
    )
    assert error_of(result).endswith("bad.jpg: This is a text, not a photo.")
    assert not (tmp_path / "out").exists()


def test_a_scene_of_one_file_can_have_a_name(photo_path: Path, record_path: Path, tmp_path: Path) -> None:
    out = tmp_path / "sent.html"
    arguments: list[str | Path] = ["scene", photo_path, "--for", "page", "--lighting", record_path, "-o", out]
    assert invoke_command(*arguments).exit_code == 0
    assert out.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert "is there already" in error_of(invoke_command(*arguments))
    assert invoke_command(*arguments, "--overwrite").exit_code == 0
    assert "folder" in error_of(invoke_command("scene", photo_path, photo_path, "--for", "page", "-o", out), 2)
    missing = [*arguments[:-1], tmp_path / "none" / "sent.html"]
    assert "There is no folder" in error_of(invoke_command(*missing), 2)

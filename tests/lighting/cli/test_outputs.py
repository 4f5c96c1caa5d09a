"""Tests of where results go: defaults, folders, what is never replaced, and the last line."""

import json
from pathlib import Path

import numpy as np
import pytest

from lighting.cli.outputs import MAPS, choose_folder, open_command
from lighting.envmap.relighting import Adjustments, adjust_lighting
from lighting.envmap.render import render
from lighting.files.exr import read_exr, read_exr_attributes
from lighting.records import Lighting
from lighting.scene import EXPORTERS
from tests.helpers.processes import LIGHTING, error_of, invoke_command

SMALL = ("--height", "16")


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
    result = invoke_command("render", record_path, "-o", tmp_path / "a.png", *SMALL)
    assert (
        result.stdout.splitlines()[-1]
        == f"Wrote {tmp_path / 'a.png'}. Open it: {open_command(str(tmp_path / 'a.png'))}"
    )
    assert EXPORTERS["blender"].opening_command("my scene") == "blender --python 'my scene/scene.py'"
    assert all(tool.opened_by.format(file="a", folder="b") for tool in EXPORTERS.values())


def test_a_default_is_beside_its_source() -> None:
    assert MAPS.beside("day/IMG_1.HEIC") == Path("day/IMG_1.exr")
    assert choose_folder("day/shot.mp4", None, "-lighting") == "day/shot-lighting"
    assert choose_folder("day/shot.mp4", "out", "-lighting") == "out"


# Another light


@pytest.mark.parametrize(
    ("options", "adjusted"),
    [
        (["--sun", "40,25"], Adjustments(sun=(40.0, 25.0))),
        (["--sun", "-120,5"], Adjustments(sun=(-120.0, 5.0))),
        (["--exposure", "-1.5"], Adjustments(exposure=-1.5)),
        (["--exposure", "+1ev"], Adjustments(exposure=1.0)),
        (["--haze", "8"], Adjustments(haze=8.0)),
        (["--overcast"], Adjustments(overcast=True)),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_a_light_is_adjusted_by_hand(
    options: list[str], adjusted: Adjustments, record_path: Path, tmp_path: Path
) -> None:
    result = invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "32", *options)
    assert result.exit_code == 0, result.output
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting == adjust_lighting(LIGHTING, adjusted)
    np.testing.assert_allclose(image, render(lighting, 32), rtol=1e-3, atol=1e-7)


def test_a_photo_and_its_scene_are_adjusted_alike(
    network: Path, photo_path: Path, tmp_path: Path, expected: Lighting
) -> None:
    options = ["--sun", "40,25", "--exposure", "1", "--model", network, "-q", *SMALL]
    assert invoke_command("envmap", photo_path, "-o", tmp_path / "a.exr", *options).exit_code == 0
    assert invoke_command("scene", photo_path, "--for", "usd", "-o", tmp_path / "s", *options).exit_code == 0
    light = adjust_lighting(expected, Adjustments(sun=(40.0, 25.0), exposure=1.0))
    assert read_exr(tmp_path / "a.exr")[1] == light
    stored = Lighting.from_dict(json.loads((tmp_path / "s" / "lighting.json").read_text()))
    assert (stored.sun_azimuth, stored.exposure) == (40.0, light.exposure)


@pytest.mark.parametrize("arguments", [["--sun"], ["--sun", "a.jpg"], ["--sun", "--no-sun"], ["--sun", "40"]])
@pytest.mark.parametrize("command", [["envmap", "a.jpg"], ["batch", "in", "out", "--envmap"]])
def test_sun_without_a_direction_says_what_it_is_now(command: list[str], arguments: list[str]) -> None:
    sentence = error_of(invoke_command(*command, *arguments), 2)
    assert "it moves the sun, and needs AZIMUTH,ELEVATION in degrees: --sun 40,25." in sentence
    assert "--no-sun leaves it out." in sentence


@pytest.mark.parametrize("option", [["--sun", "40,25"], ["--exposure", "1"], ["--haze", "3"], ["--overcast"]])
def test_adjustments_of_a_batch_are_of_its_maps(option: list[str]) -> None:
    assert f"{option[0]} needs --envmap." in error_of(invoke_command("batch", "in", "out", *option), 2)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--sun", "40,95"], "The sun's elevation is 95; it must lie in -4.2 to 90."),
        (["--exposure", "bright"], "'bright' is not a number of EV such as +0.5."),
        (["--exposure", "30"], "--exposure is 30; it must lie in -20 to 20."),
        (["--haze", "11"], "--haze is 11; it must lie in 1 to 10."),
        (["--sun", "40,25", "--no-sun"], "--sun moves the sun, and --no-sun leaves it out: choose one."),
    ],
)
def test_an_adjustment_that_cannot_be_is_wrong_usage(arguments: list[str], sentence: str, tmp_path: Path) -> None:
    assert sentence in error_of(invoke_command("envmap", "-", "-o", tmp_path / "a.exr", *arguments), 2)


def test_a_record_with_its_photo_has_the_map_of_the_photo(lit_network: Path, photo_path: Path, tmp_path: Path) -> None:
    """And without it, it says that it is the sky only."""
    record = tmp_path / "light.json"
    record.write_text(invoke_command("estimate", "--json", photo_path, "--model", lit_network).stdout)
    options = ["--model", lit_network, "--height", "32"]
    assert invoke_command("envmap", photo_path, "-o", tmp_path / "a.exr", *options).exit_code == 0
    result = invoke_command("render", record, "--photo", photo_path, "-o", tmp_path / "b.exr", *options)
    assert (result.exit_code, result.stderr) == (0, "")
    np.testing.assert_array_equal(read_exr(tmp_path / "a.exr")[0], read_exr(tmp_path / "b.exr")[0])
    alone = invoke_command("render", record, "-o", tmp_path / "c.exr", "--height", "32")
    assert alone.stderr == "Sky only: the place needs the photo (--photo PHOTO).\n"
    assert not np.array_equal(read_exr(tmp_path / "a.exr")[0], read_exr(tmp_path / "c.exr")[0])
    assert invoke_command("render", record, "-o", tmp_path / "d.exr", "--no-surroundings", *SMALL).stderr == ""
    assert "need --photo." in error_of(invoke_command("render", record, "-o", tmp_path / "e.exr", "--surroundings"), 2)


# Unsuitable photos


@pytest.mark.parametrize("command", ["estimate", "envmap", "batch"])
def test_strict_has_a_status_for_photos_that_are_not_of_outdoors(
    command: str, lit_network: Path, photo_path: Path, tmp_path: Path
) -> None:
    """The network of tests says how suitable it holds every photo."""
    outputs: dict[str, list[object]] = {
        "estimate": [],
        "envmap": ["-o", tmp_path / "a.exr", *SMALL],
        "batch": [tmp_path / "out"],
    }
    source = photo_path.parent if command == "batch" else photo_path
    arguments = [command, source, *outputs[command], "--model", lit_network, "-q"]
    suitable = json.loads(invoke_command("estimate", "--json", photo_path, "--model", lit_network).stdout)["lighting"]
    expected = 3 if suitable["suitable"] < 0.5 else 0
    assert invoke_command(*arguments, "--strict").exit_code == expected

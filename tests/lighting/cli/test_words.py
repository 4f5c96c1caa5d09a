"""What commands say."""

import json
import os
from pathlib import Path

import pytest

from lighting.cli.words import _CONTROLS, in_words, printable, shown
from lighting.envmap import render
from lighting.files import write_exr
from lighting.records import Lighting
from tests.conftest import encode, scene
from tests.lighting.cli.runners import LIGHTING, run, sub, terminal
from tests.lighting.video.clips import pan, write_clip


@pytest.mark.parametrize(
    ("azimuth", "elevation", "words"),
    [
        (-41.24, 4.0, "sun 41.2° left, 33.0° high"),
        (41.24, 4.0, "sun 41.2° right, 33.0° high"),
        (0.04, 4.0, "sun straight ahead, 33.0° high"),
        (-170.0, 4.0, "sun 170.0° left (behind), 33.0° high"),
        (180.0, -7.31, "camera looks 7.3° down"),
        (180.0, -0.04, "camera looks 0.0° up, roll 0.0°"),
    ],
)
def test_sides_are_told_in_words(azimuth: float, elevation: float, words: str) -> None:
    lighting = Lighting(azimuth, 33.0, 3.0, 0.1, camera_elevation=elevation, camera_roll=-0.04)
    assert words in in_words("x.jpg", lighting)


def test_headings_are_told_from_0_to_359() -> None:
    told = in_words("x.jpg", Lighting(10.0, 33.0, 3.0, 0.1, camera_heading=359.6, relative_heading=359.5))
    assert "heading 0°, 0° clockwise from the first photo" in told


def test_a_record_without_radii_claims_none() -> None:
    told = Lighting(10.0, 33.0, 3.0, 0.1)
    assert in_words("x.jpg", told).startswith("x.jpg: sun 10.0° right, 33.0° high, direct sunlight 100 %")
    told = Lighting(10.0, 33.0, 3.0, 0.1, radius_50=9.5, radius_90=31.0)
    assert "33.0° high (50 % within 9.5°, 90 % within 31.0°), direct sunlight" in in_words("x.jpg", told)


def test_without_json_errors_go_to_stderr_alone(network: Path, photo_path: Path) -> None:
    result = run("estimate", "absent.jpg", photo_path, "--model", network)
    assert len(result.stdout.splitlines()) == 1
    assert result.stderr.splitlines() == [
        "Error: absent.jpg: No such file or directory.",
        "1 of 2 photos failed.",
    ]
    assert result.exit_code == 1
    assert run("estimate", "", "--model", network).stderr == "Error: '': The name of the file is empty.\n"


def test_a_name_that_is_not_text_is_shown_escaped(network: Path, tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/caf\xe9.jpg"
    Path(os.fsdecode(name)).write_bytes(encode(scene(96, 64)))
    words = sub("estimate", os.fsdecode(name), "--model", network)
    assert words.returncode == 0
    line = sub("estimate", "--json", os.fsdecode(name), "--model", network).stdout
    assert os.fsencode(json.loads(line)["file"]) == name
    refused = sub("envmap", os.fsdecode(name), "-o", os.fsdecode(name), "--model", network)
    assert refused.returncode == 2
    assert b"Traceback" not in refused.stderr


def test_what_the_terminal_cannot_show_is_escaped(network: Path, tmp_path: Path) -> None:
    photo = tmp_path / "日.jpg"
    photo.write_bytes(encode(scene(96, 64)))
    result = sub("estimate", photo, "--model", network, env={**os.environ, "PYTHONIOENCODING": "latin-1"})
    assert (result.returncode, result.stderr) == (0, b"")
    assert b"\\u65e5.jpg: sun " in result.stdout


def test_progress_shows_on_a_terminal_alone(network: Path, photo_path: Path) -> None:
    photos = ["estimate", str(photo_path), str(photo_path), "--model", str(network)]
    assert b"2/2" in terminal(*photos, stdout_too=False)[1]
    assert terminal(*photos, "--quiet", stdout_too=False) == (0, b"")
    assert terminal("estimate", photo_path, "--model", network, stdout_too=False) == (0, b"")
    assert b"2/2" not in terminal(*photos, stdout_too=True)[1]


EVIL = "a\x1b]0;owned\x07\x9b2J\u202egnp.jpg"
SHOWN = r"a\x1b]0;owned\x07\x9b2J\u202egnp.jpg"


def test_control_characters_are_escaped_and_letters_are_not() -> None:
    assert printable(EVIL) == shown(EVIL) == SHOWN
    assert shown("日 é\n👩\u200d🔬.jpg") == "日 é\\n👩\u200d🔬.jpg"
    assert shown("-") == "stdin"


@pytest.mark.parametrize("command", ["estimate", "estimate --json", "envmap", "scene", "info", "render"])
@pytest.mark.parametrize("content", ["absent", "damaged", "good"])
def test_no_escape_in_a_name_reaches_the_terminal(command: str, content: str, network: Path, tmp_path: Path) -> None:
    photo = tmp_path / EVIL
    if content != "absent":
        photo.write_bytes(encode(scene(96, 64)) if content == "good" else b"\xff\xd8")
    output: list[str | Path] = ["-o", tmp_path / "out.png"] if command in ("envmap", "render") else []
    output = ["--for", "mitsuba", "-o", tmp_path / "out"] if command == "scene" else output
    model: list[str | Path] = ["--model", network] if command not in ("info", "render") else []
    result = run(*command.split(), photo, *output, *model)
    assert not _CONTROLS.search(result.output.replace("\n", ""))
    assert "owned" in result.output


def test_neither_does_one_in_a_usage_error_or_a_batch(network: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / EVIL).write_bytes(b"no photo")
    out = tmp_path / "o\x1b[2Jut"
    for result in (
        run("batch", tmp_path / "photos", out, "--model", network, "--workers", "1"),
        run("batch", tmp_path / EVIL, out, "--model", network),
        run("render", "a.json", "-o", EVIL),
        run("preview", "a.jpg", EVIL, "-o", "b.png"),
    ):
        assert result.exit_code
        assert "\\x1b" in result.output
        assert not _CONTROLS.search(result.output.replace("\n", ""))


def test_neither_does_one_in_the_name_of_a_clip_or_a_probe(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / f"{EVIL}.mp4", pan(4, 2.0))
    write_exr(tmp_path / f"{EVIL}.exr", render(LIGHTING, 32))
    for result in (
        run("video", clip, "-o", tmp_path / "out", "--height", "16", "--model", network),
        run("probe", "fit", tmp_path / f"{EVIL}.exr"),
    ):
        assert result.exit_code == 0, result.output
        assert SHOWN in result.output
        assert not _CONTROLS.search(result.output.replace("\n", ""))

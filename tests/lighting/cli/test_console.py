"""What commands read, print and write, and what of it is refused."""

import json
import os
import re
import subprocess
import sys
import weakref
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic_core import from_json

import lighting.cli.photos as photos
import lighting.fusion.estimate as fusion
from lighting.cli.console import _format_summary, escape_control_chars, escape_path
from lighting.envmap.relighting import adjust_lighting
from lighting.envmap.render import render
from lighting.files.exr import read_exr, write_exr
from lighting.fusion.user_input import UserInput
from lighting.map_options import Adjustments
from lighting.model import Model
from lighting.records import Lighting
from tests.conftest import encode, scene
from tests.helpers.clips import pan, write_clip
from tests.helpers.pages import ROOT
from tests.helpers.processes import LIGHTING, error_of, invoke_command, run_command, run_in_terminal

CONTROLS = re.compile("[\\x00-\\x1f\\x7f-\\x9f\\u2028-\\u202e\\u2066-\\u2069]")  # and what turns writing round

SMALL = ("--height", "16")


@pytest.mark.parametrize("command", [["estimate", "--json"], ["info"]])
def test_json_holds_names_that_are_not_utf_8_as_plain_escapes(
    command: list[str], network: Path, photo_path: Path, tmp_path: Path
) -> None:
    """Half a surrogate pair, which `json.dumps` makes of such a byte, is refused by strict readers."""
    name = os.fsencode(tmp_path) + b"/caf\xe9.jpg"
    try:
        os.link(photo_path, name)
    except OSError:
        pytest.skip("the file system takes UTF-8 alone")
    model = ["--model", str(network)] if command[0] == "estimate" else []
    for path in (os.fsdecode(name), os.fsdecode(name.replace(b"caf", b"absent"))):
        result = invoke_command(*command, path, *model)
        for line in result.stdout.splitlines() if command[0] == "estimate" else filter(None, [result.stdout]):
            record = from_json(line)  # strict
            assert record["file"].endswith("\\xe9.jpg")
            assert record == json.loads(line)


@pytest.mark.parametrize("command", [["estimate"], ["info"], ["render", "-o", "a.exr"], ["preview", "-o", "a.png"]])
def test_an_input_without_a_name_is_refused(command: list[str]) -> None:
    """It would be the current folder."""
    assert error_of(invoke_command(*command, "")).endswith("The name of the file is empty.")


def test_render_takes_a_record_or_a_line_of_estimate(record_path: Path, tmp_path: Path) -> None:
    line = json.dumps({"file": "photo.jpg", "lighting": LIGHTING.to_dict()}).encode()
    invoke_command("render", record_path, "-o", tmp_path / "a.exr", "--height", "32")
    invoke_command("render", "-", "-o", tmp_path / "b.exr", "--height", "32", stdin=line)
    invoke_command("render", "-", "-o", tmp_path / "c.exr", "--height", "32", stdin=b"\xef\xbb\xbf" + line)
    invoke_command(
        "render", "-", "-o", tmp_path / "d.exr", "--height", "32", stdin=line.decode().encode("utf-16")
    )  # PowerShell's
    maps = [read_exr(tmp_path / f"{name}.exr") for name in "abcd"]
    assert all((image == maps[0][0]).all() and lighting == LIGHTING for image, lighting in maps)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "stdin does not hold one JSON record: Expecting value: line 1 column 1 (char 0)."),
        ("{}\n{}", "stdin holds more than one record, and one is read at a time."),
        ("[" * 100_000, "stdin does not hold one JSON record: maximum recursion depth exceeded"),
        ("\xff", "stdin does not hold a JSON record: it is not text in UTF-8."),
        ("NaN", "stdin: A lighting record must be an object, not nan."),
        ("[]", "stdin: A lighting record must be an object, not []."),
        ('{"lighting": null}', "stdin: A lighting record must be an object, not None."),
        ("{}", "stdin: The lighting record needs an object 'sun'."),
        ('{"file": "x.jpg", "error": "Gone."}', "stdin: The JSON holds an error in place of a lighting record."),
        ('{"lightings": [{}, {}]}', "stdin: The JSON holds the records of several photos, and one is read at a time."),
        (
            '{"sun": {"azimuth": NaN, "elevation": 3}, "sky": {"turbidity": 3, "exposure": 1}}',
            "stdin: sun.azimuth must",
        ),
        (
            '{"sun": {"azimuth": 3, "elevation": 3}, "sky": {"turbidity": 11, "exposure": 1}}',
            "stdin: sky.turbidity is 11; it must",
        ),
        (
            '{"sun": {"azimuth": 3, "elevation": -5}, "sky": {"turbidity": 3, "exposure": 1}}',
            "stdin: sun.elevation is -5",
        ),
        ('{"sun": {"azimuth": 1' + "0" * 5000 + "}}", "stdin does not hold one JSON record: Exceeds the limit"),
        ('{"sun": {"azimuth": 3, "azimuth": 4}}', "stdin: The key 'azimuth' is given twice."),
        (" " * 1_000_001, "stdin is larger than a lighting record, which has at most 1 MB."),
    ],
    ids=range(16),
)
def test_a_bad_record_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    result = invoke_command("render", "-", "-o", tmp_path / "a.exr", stdin=text.encode("latin-1"))
    assert error_of(result).startswith(sentence)
    assert list(tmp_path.iterdir()) == []


def test_a_record_out_of_range_is_named(photo_path: Path, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    record = LIGHTING.to_dict()
    path.write_text(json.dumps({**record, "sky": {**record["sky"], "turbidity": 11}}), encoding="utf-8-sig")
    out = tmp_path / "out"
    commands: list[list[str | Path]] = [
        ["render", path, "-o", tmp_path / "a.exr"],
        ["info", path],
        ["scene", photo_path, "--for", "usd", "--lighting", path, "-o", out],
    ]
    for command in commands:
        assert error_of(invoke_command(*command)) == f"{path}: sky.turbidity is 11; it must lie in 1 to 10."
    assert not out.exists()


def test_a_bad_photo_leaves_an_older_output_alone(network: Path, tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"older")
    arguments: list[str | Path] = ["envmap", "-", "-o", tmp_path / "a.exr", "--overwrite", "--model", network]
    text = error_of(invoke_command(*arguments, stdin=b"bad"))
    assert text == "stdin: This is a text, not a photo."
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.exr": b"older"}


def test_a_map_needs_no_masked_arrays(network: Path, photo_path: Path, tmp_path: Path) -> None:
    """numpy imports them with some functions, which a process of its own waits for."""
    code = "import sys; from lighting.cli import cli; cli(sys.argv[1:], standalone_mode=False)"
    code += "; print('numpy.ma' in sys.modules)"
    command = [sys.executable, "-c", code, "envmap", photo_path, "-o", tmp_path / "a.exr", "-q", "--model", network]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "False"


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
    assert words in _format_summary("x.jpg", lighting)


def test_headings_are_told_from_0_to_359() -> None:
    told = _format_summary("x.jpg", Lighting(10.0, 33.0, 3.0, 0.1, camera_heading=359.6, relative_heading=359.5))
    assert "heading 0°, 0° clockwise from the first photo" in told


def test_a_record_without_radii_claims_none() -> None:
    told = Lighting(10.0, 33.0, 3.0, 0.1)
    assert _format_summary("x.jpg", told).startswith("x.jpg: sun 10.0° right, 33.0° high, direct sunlight 100 %")
    told = Lighting(10.0, 33.0, 3.0, 0.1, radius_50=9.5, radius_90=31.0)
    assert "33.0° high (50 % within 9.5°, 90 % within 31.0°); sure; direct sunlight" in _format_summary("x.jpg", told)


def test_without_json_errors_go_to_stderr_alone(network: Path, photo_path: Path) -> None:
    result = invoke_command("estimate", "absent.jpg", photo_path, "--model", network)
    assert len(result.stdout.splitlines()) == 1
    assert result.stderr.splitlines() == [
        "Error: absent.jpg: No such file or directory.",
        "1 of 2 photos failed.",
    ]
    assert result.exit_code == 1
    assert invoke_command("estimate", "", "--model", network).stderr == "Error: '': The name of the file is empty.\n"


def test_a_name_that_is_not_text_is_shown_escaped(network: Path, tmp_path: Path) -> None:
    name = os.fsencode(tmp_path) + b"/caf\xe9.jpg"
    Path(os.fsdecode(name)).write_bytes(encode(scene(96, 64)))
    words = run_command("estimate", os.fsdecode(name), "--model", network)
    assert words.returncode == 0
    line = run_command("estimate", "--json", os.fsdecode(name), "--model", network).stdout
    assert json.loads(line)["file"] == f"{tmp_path}/caf\\xe9.jpg"
    refused = run_command("envmap", os.fsdecode(name), "-o", os.fsdecode(name), "--model", network)
    assert refused.returncode == 2
    assert b"Traceback" not in refused.stderr


def test_what_the_terminal_cannot_show_is_escaped(network: Path, tmp_path: Path) -> None:
    photo = tmp_path / "日.jpg"
    photo.write_bytes(encode(scene(96, 64)))
    result = run_command("estimate", photo, "--model", network, env={**os.environ, "PYTHONIOENCODING": "latin-1"})
    assert (result.returncode, result.stderr) == (0, b"")
    assert b"\\u65e5.jpg: sun " in result.stdout


def test_progress_shows_on_a_terminal_alone(network: Path, photo_path: Path) -> None:
    photos = ["estimate", str(photo_path), str(photo_path), "--model", str(network)]
    assert b"2/2" in run_in_terminal(*photos, stdout_too=False)[1]
    assert run_in_terminal(*photos, "--quiet", stdout_too=False) == (0, b"")
    assert run_in_terminal("estimate", photo_path, "--model", network, stdout_too=False) == (0, b"")
    assert b"2/2" not in run_in_terminal(*photos, stdout_too=True)[1]


EVIL = "a\x1b]0;owned\x07\x9b2J\u202egnp.jpg"
SHOWN = r"a\x1b]0;owned\x07\x9b2J\u202egnp.jpg"


def test_control_characters_are_escaped_and_letters_are_not() -> None:
    assert escape_control_chars(EVIL) == escape_path(EVIL) == SHOWN
    assert escape_path("日 é\n👩\u200d🔬.jpg") == "日 é\\n👩\u200d🔬.jpg"
    assert escape_path("-") == "stdin"


@pytest.mark.parametrize("command", ["estimate", "estimate --json", "envmap", "scene", "info", "render"])
@pytest.mark.parametrize("content", ["absent", "damaged", "good"])
def test_no_escape_in_a_name_reaches_the_terminal(command: str, content: str, network: Path, tmp_path: Path) -> None:
    photo = tmp_path / EVIL
    if content != "absent":
        photo.write_bytes(encode(scene(96, 64)) if content == "good" else b"\xff\xd8")
    output: list[str | Path] = ["-o", tmp_path / "out.png"] if command in ("envmap", "render") else []
    output = ["--for", "mitsuba", "-o", tmp_path / "out"] if command == "scene" else output
    model: list[str | Path] = ["--model", network] if command not in ("info", "render") else []
    result = invoke_command(*command.split(), photo, *output, *model)
    assert not CONTROLS.search(result.output.replace("\n", ""))
    assert "owned" in result.output


def test_neither_does_one_in_a_usage_error_or_a_batch(network: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    (tmp_path / "photos" / EVIL).write_bytes(b"no photo")
    out = tmp_path / "o\x1b[2Jut"
    for result in (
        invoke_command("batch", tmp_path / "photos", out, "--model", network, "--workers", "1"),
        invoke_command("batch", tmp_path / EVIL, out, "--model", network),
        invoke_command("render", "a.json", "-o", EVIL),
        invoke_command("render", "a.json", EVIL, "-o", "b.png"),
    ):
        assert result.exit_code
        assert "\\x1b" in result.output
        assert not CONTROLS.search(result.output.replace("\n", ""))


def test_neither_does_one_in_the_name_of_a_clip_or_a_probe(network: Path, tmp_path: Path) -> None:
    clip = write_clip(tmp_path / f"{EVIL}.mp4", pan(4, 2.0))
    write_exr(tmp_path / f"{EVIL}.exr", render(LIGHTING, 32))
    for result in (
        invoke_command("video", clip, "-o", tmp_path / "out", "--height", "16", "--model", network),
        invoke_command("probe", "fit", tmp_path / f"{EVIL}.exr"),
    ):
        assert result.exit_code == 0, result.output
        assert SHOWN in result.output
        assert not CONTROLS.search(result.output.replace("\n", ""))


def test_the_line_of_an_answer_says_when_the_photo_was_taken() -> None:
    told = Lighting(10.0, 33.0, 3.0, 0.1, utc_time=datetime(2024, 6, 1, 16, 49, tzinfo=UTC))
    assert _format_summary("x.jpg", told).endswith("; taken 2024-06-01 16:49 +00:00")
    told = replace(told, utc_offset=5.75, time_source="zone of the place")
    assert _format_summary("x.jpg", told).endswith("; taken 2024-06-01 22:34 +05:45 (zone of the place)")


def test_the_network_is_gone_before_the_next_one_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    networks: list[weakref.ref[Model]] = []
    answer, load = fusion.estimate_light, Model.load

    def load_watched(*given: Any, **options: Any) -> Model:
        model = load(*given, **options)
        networks.append(weakref.ref(model))
        return model

    def estimate(*given: Any) -> Any:
        assert [network() for network in networks] == [None]
        return answer(*given)

    monkeypatch.setattr(Model, "load", load_watched)
    monkeypatch.setattr(fusion, "estimate_light", estimate)
    assert photos.estimate_file(str(ROOT / "examples" / "wide_street.jpg"), UserInput(), None).segments is not None
    assert len(networks) == 1


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
        (["--overcast", "--sun", "40,25"], Adjustments(overcast=True, sun=(40.0, 25.0))),
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


def test_a_sun_that_the_answer_does_not_list_is_named_by_its_option(tmp_path: Path) -> None:
    sure = Path(__file__).parents[3] / "examples" / "wide_street.jpg"
    result = invoke_command("envmap", sure, "--pick", "3", "-o", tmp_path / "a.exr", *SMALL)
    assert error_of(result).startswith("--pick is 3, and the answer lists ")
    assert not list(tmp_path.iterdir())


def test_an_error_of_any_command_names_the_option(record_path: Path, tmp_path: Path) -> None:
    result = invoke_command("render", record_path, "--pick", "2", "-o", tmp_path / "a.exr", *SMALL)
    assert error_of(result) == "--pick is 2, and the answer lists no suns."


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

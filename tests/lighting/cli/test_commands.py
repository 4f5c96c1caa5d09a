"""Tests of commands and groups: examples, suggestions, old names, completion, and what an installation holds."""

import json
import os
import shlex
import subprocess
import sys
from base64 import urlsafe_b64encode
from collections.abc import Iterator
from errno import ENOENT
from hashlib import sha256
from importlib.metadata import Distribution, version
from importlib.util import find_spec
from pathlib import Path

import click
import pytest

from lighting.cli import Command, Group, cli
from lighting.cli.info import _find_changed_files
from lighting.confinement import describe_confinement
from lighting.envmap.render import render
from lighting.files.exr import write_exr
from lighting.scene import EXPORTERS
from tests.helpers.processes import LIGHTING, error_of, invoke_command, list_commands
from tests.helpers.requirements import find


def all_commands() -> Iterator[tuple[str, Command | Group]]:
    for name, command in list_commands().items():
        assert isinstance(command, Command | Group), name
        yield name, command
        if isinstance(command, Group):
            for part, leaf in command.commands.items():
                assert isinstance(leaf, Command), part
                yield f"{name} {part}", leaf


EXAMPLES = [(name, line) for name, command in all_commands() for line in command.examples]


@pytest.mark.parametrize(
    ("name", "command"), list(all_commands()), ids=lambda value: value if isinstance(value, str) else ""
)
def test_help_ends_with_three_examples(name: str, command: Command | Group) -> None:
    text = invoke_command(*name.split(), "--help").stdout
    assert len(command.examples) == 3
    assert text.split("Examples:\n")[1].splitlines() == [f"  {line}" for line in command.examples]


@pytest.mark.parametrize(("name", "line"), EXAMPLES, ids=[line.split("  ")[0] for _, line in EXAMPLES])
def test_examples_are_right_usage(name: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for folder in ("bracket", "day", "skies", "photos"):
        Path(folder).mkdir()
    for file in ("photo.jpg", "sky.exr", "statue.png", "*.dng", "ball_*.jpg"):
        Path(file).touch()
    words = shlex.split(line.split(" > ")[0].split(" && ")[0].removeprefix("BROWSER=firefox "), comments=True)
    assert words[0] == "lighting"
    context, command = click.Context(cli, info_name="lighting"), click.Command("")
    rest = words[1:]
    while rest and isinstance(context.command, click.Group):
        found = context.command.get_command(context, rest[0])
        assert found is not None, rest
        command, name = found, rest.pop(0)
        context = (
            click.Context(command, context, name)
            if isinstance(command, click.Group)
            else command.make_context(name, rest, context)
        )
    assert not isinstance(command, click.Group)


def test_help_lists_commands_in_the_order_of_use() -> None:
    text = invoke_command("--help").stdout
    shown = [line.split()[0] for line in text.split("Commands:\n")[1].split("\n\n")[0].splitlines()]
    assert shown == list(list_commands())
    assert shown.index("envmap") < shown.index("render") < shown.index("probe") < shown.index("doctor")
    assert invoke_command("help", "probe", "merge").stdout == invoke_command("probe", "merge", "--help").stdout
    assert invoke_command("help").stdout == text


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["envmp"], "There is no command 'envmp'. Did you mean envmap?"),
        (["Estimate"], "There is no command 'Estimate'. Did you mean estimate?"),
        (["frobnicate"], "There is no command 'frobnicate'. `lighting --help` lists all."),
        (["probe", "merg"], "There is no command 'merg'. Did you mean merge?"),
        (["stereo", "day.jpg"], "There is no command 'day.jpg'. `lighting stereo --help` lists all."),
        (["IMG_1234.HEIC"], "try `lighting envmap IMG_1234.HEIC` or `lighting estimate IMG_1234.HEIC`."),
        (["my photo.jpg"], "try `lighting envmap 'my photo.jpg'` or `lighting estimate 'my photo.jpg'`."),
        (["raw.CR3"], "raw.CR3 is a photo, not a command"),
        (["shot.MP4"], "try `lighting video shot.MP4`."),
        (["light.json"], "try `lighting render light.json`."),
        (["sky.exr"], "try `lighting info sky.exr`."),
        (["."], "try `lighting batch .`."),
        (["help", "envmp"], "There is no command 'envmp'. Did you mean envmap?"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_what_is_no_command_is_told_what_to_type(words: list[str], sentence: str) -> None:
    assert sentence in error_of(invoke_command(*words), 2)


def test_one_argument_too_many_is_named(tmp_path: Path) -> None:
    sentence = error_of(invoke_command("render", "a.json", "b.json", "-o", tmp_path / "a.exr"), 2)
    assert sentence == "`lighting render` takes only LIGHTING.json; 'b.json' is too much."


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (["--lat", "48"], "--lat needs --lon too, such as --lat 48.14 --lon 11.58."),
        (["--longitude", "11"], "--lon needs --lat too, such as --lat 48.14 --lon 11.58."),
        (["--heading", "north"], "Invalid value for '--heading': 'north' is not a number such as 134.2."),
        (["--haze", "thick"], "Invalid value for '--haze': 'thick' is not a number such as 3.4."),
    ],
)
def test_errors_say_what_to_type(arguments: list[str], sentence: str) -> None:
    assert error_of(invoke_command("envmap", "a.jpg", *arguments), 2) == sentence


def test_another_file_in_a_records_place_is_named(photo_path: Path, tmp_path: Path) -> None:
    """And what to do with it."""
    exr = tmp_path / "sky map.exr"
    write_exr(exr, render(LIGHTING, 256), LIGHTING, compression="none")
    assert exr.stat().st_size > 1_000_000
    said = error_of(invoke_command("render", exr))
    assert said == f"{exr} is an EXR, not a record (.json). Its record: `lighting info '{exr}'`."
    said = error_of(invoke_command("render", photo_path))
    assert said == f"{photo_path} is a photo, not a record (.json). Its map: `lighting envmap {photo_path}`."
    (tmp_path / "a.gif").write_bytes(b"GIF89a" + bytes(50))
    assert "is a GIF, not a record (.json)." in error_of(invoke_command("render", tmp_path / "a.gif"))
    (tmp_path / "read.me").write_text("# A page\n")
    assert "no photo, EXR, Radiance HDR, network (.onnx) or record (.json)" in error_of(
        invoke_command("info", tmp_path / "read.me")
    )


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (["estimate", "--no-exif"], ["estimate", "--no-metadata"]),
        (["estimate", "--fov", "40"], ["estimate", "--vertical-fov", "40"]),
        (["estimate", "--lat=48", "--lon=11", "--time=2024-06-01T12:00Z"], [
            *("estimate", "--latitude", "48", "--longitude", "11", "--time", "2024-06-01T12:00Z")
        ]),
    ],
    ids=lambda words: words[1],
)  # fmt: skip
def test_old_names_mean_the_new_ones(old: list[str], new: list[str], photo_path: Path, network: Path) -> None:
    before, now = (invoke_command(*words, "--json", photo_path, "--model", network).stdout for words in (old, new))
    assert before == now != ""


def test_old_names_of_a_lens_and_of_a_camera_are_hidden(tmp_path: Path) -> None:
    merge, normals = (dict(all_commands())[name] for name in ("probe merge", "stereo normals"))
    arguments = [__file__, "--lens", "equidistant", "--fov=170", "--pitch", "80", "--centre", "3,4"]
    params = merge.make_context("merge", arguments).params
    assert (params["fov"], params["camera_elevation"], params["center"]) == (170.0, 80.0, (3.0, 4.0))
    params = normals.make_context("normals", [str(tmp_path), "--pitch", "5", "--roll=-2"]).params
    assert (params["camera_elevation"], params["camera_roll"]) == (5.0, -2.0)
    for name in ("probe merge", "stereo normals"):
        shown = invoke_command(*name.split(), "--help").stdout
        assert not any(f" {old} " in shown for old in ("--pitch", "--roll", "--centre"))
    assert "--fov" not in invoke_command("probe", "merge", "--help").stdout.split("Examples:")[0].replace(
        "--lens-fov", ""
    )
    assert "--no-exif" not in invoke_command("estimate", "--help").stdout


def test_a_word_behind_two_dashes_is_no_option() -> None:
    assert "--no-exif: No such file" in error_of(invoke_command("estimate", "--", "--no-exif"))


# Completion, and the installation


@pytest.mark.parametrize(
    ("words", "expected"),
    [("lighting env", "plain,envmap"), ("lighting scene a.jpg --for bl", "plain,blender")],
)
def test_shells_complete_commands_and_choices(words: str, expected: str) -> None:
    environment = {**os.environ, "_LIGHTING_COMPLETE": "bash_complete", "COMP_WORDS": words}
    environment["COMP_CWORD"] = str(len(words.split()) - 1)
    code = "import sys; sys.argv = ['lighting']; from lighting.__main__ import run_command; run_command()"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.splitlines() == [expected]


def test_shells_complete_files_models_and_packings() -> None:
    envmap = dict(all_commands())["envmap"]
    context = click.Context(envmap)
    parameters = {param.name: param for param in envmap.params}
    assert [item.type for item in parameters["photos"].shell_complete(context, "IM")] == ["file"]
    assert "hosek-wilkie" in [item.value for item in parameters["sky"].shell_complete(context, "h")]
    assert [item.value for item in parameters["compression"].shell_complete(context, "p")] == ["pxr24"]


def test_every_command_takes_json_and_quiet() -> None:
    for name, command in all_commands():
        if isinstance(command, Group):
            continue
        options = {option for param in command.params for option in param.opts}
        assert {"--json", "--quiet"} <= options, name


def test_the_doctor_says_what_works() -> None:
    result = invoke_command("doctor", "--json")
    findings = {finding["name"]: finding for finding in json.loads(result.stdout)}
    assert result.exit_code == 0
    assert findings["network"]["text"].startswith("outdoor ")
    assert {"answer", "page", "Blender", "bpy", "libraries"} <= findings.keys()
    assert findings["data"]["text"] == "6 networks and tables are intact"
    assert findings["scenes"]["text"] == f"`scene --for` writes {', '.join(EXPORTERS)}"
    assert "UTC+01:00 in Rome" in findings["day"]["text"]
    assert findings["MCP"]["found"] is (find("mcp") is not None)
    assert findings["ComfyUI's frontend"]["found"] is (find_spec("comfyui_frontend_package") is not None)
    assert findings["sandbox"]["text"].startswith(describe_confinement())
    assert findings["OpenCV"]["found"] is (find("cv2") is not None)
    assert f"numpy {version('numpy')}," in findings["libraries"]["text"]


@pytest.mark.parametrize("damaged", [False, True])
def test_the_doctor_compares_with_what_was_installed(
    damaged: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wheel's RECORD lists all files, templates and code among them."""
    parts = {"lighting/__init__.py": b"", "lighting/data/scene.usda": b"#usda 1.0", "lighting/cli/info.py": b"x = 1"}
    record = []
    for name, data in parts.items():
        (tmp_path / name).parent.mkdir(exist_ok=True, parents=True)
        (tmp_path / name).write_bytes(data)
        digest = urlsafe_b64encode(sha256(data).digest()).rstrip(b"=").decode()
        record.append(f"{name},sha256={digest},{len(data)}")
    (tmp_path / "outdoor_lighting-1.dist-info").mkdir()
    (tmp_path / "outdoor_lighting-1.dist-info" / "RECORD").write_text("\n".join([*record, "lighting/a.pyc,,"]))
    if damaged:
        (tmp_path / "lighting" / "data" / "scene.usda").write_bytes(b"#usdb 1.0")
        (tmp_path / "lighting" / "cli" / "info.py").unlink()
    installed = Distribution.at(tmp_path / "outdoor_lighting-1.dist-info")
    monkeypatch.setattr("lighting.cli.info.distribution", lambda _: installed)
    monkeypatch.setattr("lighting.cli.info.__file__", str(tmp_path / "lighting" / "cli" / "info.py"))
    (finding,) = _find_changed_files()
    changed = "lighting/data/scene.usda, lighting/cli/info.py changed since the installation; install it again"
    assert finding.text == (changed if damaged else "3 are as they were installed")
    assert (finding.found, finding.needed) == (not damaged, damaged)


def test_the_doctor_names_a_door_that_is_shut(monkeypatch: pytest.MonkeyPatch) -> None:
    """What not every photo needs is no failure."""

    def fail(*_: object) -> bytes:
        raise FileNotFoundError(ENOENT, "No such file or directory", "viewer.html")

    monkeypatch.setattr("lighting.scene.writer.zip_scene", fail)
    result = invoke_command("doctor")
    assert result.exit_code == 0
    assert "-        scenes: viewer.html: No such file or directory" in result.stdout


def test_the_doctor_names_what_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    from lighting.errors import ModelError

    def fail() -> str:
        raise ModelError("There is no network.")

    monkeypatch.setattr("lighting.cli.info._check_network", fail)
    monkeypatch.setattr("lighting.cli.info._estimate_gray", lambda: "ok")
    monkeypatch.setattr("lighting.cli.info.find_spec", lambda _: None)
    result = invoke_command("doctor")
    assert result.exit_code == 1
    assert "BROKEN   network: There is no network.\n" in result.stdout
    assert "RAW photos: pip install 'outdoor-lighting[all]'" in result.stdout
    assert invoke_command("doctor", "--quiet").stdout == "BROKEN   network: There is no network.\n"

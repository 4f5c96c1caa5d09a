"""The command line: words, JSON, files, pipes, exit statuses, and one sentence for whatever goes wrong."""

import fcntl
import json
import os
import pty
import signal
import struct
import subprocess
import sys
import termios
from io import BytesIO
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from lighting import __version__
from lighting.cli import cli
from lighting.cli.words import in_words
from lighting.envmap import render
from lighting.files import full_record
from lighting.files.exr import read_exr
from lighting.model import Model
from lighting.photo.read import read_photo
from lighting.pipeline import Estimator
from lighting.records import Lighting
from tests.conftest import TINY, encode, scene

LIGHTING = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.021, sun_visibility=0.9)
METADATA = ["local_time", "utc_offset", "utc_time", "heading", "heading_reference", "focal_length", "vertical_fov"]
COMMANDS = ["estimate", "envmap", "render", "preview", "info"]


def run(*arguments: str | Path, stdin: bytes | None = None) -> Result:
    """A command in this process; what is no click exception propagates."""
    return CliRunner().invoke(cli, [str(a) for a in arguments], input=stdin, prog_name="lighting")


def sub(*arguments: str | Path, stdin: bytes = b"", **options: Any) -> subprocess.CompletedProcess[bytes]:
    """A command in a process of its own."""
    command = [sys.executable, "-m", "lighting", *map(str, arguments)]
    return subprocess.run(command, input=stdin, capture_output=True, timeout=60, check=False, **options)


def error_of(result: Result, status: int = 1) -> str:
    """The one sentence of a command that failed."""
    assert result.exit_code == status, result.output
    assert isinstance(result.exception, SystemExit)
    assert result.stdout == ""
    line = result.stderr.splitlines()[-1]
    assert line.startswith("Error: ")
    assert line.endswith(".")
    assert len(result.stderr.splitlines()) == (1 if status == 1 else 4)
    return line.removeprefix("Error: ")


@pytest.fixture
def record_path(tmp_path: Path) -> Path:
    path = tmp_path / "lighting.json"
    path.write_text(json.dumps(LIGHTING.to_dict()))
    return path


@pytest.fixture
def expected(network: Path, photo_path: Path) -> Lighting:
    return Estimator(Model.load(network))(read_photo(photo_path)).lighting


# Help and start


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("command", [[], *([c] for c in COMMANDS)], ids=lambda c: " ".join(c) or "lighting")
def test_help_is_everywhere(command: list[str], flag: str) -> None:
    result = run(*command, flag)
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: {' '.join(['lighting', *command])} ")


def test_help_names_every_command_whole() -> None:
    text = run("--help").stdout
    for command in COMMANDS:
        assert f"\n  {command} " in text
    assert "..." not in text.split("Commands:")[1]


def test_every_option_has_help() -> None:
    for command in cli.commands.values():
        for option in command.params:
            assert isinstance(option, click.Argument) or getattr(option, "help", None), (command.name, option.name)


def test_version() -> None:
    assert run("--version").stdout == f"lighting, version {__version__}\n"


def test_help_imports_nothing_heavy() -> None:
    code = "import sys, lighting.cli; print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert "lighting.cli" in modules
    assert not {"numpy", "PIL", "onnxruntime", "OpenEXR", "tqdm", "lighting.records"} & set(modules)


def test_help_answers_at_once() -> None:
    """0.4 s is promised. Processor time, since the machine may be busy with other things."""
    before = os.times()
    assert sub("--help").returncode == 0
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    assert 0 < spent < 0.4


@pytest.mark.parametrize(
    "arguments", [["nonsense"], ["estimate"], ["envmap", "a.jpg"], ["estimate", "--nonsense", "x"]]
)
def test_wrong_usage_is_status_2(arguments: list[str]) -> None:
    assert run(*arguments).exit_code == 2


# estimate


def test_estimate_says_where_the_light_comes_from(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = run("estimate", photo_path, "--model", network)
    assert result.exit_code == 0
    (line,) = result.stdout.splitlines()
    assert result.stderr == ""
    assert line.startswith(f"{photo_path}: sun {abs(expected.sun_azimuth):.1f}° ")
    for words in (
        f"{expected.sun_elevation:.1f}° high",
        f"50 % within {expected.radius_50:.1f}°",
        f"90 % within {expected.radius_90:.1f}°",
        f"direct sunlight {100 * expected.sun_visibility:.0f} %",
        f"turbidity {expected.turbidity:.1f}",
        f"camera looks {expected.camera_elevation:.1f}° up",
        f"roll {expected.camera_roll:.1f}°",
        f"vertical field of view {expected.vertical_fov:.1f}°",
    ):
        assert words in line


@pytest.mark.parametrize(
    ("azimuth", "elevation", "words"),
    [
        (-41.24, 4.0, "sun 41.2° left, 33.0° high"),
        (41.24, 4.0, "sun 41.2° right, 33.0° high"),
        (0.04, 4.0, "sun straight ahead, 33.0° high"),
        (-170.0, 4.0, "sun 170.0° left (behind), 33.0° high"),
        (180.0, -7.31, "camera looks 7.3° down"),
    ],
)
def test_sides_are_told_in_words(azimuth: float, elevation: float, words: str) -> None:
    lighting = Lighting(azimuth, 33.0, 3.0, 0.1, camera_elevation=elevation)
    assert words in in_words("x.jpg", lighting)


def test_estimate_as_json(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = run("estimate", "--json", photo_path, photo_path, "--model", network)
    first, second = map(json.loads, result.stdout.splitlines())
    assert first == second == {"file": str(photo_path), "lighting": full_record(expected)}
    assert (result.exit_code, result.stderr) == (0, "")


def test_a_bad_photo_does_not_stop_the_others(network: Path, photo_path: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"bad")
    bad, absent = tmp_path / "bad.jpg", tmp_path / "absent.jpg"
    result = run("estimate", "--json", bad, photo_path, absent, tmp_path, "--model", network)
    lines = [json.loads(line) for line in result.stdout.splitlines()]
    assert [line["file"] for line in lines] == [str(p) for p in (bad, photo_path, absent, tmp_path)]
    assert [set(line) for line in lines] == [{"file", "error"}, {"file", "lighting"}, *[{"file", "error"}] * 2]
    assert lines[0]["error"] == "The file is not a JPEG, PNG, WebP or HEIC photo that can be read."
    assert lines[2]["error"] == "No such file or directory."
    assert result.stderr.splitlines() == [
        f"Error: {bad}: {lines[0]['error']}",
        f"Error: {absent}: No such file or directory.",
        f"Error: {tmp_path}: Is a directory.",
        "3 of 4 photos failed.",
    ]
    assert result.exit_code == 1


def test_without_json_errors_go_to_stderr_alone(network: Path, photo_path: Path) -> None:
    result = run("estimate", "absent.jpg", photo_path, "--model", network)
    assert len(result.stdout.splitlines()) == 1
    assert result.stderr.splitlines() == [
        "Error: absent.jpg: No such file or directory.",
        "1 of 2 photos failed.",
    ]
    assert result.exit_code == 1


def test_one_bad_photo_is_not_counted(network: Path) -> None:
    assert error_of(run("estimate", "absent.jpg", "--model", network)) == "absent.jpg: No such file or directory."


def test_estimate_reads_stdin(network: Path, photo_path: Path, expected: Lighting) -> None:
    result = run("estimate", "--json", "-", "--model", network, stdin=photo_path.read_bytes())
    assert json.loads(result.stdout) == {"file": "-", "lighting": full_record(expected)}
    assert error_of(run("estimate", "-", "--model", network, stdin=b"")) == "stdin: The photo is empty."


def test_a_bad_network_is_one_sentence(photo_path: Path) -> None:
    text = error_of(run("estimate", photo_path, photo_path, "--model", photo_path))
    assert text == f"{photo_path} is not an ONNX network that can be read: Protobuf parsing failed."


def test_debug_shows_the_traceback(photo_path: Path) -> None:
    plain, debug = (sub(*flag, "estimate", photo_path, "--model", "absent.onnx") for flag in ([], ["--debug"]))
    assert plain.stderr == b"Error: There is no network at absent.onnx.\n"
    assert b"Traceback" in debug.stderr
    assert plain.returncode == debug.returncode == 1


# envmap and render


@pytest.mark.parametrize(("name", "magic"), [("a.exr", b"v/1\x01"), ("a.HDR", b"#?RADIANCE"), ("a.png", b"\x89PNG")])
def test_envmap_writes_by_suffix(network: Path, photo_path: Path, tmp_path: Path, name: str, magic: bytes) -> None:
    result = run("envmap", photo_path, "-o", tmp_path / name, "--height", "64", "--model", network)
    assert (result.exit_code, result.stderr) == (0, "")
    assert (tmp_path / name).read_bytes().startswith(magic)
    assert result.stdout == run("estimate", photo_path, "--model", network).stdout
    assert {p.name for p in tmp_path.iterdir()} == {"photo.jpg", name}


def test_envmap_is_the_render_of_the_estimate(
    network: Path, photo_path: Path, tmp_path: Path, expected: Lighting
) -> None:
    run("envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "32", "--model", network)
    image, lighting = read_exr(tmp_path / "a.exr")
    assert lighting == expected
    assert image == pytest.approx(render(expected, 32))


def test_quiet_envmap_prints_nothing(network: Path, photo_path: Path, tmp_path: Path) -> None:
    result = run("envmap", photo_path, "-o", tmp_path / "a.exr", "--height", "16", "--model", network, "-q")
    assert (result.exit_code, result.output) == (0, "")


@pytest.mark.parametrize("flag", ["--sun", "--no-sun"])
def test_the_sun_is_a_choice(record_path: Path, tmp_path: Path, flag: str) -> None:
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "64", flag)
    assert read_exr(tmp_path / "a.exr")[0] == pytest.approx(render(LIGHTING, 64, sun=flag == "--sun"))


def test_yaw_turns_the_map_and_the_record_in_it(record_path: Path, tmp_path: Path) -> None:
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "64", "--yaw", "-180")
    image, lighting = read_exr(tmp_path / "a.exr")
    assert image == pytest.approx(np.roll(render(LIGHTING, 64), 64, axis=1))
    assert lighting is not None
    assert lighting.sun_azimuth == pytest.approx(138.8)


def test_render_takes_a_record_or_a_line_of_estimate(record_path: Path, tmp_path: Path) -> None:
    line = json.dumps({"file": "photo.jpg", "lighting": LIGHTING.to_dict()}).encode()
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "32")
    run("render", "-", "-o", tmp_path / "b.exr", "--height", "32", stdin=line)
    run("render", "-", "-o", tmp_path / "c.exr", "--height", "32", stdin=b"\xef\xbb\xbf" + line)
    maps = [read_exr(tmp_path / f"{name}.exr") for name in "abc"]
    assert all((image == maps[0][0]).all() and lighting == LIGHTING for image, lighting in maps)


def test_info_of_a_map_can_be_rendered_again(record_path: Path, tmp_path: Path) -> None:
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "32", "--yaw", "90")
    described = run("info", tmp_path / "a.exr")
    run("render", "-", "-o", tmp_path / "b.exr", "--height", "32", stdin=described.stdout_bytes)
    assert read_exr(tmp_path / "b.exr")[0] == pytest.approx(read_exr(tmp_path / "a.exr")[0], rel=1e-2)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("", "stdin does not hold one JSON record: Expecting value: line 1 column 1 (char 0)."),
        ("{}\n{}", "stdin does not hold one JSON record: Extra data: line 2 column 1 (char 3)."),
        ("[" * 100_000, "stdin does not hold one JSON record: maximum recursion depth exceeded"),
        ("\xff", "stdin does not hold one JSON record: 'utf-8' codec can't decode byte 0xff"),
        ("NaN", "The lighting record needs an object 'sun'."),
        ("[]", "The lighting record needs an object 'sun'."),
        ('{"lighting": null}', "The lighting record needs an object 'sun'."),
        ('{"file": "x.jpg", "error": "Gone."}', "stdin holds an error in place of a lighting record."),
        ('{"sun": {"azimuth": NaN, "elevation": 3}, "sky": {"turbidity": 3, "exposure": 1}}', "sun_azimuth must be a"),
        (
            '{"sun": {"azimuth": 3, "elevation": 3}, "sky": {"turbidity": 11, "exposure": 1}}',
            "turbidity is 11; it must",
        ),
        ('{"sun": {"azimuth": 3, "elevation": -3}, "sky": {"turbidity": 3, "exposure": 1}}', "sun_elevation is -3;"),
        ('{"sun": {"azimuth": 1' + "0" * 5000 + "}}", "stdin does not hold one JSON record: Exceeds the limit"),
    ],
    ids=range(12),
)
def test_a_bad_record_is_one_sentence(tmp_path: Path, text: str, sentence: str) -> None:
    result = run("render", "-", "-o", tmp_path / "a.exr", stdin=text.encode("latin-1"))
    assert error_of(result).startswith(sentence)
    assert list(tmp_path.iterdir()) == []


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


def test_inputs_are_never_overwritten(network: Path, tmp_path: Path) -> None:
    photo = tmp_path / "photo.png"
    photo.write_bytes(encode(scene(96, 64), "PNG"))
    (tmp_path / "link.png").symlink_to(photo)
    for output in (photo, tmp_path / "link.png", tmp_path / ".." / tmp_path.name / "photo.png"):
        for command in ("envmap", "preview"):
            text = error_of(run(command, photo, "-o", output, "--model", network), 2)
            assert text == "The input and the outputs must be different files."
    same = tmp_path / "a.png"
    error_of(run("envmap", photo, "-o", same, "--preview", same, "--model", network), 2)
    error_of(run("envmap", photo, "-o", "-", "--preview", "-", "--model", network), 2)
    assert photo.read_bytes() == encode(scene(96, 64), "PNG")


def test_a_bad_photo_leaves_an_older_output_alone(network: Path, tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"older")
    text = error_of(run("envmap", "-", "-o", tmp_path / "a.exr", "--model", network, stdin=b"bad"))
    assert text == "stdin: The file is not a JPEG, PNG, WebP or HEIC photo that can be read."
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {"a.exr": b"older"}


def test_a_write_that_fails_is_one_sentence_and_leaves_nothing(
    record_path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device", "a.exr")

    monkeypatch.setattr(Path, "replace", full)
    assert "No space left on device" in error_of(run("render", record_path, "-o", tmp_path / "a.exr", "--height", "16"))
    assert [p.name for p in tmp_path.iterdir()] == ["lighting.json"]


# preview and info


@pytest.mark.slow
def test_preview_draws_a_png(network: Path, photo_path: Path, tmp_path: Path) -> None:
    alone, beside = tmp_path / "alone.png", tmp_path / "beside.png"
    result = run("preview", photo_path, "-o", alone, "--model", network)
    assert (result.exit_code, result.output) == (0, "")
    options = ["--height", "64", "--yaw", "45", "--preview", str(beside)]
    assert run("envmap", photo_path, "-o", tmp_path / "a.exr", "--model", network, *options).exit_code == 0
    with Image.open(alone) as first, Image.open(beside) as second:
        assert first.format == "PNG"
        assert min(first.size) > 500
        assert (np.asarray(first) == np.asarray(second)).all()


@pytest.mark.slow
def test_preview_to_stdout(network: Path, photo_path: Path) -> None:
    result = run("preview", "-", "-o", "-", "--model", network, stdin=photo_path.read_bytes())
    with Image.open(BytesIO(result.stdout_bytes)) as drawing:
        assert drawing.format == "PNG"
    assert result.stderr == ""


def test_info_of_each_kind(network: Path, photo_path: Path, record_path: Path, tmp_path: Path) -> None:
    run("render", record_path, "-o", tmp_path / "a.exr", "--height", "16")
    photo, net, envmap = (json.loads(run("info", f).stdout) for f in (photo_path, network, tmp_path / "a.exr"))
    assert photo.pop("metadata") == {**dict.fromkeys(METADATA), "location": False}
    assert photo == {"file": str(photo_path), "kind": "photo", "format": "JPEG", "width": 320, "height": 240}
    assert net == {"file": str(network), "kind": "network", **json.loads(TINY.to_json())}
    assert envmap.pop("lighting") == full_record(LIGHTING)
    assert envmap == {"file": str(tmp_path / "a.exr"), "kind": "environment map", "width": 32, "height": 16}


def test_info_reads_stdin(photo_path: Path) -> None:
    assert json.loads(run("info", "-", stdin=photo_path.read_bytes()).stdout)["width"] == 320


@pytest.mark.parametrize("data", [b"", b"text", b"v/1\x01 and no more"])
def test_info_of_what_is_neither_is_one_sentence(data: bytes, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(data)
    error_of(run("info", tmp_path / "file"))
    error_of(run("info", tmp_path / "absent"))
    error_of(run("info", tmp_path))


# Real processes


def test_a_chain_of_pipes(network: Path, photo_path: Path) -> None:
    record = sub("estimate", "--json", "-", "--model", network, stdin=photo_path.read_bytes())
    envmap = sub("render", "-", "-o", "-", "--height", "32", stdin=record.stdout)
    assert read_exr(BytesIO(envmap.stdout))[0].shape == (32, 64, 3)
    direct = sub("envmap", "-", "-o", "-", "--height", "32", "--model", network, stdin=photo_path.read_bytes())
    assert direct.stdout == envmap.stdout
    assert [p.returncode for p in (record, envmap, direct)] == [0, 0, 0]
    assert [p.stderr for p in (record, envmap, direct)] == [b"", b"", b""]


def test_statuses_of_real_processes(network: Path, photo_path: Path) -> None:
    assert sub("estimate", photo_path, "--model", network).returncode == 0
    failed = sub("estimate", "absent.jpg", "--model", network)
    assert (failed.returncode, failed.stderr) == (1, b"Error: absent.jpg: No such file or directory.\n")
    assert sub("estimate").returncode == 2


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


def test_a_reader_that_leaves_early_is_no_error(network: Path, photo_path: Path) -> None:
    command = [sys.executable, "-m", "lighting", "estimate", *[str(photo_path)] * 3, "--model", str(network)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.stderr.read() == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_one_sentence(network: Path, photo_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "lighting", "envmap", str(photo_path), "-o", "-", "--model", str(network)]
        process = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60, check=False)
    assert (process.returncode, process.stderr) == (1, b"Error: No space left on device.\n")


def test_an_interrupt_leaves_no_traceback(network: Path) -> None:
    command = [sys.executable, "-m", "lighting", "estimate", "absent.jpg", "-", "--model", str(network)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith(b"Error: absent.jpg")  # now it waits for stdin
        process.send_signal(signal.SIGINT)
        assert b"Traceback" not in process.stderr.read()
    assert process.returncode == 1


def terminal(*arguments: str | Path, stdout_too: bool) -> tuple[int, bytes]:
    """Exit status and what a terminal shows of a command whose stderr, and perhaps stdout, it is."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("4H", 24, 100, 0, 0))
    command = [sys.executable, "-m", "lighting", *map(str, arguments)]
    stdout = slave if stdout_too else subprocess.PIPE
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=stdout, stderr=slave) as process:
        process.communicate(timeout=60)
    os.close(slave)
    shown = b""
    try:
        while chunk := os.read(master, 65536):
            shown += chunk
    except OSError:  # how Linux ends it
        pass
    os.close(master)
    return process.returncode, shown


def test_progress_shows_on_a_terminal_alone(network: Path, photo_path: Path) -> None:
    photos = ["estimate", str(photo_path), str(photo_path), "--model", str(network)]
    assert b"2/2" in terminal(*photos, stdout_too=False)[1]
    assert terminal(*photos, "--quiet", stdout_too=False) == (0, b"")
    assert terminal("estimate", photo_path, "--model", network, stdout_too=False) == (0, b"")
    assert b"2/2" not in terminal(*photos, stdout_too=True)[1]


def test_a_terminal_is_spared_binary_data(network: Path, photo_path: Path) -> None:
    status, shown = terminal("envmap", photo_path, "-o", "-", "--model", network, stdout_too=True)
    assert status == 2
    assert b"Binary data needs a file or a pipe, not a terminal." in shown

"""Help, version, and how errors end."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import click
import pytest

from lighting.cli import Command
from lighting.version import __version__
from tests.helpers.processes import invoke_command, list_commands, run_command, wait_for_state

COMMANDS = ["estimate", "envmap", "render", "preview", "info"]


@pytest.mark.parametrize("flag", ["-h", "--help"])
@pytest.mark.parametrize("command", [[], *([c] for c in COMMANDS)], ids=lambda c: " ".join(c) or "lighting")
def test_help_is_everywhere(command: list[str], flag: str) -> None:
    result = invoke_command(*command, flag)
    assert result.exit_code == 0
    assert result.stdout.startswith(f"Usage: {' '.join(['lighting', *command])} ")


def test_help_names_every_command_whole() -> None:
    text = invoke_command("--help").stdout
    for command in COMMANDS:
        assert f"\n  {command} " in text
    assert "..." not in text.split("Commands:")[1].split("Examples:")[0]


def test_every_option_has_help() -> None:
    assert set(COMMANDS) < set(list_commands())
    for command in list_commands().values():
        for option in command.params:
            assert isinstance(option, click.Argument) or getattr(option, "help", None), (command.name, option.name)


@pytest.mark.parametrize("name", ["envmap", "scene", "batch", "video"])
def test_a_long_help_has_five_sections(name: str) -> None:
    """Each option stands in one; those of envmap that people use are on the first screen."""
    command = list_commands()[name]
    assert isinstance(command, Command)
    context = click.Context(command, info_name=name)
    sections = command.option_sections(context)
    groups = [title for title in sections if title != "Options"]
    assert groups == ["Output", "Light", "Place", "Photo", "Map"]
    shown = [names for records in sections.values() for names, _ in records]
    options = [p for p in command.get_params(context) if isinstance(p, click.Option) and not p.hidden]
    assert len(shown) == len(set(shown)) == len(options)
    screen = "\n".join(invoke_command("envmap", "--help").stdout.splitlines()[:24])
    assert all(option in screen for option in ("--output", "--preview", "--height", "--sun", "--exposure", "--haze"))
    assert ("Options" in sections) == (name in ("scene", "batch", "video"))


@pytest.mark.parametrize("group", [[], ["probe"], ["stereo"]], ids=lambda c: " ".join(c) or "lighting")
def test_a_group_alone_shows_its_help_in_lines(group: list[str]) -> None:
    result = invoke_command(*group)
    assert result.output == invoke_command(*group, "--help").output
    assert "\\n" not in result.output


def test_version() -> None:
    assert invoke_command("--version").stdout == f"lighting, version {__version__}\n"


def test_help_imports_nothing_heavy() -> None:
    code = (
        "import sys, click, lighting.cli as c; "
        "context = click.Context(c.cli); "
        "[c.cli.get_command(context, name) for name in c.cli.list_commands(context)]; "
        "print(*sys.modules)"
    )
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert {"lighting.cli", "lighting.cli.estimate", "lighting.cli.video"} <= set(modules)
    assert not {"numpy", "PIL", "onnxruntime", "OpenEXR", "tqdm", "lighting.records"} & set(modules)


def test_help_answers_at_once() -> None:
    """0.15 s of a quiet processor is promised. One that others use as well takes up to three times as long."""
    before = os.times()
    assert run_command("--help").returncode == 0
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    assert 0 < spent < 0.45


@pytest.mark.parametrize(
    "arguments",
    [
        ["nonsense"],
        ["estimate"],
        ["envmap", "-"],
        ["estimate", "--nonsense", "x"],
        ["estimate", "x", "--model", ""],
    ],
)
def test_wrong_usage_is_status_2(arguments: list[str]) -> None:
    assert invoke_command(*arguments).exit_code == 2


def test_debug_shows_the_traceback(photo_path: Path) -> None:
    plain, debug = (run_command(*flag, "estimate", photo_path, "--model", "absent.onnx") for flag in ([], ["--debug"]))
    assert plain.stderr == b"Error: There is no network at absent.onnx.\n"
    assert b"Traceback" in debug.stderr
    assert plain.returncode == debug.returncode == 1


def test_statuses_of_real_processes(network: Path, photo_path: Path) -> None:
    assert run_command("estimate", photo_path, "--model", network).returncode == 0
    failed = run_command("estimate", "absent.jpg", "--model", network)
    assert (failed.returncode, failed.stderr) == (1, b"Error: absent.jpg: No such file or directory.\n")
    assert run_command("estimate").returncode == 2


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


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("arguments", [["--help"], ["--version"], ["render", "--help"]])
def test_so_is_one_for_help(arguments: list[str]) -> None:
    with Path("/dev/full").open("wb") as full:
        command = [sys.executable, "-m", "lighting", *arguments]
        process = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, timeout=60, check=False)
    assert (process.returncode, process.stderr) == (1, b"Error: No space left on device.\n")


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="reads /proc")
def test_an_interrupt_leaves_no_traceback(network: Path) -> None:
    command = [sys.executable, "-m", "lighting", "estimate", "absent.jpg", "-", "--model", str(network)]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe) as process:
        assert process.stderr is not None
        assert process.stderr.readline().startswith(b"Error: absent.jpg")
        wait_for_state(process.pid, "S")  # for stdin: Python sees a signal that comes just before a read only after it
        process.send_signal(signal.SIGINT)
        assert b"Traceback" not in process.stderr.read()
    assert process.returncode == 1

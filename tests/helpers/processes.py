"""Processes for tests."""

import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
import uvicorn
from click.testing import CliRunner, Result
from starlette.types import ASGIApp

from lighting.cli import cli
from lighting.records import Lighting

MANY_PHOTOS = 50  # photos, so that a batch can be stopped half-way


def run_batch(*arguments: object) -> Result:
    return CliRunner().invoke(cli, ["batch", "--workers", "1", *map(str, arguments)], prog_name="lighting")


def read_records(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "lighting.jsonl").read_text().splitlines()]


LIGHTING = Lighting(sun_azimuth=-41.2, sun_elevation=33.0, turbidity=3.4, exposure=0.021, sun_visibility=0.9)


def list_commands() -> dict[str, click.Command]:
    """The commands by name."""
    context = click.Context(cli)
    found = {name: cli.get_command(context, name) for name in cli.list_commands(context)}
    assert all(found.values())
    return {name: command for name, command in found.items() if command}


def invoke_command(*arguments: object, stdin: bytes | None = None) -> Result:
    """A command in this process; what is no click exception propagates."""
    return CliRunner().invoke(cli, [str(a) for a in arguments], input=stdin, prog_name="lighting")


def run_command(*arguments: str | Path, stdin: bytes = b"", **options: Any) -> subprocess.CompletedProcess[bytes]:
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
    assert line.endswith((".", "?"))
    assert len(result.stderr.splitlines()) == (1 if status == 1 else 4)
    return line.removeprefix("Error: ")


def run_in_terminal(*arguments: str | Path, stdout_too: bool) -> tuple[int, bytes]:
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


PATIENCE = 10.0  # seconds


def _state(pid: int) -> str:
    """The state of a process, a letter of Linux's /proc: R runs, S sleeps, Z is gone, or only its status is left."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return "Z"


def wait_for_state(pid: int, state: str) -> None:
    """Wait until a process has a state of `_state`; AssertionError where it gets another."""
    deadline = time.monotonic() + PATIENCE
    while (now := _state(pid)) != state:
        assert time.monotonic() < deadline, f"process {pid} is in state {now}, not {state}"
        time.sleep(0.02)


def wait_until_ended(pid: int) -> None:
    """Wait for the end of a process; AssertionError where it goes on."""
    wait_for_state(pid, "Z")


@contextmanager
def serve_app(app: ASGIApp, http: Any) -> Iterator[int]:
    """The port on which uvicorn serves an application by a protocol, as its setting `http` has it."""
    server = uvicorn.Server(
        uvicorn.Config(app, port=0, http=http, loop="asyncio", ws="none", log_level="error", lifespan="off")
    )
    thread = threading.Thread(target=server.run, daemon=True)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    yield server.servers[0].sockets[0].getsockname()[1]
    server.should_exit = True
    thread.join(30)

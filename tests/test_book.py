"""The book: budgets, sentences, figures and links of terms on every page; and its blocks of code run as they stand."""

import contextlib
import io
import json
import os
import re
import shlex
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from click.testing import CliRunner

from lighting.cli import cli
from lighting.estimator import Estimator
from scripts.book import (
    BESIDE,
    BUDGETS,
    MOST_WORDS,
    ROOT,
    CodeBlock,
    count_page_words,
    find_broken_rules,
    read_code_blocks,
)
from server.app import create_app
from server.settings import Settings
from tests.helpers.materials import MATERIALS

REFERENCES = sorted(path.relative_to(ROOT).as_posix() for path in (ROOT / "docs" / "reference").glob("*.md"))
RUN_HERE = {"command line", "python"}  # marks of blocks that this file runs, as it does those without a mark
RUN_ELSEWHERE = {  # marks of blocks, and what runs them
    "try": ".ci/run",
    "test": ".ci/run",
    "uv": ".ci/run",
    "blender": "tests/test_tutorials.py, by bpy or in the chroot",
    "image": "scripts/check_compose.py, by buildah and caddy",
    "train": "tests/export/test_recipes.py",
}
NOT_RUN = {"text", "json", "html", "js", "csv", "nginx"}  # languages of no program
HTTP_REFERENCE = "docs/reference/http.md"  # whose commands are run, too
SERVICE = "http://127.0.0.1:8000"
EXAMPLE_JOB = re.compile(r"/ID\b|/4d1c0a6f5e2b7398\b")  # as the pages name a job
PATIENCE = 120.0  # seconds
BEGINNINGS = {  # of files, by suffix
    ".exr": b"\x76\x2f\x31\x01",
    ".hdr": b"#?RADIANCE",
    ".jpg": b"\xff\xd8",
    ".png": b"\x89PNG",
    ".zip": b"PK",
    ".glb": b"glTF",
}
_GOES_ON = re.compile(r"\blighting (?:serve|open)\b|-m http\.server\b")  # until it is stopped
_SYNTAX = re.compile(r"[|;&$`()<]|^\s*(?:for|if|while|cd|export)\b")  # of lines that only a shell understands


def read_page(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


@pytest.mark.parametrize("name", [*BUDGETS, *REFERENCES, *BESIDE])
def test_a_page_keeps_the_rules(name: str) -> None:
    """`python -m scripts.book PAGE` prints the same."""
    assert find_broken_rules(name) == []


def test_the_book_is_short() -> None:
    pages = {name: count_page_words(read_page(name)) for name in BUDGETS if name != "export/README.md"}
    assert sum(pages.values()) <= MOST_WORDS, pages


@pytest.mark.parametrize("name", BUDGETS)
def test_every_block_has_a_language_and_is_run(name: str) -> None:
    for block in read_code_blocks(read_page(name)):
        assert block.language in {"sh", "python", *NOT_RUN}, block
        assert block.language != "text" or not re.match(r"(?:lighting|curl|python|docker|pip) ", block.text), block
        assert block.mark in {"", *RUN_HERE, *RUN_ELSEWHERE}, block


@pytest.fixture(scope="module")
def estimator() -> Estimator:
    """The packaged network, loaded once."""
    return Estimator()


@pytest.fixture(scope="module")
def service(estimator: Estimator, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[], str]]:
    """The address of the service, which the first call starts."""
    started: list[tuple[uvicorn.Server, threading.Thread]] = []

    def address() -> str:
        if not started:
            app = create_app(Settings(jobs_folder=tmp_path_factory.mktemp("jobs")), estimator)
            config = uvicorn.Config(app, port=0, log_level="error", ws="none")
            server = uvicorn.Server(config)
            started.append((server, threading.Thread(target=server.run, daemon=True)))
            started[0][1].start()
            while not server.started and started[0][1].is_alive():
                time.sleep(0.02)
        return f"http://127.0.0.1:{started[0][0].servers[0].sockets[0].getsockname()[1]}"

    yield address
    for server, thread in started:
        server.should_exit = True
        thread.join(30)


@pytest.fixture
def reader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, service: Callable[[], str]) -> "Reader":
    """A reader in a clone with a photo of their own, who types what a page says."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    (tmp_path / "photo.jpg").write_bytes((ROOT / "examples" / "wide_street.jpg").read_bytes())
    program = tmp_path / "bin" / "lighting"
    program.parent.mkdir()
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m lighting "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    path = os.pathsep.join([str(program.parent), str(Path(sys.executable).parent), os.environ["PATH"]])
    monkeypatch.setenv("PATH", path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    return Reader(service)


class Reader:
    """Runs blocks of code in the working folder: commands of the program in this process, the rest in a shell."""

    def __init__(self, service: Callable[[], str]) -> None:
        self._service = service
        self._job = ""  # that was started last
        self._names: dict[str, Any] = {"__name__": "__main__"}

    def run(self, block: CodeBlock) -> None:
        text = re.sub(r"^curl ", "curl --fail -sS ", block.text, flags=re.MULTILINE)
        text = text.replace(SERVICE, self._service()) if SERVICE in text else text
        if block.language == "python":
            with contextlib.redirect_stdout(io.StringIO()):
                exec(compile(text, "<block>", "exec"), self._names)
        elif block.language == "sh":
            lines = [line for line in text.replace("\\\n", " ").splitlines() if shlex.split(line, comments=True)]
            for line in [text] if any(map(_needs_shell, lines)) else lines:
                self._run_line(line)

    def _run_line(self, line: str) -> None:
        words = shlex.split(line, comments=True)
        if words[:2] == ["pip", "install"]:  # .ci/run installs
            return
        if words[:2] == ["npm", "install"]:  # .ci/run installs, and tests/test_tutorials.py uses it
            package, _, version = words[2].rpartition("@")
            assert json.loads(read_page("server/web/package.json"))["dependencies"][package].startswith(f"{version}.")
        elif goes_on := _GOES_ON.search(line):
            _check_server(words, goes_on[0])
        elif words[0] == "lighting" and not _needs_shell(line):
            _run_command(line, words[1:])
        else:
            self._run_in_shell(line)

    def _run_in_shell(self, line: str) -> None:
        line = EXAMPLE_JOB.sub(f"/{self._job}", line)
        done = subprocess.run(["sh", "-euc", line], capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, (line, done.stdout, done.stderr)
        if line.endswith("/v1/jobs"):
            self._job = json.loads(done.stdout)["id"]
            wait_for_job(f"{self._service()}/v1/jobs/{self._job}")


def wait_for_job(address: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while (job := json.loads(ask(address)))["state"] != "finished":
        assert job["state"] in ("queued", "running"), job
        assert time.monotonic() < deadline, job
        time.sleep(0.1)


def ask(address: str) -> bytes:
    """What a service of this machine answers; OSError if nothing does."""
    with urllib.request.build_opener(urllib.request.ProxyHandler({})).open(address, timeout=PATIENCE) as answer:
        body: bytes = answer.read()
    return body


def _check_server(words: list[str], program: str) -> None:
    """Assert that a command which goes on until it is stopped answers, on a free port, and ends when it is told to."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    own = {"LIGHTING_PORT": port, "BROWSER": shutil.which("true") or "true"}
    own |= dict(word.split("=", 1) for word in words if re.match(r"[A-Z_]+=", word))
    command = [port if word in ("8000", "9000") else word for word in words if not re.match(r"[A-Z_]+=", word)]
    with subprocess.Popen(command, env={**os.environ, **own}, stdout=subprocess.PIPE, text=True) as process:
        try:
            address = f"http://127.0.0.1:{port}/"
            if program == "lighting open":
                assert process.stdout
                address = process.stdout.readline().split()[1].partition("#")[0]
            wait_for_answer(process, address if "http.server" in program else f"{address}livez")
        finally:
            process.terminate()
            try:
                status = process.wait(PATIENCE)
            finally:
                process.kill()  # else the end of the block waits for ever
        assert status in (0, -signal.SIGTERM, 128 + signal.SIGTERM)


def wait_for_answer(process: "subprocess.Popen[str]", address: str) -> None:
    deadline = time.monotonic() + PATIENCE
    while process.poll() is None and time.monotonic() < deadline:
        with contextlib.suppress(OSError):
            ask(address)
            return
        time.sleep(0.1)
    raise AssertionError(f"{address} does not answer")


def _needs_shell(line: str) -> bool:
    """Whether a line is more than a command with its arguments, and perhaps a file for what it prints."""
    code = re.sub(r"'[^']*'|\"[^\"]*\"|#.*", "", line)
    return _SYNTAX.search(code) is not None or code.count(">") > 1


def _run_command(line: str, words: list[str]) -> None:
    target = words[words.index(">") + 1] if ">" in words else None
    words = words[: words.index(">")] if target else words
    arguments = [name for word in words for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])]
    result = CliRunner().invoke(cli, arguments, prog_name="lighting")
    assert result.exit_code == 0, (line, result.output, result.exception)
    if target:
        Path(target).write_bytes(result.stdout_bytes)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*BUDGETS, HTTP_REFERENCE])
def test_the_blocks_of_a_page_run(name: str, reader: Reader, tmp_path: Path) -> None:
    """One after the other, in one folder with what the page's reader brings; what deletes comes last."""
    if name in MATERIALS:
        MATERIALS[name](tmp_path)
    for block in sorted(read_code_blocks(read_page(name)), key=lambda block: "-X DELETE" in block.text):
        if block.mark not in RUN_ELSEWHERE:
            reader.run(block)
    for file in Path().iterdir():
        assert file.is_dir() or file.read_bytes().startswith(BEGINNINGS.get(file.suffix, b"")), file

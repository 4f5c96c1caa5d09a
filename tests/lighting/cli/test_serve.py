"""`lighting open` and `lighting serve`: the service as a process of its own."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import pytest

from tests.helpers.pages import ROOT
from tests.helpers.processes import invoke_command
from tests.helpers.service import environment

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends signals and starts a browser of its own")
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path, network: Path) -> Iterator[Start]:
    """Starts `lighting ARGUMENTS` in a folder with a foreign `server.py`; its browser writes down what it opens."""
    (tmp_path / "server.py").write_text("raise SystemExit('not this one')")
    browser = tmp_path / "browser"
    browser.write_text(f'#!/bin/sh\necho "$1" > {tmp_path}/url\n')
    browser.chmod(0o755)
    processes = []

    def begin(*arguments: str, **variables: str) -> "subprocess.Popen[str]":
        paths = {"PYTHONPATH": str(ROOT), "BROWSER": str(browser), **variables}
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "lighting", *arguments],
            cwd=tmp_path,
            env=environment(model=network) | paths,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        processes.append(process)
        return process

    yield begin
    for process in processes:
        process.terminate()  # which it hands to its service; killed, it would leave that behind
        process.communicate(timeout=60)


def wait_for(found: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60
    while not found():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def get(url: str) -> tuple[int, bytes]:
    with closing(http.client.HTTPConnection(urlsplit(url).netloc, timeout=60)) as connection:
        connection.request("GET", urlsplit(url).path)
        answer = connection.getresponse()
        return answer.status, answer.read()


@pytest.mark.slow
def test_open_shows_the_photo_in_the_browser(start: Start, tmp_path: Path, photo_path: Path) -> None:
    photo = photo_path.rename(tmp_path / "my photo.jpg")
    process = start("open", "my photo.jpg")
    assert process.stdout
    said = process.stdout.readline()
    wait_for((tmp_path / "url").is_file)
    url = (tmp_path / "url").read_text().strip()
    assert (found := re.fullmatch(r"http://127\.0\.0\.1:\d+/#(opened/[\w-]{43})/my%20photo\.jpg", url))
    assert said == f"Opened {url} with my photo.jpg in your browser. Ctrl-C ends the service.\n"
    base = url.partition("#")[0]
    assert get(base + found[1]) == (200, photo.read_bytes())
    assert [get(f"{base}{path}")[0] for path in ("opened", "opened/", f"opened/{'a' * 43}")] == [404, 404, 404]
    assert b"<script" in get(base)[1]
    process.send_signal(signal.SIGINT)
    assert process.wait(60) == 128 + signal.SIGINT
    with pytest.raises(ConnectionRefusedError):
        get(base)


@pytest.mark.slow
def test_serve_takes_host_and_port_and_ends_by_sigterm(start: Start) -> None:
    process = start("serve", "--host", "127.0.0.1", "--port", "0", "--json", "--quiet")
    assert process.stdout
    url = json.loads(process.stdout.readline())["url"]
    assert get(f"{url}livez") == (200, b'{"status":"ok"}')
    assert get(f"{url}opened/")[0] == 404
    process.send_signal(signal.SIGTERM)
    assert process.wait(60) == 128 + signal.SIGTERM
    assert process.communicate() == ("", "")


def is_in_a_network() -> bool:
    """Whether this machine has a way out; nothing is sent."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(("192.0.2.1", 9))
        except OSError:
            return False
        return not str(probe.getsockname()[0]).startswith("127.")


@pytest.mark.slow
@pytest.mark.skipif(not is_in_a_network(), reason="this machine is in no network")
def test_a_service_for_a_network_says_what_to_try_and_what_phones_open(start: Start) -> None:
    process = start("serve", "--host", "0.0.0.0", "--port", "0", LIGHTING_LOG_LEVEL="error")
    assert process.stdout
    page, api, command = re.split(r"  (?:API|Try): ", process.stdout.readline().strip())
    assert re.fullmatch(r"Page: http://127\.0\.0\.1:\d+/", page)
    assert api == f"{page[6:]}docs"
    assert command == f"curl -F photo=@photo.jpg {page[6:]}v1/lighting"
    found = re.search(r" network open (http://[\d.]+:\d+/)$", process.stdout.readline())
    assert found
    assert get(f"{found[1]}livez") == (200, b'{"status":"ok"}')


@pytest.mark.slow
def test_what_the_service_refuses_ends_the_command(start: Start, tmp_path: Path) -> None:
    processes = [start("open", LIGHTING_QUEUE="-1"), start("serve", "--host", "no.such.host.invalid")]
    results = [(process.communicate(timeout=60)[1], process.returncode) for process in processes]
    assert results[0] == ("LIGHTING_QUEUE: Input should be greater than or equal to 0\n", 1)
    assert "LIGHTING_HOST: no.such.host.invalid is no address to listen on" in results[1][0]
    assert results[1][1] == 1
    assert not (tmp_path / "url").exists()


@pytest.mark.slow
def test_a_service_that_ended_leaves_signals_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C later went to a process that was no more."""
    monkeypatch.setenv("LIGHTING_QUEUE", "-1")
    before = signal.getsignal(signal.SIGINT)
    assert invoke_command("serve").exit_code == 1
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.slow
def test_a_taken_port_is_never_advertised_and_without_one_the_next_is_taken(start: Start) -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        refused = start("serve", "--port", str(port))
        said = f"Error: Another program listens on port {port}; without --port it takes a free one.\n"
        assert refused.communicate(timeout=60) == ("", said)
        assert refused.returncode == 1
    first = start("serve", "--json")
    assert first.stdout
    url = json.loads(first.stdout.readline())["url"]
    second = start("serve", "--json")
    assert second.stdout
    following = json.loads(second.stdout.readline())["url"]
    assert urlsplit(url).port != urlsplit(following).port
    assert [get(f"{one}livez")[0] for one in (url, following)] == [200, 200]


def test_the_command_line_imports_nothing_of_the_service() -> None:
    code = "import sys, lighting.cli.serve; print({'server', 'fastapi', 'uvicorn'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert done.stdout == "set()\n"

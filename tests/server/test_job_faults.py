"""Jobs of a real service: a full disk, files that somebody removes, one client's many uploads, a kill."""

import http.client
import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

from server.job_store import JOBS_FOLDER
from tests.helpers.service import PHOTO, SMALL_DISK, Server, started

INNOCENT = "127.0.1.1"
ZIP = "application/zip"
BEGUN = f"POST /v1/jobs?kind=photos HTTP/1.1\r\nHost: x\r\nContent-Type: {ZIP}\r\nContent-Length: 9\r\n\r\nx".encode()

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8"),
]


def can_mount() -> bool:
    with TemporaryDirectory() as folder:
        command = [*SMALL_DISK, folder, "true"]
        return shutil.which("unshare") is not None and subprocess.run(command, check=False).returncode == 0


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("disk")


@pytest.fixture(scope="module")
def server(network: Path, disk: Path) -> Iterator[Server]:
    if not can_mount():
        pytest.skip("this system mounts no disk for a user")
    with started(network, disk=disk, jobs_folder=disk, concurrency=1, jobs=4) as server:
        yield server


@pytest.fixture
def folder(server: Server, disk: Path) -> Iterator[Path]:
    """The disk as the service sees it; a test leaves no job."""
    seen = Path(f"/proc/{server.process.pid}/root/{disk.relative_to('/')}")
    yield seen
    for number in [path.name for path in (seen / JOBS_FOLDER).iterdir() if path.is_dir()]:
        server.request("DELETE", f"/v1/jobs/{number}")


def submit(server: Server, source: str = INNOCENT) -> tuple[int, dict[str, Any]]:
    """Status and body of the answer to an upload that is no ZIP."""
    status, body = server.request("POST", "/v1/jobs?kind=photos", b"no ZIP", ZIP, source)
    return status, json.loads(body)


def ask(server: Server, job: dict[str, Any]) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(server.request("GET", f"/v1/jobs/{job['id']}", source=INNOCENT)[1])
    return answer


def until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def readiness(server: Server) -> tuple[int, str]:
    status, body = server.request("GET", "/readyz")
    return status, json.loads(body).get("detail", "")


def fill(folder: Path, spare: int) -> None:
    """Leave so many bytes of a disk."""
    with (folder / "fill").open("wb", buffering=0) as file, suppress(OSError):
        while file.write(bytes(4096)):
            pass
    with (folder / "fill").open("r+b") as file:
        file.truncate((folder / "fill").stat().st_size - spare)


def test_a_full_disk_lets_jobs_wait(server: Server, folder: Path) -> None:
    fill(folder, spare=8192)  # for an upload and its record, and not for its next record
    job = submit(server)[1]
    until(lambda: readiness(server) == (503, "Jobs stand still: No space left on device."))
    assert ask(server, job)["state"] == "queued"
    status, body = submit(server, "127.0.1.2")
    assert (status, body["detail"]) == (503, "The disk for jobs is full.")
    assert server.request("POST", "/v1/lighting", PHOTO, source=INNOCENT)[0] == 200
    (folder / "fill").unlink()
    until(lambda: readiness(server) == (200, ""))
    until(lambda: ask(server, job)["state"] == "failed")
    assert ask(server, job)["error"] == "The upload is no ZIP that can be read."


def test_a_disk_without_room_for_names_takes_no_place(server: Server, folder: Path) -> None:
    names = folder / "names"
    names.mkdir()
    with suppress(OSError):
        for number in range(100):
            (names / str(number)).touch()
    for _ in range(5):  # more than a client's share
        status, body = submit(server)
        assert (status, body["detail"]) == (503, "The disk for jobs is full.")
    shutil.rmtree(names)
    assert submit(server)[0] == 202


def test_a_folder_that_somebody_removes_is_its_own_jobs_loss(server: Server, folder: Path) -> None:
    fill(folder, spare=8192)
    status, gone = submit(server)
    assert status == 202
    until(lambda: readiness(server)[0] == 503)
    shutil.rmtree(folder / JOBS_FOLDER / gone["id"])
    (folder / "fill").unlink()
    until(lambda: ask(server, gone).get("status") == 404)
    next_one = submit(server)[1]
    until(lambda: ask(server, next_one)["state"] == "failed")
    assert readiness(server) == (200, "")
    shutil.rmtree(folder / JOBS_FOLDER)
    again = submit(server)[1]
    until(lambda: ask(server, again)["state"] == "failed")
    assert f"job {gone['id']} is forgotten: somebody removed its folder" in server.log
    assert "Traceback" not in server.log


def test_one_clients_uploads_take_its_share(server: Server, folder: Path) -> None:
    with ExitStack() as stack:
        connections = [stack.enter_context(server.connect("127.0.8.1")) for _ in range(60)]
        for connection in connections:
            connection.sendall(BEGUN)
            connection.settimeout(0.05)
        statuses = list[bytes]()
        deadline = time.monotonic() + 30
        while len(statuses) < 59 and time.monotonic() < deadline:
            for connection in connections:
                with suppress(TimeoutError):
                    if answer := connection.recv(12):
                        statuses.append(answer[9:])
                        connections = [other for other in connections if other is not connection]
        assert statuses == [b"429"] * 59
        assert submit(server)[0] == 202
    until(lambda: len(list((folder / JOBS_FOLDER).glob("*/work"))) == 0)


def test_failed_jobs_keep_nobody_out(server: Server) -> None:
    jobs = [submit(server, f"127.0.9.{number}")[1] for number in range(1, 5)]  # which take all places
    assert submit(server)[1]["detail"] == "All places for jobs are taken."
    until(lambda: all(ask(server, job)["state"] == "failed" for job in jobs))
    assert submit(server)[0] == 202
    assert ask(server, jobs[0])["status"] == 404


def test_a_kill_loses_nothing(network: Path, tmp_path: Path) -> None:
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "letter.txt").write_text("dear")
    settings: dict[str, Any] = {"jobs_folder": tmp_path, "concurrency": 1}
    with started(network, **settings) as server:
        assert (tmp_path / JOBS_FOLDER).stat().st_mode & 0o777 == 0o700
        job = submit(server)[1]
        with server.connect() as connection:
            connection.sendall(BEGUN)
            until(lambda: len([path for path in (tmp_path / JOBS_FOLDER).iterdir() if path.is_dir()]) == 2)
            server.process.send_signal(signal.SIGKILL)
            server.process.wait()
    (tmp_path / JOBS_FOLDER / "photos").mkdir()
    with started(network, **settings) as server:
        until(lambda: ask(server, job)["state"] == "failed")
        assert {path.name for path in (tmp_path / JOBS_FOLDER).iterdir()} == {job["id"], "lock", "photos"}
        assert "its upload had not come" in server.log
    assert (tmp_path / "home" / "letter.txt").read_text() == "dear"


@pytest.mark.thorough
def test_a_clock_that_is_set_locks_nobody_out_and_deletes_nothing(network: Path, tmp_path: Path) -> None:
    """A clock on the wall that a file sets, in a process of its own."""
    clock, waits = tmp_path / "clock", list[int]()
    first = f"import time; true = time.time; time.time = lambda: true() + float(open({str(clock)!r}).read())"
    settings: dict[str, Any] = {"jobs_folder": tmp_path, "concurrency": 1, "rate_limit": "40/minute", "first": first}

    def ask_twice(server: Server, job: dict[str, Any]) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", server.port, source_address=("127.0.1.2", 0))
        connection.request("GET", "/v1/model")
        waits.append(int(connection.getresponse().headers.get("Retry-After", 0)))
        connection.close()
        assert ask(server, job)["state"] == "failed"

    clock.write_text("0")
    with started(network, **settings) as server:
        job = submit(server)[1]
        server.until_logged("job of kind photos failed")
        while server.request("GET", "/v1/model", source="127.0.1.2")[0] == 200:
            pass
        for seconds in (-3600, 2 * 86400):
            clock.write_text(str(seconds))
            ask_twice(server, job)
    assert all(0 < wait <= 60 for wait in waits)
    with started(network, **settings) as server:  # with the clock still wrong
        ask_twice(server, job)
        future = submit(server)[1]
        server.until_logged("job of kind photos failed")
    clock.write_text("0")
    with started(network, **settings) as server:  # it is right again, and a record is of the day after tomorrow
        ask_twice(server, job)
        ask_twice(server, future)
        assert "removed job" not in server.log

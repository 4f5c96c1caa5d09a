"""The service as a process of its own, for tests."""

import http.client
import os
import re
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO

from server.limits import PLACE_BYTES
from server.settings import PREFIX
from tests.conftest import encode, scene
from tests.helpers.pages import ROOT

PHOTO = encode(scene(320, 240))
_NAMESPACE = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-ec"]
_MOUNT = 'mount -t tmpfs -o size=256k,nr_inodes=64 tmpfs "$1"; shift; exec "$@"'
SMALL_DISK = [*_NAMESPACE, _MOUNT, "sh"]  # before a folder and a command


class Server:
    """A started service."""

    def __init__(self, process: "subprocess.Popen[bytes]", log: IO[bytes]) -> None:
        self.process = process
        self._log = log
        self.port = self._logged_port()

    def _logged_port(self) -> int:
        """The free port that the service found; its log names it."""
        return int(self.until_logged(r" running on http://127\.0\.0\.1:(\d+) ")[1])

    def until_logged(self, words: str) -> re.Match[str]:
        """Wait until the log holds what the pattern says."""
        deadline = time.monotonic() + 60
        while not (found := re.search(words, self.log)):
            assert self.process.poll() is None, self.log
            assert time.monotonic() < deadline, f"it does not log {words!r}"
            time.sleep(0.02)
        return found

    @property
    def log(self) -> str:
        return os.pread(self._log.fileno(), 1 << 24, 0).decode()  # the service writes where the file stands

    def request(
        self, method: str, path: str, body: bytes | None = None, kind: str = "image/jpeg", source: str = "127.0.0.1"
    ) -> tuple[int, bytes]:
        """Status and body of an answer to a client at an address."""
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60, source_address=(source, 0))
        try:
            connection.request(method, path, body, {"Content-Type": kind} if body is not None else {})
            answer = connection.getresponse()
            return answer.status, answer.read()
        finally:
            connection.close()

    def connect(self, source: str = "127.0.0.1") -> socket.socket:
        """A connection from a loopback address."""
        return socket.create_connection(("127.0.0.1", self.port), timeout=60, source_address=(source, 0))

    def begin(
        self, length: int, path: str = "/v1/lighting", sent: int = 10, source: str = "127.0.0.1"
    ) -> socket.socket:
        """A connection on which a photo of so many bytes is announced and the first ones have come."""
        connection = self.connect(source)
        head = f"POST {path} HTTP/1.1\r\nHost: x\r\nContent-Type: image/jpeg\r\nContent-Length: {length}\r\n\r\n"
        connection.sendall(head.encode() + (PHOTO + bytes(PLACE_BYTES))[:sent])
        return connection

    def send(self, photo: bytes) -> socket.socket:
        """A connection on which a photo was sent whole."""
        connection = self.begin(len(photo))
        connection.sendall(photo[10:])
        return connection

    def decoders(self) -> list[int]:
        """The numbers of the processes that the service started."""
        pid = self.process.pid
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]

    def peak(self) -> int:
        """Bytes of memory that the process held at most."""
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return 1024 * int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])

    def metric(self, name: str) -> float:
        text = self.request("GET", "/metrics")[1].decode()
        return float(next(line.split()[-1] for line in text.splitlines() if line.startswith(f"{name} ")))

    def until(self, name: str, value: float) -> None:
        """Wait for a metric to have a value."""
        deadline = time.monotonic() + 30
        while self.metric(name) != value:
            assert time.monotonic() < deadline, f"{name} is {self.metric(name)}, not {value}"
            time.sleep(0.02)


def environment(**settings: object) -> dict[str, str]:
    """The variables of a service with some settings, on a port of its own where none is said: others run beside it."""
    settings = {"port": 0, **settings}
    outside = {name: value for name, value in os.environ.items() if not name.startswith(PREFIX)}
    return outside | {f"{PREFIX}{name.upper()}": str(value) for name, value in settings.items()}


@contextmanager
def started(
    network: Path,
    *,
    files: tuple[int, int] | None = None,
    disk: Path | None = None,
    first: str = "",
    **settings: object,
) -> Iterator[Server]:
    """A service with some settings, with a soft and a hard limit on its open files, and a small disk at a folder.

    `first` is what its process runs before, in Python.
    """
    given = environment(**{"model": network, **settings})
    command = [sys.executable, "-m", "server"]
    command = (
        [sys.executable, "-c", f"{first}; from server.__main__ import run_server; run_server()"] if first else command
    )
    command = ["prlimit", f"--nofile={files[0]}:{files[1]}", *command] if files else command
    command = [*SMALL_DISK, str(disk), *command] if disk else command
    with TemporaryFile() as log, subprocess.Popen(command, cwd=ROOT, env=given, stderr=log) as process:
        try:
            server = Server(process, log)
            wait_until_ready(server)
            yield server
        finally:
            process.kill()


def wait_until_ready(server: Server) -> None:
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        if server.request("GET", "/readyz")[0] == 200:
            return
        time.sleep(0.05)
    raise AssertionError("not ready in time")

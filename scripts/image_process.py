"""A built image as a process of this machine: how it is started, whether it is healthy, and what it answers."""

import json
import os
import signal
import subprocess
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PHOTO = Path(__file__).parent.parent / "examples" / "wide_street.jpg"
START, STOP = 120, 30  # seconds


class BrokenPromiseError(Exception):
    """The image lacks a property that it promises."""


@dataclass(frozen=True)
class Image:
    """A built image, as a read-only tree of files, and how it is run."""

    root: Path
    environment: list[str]  # NAME=VALUE
    folder: str
    user: str  # UID:GID
    start: list[str]  # ENTRYPOINT and CMD
    health: list[str]

    @property
    def port(self) -> int:
        """Where the service listens."""
        return int(dict(pair.split("=", 1) for pair in self.environment)["LIGHTING_PORT"])

    def command(self, argv: list[str]) -> list[str]:
        """The command line, for root, that runs `argv` in the image as its user, without capabilities."""
        uid, gid = self.user.split(":")
        identity = [f"--reuid={uid}", f"--regid={gid}", "--clear-groups"]
        lowered = ["setpriv", *identity, "--no-new-privs", "--bounding-set=-all", "--inh-caps=-all"]
        return ["chroot", str(self.root), *lowered, "env", "-i", "-C", self.folder, *self.environment, *argv]


def expect(kept: bool, promise: str) -> None:
    """Print the promise if it was kept; BrokenPromiseError if not."""
    if not kept:
        raise BrokenPromiseError(f"not kept: {promise}")
    print(f"ok: {promise}", flush=True)


def healthy(probe: list[str]) -> bool:
    """Whether the HEALTHCHECK's command succeeds."""
    return subprocess.run(probe, capture_output=True, timeout=START).returncode == 0


def wait_healthy(probe: list[str], service: subprocess.Popen[bytes]) -> float:
    """Seconds until the HEALTHCHECK succeeds; 0 if it does not in time or the service ends first."""
    began = time.monotonic()
    while time.monotonic() - began < START and service.poll() is None:
        if healthy(probe):
            return time.monotonic() - began
        time.sleep(0.2)
    return 0.0


@contextmanager
def started(image: Image) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Run the service as process 1 of a new namespace; yields it and its process id outside."""
    alone = ["unshare", "--pid", "--fork", f"--mount-proc={image.root / 'proc'}"]
    with subprocess.Popen([*alone, *image.command(image.start)]) as outer:
        try:
            yield outer, _only_child(outer.pid)
        finally:
            for child in _children(outer.pid):
                os.kill(child, signal.SIGKILL)
            outer.kill()


def _only_child(pid: int) -> int:
    for _ in range(100):
        if children := _children(pid):
            return children[0]
        time.sleep(0.05)
    raise BrokenPromiseError("the service did not start")


def _children(pid: int) -> list[int]:
    try:
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []


def check_requests(port: int) -> dict[str, float | list[float]]:
    """Send one request of each kind; returns the sun of the example photo."""
    record = json.loads(answer_of(port, "/v1/lighting", photos=1))
    image = answer_of(port, "/v1/envmap", photos=1)
    expect(image.startswith(b"v/1\x01") and len(image) > 100_000, f"POST /v1/envmap: an EXR of {len(image)} bytes")
    expect(b"<script" in answer_of(port, "/"), "the page is in it")
    several = json.loads(answer_of(port, "/v1/lightings", photos=2))["lightings"]
    expect("other photos" in several[1]["evidence"], "several photos are answered together")
    return dict(record["sun"])


def answer_of(port: int, path: str, photos: int = 0, host: str = "127.0.0.1") -> bytes:
    """The answer to a GET, or to a form with the example photo, as large as a camera's, once or more often."""
    photo = PHOTO.read_bytes() + bytes(3_000_000)
    part = b'--part\r\nContent-Disposition: form-data; name="photo"; filename="p.jpg"\r\n\r\n%b\r\n' % photo
    form = photos * part + b"--part--\r\n" if photos else None
    headers = {"Content-Type": "multipart/form-data; boundary=part", "Host": host}
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", form, headers)
    without_proxy = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with without_proxy.open(request, timeout=START) as answer:
        return bytes(answer.read())

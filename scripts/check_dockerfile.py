"""Build the image's tree without a container engine, and run the service from it as the image would.

    python -m scripts.check_dockerfile

Carries out the Dockerfile's own steps (see tree.py), makes the last stage read-only and starts it as its own user,
without capabilities, in a process namespace of its own and in a network of nothing but a loopback. Then the image's
HEALTHCHECK, a request, the command line, SIGTERM, and the sizes. Needs Linux, root, node and the package registries;
leaves nothing behind. Exit status 1 and one sentence if a promise is not kept.
"""

import fcntl
import json
import os
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from scripts.dockerfile import Stage, Step, UnsupportedError, read_stages
from scripts.tree import NEW_NETWORK, Tree, build, mount, unshare

ROOT = Path(__file__).parent.parent
PHOTO = ROOT / "examples" / "wide_street.jpg"
LIMIT = 350  # MB over the base
START, STOP = 120, 30  # seconds
COMPILERS = {"cc", "gcc", "g++", "clang", "ld", "make", "node", "npm", "git", "curl"}
LIBRARIES = {  # of the slim base that a program may lean on
    *("ld-linux-x86-64", "libc", "libm", "libdl", "libpthread", "librt", "libutil", "libgcc_s", "libstdc++", "libz"),
    *("libssl", "libcrypto", "libffi", "libbz2", "liblzma", "libuuid", "libexpat", "libsqlite3", "libnss_files"),
    *("libncursesw", "libtinfo", "libreadline", "libcrypt", "libnsl", "libtirpc"),
}
WHERE_PRESENT = {"libnss_systemd", "libcap", "libfribidi"}  # for this machine's users; for Pillow's right-to-left text


class BrokenPromiseError(Exception):
    """The image lacks a property that it promises."""


def main() -> None:
    """Build, run, print."""
    stages = read_stages((ROOT / "Dockerfile").read_text(encoding="utf-8"))
    with tempfile.TemporaryDirectory() as space:
        try:
            tree = build(stages, ROOT, Path(space))
            check_layer(tree.layer)
            check_service(tree, stages[-1])
        except (BrokenPromiseError, UnsupportedError, RuntimeError, OSError) as error:
            sys.exit(f"check_dockerfile: {error}")
        finally:
            subprocess.run(["umount", "--recursive", "--lazy", space], check=False)


def expect(kept: bool, promise: str) -> None:
    """Print the promise if it was kept; BrokenPromiseError if not."""
    if not kept:
        raise BrokenPromiseError(f"not kept: {promise}")
    print(f"ok: {promise}", flush=True)


def check_layer(layer: Path) -> None:
    """Check what the last stage adds to its base image: its size, no build tools, nothing outside /opt/venv."""
    files = [path for path in layer.rglob("*") if path.is_file() and not path.is_symlink()]
    size = sum(path.stat().st_size for path in files) / 1e6
    parts = sorted(_sizes(layer / "opt/venv/lib/python3.11/site-packages").items(), key=lambda item: -item[1])
    print("   " + ", ".join(f"{name} {mb:.0f}" for name, mb in parts[:8]) + " MB")
    expect(size < LIMIT, f"the image is {size:.0f} MB over its base, under {LIMIT}")
    expect(not COMPILERS & {path.name for path in files}, "no compiler and no build tool in it")
    expect({p.parts[0] for p in (f.relative_to(layer) for f in files)} == {"opt"}, "nothing in it but /opt/venv")


def _sizes(folder: Path) -> dict[str, float]:
    return {p.name: sum(f.stat().st_size for f in p.rglob("*") if f.is_file()) / 1e6 for p in folder.iterdir()}


def check_service(tree: Tree, stage: Stage) -> None:
    """Run the stage's entrypoint and health check as its user, as an engine would with --read-only."""
    entrypoint, command, health = (_step(stage, word) for word in ("ENTRYPOINT", "CMD", "HEALTHCHECK"))
    uid = int(tree.user.split(":")[0])
    expect(uid >= 1000, f"a user of its own, {tree.user}")
    mount("-o", "remount,ro", tree.root)
    unshare(NEW_NETWORK)
    _raise_loopback()
    expect(len(Path("/proc/self/net/route").read_text().splitlines()) == 1, "no network, no route")
    probe = tree.command(json.loads(health.value.removeprefix("CMD ")))
    expect(not healthy(probe), "HEALTHCHECK fails while nothing runs")
    with started(tree, entrypoint.argv + command.argv) as (service, pid):
        expect(bool(seconds := wait_healthy(probe, service)), f"HEALTHCHECK passes {seconds:.1f} s after the start")
        check_process(pid, uid, tree)
        record = check_requests(int(tree.environment["LIGHTING_PORT"]))
        check_command_line(tree, entrypoint.argv, record)
        print(f"   {_resident(pid) / 1e6:.0f} MB resident")
        os.kill(pid, signal.SIGTERM)
        expect(service.wait(STOP) in (0, 128 + signal.SIGTERM), "SIGTERM stops it")
    expect(not healthy(probe), "HEALTHCHECK fails when it has stopped")


def _step(stage: Stage, word: str) -> Step:
    step = stage.last(word)
    if step is None:
        raise UnsupportedError(f"The last stage has no {word}.")
    return step


def _raise_loopback() -> None:
    """`ip link set lo up`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as anything:
        fcntl.ioctl(anything, 0x8914, struct.pack("16sh22x", b"lo", 1))  # SIOCSIFFLAGS, IFF_UP


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
def started(tree: Tree, argv: list[str]) -> Iterator[tuple[subprocess.Popen[bytes], int]]:
    """Run the program as process 1 of a new namespace; yields it and its process id outside."""
    alone = ["unshare", "--pid", "--fork", f"--mount-proc={tree.root / 'proc'}"]
    with subprocess.Popen([*alone, *tree.command(argv)]) as outer:
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


def check_process(pid: int, uid: int, tree: Tree) -> None:
    """Check the running process: its user, its capabilities, and which libraries of the base image it uses."""
    status = dict(
        line.split(":\t", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines() if ":\t" in line
    )
    expect(set(status["Uid"].split()) == {str(uid)}, f"it runs as {uid}")
    expect(int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0, "without capabilities")
    expect(status["NSpid"].split()[-1] == "1", "it is process 1 itself, with no shell before it")
    writing = tree.command(["python", "-c", "open('/opt/venv/new', 'w')"])
    expect(b"Read-only" in subprocess.run(writing, capture_output=True).stderr, "its files are read-only")
    mapped = {line.split(None, 5)[5] for line in Path(f"/proc/{pid}/maps").read_text().splitlines() if ".so" in line}
    base = {Path(path).name.split(".so")[0] for path in mapped if not _of_python(path)}
    needed = base - WHERE_PRESENT
    expect(needed <= LIBRARIES, f"of the base's libraries it uses {', '.join(sorted(needed))}")


def _of_python(path: str) -> bool:
    return any(part in path for part in ("/opt/venv/", "/usr/local/", sys.base_prefix))


def check_requests(port: int) -> object:
    """Send one request of each kind; returns the sun of the example photo."""
    answer = _post(port, "/v1/lighting")
    record = json.loads(answer)
    image = _post(port, "/v1/envmap")
    expect(image.startswith(b"v/1\x01") and len(image) > 100_000, f"POST /v1/envmap: an EXR of {len(image)} bytes")
    with urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=START) as page:
        expect(b"<script" in page.read(), "the page is in it")
    several = json.loads(_post(port, "/v1/lighting", photos=2))["lightings"]
    expect("other photos" in several[1]["evidence"], "several photos are answered together")
    return record["sun"]


def _post(port: int, path: str, photos: int = 1) -> bytes:
    """The answer to a form with the example photo, once or more often."""
    part = (
        b'--part\r\nContent-Disposition: form-data; name="photo"; filename="p.jpg"\r\n\r\n%b\r\n' % PHOTO.read_bytes()
    )
    headers = {"Content-Type": "multipart/form-data; boundary=part"}
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", photos * part + b"--part--\r\n", headers)
    with urllib.request.urlopen(request, timeout=START) as answer:
        return bytes(answer.read())


def check_command_line(tree: Tree, entrypoint: list[str], sun: object) -> None:
    """Check that `docker run -i IMAGE lighting estimate --json -` gives the same sun as the service."""
    command = tree.command([*entrypoint, "lighting", "estimate", "--json", "-"])
    with PHOTO.open("rb") as photo:
        done = subprocess.run(command, stdin=photo, capture_output=True, timeout=START, check=True)
    expect(json.loads(done.stdout)["lighting"]["sun"] == sun, "`lighting estimate` in it says the same as the service")


def _resident(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main()

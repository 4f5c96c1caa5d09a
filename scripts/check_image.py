"""Build the image with `buildah`, and run the service and the command line from it.

    python -m scripts.check_image [FOLDER]

Builds the Dockerfile (see build_image.py), makes the result read-only and starts it as its own user, without
capabilities, in a process namespace of its own and in a network of nothing but a loopback. Then come the image's
HEALTHCHECK, requests, the command line, SIGTERM, and the sizes. Last, the service runs as compose.yaml says, alone and
behind Caddy with TLS. So every line of Docker on docs/do/run-the-service.md is carried out, by the programs here.

A second image is that of a Space of Hugging Face, with TRACES=1: README.md has the front matter of examples/huggingface
on top, and what runs is user 1000. It answers on app_port, and a collector of traces gets its spans.

All is built in memory, 3 GB of it, and is gone afterwards. The base's files alone stay, in FOLDER (400 MB), which is
~/.cache/outdoor-lighting if none is given; delete them to have newer ones. Needs root, buildah and mmdebstrap.
Exit status 1 and one sentence if a promise is not kept; one line and 0 where no image can be built.
"""

import fcntl
import json
import math
import os
import shutil
import signal
import socket
import struct
import subprocess
import sys
import tempfile
import time
import zlib
from dataclasses import replace
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

from scripts.build_image import (
    NEW_NETWORK,
    Engine,
    UnavailableError,
    build_image,
    enter_mount_namespace,
    load_base,
    unshare,
)
from scripts.check_compose import check_compose, check_run_options, read_docker_lines
from scripts.image_process import (
    PHOTO,
    START,
    STOP,
    BrokenPromiseError,
    Image,
    answer_of,
    check_requests,
    expect,
    healthy,
    started,
    wait_healthy,
)

ROOT = Path(__file__).parent.parent
SPACE = ROOT / "examples" / "huggingface" / "README.md"
CONTAINER, SPACE_CONTAINER = "image", "space"
LIMIT = 350  # MB over the base
COMPILERS = {"cc", "gcc", "g++", "clang", "ld", "make", "node", "npm", "git", "curl"}
SENT = {"CHANGELOG.md", "LICENSE", "NOTICE", "README.md", "SECURITY.md", "pyproject.toml", "uv.lock"}
SENT_FOLDERS = {"docs", "lighting", "server"}
NEVER_SENT = {"lab", "node_modules", "__pycache__", "src"}


def main() -> None:
    """Build, run, print."""
    cache = Path(sys.argv[1] if len(sys.argv) > 1 else Path.home() / ".cache/outdoor-lighting").resolve()
    space = Path(tempfile.mkdtemp())
    try:
        enter_mount_namespace("buildah", "mmdebstrap")
        mount("-t", "tmpfs", "-o", "mode=755", "tmpfs", space)
        os.environ["TMPDIR"] = str(space)  # for the programs that build
        cache.mkdir(parents=True, exist_ok=True)
        check(Engine(space), space / "view", cache)
    except UnavailableError as reason:
        print(f"skipped: no image can be built here: {reason}")
    except (BrokenPromiseError, RuntimeError, OSError, subprocess.SubprocessError) as error:
        sys.exit(f"check_image: {error}")
    finally:
        subprocess.run(["umount", "--recursive", "--lazy", space], check=False, capture_output=True)
        space.rmdir()


def check(engine: Engine, view: Path, cache: Path) -> None:
    """Build the image and hold it to all its promises; `view` becomes its read-only tree."""
    began = time.monotonic()
    load_base(engine, cache)
    print(f"   the base after {time.monotonic() - began:.0f} s", flush=True)
    check_context(engine)
    build, run, *compose = read_docker_lines()
    expect(build == ["docker", "build", "-t", run[-1], "."], f"the page builds the image that it runs, {run[-1]}")
    build_image(engine, ROOT, CONTAINER)
    print(f"   the image after {time.monotonic() - began:.0f} s", flush=True)
    front_matter = build_space(engine, view.with_name("context"))
    print(f"   the Space's after {time.monotonic() - began:.0f} s", flush=True)
    base, files, files_of_space = (unpack(engine, name) for name in ("base", CONTAINER, SPACE_CONTAINER))
    check_layer(base, files)
    check_photo(engine)
    space = read_image(engine, SPACE_CONTAINER, files_of_space, view.with_name("view-of-space"))
    check_service(image := read_image(engine, CONTAINER, files, view))
    check_run_options(run, image)
    check_compose(image, compose)
    check_space(space, front_matter)
    print(f"   {time.monotonic() - began:.0f} s in all")


def build_space(engine: Engine, context: Path) -> dict[str, str]:
    """Build what Hugging Face builds, in a copy of the files that the builder gets; returns the front matter."""
    ignored = shutil.ignore_patterns(*NEVER_SENT)
    for name in SENT_FOLDERS:
        shutil.copytree(ROOT / name, context / name, ignore=ignored)
    for name in (*SENT, "Dockerfile", ".dockerignore"):
        shutil.copyfile(ROOT / name, context / name)
    _, matter, _ = SPACE.read_text(encoding="utf-8").split("---\n", 2)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (context / "README.md").write_text(f"---\n{matter}---\n\n{page}", encoding="utf-8")
    build_image(engine, context, SPACE_CONTAINER, "TRACES=1")
    return dict(line.split(": ", 1) for line in matter.splitlines())


def check_context(engine: Engine) -> None:
    """Check what .dockerignore lets through to the builder."""
    engine.build(ROOT, "FROM scratch\nCOPY . /\n", "--tag", "context")
    folder = unpack(engine, "context")
    found = {path.relative_to(folder) for path in folder.rglob("*")}
    expect({path.parts[0] for path in found} == SENT | SENT_FOLDERS, "the builder gets what it needs, nothing else")
    expect(not [path for path in found if NEVER_SENT & set(path.parts)], "and of the page its build alone")
    engine.run("rm", "context")


def unpack(engine: Engine, image: str) -> Path:
    """The image's files, as a container of the image's name."""
    engine.run("from", "--pull=never", "--name", image, f"localhost/{image}")
    return Path(engine.run("mount", image).strip())


def check_layer(base: Path, image: Path) -> None:
    """Check what the image adds to its base: its size, no build tools, nothing outside /opt/venv."""
    sizes = {path: size for path, size in _sizes(image).items() if not os.path.lexists(base / path)}
    total, added = sum(_sizes(image).values()) / 1e6, sum(sizes.values()) / 1e6
    packages: dict[str, float] = {}
    for path, size in sizes.items():
        if "site-packages" in path.parts:
            name = path.parts[path.parts.index("site-packages") + 1]
            packages[name] = packages.get(name, 0) + size / 1e6
    largest = sorted(packages.items(), key=lambda item: -item[1])[:8]
    print(f"   {total:.0f} MB with its base; " + ", ".join(f"{name} {mb:.0f}" for name, mb in largest) + " MB")
    expect(added < LIMIT, f"the image is {added:.0f} MB over its base, under {LIMIT}")
    expect(not COMPILERS & {path.name for path in sizes}, "no compiler and no build tool in it")
    expect({path.parts[:2] for path in sizes} == {("opt", "venv")}, "nothing in it but /opt/venv")


def _sizes(folder: Path) -> dict[Path, int]:
    """The size of every file of a tree."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {path.relative_to(folder): path.stat().st_size for path in files}


def check_photo(engine: Engine) -> None:
    """Check that one photo becomes a map as docs/do/run-the-service.md shows, with the engine's own `run`."""
    command = ["run", "--isolation", "chroot", CONTAINER, "--", "lighting", "envmap", "-", "-o", "-"]
    with PHOTO.open("rb") as photo:
        result = subprocess.run(engine.argv(*command), stdin=photo, capture_output=True, timeout=START)
    expect(result.stdout.startswith(b"v/1\x01"), f"`lighting envmap - -o -`: an EXR of {len(result.stdout)} bytes")


def read_image(engine: Engine, name: str, files: Path, view: Path) -> Image:
    """The image as its own record says that it is run, its files mounted read-only at `view`."""
    record = json.loads(engine.run("inspect", "--type", "image", name))["Docker"]["config"]
    view.mkdir()
    mount("--bind", files, view)
    mount("-o", "remount,bind,ro", view)
    mount("-t", "proc", "proc", view / "proc")
    mount("--rbind", "/dev", view / "dev")
    start = record["Entrypoint"] + record["Cmd"]
    kind, *health = record["Healthcheck"]["Test"]
    expect(kind == "CMD" and start[0] == "/usr/bin/env", "neither start nor HEALTHCHECK needs a shell")
    return Image(view, record["Env"], record["WorkingDir"], record["User"], start, health)


def mount(*arguments: str | Path) -> None:
    """mount(8)."""
    subprocess.run(["mount", *map(str, arguments)], check=True)


def check_service(image: Image) -> None:
    """Run the image's service and health check as an engine would with --read-only --cap-drop ALL --network none."""
    uid = int(image.user.split(":")[0])
    expect(uid >= 1000, f"a user of its own, {image.user}")
    unshare(NEW_NETWORK)
    _raise_loopback()
    expect(len(Path("/proc/self/net/route").read_text().splitlines()) == 1, "no network, no route")
    probe = image.command(image.health)
    expect(not healthy(probe), "HEALTHCHECK fails while nothing runs")
    with started(image) as (service, pid):
        expect(bool(seconds := wait_healthy(probe, service)), f"HEALTHCHECK passes {seconds:.1f} s after the start")
        check_process(pid, uid, image)
        check_command_line(image, check_requests(image.port))
        print(f"   {_resident(pid) / 1e6:.0f} MB resident")
        began = time.monotonic()
        os.kill(pid, signal.SIGTERM)
        status = service.wait(STOP)
        expect(status in (0, 128 + signal.SIGTERM), f"SIGTERM ends it after {time.monotonic() - began:.1f} s")
    expect(not healthy(probe), "HEALTHCHECK fails when it has stopped")


def check_space(image: Image, front_matter: dict[str, str]) -> None:
    """Run the image as Hugging Face runs a Space, with a collector beside it; check_service has shut the network."""
    port, host = int(front_matter["app_port"]), "you-light.hf.space"
    expect(front_matter["sdk"] == "docker" and port == image.port, f"the Space's port {port} is the image's")
    with Collector() as collector:
        settings = {"HOSTS": host, "FRAME_ORIGINS": "https://huggingface.co", "OTLP_ENDPOINT": collector.url}
        variables = [f"LIGHTING_{name}={value}" for name, value in settings.items()]
        space = replace(image, user="1000:1000", environment=[*image.environment, *variables])
        with started(space) as (service, pid):
            expect(bool(wait_healthy(space.command(space.health), service)), "it starts as user 1000")
            status, headers, page = _get(port, "/", host)
            framed = "frame-ancestors https://huggingface.co" in headers.get("content-security-policy", "")
            expect(status == 200 and b"<script" in page and framed, "the Space's page may stand in a frame of its site")
            expect(_get(port, "/", "other.example")[0] == 421, "and has no other host's name")
            start = _get(port, "/book/start", host)[2]
            expect(b"app_port" not in start and b"<h1" in start, "the front matter is on no page")
            expect("sun" in json.loads(answer_of(port, "/v1/lighting", photos=1, host=host)), "a photo is answered")
            os.kill(pid, signal.SIGTERM)
            service.wait(STOP)
    spans = collector.content
    expect(all(name in spans for name in (b"POST /v1/lighting", b"decode", b"network")), "a collector gets its spans")


class Collector(ThreadingHTTPServer):
    """Keeps what is sent to it as traces; a context manager."""

    def __init__(self) -> None:
        self.content = b""
        super().__init__(("127.0.0.1", 0), _TraceHandler)
        self.url = f"http://127.0.0.1:{self.server_address[1]}"

    def __enter__(self) -> "Collector":
        Thread(target=self.serve_forever, daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self.shutdown()
        self.server_close()


class _TraceHandler(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        body = self.rfile.read(int(self.headers["Content-Length"]))
        self.server.content += zlib.decompress(body, 31) if self.headers["Content-Encoding"] == "gzip" else body
        self.send_response(200)
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *args: object) -> None:
        pass


def _get(port: int, path: str, host: str) -> tuple[int, dict[str, str], bytes]:
    """The status, the headers by their names in small letters, and the content of an answer to a host's name."""
    connection = HTTPConnection("127.0.0.1", port, timeout=START)
    try:
        connection.request("GET", path, headers={"Host": host})
        answer = connection.getresponse()
        return answer.status, {name.lower(): value for name, value in answer.getheaders()}, answer.read()
    finally:
        connection.close()


def _raise_loopback() -> None:
    """`ip link set lo up`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as anything:
        fcntl.ioctl(anything, 0x8914, struct.pack("16sh22x", b"lo", 1))  # SIOCSIFFLAGS, IFF_UP


def check_process(pid: int, uid: int, image: Image) -> None:
    """Check the running process: its user, its capabilities, its number, and that it cannot write."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    status = dict(line.split(":\t", 1) for line in lines if ":\t" in line)
    expect(set(status["Uid"].split()) == {str(uid)}, f"it runs as {uid}")
    expect(int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0, "without capabilities")
    expect(status["NSpid"].split()[-1] == "1", "it is process 1 itself, with no shell before it")
    writing = image.command(["python", "-c", "open('/tmp/new', 'w')"])
    expect(b"Read-only" in subprocess.run(writing, capture_output=True).stderr, "its files are read-only")


def check_command_line(image: Image, sun: dict[str, Any]) -> None:
    """Check that `docker run -i IMAGE lighting estimate --json -` gives the sun of the service, but for rounding."""
    began = time.monotonic()
    with PHOTO.open("rb") as photo:
        command = image.command([image.start[0], "lighting", "estimate", "--json", "-"])
        result = subprocess.run(command, stdin=photo, capture_output=True, timeout=START, check=True)
    seconds = time.monotonic() - began
    told = json.loads(result.stdout)["lighting"]["sun"]
    expect(_is_close(told, sun), f"`lighting estimate` in it says the same as the service, in {seconds:.1f} s")


def _is_close(told: Any, other: Any) -> bool:
    """Whether parts of two records agree; sessions for one and for many runs differ in a record's last digit."""
    match told, other:
        case dict(), dict():
            return told.keys() == other.keys() and all(_is_close(told[name], other[name]) for name in told)
        case list(), list():
            return len(told) == len(other) and all(map(_is_close, told, other))
        case int() | float(), int() | float():
            return math.isclose(told, other, rel_tol=1e-4)
    return bool(told == other)


def _resident(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main()

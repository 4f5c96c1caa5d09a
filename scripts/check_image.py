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
import shlex
import shutil
import signal
import socket
import ssl
import struct
import subprocess
import sys
import tempfile
import time
import urllib.request
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from http.client import HTTPConnection
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

from scripts.book import read_code_blocks
from scripts.build_image import (
    NEW_NETWORK,
    Engine,
    UnavailableError,
    build_image,
    enter_mount_namespace,
    load_base,
    unshare,
)

ROOT = Path(__file__).parent.parent
PHOTO = ROOT / "examples" / "wide_street.jpg"
SPACE = ROOT / "examples" / "huggingface" / "README.md"
CONTAINER, SPACE_CONTAINER = "image", "space"
PAGE = ROOT / "docs" / "do" / "run-the-service.md"
MARK = "image"  # of the page's block of Docker's lines
HTTPS = 443  # port
LIMIT = 350  # MB over the base
START, STOP = 120, 30  # seconds
COMPILERS = {"cc", "gcc", "g++", "clang", "ld", "make", "node", "npm", "git", "curl"}
SENT = {"CHANGELOG.md", "LICENSE", "NOTICE", "README.md", "SECURITY.md", "pyproject.toml"}
SENT |= {"requirements.lock", "requirements-traces.lock", "requirements-turns.lock"}
SENT_FOLDERS = {"docs", "lighting", "server"}
NEVER_SENT = {"lab", "node_modules", "__pycache__", "src"}


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


def main() -> None:
    """Build, run, print."""
    cache = Path(sys.argv[1] if len(sys.argv) > 1 else Path.home() / ".cache/outdoor-lighting").resolve()
    space = Path(tempfile.mkdtemp())
    try:
        enter_mount_namespace()
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


def expect(kept: bool, promise: str) -> None:
    """Print the promise if it was kept; BrokenPromiseError if not."""
    if not kept:
        raise BrokenPromiseError(f"not kept: {promise}")
    print(f"ok: {promise}", flush=True)


def build_space(engine: Engine, context: Path) -> dict[str, str]:
    """Build what Hugging Face builds, in a copy of the files that git tracks; returns the front matter."""
    names = _run(["git", "-c", f"safe.directory={ROOT}", "ls-files", "-z"]).split("\0")
    for path in (Path(name) for name in names if name and (ROOT / name).is_file()):
        (context / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / path, context / path)
    _, matter, _ = SPACE.read_text(encoding="utf-8").split("---\n", 2)
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (context / "README.md").write_text(f"---\n{matter}---\n\n{page}", encoding="utf-8")
    build_image(engine, context, SPACE_CONTAINER, "TRACES=1")
    return dict(line.split(": ", 1) for line in matter.splitlines())


def _run(argv: list[str]) -> str:
    return subprocess.run(argv, cwd=ROOT, capture_output=True, text=True, check=True).stdout


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
            expect("sun" in json.loads(_answer(port, "/v1/lighting", photos=1, host=host)), "a photo is answered")
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


def _add_address(address: str) -> None:
    """`ip address add ADDRESS dev lo`."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as anything:
        request = struct.pack("16sH2x4s8x", b"lo:1", socket.AF_INET, socket.inet_aton(address))
        fcntl.ioctl(anything, 0x8916, request)  # SIOCSIFADDR


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


def check_process(pid: int, uid: int, image: Image) -> None:
    """Check the running process: its user, its capabilities, its number, and that it cannot write."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    status = dict(line.split(":\t", 1) for line in lines if ":\t" in line)
    expect(set(status["Uid"].split()) == {str(uid)}, f"it runs as {uid}")
    expect(int(status["CapEff"], 16) == int(status["CapBnd"], 16) == 0, "without capabilities")
    expect(status["NSpid"].split()[-1] == "1", "it is process 1 itself, with no shell before it")
    writing = image.command(["python", "-c", "open('/tmp/new', 'w')"])
    expect(b"Read-only" in subprocess.run(writing, capture_output=True).stderr, "its files are read-only")


def check_requests(port: int) -> dict[str, float | list[float]]:
    """Send one request of each kind; returns the sun of the example photo."""
    record = json.loads(_answer(port, "/v1/lighting", photos=1))
    image = _answer(port, "/v1/envmap", photos=1)
    expect(image.startswith(b"v/1\x01") and len(image) > 100_000, f"POST /v1/envmap: an EXR of {len(image)} bytes")
    expect(b"<script" in _answer(port, "/"), "the page is in it")
    several = json.loads(_answer(port, "/v1/lightings", photos=2))["lightings"]
    expect("other photos" in several[1]["evidence"], "several photos are answered together")
    return dict(record["sun"])


def _answer(port: int, path: str, photos: int = 0, host: str = "127.0.0.1") -> bytes:
    """The answer to a GET, or to a form with the example photo, as large as a camera's, once or more often."""
    photo = PHOTO.read_bytes() + bytes(3_000_000)
    part = b'--part\r\nContent-Disposition: form-data; name="photo"; filename="p.jpg"\r\n\r\n%b\r\n' % photo
    form = photos * part + b"--part--\r\n" if photos else None
    headers = {"Content-Type": "multipart/form-data; boundary=part", "Host": host}
    request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", form, headers)
    without_proxy = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with without_proxy.open(request, timeout=START) as answer:
        return bytes(answer.read())


def check_command_line(image: Image, sun: dict[str, float | list[float]]) -> None:
    """Check that `docker run -i IMAGE lighting estimate --json -` gives the sun of the service, but for rounding."""
    began = time.monotonic()
    with PHOTO.open("rb") as photo:
        command = image.command([image.start[0], "lighting", "estimate", "--json", "-"])
        result = subprocess.run(command, stdin=photo, capture_output=True, timeout=START, check=True)
    seconds = time.monotonic() - began
    told = json.loads(result.stdout)["lighting"]["sun"]
    same = told.keys() == sun.keys() and all(_is_close(told[name], value) for name, value in sun.items())
    expect(same, f"`lighting estimate` in it says the same as the service, in {seconds:.1f} s")


def _is_close(told: float | list[float], other: float | list[float]) -> bool:
    """Whether two numbers or vectors agree; sessions for one and for many runs differ in a record's last digit."""
    if isinstance(told, list) and isinstance(other, list):
        return len(told) == len(other) and all(map(_is_close, told, other))
    return not isinstance(told, list) and not isinstance(other, list) and math.isclose(told, other, rel_tol=1e-4)


def read_docker_lines() -> list[list[str]]:
    """The words of each line of the page's block of Docker."""
    (text,) = (b.text for b in read_code_blocks(PAGE.read_text(encoding="utf-8")) if b.mark == MARK)
    return [shlex.split(line, comments=True) for line in text.splitlines()]


def check_run_options(run: list[str], image: Image) -> None:
    """Check that `docker run` of the page gives the options under which the service just ran, and no other.

    Args:
        run: the line's words.
        image: that ran.
    """
    ran = ["docker", "run", "--rm", "-p", f"8000:{image.port}", "--read-only", "--cap-drop", "ALL"]
    expect(run[:-1] == ran, f"it ran as `{' '.join(run)}` says")


def check_compose(image: Image, lines: list[list[str]]) -> None:
    """Run the service by compose.yaml's settings, and Caddy in front of it, as the page's lines do.

    Both have the proxy's address, which this network of a loopback gets too.

    Args:
        image: of the service.
        lines: the words of `docker compose up`, and of the same with the proxy for a site.
    """
    import yaml

    services = yaml.safe_load((ROOT / "compose.yaml").read_text(encoding="utf-8"))["services"]
    alone, (site, *proxied) = lines
    expect(alone == ["docker", "compose", "up", "--build"], "the page starts compose.yaml")
    profile = services["proxy"]["profiles"]
    expect(proxied == [*alone[:2], "--profile", *profile, *alone[2:]], "and its proxy, by the profile's name")
    settings = services["lighting"]["environment"]
    _add_address(address := services["proxy"]["networks"]["default"]["ipv4_address"])
    composed = replace(image, environment=[*image.environment, *(f"{k}={v}" for k, v in settings.items())])
    with started(composed) as (service, pid):
        expect(bool(wait_healthy(composed.command(image.health), service)), "it runs by the settings of compose.yaml")
        check_requests(image.port)
        if shutil.which("caddy"):
            check_proxy(f"{address}:{image.port}", site.partition("=")[2], services["proxy"]["environment"])
        else:
            print("skipped: there is no caddy for the proxy of compose.yaml")
        os.kill(pid, signal.SIGTERM)
        service.wait(STOP)


def check_proxy(service: str, site: str, variables: dict[str, str | int]) -> None:
    """Ask the service over TLS by the name of a site, whose certificate Caddy itself signs.

    Args:
        service: its address and port.
        site: its host name.
        variables: of the Caddyfile.
    """
    own = {"SITE": site, "SERVICE": service}
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, **{k: str(v) for k, v in variables.items()}, **own, "XDG_DATA_HOME": folder}
        config = Path(folder, "Caddyfile")
        text = (ROOT / "Caddyfile").read_text(encoding="utf-8")
        config.write_text(text.replace("\n{\n", "\n{\n\tadmin off\n\tlocal_certs\n\tskip_install_trust\n", 1))
        command = ["caddy", "run", "--config", config, "--adapter", "caddyfile"]
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as proxy:
            try:
                status = wait_for_site(proxy, site, Path(folder, "caddy/pki/authorities/local/root.crt"))
            finally:
                proxy.kill()
    expect(status == 200, f"https://{site} answers through Caddy")


def wait_for_site(proxy: "subprocess.Popen[bytes]", site: str, root: Path) -> int:
    """The status of a site's readiness once it answers; 0 if it does not in time.

    Args:
        proxy: that answers.
        site: its host name.
        root: the certificate that signs the site's.
    """
    began = time.monotonic()
    while time.monotonic() - began < START and proxy.poll() is None:
        try:
            return _ask_site(site, ssl.create_default_context(cafile=root))
        except OSError:
            time.sleep(0.2)
    return 0


def _ask_site(site: str, context: ssl.SSLContext) -> int:
    """The status of /readyz at a site of the loopback."""
    with (
        socket.create_connection(("127.0.0.1", HTTPS), START) as plain,
        context.wrap_socket(plain, server_hostname=site) as secure,
    ):
        secure.sendall(f"GET /readyz HTTP/1.1\r\nHost: {site}\r\nConnection: close\r\n\r\n".encode())
        return int(secure.recv(12).split()[1])


def _resident(pid: int) -> int:
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


if __name__ == "__main__":
    main()

"""Innocent clients beside hostile ones: who is kept out, how long answers take, and what each route costs.

    python -m benchmarks.attack [--seconds 180] [--clients 64] [--hostile 64] [--caddy caddy]
    python -m benchmarks.attack --costs
    python -m benchmarks.attack --jobs

Innocent clients send a photo each two seconds, every client from a loopback address of its own (Linux has 127.0.0.0/8).
They run alone, and beside hostile clients, which are of four kinds in equal parts:

- unread: ask for maps of 100 MB, four at a time, and read nothing or 10 kB/s;
- work: ask for previews, four at a time;
- headers: send the headers of eight uploads and no body;
- silent: open 100 connections and say nothing.

Each begins again a second after it is refused or its connection ends. At the end the service gets SIGTERM under attack.
All this is done on the service itself and behind Caddy with this project's Caddyfile, where `--caddy` names it.

With `--jobs` long jobs are attacked: by one client's 60 uploads, a full disk, folders that somebody removes, and locks.

An innocent answer is right if it is the same to the byte as the first one. `refused` are connections that nobody took,
as after SIGTERM; `lost` are requests on a connection that ended without an answer. Times are milliseconds.
"""

import argparse
import asyncio
import json
import multiprocessing
import os
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass, field
from http.client import HTTPConnection
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urljoin

from benchmarks.common import ROOT, describe_machine, make_photo
from benchmarks.load import free_port, processor_time, started, wait_until_answered
from server.job_store import JOBS_FOLDER

PERIOD = 2.0  # seconds between an innocent client's photos
PHOTO_SIZE = (640, 480)
MAP = "/v1/envmap?sun_azimuth=-41&sun_elevation=33&turbidity=3&exposure=4&height=2048&compression=none"
KINDS = ("unread", "work", "headers", "silent")
PAUSE = 1.0  # seconds after which a hostile client begins again
TIMEOUT = 120.0  # seconds for an innocent answer
COST_RUNS = 5
HEAD = f"{'':<22}{'answers':>8}{'right':>7}{'p50':>8}{'p95':>8}{'p99':>8}{'x alone':>9}   others"


@dataclass(frozen=True)
class Target:
    """What is attacked."""

    port: int
    photo: bytes

    def post(self, path: str, length: int | None = None) -> bytes:
        """The head of a request with a photo."""
        size = len(self.photo) if length is None else length
        kind = f"Content-Type: image/jpeg\r\nContent-Length: {size}\r\n"
        return f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n{kind}\r\n".encode()

    def get(self, path: str) -> bytes:
        """A request without a body."""
        return f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n\r\n".encode()

    async def connect(self, source: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        """A connection from a loopback address."""
        return await asyncio.open_connection("127.0.0.1", self.port, local_addr=(source, 0), limit=1 << 20)


@dataclass
class Tally:
    """What innocent clients got."""

    seconds: list[float] = field(default_factory=list)  # until right answers were whole
    counts: Counter[str] = field(default_factory=Counter)  # "right", "wrong", statuses, "refused", "lost"

    def percentile(self, share: int) -> float:
        """Milliseconds within which so many per cent of the right answers came."""
        return 1000 * statistics.quantiles(self.seconds, n=100, method="inclusive")[share - 1]

    def row(self, name: str, alone: "Tally | None" = None) -> str:
        """A line of the table, with the p99 as a multiple of that alone."""
        times = "".join(f"{self.percentile(share):8.0f}" for share in (50, 95, 99))
        ratio = f"{self.percentile(99) / alone.percentile(99):8.2f}x" if alone else f"{'':9}"
        others = ", ".join(f"{n} x {what}" for what, n in sorted(self.counts.items()) if what != "right")
        return f"{name:<22}{self.counts.total():>8}{self.counts['right']:>7}{times}{ratio}   {others}"


class Innocent:
    """A client that sends a photo each PERIOD over a connection that it keeps."""

    def __init__(self, target: Target, source: str, expected: bytes, tally: Tally) -> None:
        self.target, self.source, self.expected, self.tally = target, source, expected, tally
        self.streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def run(self, until: float, stop: asyncio.Event) -> None:
        """Send photos until the time is over or nobody listens any more."""
        following = time.monotonic() + random.uniform(0, PERIOD)
        while following < until and not stop.is_set():
            await asyncio.sleep(max(0.0, following - time.monotonic()))
            began = time.monotonic()
            outcome = await self._ask()
            self.tally.counts[outcome] += 1
            if outcome == "right":
                self.tally.seconds.append(time.monotonic() - began)
            elif stop.is_set():
                break
            following = max(following + PERIOD, time.monotonic())
        self._close()

    async def _ask(self) -> str:
        if self.streams and self.streams[0].at_eof():
            self._close()  # by the service, while nothing was asked
        try:
            self.streams = self.streams or await self.target.connect(self.source)
        except OSError:
            return "refused"
        try:
            async with asyncio.timeout(TIMEOUT):
                return await self._send(*self.streams)
        except (OSError, EOFError, TimeoutError):
            self._close()
            return "lost"

    async def _send(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> str:
        writer.write(self.target.post("/v1/lighting") + self.target.photo)
        head = await reader.readuntil(b"\r\n\r\n")
        body = await reader.readexactly(_content_length(head))
        if b"\r\nconnection: close" in head.lower():
            self._close()
        if head[9:12] != b"200":
            return _describe_refusal(head, body)
        return "right" if body == self.expected else "wrong"

    def _close(self) -> None:
        if self.streams:
            self.streams[1].close()
        self.streams = None


def _describe_refusal(head: bytes, body: bytes) -> str:
    """A status and, where the service gives it, its reason."""
    status = head[9:12].decode()
    if b"application/problem+json" not in head:
        return status
    return f"{status} ({json.loads(body)['detail'].rstrip('.')})"


def _content_length(head: bytes) -> int:
    lines = head.lower().split(b"\r\n")
    return int(next(line for line in lines if line.startswith(b"content-length:")).partition(b":")[2])


async def ask_as_innocents(target: Target, clients: int, seconds: float, expected: bytes, stop: Any = None) -> Tally:
    """Let innocent clients ask for some time; what they got."""
    tally, until, stopped = Tally(), time.monotonic() + seconds, asyncio.Event()

    async def watch() -> None:
        while stop and not stop():
            await asyncio.sleep(0.1)
        stopped.set()

    askers = [Innocent(target, f"127.0.1.{n + 1}", expected, tally).run(until, stopped) for n in range(clients)]
    watcher = asyncio.create_task(watch()) if stop else None
    await asyncio.gather(*askers)
    if watcher:
        watcher.cancel()
    return tally


async def leave_unread(target: Target, source: str, number: int) -> None:
    """Ask for large maps and take them never, or at 10 kB/s."""
    reader, writer = await target.connect(source)
    try:
        writer.write(target.get(MAP))
        status = await reader.readuntil(b"\r\n")
        while b" 200 " in status:
            await asyncio.sleep(1)
            if number % 2 and not await reader.read(10_000):
                break
    finally:
        writer.transport.abort()


async def ask_for_work(target: Target, source: str, _: int) -> None:
    """Ask for previews."""
    reader, writer = await target.connect(source)
    try:
        writer.write(target.post("/v1/preview") + target.photo)
        head = await reader.readuntil(b"\r\n\r\n")
        await reader.readexactly(_content_length(head))
    finally:
        writer.close()


async def announce_uploads(target: Target, source: str, _: int) -> None:
    """Send headers without a body."""
    reader, writer = await target.connect(source)
    try:
        writer.write(target.post("/v1/lighting", 30_000_000))
        await reader.read(1000)
    finally:
        writer.close()


async def stay_silent(target: Target, source: str, _: int) -> None:
    """Open a connection."""
    reader, writer = await target.connect(source)
    try:
        await reader.read(1000)
    finally:
        writer.close()


ATTACKS: dict[str, tuple[int, Callable[[Target, str, int], Coroutine[Any, Any, None]]]] = {  # at a time, and what
    "unread": (4, leave_unread),
    "work": (4, ask_for_work),
    "headers": (8, announce_uploads),
    "silent": (100, stay_silent),
}


async def attack(target: Target, clients: int) -> None:
    """Attack until this process is ended."""

    async def repeat(kind: str, source: str, number: int) -> None:
        while True:
            with suppress(OSError, EOFError, StopIteration, ValueError):
                await ATTACKS[kind][1](target, source, number)
            await asyncio.sleep(PAUSE)

    async def watch() -> None:
        parent = os.getppid()
        while os.getppid() == parent:
            await asyncio.sleep(1)
        os._exit(1)  # the benchmark was killed

    kinds = [(KINDS[n % len(KINDS)], f"127.0.2.{n + 1}") for n in range(clients)]
    watcher = asyncio.create_task(watch())
    await asyncio.gather(*(repeat(kind, source, n) for kind, source in kinds for n in range(ATTACKS[kind][0])))
    watcher.cancel()


def _attack_in_process(target: Target, clients: int) -> None:
    import resource

    os.setsid()  # Linux shares the processors among sessions first: hostile clients take none of the service's share
    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    asyncio.run(attack(target, clients))


@contextmanager
def attacked(target: Target, clients: int) -> Iterator[None]:
    """Hostile clients in a process of their own."""
    process = multiprocessing.get_context("spawn").Process(target=_attack_in_process, args=(target, clients))
    process.start()
    try:
        yield
    finally:
        process.kill()
        process.join()


@contextmanager
def behind_caddy(program: str, port: int) -> Iterator[int]:
    """The port of a Caddy with this project's Caddyfile in front of the service."""
    front = free_port()
    variables = {"SITE": f"http://:{front}", "SERVICE": f"127.0.0.1:{port}", "MAX_BYTES": "64000000"}
    variables |= {"UPLOAD_SECONDS": "60", "HEADER_SECONDS": "10"}
    with tempfile.TemporaryDirectory() as home:
        environment = {**os.environ, **variables, "HOME": home, "XDG_DATA_HOME": home, "XDG_CONFIG_HOME": home}
        config = Path(home, "Caddyfile")
        config.write_text((ROOT / "Caddyfile").read_text().replace("{\n", "{\n\tadmin off\n", 1))
        command = [program, "run", "--config", str(config), "--adapter", "caddyfile"]
        with subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) as process:
            try:
                wait_until_answered(f"http://127.0.0.1:{front}/livez", process)
                yield front
            finally:
                process.kill()


def first_answer(target: Target) -> bytes:
    """The right answer, which is the same each time."""
    with socket.create_connection(("127.0.0.1", target.port)) as connection, connection.makefile("rb") as answer:
        connection.sendall(target.post("/v1/lighting") + target.photo)
        head = b"".join(iter(answer.readline, b"\r\n")) + b"\r\n"
        if head[9:12] != b"200":
            sys.exit(f"The first answer is {head[:12].decode()}.")
        return answer.read(_content_length(head))


def compare(options: argparse.Namespace, photo: bytes, caddy: str | None) -> None:
    """Run the innocent clients alone, beside hostile ones, and through a shutdown; print a line for each."""
    name, trusted = ("behind Caddy", "127.0.0.1") if caddy else ("the service", "")
    service = [sys.executable, "-m", "server"]
    settings = {"LIGHTING_TRUSTED_PROXIES": trusted, "LIGHTING_UPLOADS": "32", "LIGHTING_UPLOADS_PER_CLIENT": "8"}
    with ExitStack() as stack:
        port, process = stack.enter_context(started(service, "/readyz", 32, settings))
        target = Target(stack.enter_context(behind_caddy(caddy, port)) if caddy else port, photo)
        expected = first_answer(target)
        asyncio.run(ask_as_innocents(target, options.clients, 2 * PERIOD, expected))  # every thread exists afterwards
        alone = asyncio.run(ask_as_innocents(target, options.clients, options.seconds, expected))
        print(alone.row(f"{name}, alone"), flush=True)
        with attacked(target, options.hostile):
            time.sleep(5)
            tally = asyncio.run(ask_as_innocents(target, options.clients, options.seconds, expected))
            print(tally.row(f"{name}, attacked", alone), flush=True)
            print(f"{'':<22}{_describe_service(port)}", flush=True)
            last = asyncio.run(_stop_under_attack(target, options.clients, expected, process))
            print(last.row(f"{name}, SIGTERM"), f"; exit status {process.wait(60)}", flush=True)


def _describe_service(port: int) -> str:
    """Some gauges of the service."""
    names = ("lighting_connections", "lighting_uploads", "lighting_queue_depth", "lighting_unsent_bytes")
    with socket.create_connection(("127.0.0.1", port)) as connection, connection.makefile("rb") as answer:
        connection.sendall(b"GET /metrics HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        pairs = [line.split() for line in answer.read().decode().splitlines() if line.startswith(names)]
    return ", ".join(f"{name.removeprefix('lighting_')} {float(value):g}" for name, value in pairs)


async def _stop_under_attack(
    target: Target, clients: int, expected: bytes, process: "subprocess.Popen[bytes]"
) -> Tally:
    """What innocent clients get when the service is told to stop; 502 is Caddy's word where it is gone."""
    asyncio.get_running_loop().call_later(2 * PERIOD, process.send_signal, signal.SIGTERM)
    began = time.monotonic()
    return await ask_as_innocents(target, clients, 60, expected, lambda: time.monotonic() - began > 2 * PERIOD)


def print_costs(photo: bytes) -> None:
    """Processor time of each route, of the service with all its processes."""
    large = Path(tempfile.mkdtemp(), "large.jpg")
    photos = {"0.3 MP": photo, "12 MP": make_photo(large).read_bytes()}
    shutil.rmtree(large.parent)
    sky = MAP.partition("&height")[0].partition("?")[2]
    requests = [
        ("POST", f"/v1/{route}", size) for size in photos for route in ("lighting", "photo", "envmap", "preview")
    ]
    requests += [("POST", "/v1/scene?for=blender", size) for size in photos]
    requests += [
        ("GET", f"/v1/envmap?{sky}{more}", "") for more in ("", "&height=2048", "&height=2048&compression=none")
    ]
    requests += [("GET", f"/v1/scene?{sky}&for=blender", ""), ("GET", "/v1/model", "")]
    with started([sys.executable, "-m", "server"], "/readyz") as (port, process):
        for method, path, size in requests:
            target = Target(port, photos.get(size, b""))
            request = target.post(path) + target.photo if method == "POST" else target.get(path)
            before = 0.0
            for run in range(COST_RUNS + 1):
                if run == 1:  # the first is to warm up
                    before = processor_time(process.pid)
                _ask_once(port, request)
            cost = (processor_time(process.pid) - before) / COST_RUNS
            shown = path.replace(f"?{sky}&", "?").replace(f"?{sky}", "")
            print(f"{method:<5}{shown:<45}{size:<8}{cost:7.3f} CPU s", flush=True)


def _ask_once(port: int, request: bytes) -> None:
    with socket.create_connection(("127.0.0.1", port)) as connection, connection.makefile("rb") as answer:
        connection.sendall(request)
        head = b"".join(iter(answer.readline, b"\r\n")) + b"\r\n"
        if head[9:12] != b"200":
            sys.exit(f"{request[:60]!r} is answered {head[:12].decode()}.")
        answer.read(_content_length(head))


@contextmanager
def _begin_uploads(port: int, _: Path) -> Iterator[None]:
    """Sixty uploads of one client, of which a byte comes."""
    head = f"POST /v1/jobs?kind=photos HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nContent-Type: application/zip\r\n"
    with ExitStack() as stack:
        for _number in range(60):
            source = ("127.0.2.1", 0)
            connection = stack.enter_context(socket.create_connection(("127.0.0.1", port), source_address=source))
            connection.sendall(f"{head}Content-Length: 9\r\n\r\nx".encode())
        yield


@contextmanager
def _fill_disk(_: int, folder: Path) -> Iterator[None]:
    """A disk without a byte left."""
    with (folder / "fill").open("wb", buffering=0) as file, suppress(OSError):
        while file.write(bytes(4096)):
            pass
    yield
    (folder / "fill").unlink()


@contextmanager
def _remove_folders(_: int, folder: Path) -> Iterator[None]:
    """Folders of jobs that wait and work are removed, by a shell of the operator's."""
    yield
    shutil.rmtree(folder / JOBS_FOLDER)


@contextmanager
def _lock_records(_: int, folder: Path) -> Iterator[None]:
    """Somebody locks every file, as a shell that reads a table."""
    import fcntl

    with ExitStack() as stack:
        for path in [path for path in folder.rglob("*") if path.is_file()]:
            file = stack.enter_context(path.open("r+b"))
            fcntl.lockf(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield


JOB_ATTACKS = {
    "60 uploads": _begin_uploads,
    "full disk": _fill_disk,
    "removed folders": _remove_folders,
    "locked files": _lock_records,
}
SMALL_DISK = 'mount -t tmpfs -o size=32m tmpfs "$1"; shift; exec "$@"'  # in a namespace of the service's own


def attack_jobs(photo: bytes) -> None:
    """Attack long jobs, one way after another; print what innocent clients get meanwhile, and of a job afterwards."""
    print(f"{'':<18}{'/livez ms':>10}{'photo':>7}{'job':>5}{'afterwards':>12}   /readyz meanwhile")
    with tempfile.TemporaryDirectory() as name:
        service = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-ec", SMALL_DISK, "sh", name]
        service += [sys.executable, "-m", "server"]
        with started(service, "/readyz", 32, {"LIGHTING_JOBS_FOLDER": name}) as (port, process):
            folder = Path(f"/proc/{process.pid}/root{name}")
            for kind, begin in JOB_ATTACKS.items():
                with begin(port, folder):
                    job, first = _submit_job(port, photo)
                    slowest = max(_time_livez(port) for _ in range(20))
                    answer, _ = _call(port, "POST", "/v1/lighting", photo, "image/jpeg")
                    ready, detail = _call(port, "GET", "/readyz")
                _, last = _submit_job(port, photo)
                ended = _wait_for_job(port, last) if last else "refused"
                for address in filter(None, (first, last)):
                    _call(port, "DELETE", address)
                told = f"{ready} {detail.get('detail', '')}"
                print(f"{kind:<18}{1000 * slowest:>10.0f}{answer:>7}{job:>5}{ended:>12}   {told}", flush=True)
                if answer != 200 or ended != "finished":
                    sys.exit("This attack does harm.")


def _time_livez(port: int) -> float:
    """Seconds until the process says that it lives."""
    time.sleep(0.1)
    began = time.monotonic()
    _call(port, "GET", "/livez")
    return time.monotonic() - began


def _submit_job(port: int, photo: bytes) -> tuple[int, str]:
    """The status of the answer to a job of one photo, and its address."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("photo.jpg", photo)
    status, record = _call(port, "POST", "/v1/jobs?kind=photos", stream.getvalue(), "application/zip")
    return status, urljoin("/v1/jobs", record.get("links", {}).get("self", ""))


def _wait_for_job(port: int, address: str) -> str:
    """How a job ended."""
    until = time.monotonic() + TIMEOUT
    while time.monotonic() < until:
        _, record = _call(port, "GET", address)
        if record.get("state") not in ("queued", "running"):
            return str(record.get("state", record.get("status")))
        time.sleep(0.2)
    return "waits"


def _call(port: int, method: str, path: str, body: bytes | None = None, kind: str = "") -> tuple[int, dict[str, Any]]:
    """Status and JSON of an answer to an innocent client."""
    connection = HTTPConnection("127.0.0.1", port, timeout=TIMEOUT, source_address=("127.0.1.1", 0))
    with closing(connection):
        connection.request(method, path, body, {"Content-Type": kind} if kind else {})
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read() or b"{}")


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=180, help="of each of the four runs")
    parser.add_argument("--clients", type=int, default=64, help="innocent ones; fewer where the machine is busy")
    parser.add_argument("--hostile", type=int, default=64, help="hostile clients")
    parser.add_argument("--caddy", metavar="PROGRAM", help="measure behind Caddy, too")
    parser.add_argument("--costs", action="store_true", help="print what each route costs, and nothing else")
    parser.add_argument("--jobs", action="store_true", help="attack long jobs, and nothing else")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        photo = make_photo(Path(folder, "photo.jpg"), PHOTO_SIZE).read_bytes()
    print(f"{describe_machine()}; load {os.getloadavg()[0]:.1f}")
    if options.costs:
        print_costs(photo)
        return
    if options.jobs:
        attack_jobs(photo)
        return
    size = len(photo) / 1e3
    print(f"{options.clients} innocent clients, photos of {size:.0f} kB; {options.hostile} hostile ones\n{HEAD}")
    compare(options, photo, None)
    if options.caddy:
        compare(options, photo, options.caddy)


if __name__ == "__main__":
    main()

"""The service under load, compared with LitServe doing the same job.

    python -m benchmarks.load [--seconds 60] [--beside PYTHON]

1, 4, 8, 16 and 64 clients send a 12-megapixel JPEG each, again and again, and wait for a 1024 x 512 EXR: requests per
second, latency in milliseconds, and the processor time [ms] that a request costs the service with all its processes,
which other work on the machine changes least. PYTHON is one with litserve, python-multipart and this project's
requirements:

    python -m venv lit && lit/bin/pip install litserve==0.2.19 python-multipart .

Then the service's memory before and after, and what SIGTERM does to requests under way. Everything stays on 127.0.0.1.
"""

import argparse
import asyncio
import os
import platform
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from benchmarks.clients import Job, Outcome, ask_for
from benchmarks.common import ROOT, make_photo

LEVELS = (1, 4, 8, 16, 64)  # clients
EXR, RECORD = b"v/1\x01", b'{"model"'
START = 60  # seconds
HEAD = f"{'clients':>26}{'req/s':>8}{'p50':>9}{'p95':>9}{'p99':>9}{'replies':>9}{'CPU':>7}"


def main() -> None:
    """Measure and print."""
    options = _options()
    share = options.seconds / (16 if options.beside else 10)  # of the time, for one level of one service
    print(f"{platform.machine()}, {os.cpu_count()} CPUs, Python {platform.python_version()}, queue {options.queue}")
    with ExitStack() as stack:
        photo = stack.enter_context(_photo())
        port, ours = stack.enter_context(started([sys.executable, "-m", "server"], "/readyz", options.queue))
        print(f"photo of {len(photo) / 1e6:.1f} MB\n\n{HEAD}")
        jobs, groups = {"POST /v1/envmap": Job(port, "/v1/envmap", photo, EXR)}, {"POST /v1/envmap": ours.pid}
        if options.beside:
            other = [options.beside, str(ROOT / "benchmarks/litserve_app.py")]
            other_port, other_process = stack.enter_context(started(other, "/health"))
            jobs["LitServe"] = Job(other_port, "/predict", photo, EXR)
            groups["LitServe"] = other_process.pid
        for job in jobs.values():  # every buffer and thread exists afterwards
            run(job, max(LEVELS), share)
        before = memory(ours.pid)
        for clients in LEVELS:
            outcomes = {}
            for name, job in jobs.items():
                outcomes[name] = measured(name, job, groups[name], clients, share)
            if options.beside:
                compare(*outcomes.values())
        for clients in LEVELS:
            light = Job(port, "/v1/lighting", photo, RECORD)
            measured("POST /v1/lighting", light, ours.pid, clients, share / 2)
        after = memory(ours.pid)
        print(f"\nmemory {before:.0f} MB after warm-up, {after:.0f} MB at the end: {after / before - 1:+.1%}")
        interrupt(jobs["POST /v1/envmap"], ours, share)


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=60, help="of measuring, all in all")
    parser.add_argument("--beside", metavar="PYTHON", help="measure LitServe too, run by this Python")
    parser.add_argument("--queue", type=int, default=64, help="the service's setting LIGHTING_QUEUE")
    return parser.parse_args()


@contextmanager
def _photo() -> Iterator[bytes]:
    with tempfile.TemporaryDirectory() as folder:
        yield make_photo(Path(folder) / "photo.jpg").read_bytes()


@contextmanager
def started(
    command: list[str], ready: str, queue: int = 64, more: Mapping[str, str] | None = None
) -> Iterator[tuple[int, subprocess.Popen[bytes]]]:
    """Run a service in a process group of its own, with more variables; its port and process once it is ready."""
    port = free_port()
    settings = {"LIGHTING_PORT": str(port), "LIGHTING_QUEUE": str(queue), "LIGHTING_LOG_LEVEL": "warning"}
    settings |= {"LIGHTING_UPLOADS": str(max(LEVELS)), "LIGHTING_UPLOADS_PER_CLIENT": str(max(LEVELS))}  # one address
    quiet = {"PYTHONPATH": str(ROOT), "ORT_DISABLE_TELEMETRY": "1"}
    arguments = command if "-m" in command else [*command, str(port)]
    environment = {**os.environ, **settings, **quiet, **(more or {})}
    with subprocess.Popen(arguments, env=environment, stdout=subprocess.DEVNULL, process_group=0) as process:
        try:
            wait_until_answered(f"http://127.0.0.1:{port}{ready}", process)
            yield port, process
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def free_port() -> int:
    """A port on which nobody listens."""
    with socket.create_server(("127.0.0.1", 0)) as anything:
        return int(anything.getsockname()[1])


def wait_until_answered(url: str, process: subprocess.Popen[bytes]) -> None:
    """Wait until a process answers a request; ends this one if it does not."""
    for _ in range(START * 5):
        try:
            urllib.request.urlopen(url, timeout=5).close()
            return
        except (urllib.error.URLError, OSError):
            if process.poll() is not None:
                break
        time.sleep(0.2)
    sys.exit(f"{url} is not there.")


def run(job: Job, clients: int, seconds: float) -> Outcome:
    """`ask_for`, from a loop of its own."""
    return asyncio.run(ask_for(job, clients, seconds))


def measured(name: str, job: Job, group: int, clients: int, seconds: float) -> Outcome:
    """`run`, printed as a line of the table; `group` is the process group of the service."""
    before = processor_time(group)
    outcome = run(job, clients, seconds)
    busy = 1000 * (processor_time(group) - before) / max(1, outcome.counts["200"])
    print(f"{name:<18}{clients:>8}{outcome.row(busy)}", flush=True)
    return outcome


def processor_time(group: int) -> float:
    """Seconds that the processes of a group have worked; those that have ended do not count."""
    ticks = 0
    for status in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = status.read_text().rpartition(")")[2].split()  # from the state on, field 3 of proc(5)
            ticks += int(fields[11]) + int(fields[12]) if int(fields[2]) == group else 0
    return ticks / os.sysconf("SC_CLK_TCK")


def compare(ours: Outcome, other: Outcome) -> None:
    """Our rate and our p99 as multiples of the other's."""
    rate = ours.rate / other.rate
    print(f"{'':<26}{rate:7.2f}x{'':18}{ours.percentile(99) / other.percentile(99):8.2f}x", flush=True)


def memory(pid: int) -> float:
    """Proportional share of memory of a process, MB."""
    lines = Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("Pss:")) * 1024 / 1e6


def interrupt(job: Job, service: subprocess.Popen[bytes], seconds: float) -> None:
    """Send SIGTERM while 16 clients ask; every request that the service had taken must get its whole reply."""

    async def request_once() -> Outcome:
        asyncio.get_running_loop().call_later(seconds / 2, service.send_signal, signal.SIGTERM)
        return await ask_for(job, 16, seconds)

    outcome = asyncio.run(request_once())
    code = service.wait(START)
    print(f"SIGTERM under 16 clients: {dict(sorted(outcome.counts.items()))}, exit status {code}")


if __name__ == "__main__":
    main()

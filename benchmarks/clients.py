"""The service under load: a server process of its own, and clients that ask again as soon as they are answered."""

import http.client
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

PATIENCE = 60  # seconds for the service to be ready


@contextmanager
def service() -> Iterator[int]:
    """The port of `python -m server`, ready to answer."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    settings = {**os.environ, "LIGHTING_PORT": str(port)}
    running = subprocess.Popen([sys.executable, "-m", "server"], env=settings, stderr=subprocess.DEVNULL)
    try:
        _wait_until_ready(port)
        yield port
    finally:
        running.terminate()
        running.wait()


def _wait_until_ready(port: int) -> None:
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        try:
            if _ask(port, "GET", "/readyz", b"") == 200:
                return
        except OSError:
            pass
        time.sleep(0.1)
    raise SystemExit("The service did not become ready.")


def _ask(port: int, method: str, path: str, body: bytes) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=PATIENCE)
    try:
        connection.request(method, path, body, {"Content-Type": "image/jpeg"})
        answer = connection.getresponse()
        answer.read()
        return answer.status
    finally:
        connection.close()


def load(port: int, photo: Path, clients: int, seconds: float) -> dict[str, float]:
    """Answered photos per second, their latency [ms], and the share of requests that the full queue turned away."""
    body, end = photo.read_bytes(), time.monotonic() + seconds
    took: list[float] = []
    refused: list[int] = []

    def ask_on() -> None:
        while time.monotonic() < end:
            started = time.monotonic()
            status = _ask(port, "POST", "/v1/lighting", body)
            if status == 200:
                took.append(time.monotonic() - started)
            else:
                refused.append(status)
                time.sleep(0.05)

    threads = [threading.Thread(target=ask_on) for _ in range(clients)]
    started = time.monotonic()
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    rate = len(took) / (time.monotonic() - started)
    took.sort()
    return {
        "rate": rate,
        "median": 1000 * took[len(took) // 2] if took else 0.0,
        "p95": 1000 * took[int(0.95 * len(took))] if took else 0.0,
        "refused": len(refused) / max(1, len(refused) + len(took)),
    }

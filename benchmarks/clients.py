"""Clients that send a photo as a form over kept connections and time the whole replies."""

import asyncio
import statistics
import time
from collections import Counter
from dataclasses import dataclass, field
from typing import Self

_BOUNDARY = "5f1c6a0e9d"


@dataclass(frozen=True)
class Job:
    """The request that every client repeats."""

    port: int
    path: str
    photo: bytes
    starts_with: bytes  # of a right answer

    def request(self) -> bytes:
        """The bytes on the wire: a form with the file `photo`."""
        part = f'--{_BOUNDARY}\r\nContent-Disposition: form-data; name="photo"; filename="p.jpg"\r\n'
        body = f"{part}Content-Type: image/jpeg\r\n\r\n".encode() + self.photo + f"\r\n--{_BOUNDARY}--\r\n".encode()
        kind = f"Content-Type: multipart/form-data; boundary={_BOUNDARY}\r\nContent-Length: {len(body)}\r\n"
        return f"POST {self.path} HTTP/1.1\r\nHost: 127.0.0.1:{self.port}\r\n{kind}\r\n".encode() + body


@dataclass
class Outcome:
    """The replies to the clients of one run."""

    seconds: float = 0.0  # from the first request to the last whole reply
    latencies: list[float] = field(default_factory=list)  # seconds from the first try to the right answer
    counts: Counter[str] = field(default_factory=Counter)  # "200", "503", "refused", "unanswered", "broken"

    @property
    def rate(self) -> float:
        """Right answers per second."""
        return len(self.latencies) / self.seconds

    def percentile(self, share: int) -> float:
        """Seconds within which so many per cent of the answers came."""
        return statistics.quantiles(self.latencies, n=100, method="inclusive")[share - 1]

    def row(self, busy: float) -> str:
        """Requests per second, percentiles, and the processor time `busy` [ms] of one, for a table."""
        times = "".join(f"{1000 * self.percentile(share):9.0f}" for share in (50, 95, 99))
        others = ", ".join(f"{count} x {what}" for what, count in sorted(self.counts.items()) if what != "200")
        return f"{self.rate:8.1f}{times}{self.counts['200']:9d}{busy:7.0f}   {others}"


class Connection:
    """One connection, opened when it is needed and again after it was closed."""

    def __init__(self, port: int) -> None:
        self.port = port
        self.streams: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close it if it is open."""
        if self.streams:
            self.streams[1].close()
        self.streams = None

    async def ask(self, request: bytes) -> tuple[str, int, bytes]:
        """Status, Retry-After and body; or "refused", "unanswered" or "broken" in place of the status."""
        heard = False
        if self.streams and (self.streams[0].at_eof() or self.streams[0].exception()):
            self.close()  # by the service, while nothing was asked
        try:
            if self.streams is None:
                self.streams = await asyncio.open_connection("127.0.0.1", self.port, limit=1 << 22)
        except OSError:
            return "refused", 0, b""
        reader, writer = self.streams
        try:
            writer.write(request)
            head = await reader.readuntil(b"\r\n\r\n")
            heard = True
            headers = _headers(head)
            body = await reader.readexactly(int(headers["content-length"]))
        except (OSError, EOFError, KeyError) as error:
            self.close()
            partial = heard or bool(getattr(error, "partial", b""))
            return "broken" if partial else "unanswered", 0, b""
        if headers.get("connection") == "close":
            self.close()
        return head[9:12].decode(), int(headers.get("retry-after", 0)), body


def _headers(head: bytes) -> dict[str, str]:
    lines = head.decode("latin-1").split("\r\n")[1:]
    return {name.lower(): value.strip() for name, _, value in (line.partition(":") for line in lines) if name}


async def ask_for(job: Job, clients: int, seconds: float) -> Outcome:
    """Let this many clients ask for this many seconds; requests still running then are waited for and count.

    A client that is told to come back later does, after the time it is told, and that time counts.
    """
    outcome, request, began = Outcome(), job.request(), time.perf_counter()
    ends = [client(job, request, outcome, began + seconds) for _ in range(clients)]
    await asyncio.gather(*ends)
    outcome.seconds = time.perf_counter() - began
    return outcome


async def client(job: Job, request: bytes, outcome: Outcome, until: float) -> None:
    """Ask one request after another until the time is over or nobody answers."""
    async with Connection(job.port) as connection:
        while time.perf_counter() < until:
            began = time.perf_counter()
            while (reply := await connection.ask(request))[0] in ("429", "503"):
                outcome.counts[reply[0]] += 1
                await asyncio.sleep(reply[1])
            status = "broken" if reply[0] == "200" and not reply[2].startswith(job.starts_with) else reply[0]
            outcome.counts[status] += 1
            if status != "200":
                return
            outcome.latencies.append(time.perf_counter() - began)

"""Which connections are refused, and what ends one, on a real socket: heads, bodies in crumbs, untaken answers."""

import asyncio
import json
import logging
import re
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import partial
from http.client import HTTPResponse
from typing import Any

import pytest
from starlette.types import Receive, Scope, Send

from lighting.estimator import Estimator
from server import connections
from server.connections import (
    MAX_CHUNKS,
    MAX_HEADER_BYTES,
    MAX_REFUSALS,
    MIN_MEAN_CHUNK,
    BoundedProtocol,
    Listener,
    bind_listeners,
)
from server.dependencies import Service
from server.limits import ConnectionLimiter, PendingResponses
from server.middleware import SECURITY_HEADERS
from server.schemas import Problem
from server.settings import Settings
from tests.helpers.processes import serve_app

READ_BYTES = 4096

SECONDS = 1.0
GREEDY = "127.0.0.2"  # the address of a client that is refused
LARGE = 50_000_000  # bytes of an answer: more than the sockets of both sides keep

on_linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8")

gone = threading.Event()  # when the client of /wait has disconnected
go_on = threading.Event()  # when /wait may answer


async def wait_for_client(receive: Receive) -> None:
    """Read the body, and wait until its client has disconnected or the answer may be sent."""
    while (await receive()).get("more_body"):
        pass
    reading = asyncio.ensure_future(receive())
    while not reading.done() and not go_on.is_set():
        await asyncio.sleep(0.01)
    if reading.done():
        gone.set()
    reading.cancel()


async def app(scope: Scope, receive: Receive, send: Send) -> None:
    """Answers with the number of bytes of the body, after reading it unless the path is /early; or with LARGE ones."""
    if scope["path"] == "/wait":
        await wait_for_client(receive)
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"4")]})
        await send({"type": "http.response.body", "body": b"done"})
        return
    if scope["path"] == "/large":
        await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"%d" % LARGE)]})
        await send({"type": "http.response.body", "body": bytes(LARGE)})
        return
    size = 0
    while scope["path"] != "/early":
        message = await receive()
        size += len(message.get("body", b""))
        if not message.get("more_body"):
            break
    await send({"type": "http.response.start", "status": 200, "headers": [(b"content-length", b"%d" % len(str(size)))]})
    await send({"type": "http.response.body", "body": str(size).encode()})


@pytest.fixture(scope="module")
def service(estimator: Estimator) -> Service:
    return Service(Settings(header_seconds=SECONDS, answer_rate=10_000_000, unsent_bytes=LARGE), estimator)


@pytest.fixture(scope="module")
def pending(service: Service) -> PendingResponses:
    return service.pending


@pytest.fixture(scope="module")
def port(service: Service) -> Iterator[int]:
    with serve_app(app, protocol(service)) as number:
        yield number


def protocol(service: Service) -> Any:
    return partial(BoundedProtocol, service=service)


def connected(port: int) -> socket.socket:
    return socket.create_connection(("127.0.0.1", port), timeout=30)


def rest(connection: socket.socket) -> bytes:
    """What the service still says until it closes the connection."""
    with connection, connection.makefile("rb") as said:
        return said.read()


def answered(connection: socket.socket) -> bytes:
    """The body of the next answer, in however many pieces it comes."""
    with HTTPResponse(connection) as answer:
        answer.begin()
        assert answer.status == 200
        return answer.read()


def drip(connection: socket.socket) -> None:
    """Send a byte now and then for 20 s, unless the connection ends."""
    until = time.monotonic() + 20
    while time.monotonic() < until:
        connection.sendall(b"a")
        time.sleep(0.02)


def refused(answer: bytes, status: int, name: str) -> None:
    head, body = answer.split(b"\r\n\r\n", 1)
    assert head.startswith(b"HTTP/1.1 %d" % status)
    headers = dict(line.split(b": ", 1) for line in head.split(b"\r\n")[1:])
    assert headers[b"content-type"] == b"application/problem+json"
    found = Problem.model_validate(json.loads(body))
    assert headers[b"x-request-id"].decode() == found.request_id != ""
    assert {name: headers[name.lower().encode()].decode() for name in SECURITY_HEADERS} == SECURITY_HEADERS
    assert headers[b"lighting-model"] == b"tiny 0.0.1"
    assert b"date" in headers
    assert (found.status, found.type) == (status, f"tag:outdoor-lighting,2026:{name}")


def test_headers_that_are_too_large_are_431(port: int) -> None:
    for headers in (b"X-A: " + b"a" * MAX_HEADER_BYTES + b"\r\n", b"X-A: a\r\n" * 2500):
        connection = connected(port)
        connection.sendall(b"GET / HTTP/1.1\r\nHost: x\r\n" + headers)
        refused(rest(connection), 431, "headers-too-large")


@pytest.mark.parametrize("over", [2, 1000, READ_BYTES, 2 * READ_BYTES])
def test_whole_headers_a_little_too_large_are_431_too(port: int, over: int) -> None:
    connection = connected(port)
    frame = b"GET / HTTP/1.1\r\nHost: x\r\nX-A: %s\r\n\r\n"
    connection.sendall(frame % (b"a" * (MAX_HEADER_BYTES + over - len(frame % b""))))
    refused(rest(connection), 431, "headers-too-large")


def test_headers_that_come_at_once_have_no_larger_limit(port: int) -> None:
    connection = connected(port)
    connection.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nX-A: " + b"a" * 3 * MAX_HEADER_BYTES + b"\r\n\r\n")
    refused(rest(connection), 431, "headers-too-large")


def test_headers_up_to_the_limit_are_taken(port: int) -> None:
    connection = connected(port)
    connection.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nConnection: close\r\nX-A: " + b"a" * 15000 + b"\r\n\r\n")
    assert rest(connection).endswith(b"\r\n\r\n0")


def test_what_is_no_http_is_400(port: int) -> None:
    connection = connected(port)
    connection.sendall(b"\x16\x03\x01 hello\r\n\r\n")
    refused(rest(connection), 400, "malformed-request")


@pytest.mark.parametrize(
    ("headers", "reason"),
    [
        (b"", b"Missing mandatory Host: header"),
        (b"Host: x\r\nContent-Length: 3\r\nContent-Length: 4\r\n", b"conflicting Content-Length headers"),
        (b"Host: x\r\nAuthor ization: Bearer secret\r\n", b"illegal header line"),
    ],
)
def test_what_is_wrong_with_headers_is_said_and_the_headers_are_not(port: int, headers: bytes, reason: bytes) -> None:
    connection = connected(port)
    connection.sendall(b"GET / HTTP/1.1\r\n" + headers + b"\r\n")
    answer = rest(connection)
    refused(answer, 400, "malformed-request")
    assert b"The request cannot be read: " + reason + b"." in answer
    assert b"secret" not in answer


def test_what_never_became_a_request_is_logged(port: int, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level("INFO", "server.access"):
        for sent in (b"hello\r\n\r\n", b"GET / HTTP/1.1\r\nHost: x\r\nX-A: "):
            connection = connected(port)
            connection.sendall(sent)
            rest(connection)
    said = [record.getMessage() for record in caplog.records if record.name == "server.access"]
    assert [re.sub("[0-9a-f]{16}$", "ID", line) for line in said] == [
        "refused 400 malformed-request id=ID",
        "refused 408 too-slow id=ID",
    ]


@pytest.mark.parametrize("protocol", [b"h2c", b"websocket"])
def test_an_upgrade_that_is_not_made_is_no_news(
    port: int, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, protocol: bytes
) -> None:
    monkeypatch.setattr(logging.getLogger("uvicorn.error"), "handlers", [caplog.handler])
    head = b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\nConnection: Upgrade\r\nUpgrade: %b\r\n\r\n" % protocol
    with connected(port) as connection, caplog.at_level("WARNING", "uvicorn.error"):
        connection.sendall(head + b"abc")
        assert answered(connection) == b"3"
    assert not caplog.records


@pytest.mark.parametrize("sent", [b"", b"GET / HTTP/1.1\r\nHost: x\r\nX-A: "])
def test_headers_that_do_not_come_end_the_connection(port: int, sent: bytes) -> None:
    connection = connected(port)
    connection.sendall(sent)
    began = time.monotonic()
    refused(rest(connection), 408, "too-slow")
    assert time.monotonic() - began < 20


def test_headers_that_drip_in_do_not_prolong_it(port: int) -> None:
    with connected(port) as connection:
        connection.sendall(b"GET / HTTP/1.1\r\nHost: x\r\nX-A: ")
        with pytest.raises(OSError, match=r"."):
            drip(connection)


def test_a_body_has_its_own_time_and_the_next_request_comes_after_it(port: int) -> None:
    with connected(port) as connection:
        for _ in range(2):
            connection.sendall(b"POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 30000\r\n\r\n" + bytes(10000))
            time.sleep(1.5 * SECONDS)
            connection.sendall(bytes(20000))
            assert answered(connection) == b"30000"


def test_a_body_that_drips_in_after_its_answer_ends_the_connection(port: int) -> None:
    with connected(port) as connection:
        connection.sendall(b"POST /early HTTP/1.1\r\nHost: x\r\nContent-Length: 30000\r\n\r\n" + bytes(10))
        assert answered(connection) == b"0"
        with pytest.raises(OSError, match=r"."):
            drip(connection)


def test_the_silence_after_a_body_that_came_after_its_answer_is_not_answered(port: int) -> None:
    connection = connected(port)
    connection.sendall(b"POST /early HTTP/1.1\r\nHost: x\r\nContent-Length: 30000\r\n\r\n" + bytes(10))
    time.sleep(0.2)
    connection.sendall(bytes(29990))
    assert rest(connection).count(b"HTTP/1.1") == 1


CHUNKED = b"POST %s HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n"


@pytest.mark.parametrize("method", [b"POST", b"GET"])
def test_a_body_has_one_end(port: int, method: bytes) -> None:
    connection = connected(port)
    ends = b"Content-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
    connection.sendall(method + b" / HTTP/1.1\r\nHost: x\r\n" + ends + b"GET /early HTTP/1.1\r\nHost: x\r\n\r\n")
    answer = rest(connection)
    refused(answer, 400, "malformed-request")
    assert b"both say where the body ends; send one of them." in answer
    assert answer.count(b"HTTP/1.1 ") == 1


def test_a_body_in_crumbs_is_400(port: int) -> None:
    connection = connected(port)
    connection.sendall(CHUNKED % b"/" + b"1\r\nx\r\n" * (MAX_CHUNKS + 1))
    refused(rest(connection), 400, "unreadable-body")


def test_crumbs_after_an_answer_end_the_connection(caplog: pytest.LogCaptureFixture) -> None:
    with serve_app(app, protocol(Service(Settings(header_seconds=1000.0)))) as port:
        connection = connected(port)
        connection.sendall(CHUNKED % b"/early")
        time.sleep(0.2)
        connection.sendall(b"1\r\nx\r\n" * (MAX_CHUNKS + 1))
        assert rest(connection).count(b"HTTP/1.1") == 1
    assert not [record for record in caplog.records if record.exc_info]


def test_many_chunks_that_are_no_crumbs_and_few_that_are_are_taken(port: int) -> None:
    for size, count in ((MIN_MEAN_CHUNK, 3 * MAX_CHUNKS), (1, MAX_CHUNKS)):
        with connected(port) as connection:
            connection.sendall(CHUNKED % b"/" + (b"%x\r\n%s\r\n" % (size, bytes(size))) * count + b"0\r\n\r\n")
            assert answered(connection) == b"%d" % (size * count)


def test_chunks_are_read_in_small_pieces_so_that_others_have_their_turn(
    port: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    pieces: list[int] = []
    read = BoundedProtocol.data_received

    def noted(self: BoundedProtocol, data: bytes) -> None:
        pieces.append(len(data))
        read(self, data)

    monkeypatch.setattr(BoundedProtocol, "data_received", noted)
    for head in (
        CHUNKED % b"/" + b"%x\r\n" % 1_000_000,
        b"POST / HTTP/1.1\r\nContent-Length: 1000000\r\nHost: x\r\n\r\n",
    ):
        pieces.clear()
        with connected(port) as connection:
            connection.sendall(head + bytes(1_000_000) + (b"\r\n0\r\n\r\n" if b"chunked" in head else b""))
            assert answered(connection) == b"1000000"
        assert (max(pieces) <= READ_BYTES) == (b"chunked" in head)


def large(port: int) -> socket.socket:
    connection = connected(port)
    connection.sendall(b"GET /large HTTP/1.1\r\nHost: x\r\n\r\n")
    return connection


def until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_an_answer_that_is_not_taken_is_dropped(
    port: int, pending: PendingResponses, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("INFO", "server.access")
    monkeypatch.setattr(connections, "RESPONSE_GRACE", 3.0)
    with large(port) as connection:
        until(lambda: pending.size > 0)
        assert pending.size > LARGE // 2
        until(lambda: pending.size == 0)
        assert len(rest(connection)) < LARGE
    assert "dropped an answer" in caplog.text


def test_an_answer_that_is_taken_slowly_but_fast_enough_comes_whole(
    port: int, pending: PendingResponses, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(connections, "RESPONSE_GRACE", 0.5)
    taken = 0
    with large(port) as connection:
        until(lambda: pending.size > 0)
        while taken < LARGE:
            taken += len(connection.recv(1 << 20))
            time.sleep(0.02)
    until(lambda: pending.size == 0)


WAIT = b"POST /wait HTTP/1.1\r\nHost: x\r\nContent-Length: 3\r\n\r\nabc"


@pytest.fixture
def waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connections, "_PROBE_SECONDS", (0.3, 0.1, 0.1))
    gone.clear()
    go_on.clear()


@pytest.mark.parametrize("requests", [1, 2])
@pytest.mark.usefixtures("waiting")
def test_a_client_that_sends_no_more_gets_its_answers(port: int, requests: int) -> None:
    connection = connected(port)
    connection.sendall(WAIT * requests)
    connection.shutdown(socket.SHUT_WR)
    threading.Timer(0.1, go_on.set).start()
    answer = rest(connection)
    assert answer.count(b"HTTP/1.1 200") == answer.count(b"done") == requests
    assert b" 100 " not in answer
    assert not gone.is_set()


@pytest.mark.usefixtures("waiting")
def test_a_client_that_waits_for_long_gets_interim_answers(port: int) -> None:
    connection = connected(port)
    connection.sendall(WAIT)
    connection.shutdown(socket.SHUT_WR)
    threading.Timer(1.0, go_on.set).start()
    with HTTPResponse(connection) as answer:
        answer.begin()  # skips them
        assert (answer.status, answer.read()) == (200, b"done")
    connection.close()


@pytest.mark.usefixtures("waiting")
def test_a_client_that_has_gone_altogether_is_noticed(port: int) -> None:
    connection = connected(port)
    connection.sendall(WAIT)
    time.sleep(0.1)
    connection.close()
    assert gone.wait(20)


@pytest.mark.usefixtures("waiting")
def test_half_a_body_is_no_request(port: int) -> None:
    connection = connected(port)
    connection.sendall(WAIT[:-1])
    connection.shutdown(socket.SHUT_WR)
    assert rest(connection) == b""
    assert gone.wait(20)


@pytest.mark.usefixtures("waiting")
def test_silent_connections_give_way_and_working_ones_do_not() -> None:
    service = Service(Settings(header_seconds=60.0, answer_rate=1, trusted_proxies="127.0.0.1"))
    service.connections = limiter = ConnectionLimiter(3, 3)
    with serve_app(app, protocol(service)) as port:
        working, silent = connected(port), connected(port)
        working.sendall(WAIT)
        until(lambda: limiter.count == 2)
        others = [connected(port) for _ in range(3)]
        assert rest(silent) == b""
        assert limiter.count == 3
        go_on.set()
        answer = b""
        while b"done" not in answer:
            received = working.recv(1000)
            assert received, answer
            answer += received
        for connection in (working, *others):
            connection.close()
        until(lambda: limiter.count == 0)


@pytest.fixture
def listener() -> Iterator[Listener]:
    (listener,) = bind_listeners("127.0.0.1", 0)
    with listener:
        listener.refuses = lambda host: host == GREEDY
        listener.setblocking(False)
        listener.listen(1)
        yield listener


def connect(listener: Listener, host: str) -> socket.socket:
    return socket.create_connection(listener.getsockname(), timeout=10, source_address=(host, 0))


@on_linux
def test_a_refused_connection_is_closed_and_the_next_one_taken(listener: Listener) -> None:
    with connect(listener, GREEDY) as refused, connect(listener, "127.0.0.3") as taken:
        connection, address = listener.accept()
        assert (type(connection), address) == (socket.socket, taken.getsockname())
        connection.close()
        assert refused.recv(1) == b""
        with pytest.raises(BlockingIOError):
            listener.accept()


@on_linux
def test_refusals_leave_the_loop_its_turn(listener: Listener) -> None:
    crowd = [connect(listener, GREEDY) for _ in range(MAX_REFUSALS + 1)]
    with connect(listener, "127.0.0.3"):
        with pytest.raises(BlockingIOError):
            listener.accept()
        assert [crowd[0].recv(1), crowd[MAX_REFUSALS - 1].recv(1)] == [b"", b""]
        (connection,) = listener.accept_waiting()
        connection.close()
    for refused in crowd:
        refused.close()


@on_linux
def test_a_name_of_two_addresses_is_bound_where_they_are_free() -> None:
    addresses = {info[4][0] for info in socket.getaddrinfo("localhost", 0, type=socket.SOCK_STREAM)}
    listeners = bind_listeners("localhost", 0)
    assert {listener.getsockname()[0] for listener in listeners} <= addresses
    for listener in listeners:
        listener.close()

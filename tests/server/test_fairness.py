"""Greedy clients keep nobody out: a real service, innocent and hostile clients at loopback addresses of their own."""

import http.client
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from server.limits import PLACE_BYTES
from tests.helpers.pages import ROOT
from tests.helpers.requirements import require
from tests.helpers.service import PHOTO, Server, started

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(sys.platform != "linux", reason="only Linux has all of 127.0.0.0/8"),
]

INNOCENT = "127.0.1.1"
SKY = "sun_azimuth=10&sun_elevation=30&turbidity=3&exposure=0.02"
LARGE_MAP = f"GET /v1/envmap?{SKY}&height=1024&compression=none HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()  # 25 MB
LONG_WORK = f"GET /v1/envmap?{SKY}&height=2048 HTTP/1.1\r\nHost: localhost\r\n\r\n".encode()


@pytest.fixture(scope="module")
def server(network: Path) -> Iterator[Server]:
    with started(network, concurrency=1, queue=5, uploads=3, uploads_per_client=2, unsent_bytes=60_000_000) as server:
        yield server


def ask_innocently(server: Server) -> None:
    """A photo is answered, and the service is ready."""
    assert server.request("POST", "/v1/lighting", PHOTO, source=INNOCENT)[0] == 200
    assert server.request("GET", "/readyz", source=INNOCENT)[0] == 200


def status_of(connection: socket.socket) -> bytes:
    """The status of an answer of which nothing else is read."""
    return connection.recv(12)[9:]


def test_unread_answers_are_the_loss_of_who_does_not_read(server: Server) -> None:
    with ExitStack() as stack:
        statuses = []
        for _ in range(4):
            connection = stack.enter_context(server.connect("127.0.2.1"))
            connection.sendall(LARGE_MAP)
            statuses.append(status_of(connection))
            ask_innocently(server)
        assert statuses == [b"200", b"429", b"429", b"429"]  # a quarter of 60 MB waits for this client
        for number in range(2, 6):
            connection = stack.enter_context(server.connect(f"127.0.2.{number}"))
            connection.sendall(LARGE_MAP)
            assert status_of(connection) == b"200"
            ask_innocently(server)
        assert server.metric("lighting_unsent_bytes") < 60_000_000 + 26_000_000
        assert "dropped an answer to make room for others" in server.log
    server.until("lighting_unsent_bytes", 0)


def test_work_goes_in_turn_and_the_greedy_one_is_refused(server: Server) -> None:
    with ExitStack() as stack:
        greedy = [stack.enter_context(server.connect("127.0.3.1")) for _ in range(12)]
        for connection in greedy:
            connection.sendall(LONG_WORK)
        for _ in range(3):
            ask_innocently(server)
        statuses = [status_of(connection) for connection in greedy]
    assert set(statuses) == {b"200", b"429"}
    assert 1 <= statuses.count(b"200") <= 6
    server.until("lighting_running", 0)


def test_beside_a_client_s_dear_requests_others_have_a_thread(network: Path) -> None:
    """Also the first ones after a start, of which nobody knows yet how long they take."""
    with started(network, concurrency=2) as server, ExitStack() as stack:
        dear = [stack.enter_context(server.connect("127.0.3.2")) for _ in range(3)]
        for connection in dear:
            connection.sendall(LONG_WORK)
        server.until("lighting_queue_depth", 1)
        assert server.metric("lighting_running") == 2
        ask_innocently(server)
        assert [status_of(connection) for connection in dear] == [b"200", b"200", b"200"]


def test_headers_of_uploads_take_no_place(server: Server) -> None:
    with ExitStack() as stack:
        for number in range(32):
            stack.enter_context(server.begin(1_000_000, sent=0, source=f"127.0.4.{number % 4}"))
        large = PHOTO + bytes(2 * PLACE_BYTES)  # which needs a place
        for _ in range(3):
            ask_innocently(server)
            assert server.request("POST", "/v1/lighting", large, source=INNOCENT)[0] == 200
        assert server.metric("lighting_uploads") == 0
        slow = [
            stack.enter_context(server.begin(1_000_000, sent=PLACE_BYTES, source=f"127.0.4.{number}"))
            for number in range(1, 4)
        ]
        server.until("lighting_uploads", 3)
        assert server.request("POST", "/v1/lighting", large, source=INNOCENT)[0] == 200
        gone = [connection for connection in slow if _is_answered(connection)]
        assert [status_of(connection) for connection in gone] == [b"503"]


def _is_answered(connection: socket.socket) -> bool:
    connection.settimeout(0.5)
    try:
        return bool(connection.recv(1, socket.MSG_PEEK))
    except TimeoutError:
        return False


def test_silent_connections_leave_room_and_the_log_alone(network: Path) -> None:
    with started(network, files=(64, 512), concurrency=1) as server, ExitStack() as stack:
        limits = Path(f"/proc/{server.process.pid}/limits").read_text()
        line = next(line for line in limits.splitlines() if line.startswith("Max open files"))
        assert line.split()[3:5] == ["512", "512"]
        before = len(server.log)
        for number in range(700):
            connection = stack.enter_context(server.connect(f"127.0.5.{1 + number % 100}"))
            if number % 100 == 99:
                began = time.monotonic()
                assert server.request("GET", "/livez", source=INNOCENT)[0] == 200
                assert time.monotonic() - began < 30
        ask_innocently(server)
        assert 100 < server.metric("lighting_connections") < 512
        said = server.log[before:]
        assert said.count("too many connections") == 1
        assert "Traceback" not in said
        assert "Too many open files" not in said
        assert connection.fileno() > 0


def test_one_client_has_its_share_of_connections(network: Path) -> None:
    with started(network, concurrency=1, connections_per_client=10) as server, ExitStack() as stack:
        connections = [stack.enter_context(server.connect("127.0.6.1")) for _ in range(15)]
        ask_innocently(server)
        gone = 0
        for connection in connections:
            connection.settimeout(0.2)
            try:
                gone += connection.recv(1) == b""
            except ConnectionResetError:
                gone += 1
            except TimeoutError:
                pass
        assert gone == 5


def _start_caddy(command: list[str], variables: dict[str, str]) -> tuple[subprocess.Popen[bytes], int]:
    """A Caddy that answers, and its port; it ends, and another begins, where somebody took the port meanwhile."""
    deadline = time.monotonic() + 30
    while True:
        with socket.create_server(("127.0.0.1", 0)) as anything:
            port = int(anything.getsockname()[1])
        process = subprocess.Popen(command, env=variables | {"SITE": f"http://:{port}"}, stderr=subprocess.DEVNULL)
        while process.poll() is None:
            with suppress(ConnectionError, http.client.HTTPException):  # of whoever took it
                if _status_at(port, "/livez", INNOCENT) == 200:
                    return process, port
            if time.monotonic() > deadline:
                process.kill()
                process.wait()
                raise AssertionError("Caddy does not answer")
            time.sleep(0.05)


@contextmanager
def behind_caddy(server: Server, folder: Path) -> Iterator[int]:
    """The port of a Caddy with this project's Caddyfile in front of a service."""
    config = folder / "Caddyfile"
    config.write_text((ROOT / "Caddyfile").read_text().replace("{\n", "{\n\tadmin off\n", 1))
    variables = {"SERVICE": f"127.0.0.1:{server.port}", "MAX_BYTES": "64000000"}
    variables |= {"UPLOAD_SECONDS": "60", "HEADER_SECONDS": "10", "HOME": str(folder)}
    command = [require("caddy"), "run", "--config", str(config), "--adapter", "caddyfile"]
    process, port = _start_caddy(command, os.environ | variables)
    with process:
        try:
            yield port
        finally:
            process.kill()


def _status_at(port: int, path: str, source: str) -> int:
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60, source_address=(source, 0))
    try:
        connection.request("GET", path)
        return connection.getresponse().status
    except ConnectionRefusedError:
        return 0
    finally:
        connection.close()


@pytest.mark.needs("caddy")
def test_behind_caddy_clients_have_their_own_shares_and_no_counters(network: Path, tmp_path: Path) -> None:
    settings: dict[str, Any] = {
        "trusted_proxies": "127.0.0.1",
        "unsent_bytes": 100_000_000,
        "connections_per_client": 2,
        "answer_rate": 1,  # so that none is dropped, however slow this machine
    }
    with started(network, concurrency=1, **settings) as server, behind_caddy(server, tmp_path) as port:
        assert [_status_at(port, path, INNOCENT) for path in ("/metrics", "/v1/model", "/")] == [404, 200, 200]
        assert server.request("GET", "/metrics")[0] == 200
        with ExitStack() as stack:
            statuses = []
            for number in range(6):
                connection = socket.create_connection(("127.0.0.1", port), 60, (f"127.0.7.{number // 3}", 0))
                stack.enter_context(connection)
                connection.sendall(LARGE_MAP)
                statuses.append(status_of(connection))
                time.sleep(0.2)
                assert _status_at(port, "/v1/model", INNOCENT) == 200
                assert _status_at(port, f"/v1/envmap?{SKY}&height=16", INNOCENT) == 200
        assert statuses[0] == statuses[3] == b"200"
        assert b"429" in statuses[:3]
        assert b"429" in statuses[3:]


def test_a_client_that_sends_no_more_gets_its_answer(server: Server) -> None:
    with server.begin(len(PHOTO), sent=len(PHOTO)) as connection:
        connection.shutdown(socket.SHUT_WR)
        with connection.makefile("rb") as answer:
            assert b"HTTP/1.1 200 OK" in answer.read()


def test_a_refusal_has_one_line_in_the_log(server: Server) -> None:
    before = len(server.log)
    with server.connect() as connection:
        head = b"POST /v1/lighting HTTP/1.1\r\nHost: x\r\nX-Request-ID: mine\r\nContent-Type: image/jpeg\r\n"
        connection.sendall(head + b"Transfer-Encoding: chunked\r\n\r\n" + b"1\r\nx\r\n" * 8192)
        with connection.makefile("rb") as answer:
            said = answer.read()
    assert said.startswith(b"HTTP/1.1 400 ")
    assert b"x-request-id: mine\r\n" in said
    server.until_logged("id=mine")
    lines = server.log[before:].splitlines()
    assert len(lines) == 1
    assert "POST /v1/lighting 400 unreadable-body" in lines[0]


def test_requests_on_their_way_are_answered_at_sigterm(network: Path) -> None:
    with started(network, concurrency=1) as server, ExitStack() as stack:
        connections = [stack.enter_context(server.connect()) for _ in range(4)]
        head = (
            f"POST /v1/lighting HTTP/1.1\r\nHost: x\r\nContent-Type: image/jpeg\r\nContent-Length: {len(PHOTO)}\r\n\r\n"
        )
        time.sleep(0.2)  # until they are accepted

        def send() -> None:
            for connection in connections:
                connection.sendall(head.encode() + PHOTO)

        server.process.terminate()
        threading.Timer(0.1, send).start()
        assert [status_of(connection) for connection in connections] == [b"200"] * 4
        server.process.wait(60)


@pytest.mark.needs("caddy")
def test_behind_caddy_a_restart_loses_no_request(network: Path, tmp_path: Path) -> None:
    """Photos are sent until a moment before the service ends: Caddy before 2.11.2 sends no body twice."""
    settings: dict[str, Any] = {"trusted_proxies": "127.0.0.1", "concurrency": 1}
    statuses: dict[str, list[int]] = {"POST": [], "GET": []}
    stopping = {"POST": threading.Event(), "GET": threading.Event()}

    def ask(port: int, method: str, pause: float) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60, source_address=(INNOCENT, 0))
        path, body = ("/v1/lighting", PHOTO) if method == "POST" else ("/v1/model", None)
        while not stopping[method].wait(pause):
            connection.request(method, path, body, {"Content-Type": "image/jpeg"} if body else {})
            answer = connection.getresponse()
            answer.read()
            statuses[method].append(answer.status)
        connection.close()

    with ExitStack() as stack:
        server = stack.enter_context(started(network, **settings))
        port = stack.enter_context(behind_caddy(server, tmp_path))
        pauses = (0.05, 0.1, 0.15, 0.2)
        threads = [threading.Thread(target=ask, args=(port, method, p)) for method in statuses for p in pauses]
        for thread in threads:
            thread.start()
        time.sleep(0.5)
        server.process.terminate()
        time.sleep(0.2)
        assert server.request("GET", "/readyz")[0] == 503
        with server.send(PHOTO) as connection, connection.makefile("rb") as answer:
            assert b"\r\nconnection: close\r\n" in answer.read()
        time.sleep(2)  # of the four for which the service goes on
        stopping["POST"].set()
        assert server.process.wait(60) == -15
        stack.enter_context(started(network, port=server.port, **settings))
        stopping["GET"].set()
        for thread in threads:
            thread.join()
    assert set(statuses["POST"]) == set(statuses["GET"]) == {200}


@pytest.mark.needs("caddy")
def test_work_of_a_proxy_s_client_that_has_gone_ends_at_once(network: Path, tmp_path: Path) -> None:
    settings: dict[str, Any] = {"trusted_proxies": "127.0.0.1", "concurrency": 1}
    with started(network, **settings) as server, behind_caddy(server, tmp_path) as port:
        connections = [socket.create_connection(("127.0.0.1", port), 60, ("127.0.8.1", 0)) for _ in range(4)]
        for connection in connections:
            connection.sendall(LONG_WORK)
        server.until("lighting_queue_depth", 3)
        for connection in connections[1:]:
            connection.close()
        began = time.monotonic()
        server.until("lighting_queue_depth", 0)
        assert server.metric("lighting_running") == 1
        assert status_of(connections[0]) == b"200"
        assert time.monotonic() - began < 30
        connections[0].close()

"""Tests of main."""

import http.client
import json
import os
import re
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from urllib.parse import urljoin

import pytest
from PIL import Image

from server.__main__ import run_server
from server.limits import PLACE_BYTES
from server.settings import PREFIX, Settings
from tests.conftest import encode, scene
from tests.helpers.pages import ROOT
from tests.helpers.processes import wait_until_ended
from tests.helpers.service import PHOTO, Server, environment, started

linux = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")

QUERY = "sun_azimuth=10&sun_elevation=30&turbidity=3&exposure=0.02"
LARGE_MAP = f"GET /v1/envmap?{QUERY}&height=1024&compression=none HTTP/1.1\r\nHost: x\r\n\r\n".encode()  # 25 MB
each_signal = pytest.mark.parametrize(
    "sign",
    [signal.SIGTERM, *(pytest.param(s, marks=pytest.mark.thorough) for s in (signal.SIGINT, signal.SIGHUP))],
    ids=lambda sign: sign.name,
)


@pytest.fixture(autouse=True)
def heard_sighup() -> Iterator[None]:
    """A service inherits that SIGHUP is ignored, as it is where nohup has started the tests."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture(scope="module")
def server(network: Path) -> Iterator[Server]:
    with started(network, concurrency=1, queue=2, uploads=3, upload_seconds=20) as server:
        yield server


@pytest.mark.slow
def test_it_answers(server: Server) -> None:
    status, body = server.request("POST", "/v1/lighting", PHOTO)
    assert (status, json.loads(body)["model"]) == (200, {"name": "tiny", "version": "0.0.1"})


@pytest.mark.slow
def test_100_megabytes_are_413_and_the_connection_survives(server: Server) -> None:
    connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
    for _ in range(2):
        connection.request("POST", "/v1/lighting", bytes(100_000_000), {"Content-Type": "image/jpeg"})
        answer = connection.getresponse()
        assert (answer.status, json.loads(answer.read())["title"]) == (413, "The body or the photo is too large")
    connection.request("POST", "/v1/lighting", PHOTO, {"Content-Type": "image/jpeg"})
    assert connection.getresponse().status == 200
    connection.close()


@pytest.mark.slow
def test_headers_that_come_at_once_are_bounded_whatever_loop_is_installed(server: Server) -> None:
    """uvloop gave protocols all that a socket held."""
    with server.connect() as connection:
        connection.sendall(
            b"GET /livez HTTP/1.1\r\nHost: x\r\nX-A: " + bytes(30_000).replace(b"\0", b"a") + b"\r\n\r\n"
        )
        assert connection.recv(12) == b"HTTP/1.1 431"


@pytest.mark.slow
@linux
@pytest.mark.parametrize("line", [b"X-A: " + bytes(1000).replace(b"\0", b"a"), b"X-A: a"], ids=["long", "many"])
def test_megabytes_of_headers_are_refused_and_take_no_memory(server: Server, line: bytes) -> None:
    before = server.peak()
    headers = (line + b"\r\n") * (50_000_000 // len(line))
    connection = socket.create_connection(("127.0.0.1", server.port), timeout=60)
    with connection, pytest.raises(ConnectionError):
        connection.sendall(b"GET /livez HTTP/1.1\r\nHost: x\r\n" + headers)
    assert server.peak() - before < 5_000_000
    assert server.request("GET", "/livez")[0] == 200


@pytest.mark.slow
@pytest.mark.parametrize(("trusted", "second"), [("", 429), pytest.param("127.0.0.1", 200, marks=pytest.mark.thorough)])
def test_a_client_names_itself_only_through_a_proxy_that_is_trusted(network: Path, trusted: str, second: int) -> None:
    with started(network, rate_limit="1/minute", trusted_proxies=trusted) as server:
        answers = []
        for address in ("192.0.2.1", "192.0.2.2"):
            connection = http.client.HTTPConnection("127.0.0.1", server.port, timeout=60)
            connection.request("GET", "/v1/model", headers={"X-Forwarded-For": address})
            answers.append(connection.getresponse().status)
            connection.close()
        assert answers == [200, second]


@pytest.mark.slow
def test_clients_that_go_away_in_their_upload_free_their_places(server: Server) -> None:
    connections = [server.begin(1_000_000, sent=PLACE_BYTES) for _ in range(3)]
    server.until("lighting_uploads", 3)
    assert server.metric("lighting_queue_depth") == 0
    assert server.request("POST", "/v1/lighting", PHOTO + bytes(PLACE_BYTES))[0] == 200  # the slowest gave way
    assert server.request("POST", "/v1/lighting", PHOTO)[0] == server.request("GET", "/readyz")[0] == 200
    for connection in connections:
        connection.close()
    server.until("lighting_uploads", 0)
    assert server.request("GET", "/readyz")[0] == 200
    assert server.request("POST", "/v1/lighting", PHOTO)[0] == 200


@pytest.mark.slow
def test_clients_that_go_away_while_they_wait_free_their_places(server: Server) -> None:
    request = f"GET /v1/envmap?{QUERY}&height=2048 HTTP/1.1\r\nHost: x\r\n\r\n".encode()
    connections = [socket.create_connection(("127.0.0.1", server.port), timeout=60) for _ in range(3)]
    for connection in connections:
        connection.sendall(request)
    server.until("lighting_queue_depth", 2)
    for connection in connections:
        connection.close()
    server.until("lighting_queue_depth", 0)
    server.until("lighting_running", 0)
    assert server.request("GET", f"/v1/envmap?{QUERY}&height=16")[0] == 200


@pytest.mark.slow
def test_a_slow_upload_is_408_and_harms_nobody(network: Path) -> None:
    with started(network, upload_seconds=1) as server:
        slow = server.begin(1_000_000)
        assert server.request("POST", "/v1/lighting", PHOTO)[0] == 200
        assert slow.recv(100).startswith(b"HTTP/1.1 408 ")
        slow.close()
        assert server.request("POST", "/v1/lighting", PHOTO)[0] == 200


@pytest.mark.slow
def test_a_photo_that_takes_too_long_is_413_and_otherwise_it_is_read(network: Path, server: Server) -> None:
    with started(network, concurrency=1, decode_seconds=0.1) as hasty:
        large = encode(Image.fromarray(scene(50, 40)).resize((5000, 4000)), "PNG", compress_level=1)
        status, body = hasty.request("POST", "/v1/lighting", large, "image/png")
        assert (status, json.loads(body)["detail"]) == (413, "The photo takes longer than 0.1 seconds to decode.")
    assert server.request("POST", "/v1/lighting", large, "image/png")[0] == 200


@pytest.mark.slow
@pytest.mark.thorough
def test_66_slow_uploads_from_one_address_leave_the_others_alone(network: Path) -> None:
    allowed = Settings().uploads_per_client
    with started(network) as server:
        with ExitStack() as held:
            slow = [held.enter_context(server.begin(1_000_000, sent=PLACE_BYTES)) for _ in range(66)]
            server.until("lighting_uploads", allowed)
            assert server.request("GET", "/readyz")[0] == 200
            refused = first_answered(slow, len(slow) - allowed)
            assert {connection.recv(12) for connection in refused} == {b"HTTP/1.1 429"}
        server.until("lighting_uploads", 0)
        assert server.request("POST", "/v1/lighting", PHOTO)[0] == 200


def first_answered(connections: list[socket.socket], count: int) -> list[socket.socket]:
    """The connections that are answered first; which of them the service reads first is up to the machine."""
    answered: list[socket.socket] = []
    while len(answered) < count:
        waiting = [c for c in connections if c not in answered]
        ready, _, _ = select.select(waiting, [], [], 60)
        assert ready
        answered += ready
    return answered[:count]


@contextmanager
def held(decoder: int) -> Iterator[None]:
    """A decoder that does not go on with its photo."""
    os.kill(decoder, signal.SIGSTOP)
    try:
        yield
    finally:
        with suppress(ProcessLookupError):
            os.kill(decoder, signal.SIGCONT)


@pytest.mark.slow
@linux
@each_signal
def test_what_ends_all_processes_together_lets_the_running_photo_end_well(network: Path, sign: signal.Signals) -> None:
    """As a terminal that closes and a service manager send their signals."""
    with started(network, concurrency=1) as server:
        (decoder,) = server.decoders()
        with held(decoder):
            connection = server.send(PHOTO)
            server.until("lighting_running", 1)
            for pid in (decoder, server.process.pid):
                os.kill(pid, sign)
            time.sleep(0.5)
        assert json.loads(whole_answer(connection))["model"]["name"] == "tiny"
        assert server.process.wait(60) == (-signal.SIGINT if sign == signal.SIGINT else -signal.SIGTERM)
        wait_until_ended(decoder)
        assert "Traceback" not in server.log


@pytest.mark.slow
@linux
@each_signal
def test_a_step_that_takes_longer_than_a_shutdown_does_not_hold_it(network: Path, sign: signal.Signals) -> None:
    with started(network, concurrency=1, shutdown_seconds=1, decode_seconds=60) as server, held(*server.decoders()):
        connection = server.send(PHOTO)
        server.until("lighting_running", 1)
        server.process.send_signal(sign)
        assert json.loads(whole_answer(connection, 503))["type"] == "tag:outdoor-lighting,2026:busy"
        assert server.process.wait(20) < 0
        assert "Traceback" not in server.log


@pytest.mark.slow
@linux
@each_signal
def test_a_sigint_in_a_shutdown_ends_it_at_once(network: Path, sign: signal.Signals) -> None:
    with started(network, concurrency=1, shutdown_seconds=60, decode_seconds=60) as server, held(*server.decoders()):
        with server.send(PHOTO):
            server.until("lighting_running", 1)
            server.process.send_signal(sign)
            server.until_logged("Shutting down")
            server.process.send_signal(signal.SIGINT)
            assert server.process.wait(20) == -signal.SIGINT
        assert "Traceback" not in server.log


@pytest.mark.slow
@linux
def test_a_sighup_that_is_ignored_at_the_start_stays_ignored(network: Path) -> None:
    """As nohup has it."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with started(network, concurrency=1) as server:
            server.process.send_signal(signal.SIGHUP)
            assert server.request("POST", "/v1/lighting", PHOTO)[0] == 200
            assert "Shutting down" not in server.log
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.slow
def test_after_sigterm_running_requests_end_well_and_new_ones_are_refused(network: Path) -> None:
    with started(network, concurrency=1, queue=8) as server:
        connections = [socket.create_connection(("127.0.0.1", server.port), timeout=60) for _ in range(3)]
        for connection in connections:
            connection.sendall(f"GET /v1/envmap?{QUERY}&height=1024&format=hdr HTTP/1.1\r\nHost: x\r\n\r\n".encode())
        server.until("lighting_queue_depth", 2)
        server.process.send_signal(signal.SIGTERM)
        answers = [whole_answer(connection) for connection in connections]
        assert server.process.wait(60) == -signal.SIGTERM
        assert {answer for answer in answers if answer.startswith(b"#?RADIANCE")} == {answers[0]}
        with pytest.raises(ConnectionError):
            server.request("GET", "/livez")
        assert "Traceback" not in server.log
        assert "sun_azimuth" not in server.log


@pytest.mark.slow
def test_what_a_shutdown_cannot_wait_for_is_answered_503(network: Path) -> None:
    with started(network, concurrency=1, shutdown_seconds=1) as server, server.connect("127.0.0.1") as unread:
        unread.sendall(LARGE_MAP)
        assert unread.recv(12)[9:] == b"200"
        connection = socket.create_connection(("127.0.0.1", server.port), timeout=60)
        connection.sendall(b"POST /v1/lighting HTTP/1.1\r\nHost: x\r\nContent-Type: image/jpeg\r\n")
        connection.sendall(b"Content-Length: 100000\r\n\r\n" + bytes(PLACE_BYTES))
        server.until("lighting_uploads", 1)
        server.process.send_signal(signal.SIGTERM)
        answer = json.loads(whole_answer(connection, 503))
        assert server.process.wait(60) == -signal.SIGTERM
        assert answer["type"] == "tag:outdoor-lighting,2026:busy"
        assert "shut down" in answer["detail"]
        assert "dropped 1 answers that their clients did not take" in server.log
        assert "Cancel 1 running task" in server.log  # only the one that was told so
        assert "Traceback" not in server.log
        assert "without completing" not in server.log


def whole_answer(connection: socket.socket, status: int = 200) -> bytes:
    answer = http.client.HTTPResponse(connection)
    answer.begin()
    body = answer.read()
    assert (answer.status, len(body)) == (status, int(answer.headers["content-length"]))
    connection.close()
    return body


@pytest.mark.parametrize("argument", ["--port=8193", "photo.jpg"])
def test_arguments_are_refused_not_ignored(
    argument: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("server.__main__._prepare_process", lambda: None)
    monkeypatch.setattr(sys, "argv", ["lighting-server", argument])
    with pytest.raises(SystemExit) as ended:
        run_server()
    printed = capsys.readouterr()
    assert (ended.value.code, printed.out) == (2, "")
    assert printed.err.splitlines()[-1] == f"lighting-server: error: unrecognized arguments: {argument}"


@pytest.mark.slow
def test_help_lists_every_setting_with_its_default() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "server", "--help"], cwd=ROOT, capture_output=True, text=True, timeout=60
    )
    assert (done.returncode, done.stderr) == (0, "")
    for name, field in Settings.model_fields.items():
        default = "" if field.default in (None, "", ()) else f" [{field.default}]"
        meaning = re.escape(f"{field.description}{default}")
        assert re.search(rf"^  {PREFIX}{name.upper()} +{meaning}$", done.stdout, re.MULTILINE), name


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"model": "/nowhere/none.onnx"}, "There is no network at /nowhere/none.onnx."),
        ({"port": "http", "queue": "-1"}, "LIGHTING_QUEUE: Input should be greater than or equal to 0"),
        ({"rate_limit": "often"}, "LIGHTING_RATE_LIMIT: often is not a rate limit such as 60/minute"),
        ({"cors_origins": "example.org"}, "LIGHTING_CORS_ORIGINS: example.org is not an origin"),
        ({"trusted_proxies": "proxy"}, "LIGHTING_TRUSTED_PROXIES: proxy is not an IP address"),
        ({"host": "no host"}, "LIGHTING_HOST: no host is no address to listen on: "),
        ({"host": "192.0.2.1"}, "LIGHTING_HOST: 192.0.2.1:0 cannot be listened on: Cannot assign"),
        ({"api_key": "secret"}, "LIGHTING_API_KEY is no setting; did you mean LIGHTING_API_KEYS?"),
        ({"api_keys_file": "/nowhere/keys"}, "LIGHTING_API_KEYS_FILE: /nowhere/keys cannot be read: No such file"),
    ],
)
def test_a_start_that_fails_says_why_in_a_sentence(
    settings: dict[str, str], words: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Raised as the end of the process, whose status it makes 1."""
    for name, value in environment(**settings).items():
        monkeypatch.setenv(name, value)
    for change in ("_end_at_signals", "_prepare_process"):  # of this process, which goes on
        monkeypatch.setattr(f"server.__main__.{change}", lambda: None)
    monkeypatch.setattr("server.limits.raise_file_limit", lambda: None)
    monkeypatch.setattr(sys, "argv", ["lighting-server"])
    with pytest.raises(SystemExit) as ended:
        run_server()
    assert isinstance(ended.value.code, str)
    assert words in ended.value.code


@pytest.mark.slow
def test_a_process_that_cannot_start_ends_with_the_sentence_alone() -> None:
    command, given = [sys.executable, "-m", "server"], environment(model="/nowhere/none.onnx")
    done = subprocess.run(command, cwd=ROOT, env=given, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout, done.stderr) == (1, "", "There is no network at /nowhere/none.onnx.\n")


@pytest.mark.slow
@pytest.mark.parametrize("root", [pytest.param("", marks=pytest.mark.thorough), "/tools/light"])
def test_links_lead_to_the_map_below_the_path_that_a_proxy_took_away(network: Path, root: str) -> None:
    """Whether or not the service knows that path."""
    with started(network, concurrency=1, root_path=root) as server:
        link = json.loads(server.request("POST", "/v1/lighting", PHOTO)[1])["links"]["envmap"]
        outside = urljoin("https://example.org/tools/light/v1/lighting", link)
        assert outside.startswith("https://example.org/tools/light/v1/envmap?")
        assert server.request("GET", outside.removeprefix("https://example.org/tools/light") + "&height=16")[0] == 200


@pytest.mark.slow
def test_the_service_names_the_path_that_a_proxy_took_away(network: Path) -> None:
    with started(network, concurrency=1, root_path="/tools/light") as server:
        assert json.loads(server.request("GET", "/openapi.json")[1])["servers"][0]["url"] == "/tools/light"
        assert json.loads(server.request("GET", "/nowhere")[1])["instance"] == "/tools/light/nowhere"
        assert server.request("GET", "/")[0] == server.request("GET", "/favicon.ico")[0] == 200
        assert server.request("GET", "/healthz")[0] == 410


@pytest.mark.slow
@pytest.mark.parametrize("workers", ["2", pytest.param("auto", marks=pytest.mark.thorough)])
def test_it_starts_where_a_host_says_how_many_processes_a_service_may_have(
    network: Path, monkeypatch: pytest.MonkeyPatch, workers: str
) -> None:
    monkeypatch.setenv("WEB_CONCURRENCY", workers)
    with started(network, concurrency=1) as server:
        assert server.request("GET", "/livez")[0] == 200


@pytest.mark.slow
def test_a_port_that_is_taken_is_told_in_a_sentence() -> None:
    with socket.create_server(("127.0.0.1", 0)) as other:
        port = other.getsockname()[1]
        command = [sys.executable, "-m", "server"]
        given = environment(port=port)
        done = subprocess.run(command, cwd=ROOT, env=given, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == f"LIGHTING_PORT: 127.0.0.1:{port} cannot be listened on: Address already in use.\n"


KEPT = """
import sys
from pathlib import Path
from server.__main__ import _prepare_process
if sys.argv[1] == "prepared":
    _prepare_process()
import numpy as np
def resident():
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096
before = resident()
buffers = [np.ones(1_000_000) for _ in range(20)]
del buffers
print((resident() - before) // 1_000_000)
"""


def run(code: str, *arguments: str, **environment: str) -> str:
    kept = {name: value for name, value in os.environ.items() if name != "OMP_NUM_THREADS"}
    command = [sys.executable, "-c", code, *arguments]
    done = subprocess.run(command, env=kept | environment, capture_output=True, text=True, timeout=60, check=True)
    return done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize(("given", "threads"), [({}, "1"), ({"OMP_NUM_THREADS": "3"}, "3")])
def test_one_thread_unless_the_operator_says_otherwise(given: dict[str, str], threads: str) -> None:
    code = "import os, server.__main__ as main; main._prepare_process(); print(os.environ['OMP_NUM_THREADS'])"
    assert run(code, **given) == threads


@pytest.mark.slow
def test_nothing_imports_numpy_before() -> None:
    assert run("import sys, server.__main__; print('numpy' in sys.modules)") == "False"


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="needs glibc's mallopt")
@pytest.mark.thorough
def test_the_buffers_of_photos_stay_with_the_process() -> None:
    """Of 20 buffers of 8 MB."""
    assert int(run(KEPT, "prepared")) > 120
    assert int(run(KEPT, "as it comes")) < 40

"""Middleware: what browsers are told and refused, readiness, errors, rests of bodies; nothing personal in the log."""

import asyncio
import logging
import re
from collections.abc import Iterator
from contextlib import ExitStack, closing
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from starlette.types import Message, Receive, Scope, Send

from lighting.errors import ModelError
from lighting.estimator import Estimator
from server import middleware
from server.app import create_app
from server.middleware import SECURITY_HEADERS, SLICE_BYTES, DrainBodyMiddleware, SliceMiddleware
from server.settings import Settings, SettingsError
from tests.helpers.processes import serve_app
from tests.server.conftest import SKY, client_of, jpeg_headers, problem, sample

OPEN = ("/", "/favicon.ico", "/livez", "/readyz", "/metrics", "/openapi.json")


JPEG = {"Content-Type": "image/jpeg"}


def test_it_is_ready_once_the_network_has_answered(app: FastAPI, estimator: Estimator) -> None:
    before = client_of(estimator)
    assert (before.get("/livez").status_code, before.get("/readyz").status_code) == (200, 503)
    with TestClient(app) as client:
        app.state.service.warm_up()
        assert client.get("/readyz").json() == {"status": "ok"}
        assert sample(client, 'lighting_model_info{name="tiny",version="0.0.1"}') == 1


def test_readiness_tells_when_the_next_photo_would_be_refused(app: FastAPI) -> None:
    service = app.state.service
    with TestClient(app) as client, ExitStack() as taken:
        service.warm_up()
        for number in range(service.limiter.capacity):
            assert client.get("/readyz").status_code == 200, number
            taken.enter_context(service.limiter.admission(size=service.settings.max_bytes))
        answer = client.get("/readyz")
        problem(answer, 503, "busy")
        assert answer.headers["retry-after"] == "1"
        assert client.get("/livez").status_code == 200
        taken.close()
        assert client.get("/readyz").status_code == 200


def test_a_network_that_cannot_answer_is_never_ready(
    estimator: Estimator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise ModelError("The network failed.")

    app = create_app(Settings(), estimator)
    monkeypatch.setattr(app.state.service, "warm_up", fail)
    with caplog.at_level(logging.ERROR), TestClient(app) as client:
        assert client.get("/readyz").status_code == 503
        assert client.get("/livez").status_code == 200
    assert "cannot answer" in caplog.text


def test_health_is_neither_counted_nor_logged(client: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "server.access"):
        for path in ("/livez", "/readyz", "/metrics"):
            client.get(path)
    assert "lighting_requests_total{" not in client.get("/metrics").text
    assert not [record for record in caplog.records if record.name == "server.access"]


def test_the_line_of_a_request_says_how_it_ended(
    client: TestClient, jpeg: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.INFO, "server.access"):
        client.post("/v1/lighting?exif=false", content=jpeg, headers=JPEG)
        client.post("/v1/lighting", content=b"text", headers=JPEG)
        client.get("/openapi.json")
        client.head("/openapi.json")
        client.head("/v1/envmap")
        client.delete("/secret/path")
    lines = [record.getMessage() for record in caplog.records if record.name == "server.access"]
    assert [re.sub(r"\d+ ms id=\w+$", "", line) for line in lines] == [
        "POST /v1/lighting 200 ",
        "POST /v1/lighting 400 unreadable-photo ",
        "GET /openapi.json 200 ",
        "HEAD /openapi.json 200 ",
        "HEAD /v1/envmap 422 invalid ",
        "DELETE unmatched 404 not-found ",
    ]


def test_a_request_id_is_echoed_or_made(client: TestClient) -> None:
    assert client.get("/livez", headers={"X-Request-ID": "trace-1.2_3"}).headers["x-request-id"] == "trace-1.2_3"
    made = client.get("/livez").headers["x-request-id"]
    assert re.fullmatch(r"[0-9a-f]{16}", made)
    for bad in ("x" * 65, "a b", "<b>", "é", ""):
        answer = client.get("/livez", headers={b"X-Request-ID": bad.encode("latin-1")})
        assert re.fullmatch(r"[0-9a-f]{16}", answer.headers["x-request-id"])
    assert client.get("/livez").headers["x-request-id"] != made


LARGE = bytes(20_000_000)  # more than the sockets of both sides keep


async def refusing(_scope: Scope, _receive: Receive, send: Send) -> None:
    """Answers without a look at the body."""
    await send({"type": "http.response.start", "status": 415, "headers": [(b"content-length", b"2")]})
    await send({"type": "http.response.body", "body": b"no"})


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    with serve_app(DrainBodyMiddleware(refusing), "h11") as number:
        yield number


@pytest.mark.parametrize("headers", [{}, {"Connection": "close"}])
def test_a_refusal_of_a_large_body_is_heard(port: int, headers: dict[str, str]) -> None:
    with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
        connection.request("POST", "/", LARGE, headers)
        with connection.getresponse() as answer:
            assert (answer.status, answer.read()) == (415, b"no")


def answered(scope: Scope, receive: Receive) -> list[Message]:
    """What is sent to the client of a request."""
    sent: list[Message] = []

    async def send(message: Message) -> None:
        sent.append(message)

    anyio.run(DrainBodyMiddleware(refusing), scope, receive, send)
    return sent


@pytest.mark.parametrize(
    ("headers", "version", "reads"),
    [
        ([(b"connection", b"close")], "1.1", True),
        ([], "1.0", True),
        ([], "1.1", False),
        ([(b"connection", b"close"), (b"expect", b"100-continue")], "1.1", False),
    ],
)
def test_only_a_body_on_its_way_over_a_closing_connection_is_read(
    headers: list[tuple[bytes, bytes]], version: str, reads: bool
) -> None:
    parts = [{"type": "http.request", "more_body": more} for more in (True, True, False)]

    async def receive() -> Message:
        return parts.pop(0)

    sent = answered({"type": "http", "headers": headers, "http_version": version}, receive)
    assert (not parts) == reads
    assert b"".join(message.get("body", b"") for message in sent) == b"no"
    assert not sent[-1].get("more_body")


def test_a_body_that_does_not_end_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(middleware, "DRAIN_SECONDS", 0.05)

    async def receive() -> Message:
        await anyio.sleep(0.01)
        return {"type": "http.request", "more_body": True}

    sent = answered({"type": "http", "headers": [], "http_version": "1.0"}, receive)
    assert not sent[-1].get("more_body")


@pytest.mark.parametrize("size", [0, 1, SLICE_BYTES, SLICE_BYTES + 1, 3 * SLICE_BYTES, 3 * SLICE_BYTES + 7])
def test_large_bodies_are_sent_in_slices_and_the_rest_is_known(size: int) -> None:
    body = bytes(index % 251 for index in range(size))
    scope: Scope = {"type": "http"}
    sent: list[tuple[bytes, bool, int]] = []

    async def app(_scope: Scope, _receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": 200})
        await send({"type": "http.response.body", "body": body})

    async def send(message: Message) -> None:
        if message["type"] == "http.response.body":
            sent.append((bytes(message["body"]), message.get("more_body", False), scope.get("unsent_rest", 0)))

    async def receive() -> Message:
        raise AssertionError

    anyio.run(SliceMiddleware(app), scope, receive, send)
    assert b"".join(part for part, _, _ in sent) == body
    assert [more for _, more, _ in sent] == [True] * (len(sent) - 1) + [False]
    assert max(len(part) for part, _, _ in sent) <= SLICE_BYTES
    lengths = [len(part) for part, _, _ in sent]
    assert [rest for _, _, rest in sent] == [sum(lengths[n + 1 :]) for n in range(len(sent))]


def test_others_run_between_the_slices_of_a_body() -> None:
    events: list[str] = []

    async def app(_scope: Scope, _receive: Receive, send: Send) -> None:
        await send({"type": "http.response.body", "body": bytes(3 * SLICE_BYTES)})

    async def send(_message: Message) -> None:
        events.append("slice")

    async def receive() -> Message:
        raise AssertionError

    async def answer() -> None:
        asyncio.get_running_loop().call_soon(events.append, "other")
        await SliceMiddleware(app)({"type": "http"}, receive, send)

    asyncio.run(answer())
    assert events == ["slice", "other", "slice", "slice"]


def test_the_network_is_loaded_once_at_the_start_with_the_threads_set(network: Path) -> None:
    app = create_app(Settings(model=network, threads=3))
    service = app.state.service
    assert service.loaded_estimator is None
    with TestClient(app):
        estimator = service.estimator
        assert estimator.model.session.get_session_options().intra_op_num_threads == 3
        service.load()
        assert service.estimator is estimator


def test_a_service_without_a_network_does_not_start(tmp_path: Path) -> None:
    app = create_app(Settings(model=tmp_path / "none.onnx"))
    with pytest.raises(ModelError, match="no network"), TestClient(app):
        pass


def test_a_file_of_keys_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="cannot be read"):
        create_app(Settings(api_keys_file=tmp_path / "none"))


def test_an_origin_that_may_call_sees_the_exposed_headers(estimator: Estimator) -> None:
    client = client_of(estimator, cors_origins=("https://page.example",))
    answer = client.get("/v1/model", headers={"Origin": "https://page.example"})
    assert answer.headers["access-control-allow-origin"] == "https://page.example"
    assert answer.headers["access-control-expose-headers"] == (
        "ETag, Location, Retry-After, X-Request-ID, Lighting-Model, Lighting-Warnings"
    )


def test_an_origin_that_may_call_may_ask_whether_its_copy_is_still_good(estimator: Estimator) -> None:
    client = client_of(estimator, cors_origins=("https://page.example",))
    asked = {"Access-Control-Request-Method": "GET", "Access-Control-Request-Headers": "if-none-match"}
    assert client.options("/v1/envmap", headers={"Origin": "https://page.example", **asked}).status_code == 200


def test_the_document_says_how_many_photos_a_form_may_hold(estimator: Estimator) -> None:
    document = client_of(estimator, max_photos=3).get("/openapi.json").json()
    body = document["paths"]["/v1/lightings"]["post"]["requestBody"]["content"]["multipart/form-data"]
    assert body["schema"]["properties"]["photo"]["maxItems"] == 3


def test_the_document_holds_the_schemas_of_bodies_and_errors(app: FastAPI) -> None:
    schemas = app.openapi()["components"]["schemas"]
    assert {"Problem", "LightingRecord", "LightingEstimate", "SunPart", "PlacePart"} <= set(schemas)
    assert app.openapi()["info"]["license"]["identifier"] == "Apache-2.0"


@pytest.mark.parametrize("path", [*OPEN, "/v1/model", "/nothing", "/v1/envmap"])
def test_security_headers_are_on_every_answer(client: TestClient, path: str) -> None:
    headers = client.get(path).headers
    assert {name: headers[name] for name in SECURITY_HEADERS} == SECURITY_HEADERS


def test_the_page_may_be_shown_in_frames_of_origins_that_are_set(estimator: Estimator) -> None:
    headers = client_of(estimator, frame_origins="https://huggingface.co https://example.org").get("/v1/model").headers
    own = SECURITY_HEADERS["Content-Security-Policy"].removesuffix("'none'")
    assert headers["Content-Security-Policy"] == f"{own}https://huggingface.co https://example.org"
    assert "X-Frame-Options" not in headers


def test_the_policy_names_no_other_host() -> None:
    policy = SECURITY_HEADERS["Content-Security-Policy"]
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy
    assert "'unsafe-inline'" not in policy
    assert "'unsafe-eval'" not in policy


def test_other_origins_are_refused_unless_set(client: TestClient, estimator: Estimator) -> None:
    origin = {"Origin": "https://example.org"}
    assert "access-control-allow-origin" not in client.get("/v1/model", headers=origin).headers
    sharing = client_of(estimator, cors_origins="https://example.org https://example.net")
    answer = sharing.get("/v1/model", headers=origin)
    assert answer.headers["access-control-allow-origin"] == "https://example.org"
    assert "ETag" in answer.headers["access-control-expose-headers"]
    assert "access-control-allow-origin" not in sharing.get("/v1/model", headers={"Origin": "https://evil.org"}).headers
    preflight = {**origin, "Access-Control-Request-Method": "POST"}
    assert sharing.options("/v1/lighting", headers=preflight).status_code == 200


def test_the_log_holds_no_query_no_file_name_and_no_position(
    client: TestClient, jpeg: bytes, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.DEBUG):
        client.get("/v1/envmap", params={**SKY, "latitude": "48.137"})
        client.post("/v1/lighting?probability=true", files={"photo": ("holiday-at-home.jpg", jpeg, "image/jpeg")})
        client.get("/v1/private-path%0A48.137", headers={"X-Request-ID": "forged\nline"})
    records = [record for record in caplog.records if record.name in ("server.access", "server.problems")]
    text = "\n".join(record.getMessage() for record in records)
    assert text.count("\n") == 2
    assert "POST /v1/lighting 200" in text
    for secret in ("48.137", "holiday", "probability", "private", "forged", "41.2"):
        assert secret not in text


FOREIGN = "https://evil.example"


NAVIGATED = {"Sec-Fetch-Mode": "navigate"}


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"Origin": FOREIGN}, 403),
        ({"Origin": "null"}, 403),
        ({"Origin": "http://testserver:3000"}, 403),
        ({"Origin": "https://testserver"}, 200),
        ({"Origin": "http://TESTSERVER:80"}, 200),
        ({"Origin": "https://light.example.org", "Sec-Fetch-Site": "same-origin"}, 200),  # behind a proxy
        ({}, 200),
    ],
)
def test_a_form_of_another_origin_is_refused(
    client: TestClient, jpeg: bytes, headers: dict[str, str], status: int
) -> None:
    answer = client.post("/v1/lighting", files={"photo": ("a.jpg", jpeg, "image/jpeg")}, headers=headers)
    if status == 200:
        assert answer.status_code == 200
    else:
        problem(answer, 403, "foreign-origin")


def test_a_form_of_an_origin_that_may_call_is_taken(estimator: Estimator, jpeg: bytes) -> None:
    for origins, status in (("https://example.org", 200), ("*", 200), ("https://example.net", 403)):
        client = client_of(estimator, cors_origins=origins)
        answer = client.post("/v1/lighting", content=jpeg, headers={**jpeg_headers(), "Origin": "https://example.org"})
        assert answer.status_code == status


@pytest.mark.parametrize(
    ("host", "headers", "status"),
    [
        ("127.0.0.1:8000", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, 403),
        ("[::1]:8000", {"Sec-Fetch-Site": "same-site", "Sec-Fetch-Mode": "no-cors"}, 403),
        ("localhost", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "iframe"}, 403),
        (
            "localhost",
            {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"},
            200,
        ),
        ("localhost", {"Sec-Fetch-Site": "same-origin"}, 200),
        ("localhost", {"Sec-Fetch-Site": "none"}, 200),
        ("light.example.org", {"Sec-Fetch-Site": "cross-site", "Sec-Fetch-Mode": "no-cors"}, 200),
    ],
)
def test_pictures_in_other_pages_cost_a_local_service_nothing(
    client: TestClient, host: str, headers: dict[str, str], status: int
) -> None:
    assert client.get("/v1/model", headers={"Host": host, **headers}).status_code == status
    assert client.get("/livez", headers={"Host": host, **headers}).status_code == 200


def status_for_host(estimator: Estimator, host: str, server: str = "127.0.0.1", **settings: Any) -> int:
    """The status of a request for a host on a connection to an address, from 10.0.0.1 for 192.0.2.7."""
    app = create_app(Settings(**settings), estimator)
    client = TestClient(app, base_url=f"http://{server}:8000", client=("10.0.0.1", 5000))
    answer = client.get("/v1/model", headers={"Host": host, "X-Forwarded-For": "192.0.2.7"})
    if answer.status_code != 200:
        problem(answer, 421, "wrong-host")
    return answer.status_code


def test_a_range_that_a_file_has_not_is_a_problem(estimator: Estimator, tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"0123456789")
    client = client_of(estimator, photo=tmp_path / "a.jpg", photo_secret="s")
    answer = client.get("/opened/s", headers={"Range": "bytes=2-3"})
    assert (answer.status_code, answer.content) == (206, b"23")
    answer = client.get("/opened/s", headers={"Range": "bytes=10-"})
    problem(answer, 416, "bad-range")
    assert answer.headers["content-range"].endswith("*/10")
    for text in ("bytes=5-2", "bytes=x", "apples=1-2", "bytes=", "bytes=" + "9" * 5000 + "-"):
        problem(client.get("/opened/s", headers={"Range": text}), 416, "bad-range")


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8000", "localhost:8000", "[::1]:8000", "LocalHost.", "a.localhost", "lamp", "10.1.1.1"]
)
def test_a_local_service_is_called_by_address(estimator: Estimator, host: str) -> None:
    assert status_for_host(estimator, host) == 200


@pytest.mark.parametrize(
    "host", ["evil.example:8000", "localhost.evil.example", "127.0.0.1.evil.example", "lamp.local"]
)
def test_names_that_may_point_anywhere_are_refused_by_a_local_service(estimator: Estimator, host: str) -> None:
    assert status_for_host(estimator, host) == 421
    assert status_for_host(estimator, host, hosts="lamp.example") == 421
    assert status_for_host(estimator, host, "192.0.2.1", hosts="lamp.example") == 421
    assert status_for_host(estimator, host, hosts=host.partition(":")[0]) == 200
    assert status_for_host(estimator, host, "192.0.2.1") == 200
    assert status_for_host(estimator, host, trusted_proxies="10.0.0.1") == 200
    assert status_for_host(estimator, host, trusted_proxies="10.0.0.1", hosts="lamp.example") == 200
    assert status_for_host(estimator, host, trusted_proxies="10.0.0.2") == 421


def test_a_proxy_of_this_machine_passes_the_service_s_names_alone(estimator: Estimator) -> None:
    """A page in a browser of this machine could send the proxy's headers itself."""
    app = create_app(Settings(trusted_proxies="127.0.0.1", hosts="lamp.example"), estimator)
    client = TestClient(app, base_url="http://127.0.0.1:8000", client=("127.0.0.1", 5000))
    for host, status in (("lamp.example", 200), ("evil.example", 421)):
        headers = {"Host": host, "X-Forwarded-For": "192.0.2.7"}
        assert client.get("/v1/model", headers=headers).status_code == status

"""Keys, rates, headers, other origins; and nothing personal in the log."""

import hmac
import logging
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from server.auth import SECURITY_HEADERS, ApiKeys, RateLimiter, client_address
from server.settings import Settings, SettingsError
from tests.server.conftest import SKY, client_of, problem

OPEN = ("/", "/favicon.ico", "/livez", "/readyz", "/metrics", "/openapi.json")
JPEG = {"Content-Type": "image/jpeg"}


@pytest.fixture
def guarded(estimator: Estimator, tmp_path: Path) -> TestClient:
    file = tmp_path / "keys"
    file.write_text("# who: the robot\nfrom-file  # until May\n\n  also-from-file\n", encoding="utf-8")
    client = client_of(estimator, api_keys="first, second", api_keys_file=file)
    client.app.state.service.warm_up()  # type: ignore[attr-defined]
    return client


@pytest.mark.parametrize("key", ["first", "second", "from-file", "also-from-file"])
def test_each_key_opens(guarded: TestClient, key: str) -> None:
    assert guarded.get("/v1/model", headers={"Authorization": f"Bearer {key}"}).status_code == 200


@pytest.mark.parametrize(
    ("header", "status"), [
        (None, 401), ("", 401), ("Bearer", 401), ("Bearer ", 401), ("Basic first", 401), ("first", 401),
        ("Bearer third", 403), ("Bearer FIRST", 403), ("Bearer first,", 403), ("Bearer # who: the robot", 403),
        ("Bearer until May", 403), ("Bearer é", 403),
    ],
)  # fmt: skip
def test_nothing_else_does_and_a_wrong_key_is_told_from_none(
    guarded: TestClient, header: str | None, status: int
) -> None:
    headers = {} if header is None else {b"Authorization": header.encode("latin-1")}
    for answer in (
        guarded.get("/v1/model", headers=headers),
        guarded.get("/v1/envmap?sun=perhaps", headers=headers),
        guarded.post("/v1/lighting", content=b"no photo", headers=headers),
    ):
        body = problem(answer, status, {401: "unauthorised", 403: "forbidden"}[status])
        assert ("none of the service's" in body["detail"]) == (status == 403)
        assert answer.headers["www-authenticate"] == "Bearer"


def test_operations_and_the_page_need_no_key(guarded: TestClient) -> None:
    assert {path: guarded.get(path).status_code for path in OPEN} == dict.fromkeys(OPEN, 200)


def test_maps_behind_a_key_are_kept_by_nobody_else(guarded: TestClient) -> None:
    answer = guarded.get("/v1/envmap", params={**SKY, "height": 16}, headers={"Authorization": "Bearer first"})
    assert answer.headers["cache-control"].startswith("private")


def test_the_document_tells_of_keys_and_rates_where_they_apply(guarded: TestClient, client: TestClient) -> None:
    path = "/v1/lighting"
    closed, free = (c.get("/openapi.json").json()["paths"][path]["post"] for c in (guarded, client))
    assert closed["security"]
    assert {"401", "403"} <= set(closed["responses"])
    assert "security" not in free
    assert "401" not in free["responses"]


def test_keys_are_compared_in_constant_time_and_all_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []
    original = hmac.compare_digest

    def compare(a: bytes, b: bytes) -> bool:
        compared.append((a, b))
        return bool(original(a, b))

    monkeypatch.setattr(hmac, "compare_digest", compare)
    assert ApiKeys(["a", "b", "c"]).is_valid("a")
    assert len(compared) == 3
    assert {len(part) for pair in compared for part in pair} == {32}


def test_keys_are_in_no_text(estimator: Estimator, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG):
        client = client_of(estimator, api_keys="hush-hush")
        client.get("/v1/model", headers={"Authorization": "Bearer hush-hush"})
    service = client.app.state.service  # type: ignore[attr-defined]
    assert "hush" not in caplog.text + repr(service.settings) + str(vars(service.keys))


def test_the_rate_of_each_client_is_limited(estimator: Estimator) -> None:
    client = client_of(estimator, rate_limit="2/minute")
    assert [client.get("/v1/model").status_code for _ in range(2)] == [200, 200]
    answer = client.get("/v1/model")
    problem(answer, 429, "too-many-requests")
    assert 0 < int(answer.headers["retry-after"]) <= 60
    assert client.get("/livez").status_code == 200
    other = TestClient(client.app, client=("192.0.2.7", 5000))
    assert other.get("/v1/model").status_code == 200


def test_keys_cannot_be_guessed_faster_than_the_rate(estimator: Estimator) -> None:
    client = client_of(estimator, rate_limit="2/minute", api_keys="right")
    guesses = [client.get("/v1/model", headers={"Authorization": f"Bearer {key}"}).status_code for key in "abc"]
    assert guesses == [403, 403, 429]


def test_several_limits_apply_together() -> None:
    rate = RateLimiter(Settings(rate_limit="5/second; 2/hour").rate_limits)
    waits = [rate.seconds_to_wait("me") for _ in range(3)]
    assert waits[:2] == [0, 0]
    assert 3000 < waits[2] <= 3600
    assert rate.seconds_to_wait("you") == 0


def test_a_refused_request_counts_for_no_limit() -> None:
    rate = RateLimiter(Settings(rate_limit="1/minute; 3/hour").rate_limits)
    waits = [rate.seconds_to_wait("me") for _ in range(9)]
    assert waits[0] == 0
    assert all(0 < wait <= 60 for wait in waits[1:])


@pytest.mark.parametrize("text", ["", "# keys go here\n", "\n \n"])
def test_a_file_without_keys_does_not_open_the_service(text: str, tmp_path: Path) -> None:
    file = tmp_path / "keys"
    file.write_text(text)
    with pytest.raises(SettingsError, match="holds no key"):
        Settings(api_keys_file=file).all_keys()
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(SettingsError, match="is not a text file"):
        Settings(api_keys_file=file).all_keys()


def test_an_empty_list_of_keys_does_not_open_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIGHTING_API_KEYS", " , ")
    with pytest.raises(ValueError, match="holds no key"):
        Settings()


@pytest.mark.parametrize(
    ("host", "name"),
    [
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("192.0.2.1:5678", "192.0.2.1"),
        ("192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("2001:db8:1:2::9", "2001:db8:1:2::/64"),
        ("testclient", "unknown"),
    ],
)
def test_clients_are_known_by_address(host: str, name: str) -> None:
    from starlette.requests import Request

    assert client_address(Request({"type": "http", "client": (host, 1)})) == name
    assert client_address(Request({"type": "http", "client": None})) == "unknown"


@pytest.mark.parametrize("path", [*OPEN, "/v1/model", "/nothing", "/v1/envmap"])
def test_security_headers_are_on_every_answer(client: TestClient, path: str) -> None:
    headers = client.get(path).headers
    assert {name: headers[name] for name in SECURITY_HEADERS} == SECURITY_HEADERS


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

"""Keys, rates, headers, other origins; and nothing personal in the log."""

import hmac
import logging
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from server.app import create_app
from server.auth import SECURITY_HEADERS, ApiKeys, CpuLimiter, RateLimiter
from server.limits import UNKNOWN, Client, client_of_address
from server.settings import Settings, SettingsError
from tests.server.conftest import SKY, client_of, jpeg_headers, problem

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
        assert ("does not know this API key" in body["detail"]) == (status == 403)
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
    assert ApiKeys(["a", "b", "c"]).find("a") == 0
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


ME = Client(("me",))


def test_a_home_s_networks_share_a_larger_limit() -> None:
    rate = RateLimiter(Settings(rate_limit="2/minute").rate_limits)
    home = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101, 0x102)]
    assert [rate.seconds_to_wait(home[0]) > 0 for _ in range(3)] == [False, False, True]
    assert [rate.seconds_to_wait(home[1]) > 0 for _ in range(2)] == [False, False]
    assert rate.seconds_to_wait(home[2]) > 0  # the /56 has twice the limit
    assert rate.seconds_to_wait(client_of_address("2001:db8:0:200::1")) == 0


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_processor_time_is_limited_in_a_window_that_moves() -> None:
    clock = Clock()
    limiter = CpuLimiter(Settings(cpu_limit="10/minute; 15/hour").cpu_limits, clock)
    assert limiter
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 6.0)
    clock.now += 20
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 5.0)
    assert 39 <= limiter.seconds_to_wait(ME) <= 41  # until the first six have left the minute
    assert limiter.seconds_to_wait(Client(("you",))) == 0
    clock.now += limiter.seconds_to_wait(ME)
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 4.0)
    assert 3400 < limiter.seconds_to_wait(ME) <= 3600
    clock.now += 7200
    limiter.charge(Client(("you",)), 1.0)
    assert limiter.seconds_to_wait(ME) == 0


def test_a_client_that_used_its_processor_time_waits(estimator: Estimator, jpeg: bytes) -> None:
    client = client_of(estimator, cpu_limit="1/minute")
    service = client.app.state.service  # type: ignore[attr-defined]
    assert client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()).status_code == 200
    used = service.limiter.usage.load(UNKNOWN)
    assert 0 < used < 1
    service.cpu_limiter.charge(UNKNOWN, 1 - used / 2)
    answer = client.post("/v1/lighting", content=jpeg, headers=jpeg_headers())
    problem(answer, 429, "too-many-requests")
    assert 0 < int(answer.headers["retry-after"]) <= 60
    assert TestClient(client.app, client=("192.0.2.7", 5000)).get("/v1/model").status_code == 200


def test_who_has_a_key_is_known_by_it(estimator: Estimator) -> None:
    client = client_of(estimator, rate_limit="1/minute", api_keys="one two")
    bearers = [{"Authorization": f"Bearer {key}"} for key in ("one", "one", "two", "wrong", "other")]
    statuses = [client.get("/v1/model", headers=headers).status_code for headers in bearers]
    assert statuses == [200, 429, 200, 403, 429]


def test_several_limits_apply_together() -> None:
    rate = RateLimiter(Settings(rate_limit="5/second; 2/hour").rate_limits)
    waits = [rate.seconds_to_wait(ME) for _ in range(3)]
    assert waits[:2] == [0, 0]
    assert 3000 < waits[2] <= 3600
    assert rate.seconds_to_wait(Client(("you",))) == 0


def test_a_refused_request_counts_for_no_limit() -> None:
    rate = RateLimiter(Settings(rate_limit="1/minute; 3/hour").rate_limits)
    waits = [rate.seconds_to_wait(ME) for _ in range(9)]
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

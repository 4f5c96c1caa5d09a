"""Who is one client, by key or address, and what each may use."""

import hmac
import json
import logging
import sys
import time
import tracemalloc
from itertools import count
from pathlib import Path
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from server import request_body
from server.app import create_app
from server.dependencies import Service
from server.limits import (
    GROUP_SHARES,
    PLACE_BYTES,
    UNKNOWN,
    ApiKeys,
    ArrivingBody,
    ConnectionLimiter,
    PendingResponses,
    RateLimiter,
    Tally,
    UploadLimiter,
    client_of_address,
    client_of_key,
    count_possible_connections,
)
from server.limits import Client as Asker
from server.problems import BUSY, SHARE_TAKEN, TOO_MANY_UPLOADS
from server.settings import Settings, SettingsError
from tests.server.conftest import SKY, Client, client_of, jpeg_headers, problem, refused, service_of, until

LARGE = bytes(3 * PLACE_BYTES)  # of a body that needs a place


@pytest.mark.parametrize(
    ("host", "groups"),
    [
        ("::ffff:192.0.2.1", ("192.0.2.1",)),
        ("192.0.2.1:5678", ("192.0.2.1",)),
        ("192.0.2.1", ("192.0.2.1",)),
        ("64:ff9b::192.0.2.1", ("192.0.2.1",)),
        ("64:ff9b::c000:202", ("192.0.2.2",)),
        ("64:ff9b:1::192.0.2.3", ("64:ff9b:1::c000:203",)),
        ("64:ff9b:1:c000:2:400::", ("64:ff9b:1:c000:2:400::",)),
        ("64:ff9b:0:0:0:1:c000:202", ("64:ff9b::/64", "64:ff9b::/56", "64:ff9b::/48")),
        ("2001:db8:1:abcd:3:4:5:6", ("2001:db8:1:abcd::/64", "2001:db8:1:ab00::/56", "2001:db8:1::/48")),
        ("2001:db8:1:abcd::9", ("2001:db8:1:abcd::/64", "2001:db8:1:ab00::/56", "2001:db8:1::/48")),
        ("fe80::1%eth0", ("fe80::/64", "fe80::/56", "fe80::/48")),
        ("testclient", ("unknown",)),
        ("", ("unknown",)),
    ],
)
def test_clients_are_known_by_address(host: str, groups: tuple[str, ...]) -> None:
    assert client_of_address(host) == Asker(groups)


def test_a_key_is_a_client_and_no_address() -> None:
    assert client_of_key(0) != client_of_key(1)
    assert client_of_key(0).groups != client_of_address("192.0.2.1").groups


def test_sums_are_of_groups_and_divided_by_their_shares() -> None:
    tally = Tally()
    rooms = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101, 0x102, 0x200)]
    for room in rooms[:3]:
        tally.add(room, 1)
    assert tally.load(rooms[0]) == 3 / GROUP_SHARES[1]
    assert tally.load(rooms[0], 2) == 3.0
    assert tally.load(rooms[3]) == 3 / GROUP_SHARES[2]
    assert tally.load(client_of_address("2001:db8:1::1")) == 0
    assert len(tally) == 3
    for room in rooms[:3]:
        tally.add(room, -1)
    assert (len(tally), tally.load(rooms[0])) == (0, 0)


def body(name: str, rate: float = 1e6) -> ArrivingBody:
    """A body of a client, which came at a rate [B/s]."""
    arriving = ArrivingBody(client_of_address(name) if ":" in name else Asker((name,)), lambda: None, PLACE_BYTES)
    arriving.began -= PLACE_BYTES / rate
    return arriving


def test_places_run_out_and_come_back() -> None:
    uploads = UploadLimiter(3, 2)
    with uploads.count_upload(body("a")), uploads.count_upload(body("a")):
        with refused(TOO_MANY_UPLOADS), uploads.count_upload(body("a")):
            raise AssertionError("there was no place")
        with uploads.count_upload(body("b")):
            with refused(BUSY, "bodies are arriving"), uploads.count_upload(body("c", 1e3)):
                raise AssertionError("there was no place")
            assert uploads.count == 3
            with uploads.count_upload(body("c", 2e6)):
                assert uploads.count == 3
        assert uploads.count <= 2
    assert uploads.count == 0


def test_a_home_s_networks_share_places() -> None:
    uploads = UploadLimiter(9, 1)
    with uploads.count_upload(body("2001:db8:0:100::1")), uploads.count_upload(body("2001:db8:0:101::1")):
        with refused(TOO_MANY_UPLOADS), uploads.count_upload(body("2001:db8:0:102::1")):
            raise AssertionError("the /56 has two")
        with uploads.count_upload(body("2001:db8:0:200::1")):
            with refused(TOO_MANY_UPLOADS), uploads.count_upload(body("2001:db8:0:300::1")):
                raise AssertionError("the /48 has three")
            with uploads.count_upload(body("64:ff9b::192.0.2.1")), uploads.count_upload(body("64:ff9b::192.0.2.2")):
                assert uploads.count == 5


def test_too_many_from_one_client_are_429(estimator: Estimator, jpeg: bytes) -> None:
    client = client_of(estimator, uploads=3, uploads_per_client=2)
    uploads = service_of(client).uploads
    large = jpeg + bytes(PLACE_BYTES)

    def post(data: bytes = large) -> Any:
        return client.post("/v1/lighting", content=data, headers=jpeg_headers())

    with uploads.count_upload(body("unknown")):
        assert post().status_code == 200
        with uploads.count_upload(body("unknown")):
            answer = post()
            assert "from this client" in problem(answer, 429, "too-many-uploads")["detail"]
            assert answer.headers["retry-after"] == "1"
            assert post(jpeg).status_code == 200  # it is small
            assert client.get("/v1/model").status_code == 200
    assert post().status_code == 200
    assert uploads.count == 0


def test_an_upload_that_breaks_off_frees_its_place(app: FastAPI) -> None:
    service = app.state.service

    async def scenario() -> None:
        client = Client(app, LARGE, sent=PLACE_BYTES)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(client.ask)
            await until(lambda: service.uploads.count == 1)
            assert service.limiter.admitted == 0
            client.gone.set()
        assert client.status == 499
        assert service.uploads.count == 0

    anyio.run(scenario)


def test_an_upload_that_takes_too_long_is_408_and_frees_its_place(estimator: Estimator, jpeg: bytes) -> None:
    async def scenario() -> None:
        app = create_app(Settings(upload_seconds=0.05), estimator)
        client = Client(app, jpeg, sent=100)
        await client.ask()
        assert client.status == 408
        assert client.headers[b"connection"] == b"close"
        assert app.state.service.uploads.count == 0

    anyio.run(scenario)


def test_an_upload_that_is_slower_than_the_least_rate_is_408(
    estimator: Estimator, jpeg: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(request_body, "UPLOAD_GRACE", 0.05)

    async def scenario(sent: int) -> int:
        client = Client(create_app(Settings(upload_rate=1000), estimator), jpeg, sent=sent)
        with anyio.move_on_after(1.0):
            await client.ask()
        return client.status

    assert anyio.run(scenario, 100) == 408  # 0.05 s and 0.1 s for the bytes that came
    assert anyio.run(scenario, 3000) == 503  # more than 3 s; after 1 s the scenario ends it, as a shutdown does


@pytest.mark.parametrize("sent", [0, 100, PLACE_BYTES - 1])
def test_a_body_takes_no_place_before_its_first_64_kb(app: FastAPI, jpeg: bytes, sent: int) -> None:
    service = app.state.service

    async def scenario() -> None:
        slow = [Client(app, LARGE, sent=sent) for _ in range(service.settings.uploads_per_client + 1)]
        quick = Client(app, jpeg)
        async with anyio.create_task_group() as tasks:
            for client in slow:
                tasks.start_soon(client.ask)
            await until(lambda: not any(client.bodies for client in slow))
            assert service.uploads.count == 0
            await quick.ask()
            for client in slow:
                client.gone.set()
        assert quick.status == 200
        assert {client.status for client in slow} == {499}

    anyio.run(scenario)


def test_the_slowest_upload_gives_way(estimator: Estimator) -> None:
    app = create_app(Settings(uploads=2, uploads_per_client=2), estimator)
    service = app.state.service

    async def scenario() -> None:
        slow, slower = (Client(app, LARGE, sent=PLACE_BYTES + more) for more in (50_000, 0))
        slow.source, slower.source = "192.0.2.1", "192.0.2.2"
        quick = Client(app, LARGE)
        quick.source = "192.0.2.3"
        async with anyio.create_task_group() as tasks:
            for client in (slow, slower):
                tasks.start_soon(client.ask)
            await until(lambda: service.uploads.count == 2)
            await anyio.sleep(0.2)
            await quick.ask()
            await until(lambda: slower.status)
            slow.gone.set()
        assert (slow.status, slower.status) == (499, 503)
        assert slower.headers[b"connection"] == b"close"
        assert json.loads(slower.sent[1]["body"])["type"].endswith(":busy")
        assert quick.status == 400  # it is no photo, which is seen once it has arrived
        assert service.uploads.count == 0

    anyio.run(scenario)


class Unsent:
    """An answer of which some bytes wait."""

    def __init__(self, size: int, seconds: float = 1.0) -> None:
        self.size, self.seconds = size, seconds
        self.dropped = False

    def unsent_bytes(self) -> int:
        return self.size

    def seconds_left(self) -> float:
        return self.seconds

    def drop_answer(self) -> None:
        self.dropped = True

    give_way = drop_answer


ME, YOU, SHE, HE, THEY = (Asker((name,)) for name in ("me", "you", "she", "he", "they"))


def test_what_waits_is_counted_until_it_has_gone() -> None:
    pending = PendingResponses(100)
    one, other = Unsent(60), Unsent(40)
    pending.add(one, ME)
    pending.add(other, YOU)
    assert pending.size == 100
    pending.discard(other)
    pending.discard(other)
    assert pending.size == 60
    pending.check(SHE)
    assert not one.dropped


def test_a_client_has_a_quarter_of_what_may_wait() -> None:
    pending = PendingResponses(100)
    pending.add(Unsent(24), ME)
    pending.check(ME)
    pending.add(Unsent(1), ME)
    with refused(SHARE_TAKEN, "wait for this client"):
        pending.check(ME)
    pending.check(YOU)
    home = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101, 0x102, 0x200)]
    for client in home[:2]:
        pending.add(Unsent(25), client)
    with refused(SHARE_TAKEN):
        pending.check(home[2])  # twice a share waits for its /56
    pending.check(home[3])


def test_the_slowest_answers_make_room() -> None:
    pending = PendingResponses(100)
    answers = [Unsent(30, seconds) for seconds in (1.0, 9.0, 5.0, 2.0)]
    for answer, client in zip(answers, (ME, YOU, SHE, HE), strict=True):
        pending.add(answer, client)
    pending.check(THEY)
    assert [answer.dropped for answer in answers] == [False, True, False, False]
    assert pending.size == 90


@pytest.fixture
def unsent_client(estimator: Estimator) -> TestClient:
    return client_of(estimator, unsent_bytes=1000)


def test_a_client_that_takes_no_answers_gets_no_more(unsent_client: TestClient, jpeg: bytes) -> None:
    service = service_of(unsent_client)
    service.warm_up()
    answer = Unsent(250)
    service.pending.add(answer, UNKNOWN)
    problem(unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 429, "share-taken")
    problem(unsent_client.get("/v1/envmap", params=SKY), 429, "share-taken")
    assert unsent_client.get("/readyz").status_code == 200
    other = TestClient(unsent_client.app, client=("192.0.2.7", 5000))
    assert other.post("/v1/lighting", content=jpeg, headers=jpeg_headers()).status_code == 200
    service.pending.discard(answer)
    assert unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()).status_code == 200


def test_one_that_was_admitted_before_is_told_too_when_its_turn_comes(
    unsent_client: TestClient, jpeg: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = service_of(unsent_client)
    run = service.limiter.run

    async def late(*arguments: object) -> object:
        service.pending.add(Unsent(1000), UNKNOWN)
        return await run(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(service.limiter, "run", late)
    monkeypatch.setattr(Service, "read_photo", lambda *_: pytest.fail("work has begun"))
    problem(unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 429, "share-taken")


class Open:
    """A connection, and whether it gave way."""

    gone = False

    def give_way(self) -> None:
        self.gone = True


def test_the_connection_that_is_silent_longest_gives_way() -> None:
    limiter = ConnectionLimiter(4, 3)
    idle, working, old, young = (Open() for _ in range(4))
    for number, connection in enumerate((idle, working, old, young)):
        assert limiter.open(connection, Asker((str(number),)))
    limiter.note_request(idle)
    limiter.note_answer(idle)
    limiter.note_request(working)
    for expected in (old, young, None, idle):
        if expected is None:
            continue
        newest = Open()
        assert limiter.open(newest, ME if expected is old else None)
        assert expected.gone
        limiter.note_request(newest)
    assert not limiter.open(Open(), YOU)  # all are at work
    assert limiter.count == 4
    limiter.close(working)
    limiter.close(working)
    assert limiter.open(Open(), YOU)


def test_a_client_has_a_share_of_connections_and_a_proxy_has_none(caplog: pytest.LogCaptureFixture) -> None:
    limiter = ConnectionLimiter(9, 2)
    with caplog.at_level("WARNING", "server.limits"):
        opened = [limiter.open(Open(), ME) for _ in range(5)]
        assert opened == [True, True, False, False, False]
        assert all(limiter.open(Open(), None) for _ in range(7))
        assert limiter.open(Open(), YOU)
    assert caplog.messages == ["too many connections: 1 ended or refused, 2 open"]  # then one a minute


def test_a_client_with_many_connections_gets_no_more_when_all_are_taken() -> None:
    limiter = ConnectionLimiter(20, 20)
    assert all(limiter.open(Open(), ME) for _ in range(18))
    assert all(limiter.open(Open(), Asker((name,))) for name in "ab")
    assert not limiter.open(Open(), ME)  # 19 of 20, with three clients
    assert limiter.open(Open(), YOU)  # for which one of the 18 gives way
    assert limiter.count == 20


def test_who_gets_no_further_connection_is_known_before_it_is_opened() -> None:
    limiter = ConnectionLimiter(20, 12)
    assert not limiter.refuses(ME)
    for number in range(8):
        limiter.open(Open(), Asker((str(number),)))
    assert all(limiter.open(Open(), ME) for _ in range(12))
    assert limiter.refuses(ME)
    assert not limiter.refuses(YOU)


def test_a_client_with_as_many_connections_as_a_browser_opens_gets_them() -> None:
    limiter = ConnectionLimiter(20, 20)
    assert all(limiter.open(Open(), Asker((str(number),))) for number in range(20))
    assert all(limiter.open(Open(), ME) for _ in range(8))
    assert not limiter.open(Open(), ME)


def test_a_client_is_taken_beside_the_connections_of_a_proxy() -> None:
    limiter = ConnectionLimiter(8, 8)
    assert all(limiter.open(Open(), None) for _ in range(8))
    assert limiter.open(Open(), ME)


def test_connections_need_files(monkeypatch: pytest.MonkeyPatch) -> None:
    resource = pytest.importorskip("resource")
    for limit, least, most in ((1024, 700, 900), (resource.RLIM_INFINITY, sys.maxsize, sys.maxsize), (64, 8, 8)):
        monkeypatch.setattr(resource, "getrlimit", lambda _, limit=limit: (limit, limit))
        assert least <= count_possible_connections(4) <= most


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


ME = Asker(("me",))


def ask(rate: RateLimiter, client: Asker = ME) -> int:
    """Seconds that a client has to wait; without any, its request counts."""
    if not (wait := rate.seconds_to_wait(client)):
        rate.charge(client, 1.0)
    return wait


def test_a_home_s_networks_share_a_larger_limit() -> None:
    rate = RateLimiter(Settings(rate_limit="2/minute").rate_limit)
    home = [client_of_address(f"2001:db8:0:{network:x}::1") for network in (0x100, 0x101, 0x102)]
    assert [ask(rate, home[0]) > 0 for _ in range(3)] == [False, False, True]
    assert [ask(rate, home[1]) > 0 for _ in range(2)] == [False, False]
    assert rate.seconds_to_wait(home[2]) > 0  # the /56 has twice the limit
    assert rate.seconds_to_wait(client_of_address("2001:db8:0:200::1")) == 0


class Clock:
    now = 1000.0

    def __call__(self) -> float:
        return self.now


def test_processor_time_is_limited_in_a_window_that_moves() -> None:
    clock = Clock()
    limiter = RateLimiter(Settings(cpu_limit="10/minute; 15/hour").cpu_limit, clock)
    assert limiter
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 6.0)
    clock.now += 20
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 5.0)
    assert 39 <= limiter.seconds_to_wait(ME) <= 41  # until the first six have left the minute
    assert limiter.seconds_to_wait(Asker(("you",))) == 0
    clock.now += limiter.seconds_to_wait(ME)
    assert limiter.seconds_to_wait(ME) == 0
    limiter.charge(ME, 4.0)
    assert 3400 < limiter.seconds_to_wait(ME) <= 3600
    clock.now += 7200
    limiter.charge(Asker(("you",)), 1.0)
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
    bearers = ("Bearer one", "Bearer one", "Bearer  one", "bearer one ", "Bearer two", "Bearer wrong", "Bearer other")
    statuses = [client.get("/v1/model", headers={"Authorization": text}).status_code for text in bearers]
    assert statuses == [200, 429, 429, 429, 200, 403, 429]


def test_several_limits_apply_together() -> None:
    rate = RateLimiter(Settings(rate_limit="5/second; 2/hour").rate_limit)
    waits = [ask(rate) for _ in range(3)]
    assert waits[:2] == [0, 0]
    assert 3000 < waits[2] <= 3600
    assert rate.seconds_to_wait(Asker(("you",))) == 0


def test_a_client_that_never_rests_takes_no_more_memory_with_time() -> None:
    seconds = count()
    rate = RateLimiter(Settings(rate_limit="600/minute").rate_limit, lambda: next(seconds))
    tracemalloc.start()
    try:
        for _ in range(20_000):
            rate.charge(UNKNOWN, 1.0)
        assert tracemalloc.get_traced_memory()[0] < 100_000
    finally:
        tracemalloc.stop()


def test_a_clock_that_is_set_changes_no_limit(monkeypatch: pytest.MonkeyPatch) -> None:
    rate, now = RateLimiter(Settings(rate_limit="1/minute").rate_limit), time.time()
    ask(rate)
    for set_to in (now - 3600, now + 3600):
        monkeypatch.setattr(time, "time", lambda set_to=set_to: set_to)
        assert 0 < ask(rate) <= 60


def test_a_refused_request_counts_for_no_limit() -> None:
    rate = RateLimiter(Settings(rate_limit="1/minute; 3/hour").rate_limit)
    waits = [ask(rate) for _ in range(9)]
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

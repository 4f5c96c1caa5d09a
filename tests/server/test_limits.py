"""Tests of limits."""

import json
import threading
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from starlette.types import Message

from lighting.estimator import Estimator
from lighting.photo.reader import Photo
from lighting.records import Estimate
from server import request_body
from server.app import create_app
from server.dependencies import Service
from server.limits import BusyError, PendingResponses, TooManyUploadsError, UploadLimiter, WorkLimiter
from server.settings import Settings
from tests.server.conftest import SKY, Client, client_of, jpeg_headers, problem, service_of, until


def test_places_run_out_and_come_back() -> None:
    uploads = UploadLimiter(3, 2)
    with uploads.count_upload("a"), uploads.count_upload("a"):
        with pytest.raises(TooManyUploadsError), uploads.count_upload("a"):
            raise AssertionError("there was no place")
        with uploads.count_upload("b"):
            assert uploads.full
            with pytest.raises(BusyError), uploads.count_upload("c"):
                raise AssertionError("there was no place")
        with uploads.count_upload("c"):
            assert uploads.count == 3
    assert (uploads.count, uploads.full) == (0, False)


@pytest.fixture
def client(estimator: Estimator) -> TestClient:
    return client_of(estimator, uploads=3, uploads_per_client=2)


def test_too_many_from_one_address_are_429_and_from_all_503(client: TestClient, jpeg: bytes) -> None:
    uploads = service_of(client).uploads

    def post() -> Any:
        return client.post("/v1/lighting", content=jpeg, headers=jpeg_headers())

    with uploads.count_upload("unknown"):
        assert post().status_code == 200
        with uploads.count_upload("unknown"):
            answer = post()
            assert "from this address" in problem(answer, 429, "too-many-uploads")["detail"]
            assert answer.headers["retry-after"] == "1"
            assert client.get("/v1/model").status_code == 200
    with uploads.count_upload("a"), uploads.count_upload("b"), uploads.count_upload("c"):
        problem(post(), 503, "busy")
    assert post().status_code == 200
    assert uploads.count == 0


def test_the_sentence_says_what_there_is_no_room_for() -> None:
    uploads = UploadLimiter(1, 1)
    with uploads.count_upload("a"), pytest.raises(BusyError, match="bodies are arriving"), uploads.count_upload("b"):
        pass


class Held:
    """A service with one place and one waiting place whose readings of photos last until `release`."""

    def __init__(self, estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
        self.app: FastAPI = create_app(Settings(concurrency=1, queue=1), estimator)
        self.service: Service = self.app.state.service
        self.release = threading.Event()
        self.estimates = 0
        read, estimate = self.service.read_photo, self.service.estimate

        def held_read(*arguments: Any) -> Photo:
            assert self.release.wait(30)
            photo: Photo = read(*arguments)
            return photo

        def counted_estimate(*arguments: Any) -> list[Estimate]:
            self.estimates += 1
            answer: list[Estimate] = estimate(*arguments)
            return answer

        monkeypatch.setattr(self.service, "read_photo", held_read)
        monkeypatch.setattr(self.service, "estimate", counted_estimate)


@pytest.fixture
def held(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> Held:
    return Held(estimator, monkeypatch)


def test_limiter_places_run_out_and_come_back() -> None:
    limiter = WorkLimiter(1, 1)
    with limiter.admission():
        with limiter.admission():
            assert (limiter.admitted, limiter.waiting) == (2, 2)
            with pytest.raises(BusyError), limiter.admission():
                raise AssertionError("there was no place")
        with limiter.admission():
            assert limiter.admitted == 2
    with pytest.raises(KeyError), limiter.admission():
        raise KeyError
    assert limiter.admitted == 0


def test_a_full_queue_is_told_at_once_and_who_leaves_it_makes_room(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        running, waiting, refused, late = (Client(held.app, jpeg) for _ in range(4))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(running.ask)
            await until(lambda: held.service.limiter.running == 1)
            tasks.start_soon(waiting.ask)
            await until(lambda: held.service.limiter.waiting == 1)
            await refused.ask()
            assert refused.status == 503
            assert refused.headers[b"retry-after"] == b"1"
            assert json.loads(refused.sent[1]["body"])["type"].endswith(":busy")
            waiting.gone.set()
            await until(lambda: held.service.limiter.admitted == 1)
            tasks.start_soon(late.ask)
            await until(lambda: held.service.limiter.waiting == 1)
            held.release.set()
        assert (running.status, waiting.status, late.status) == (200, 499, 200)
        assert held.service.limiter.admitted == held.service.limiter.running == 0

    anyio.run(scenario)


def test_work_for_a_client_that_has_gone_stops_at_its_next_step(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        client = Client(held.app, jpeg)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(client.ask)
            await until(lambda: held.service.limiter.running == 1)
            client.gone.set()
            await anyio.sleep(0.01)
            held.release.set()
        assert client.status == 499
        assert held.estimates == 0
        assert held.service.limiter.admitted == held.service.limiter.running == 0

    anyio.run(scenario)


def test_an_upload_that_breaks_off_frees_its_place(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        client = Client(held.app, jpeg, sent=100)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(client.ask)
            await until(lambda: held.service.uploads.count == 1)
            assert held.service.limiter.admitted == 0
            client.gone.set()
        assert client.status == 499
        assert held.service.uploads.count == 0

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


def test_slow_uploads_take_no_place_from_others(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        held.release.set()
        slow = [Client(held.app, jpeg, sent=100) for _ in range(6)]
        quick = Client(held.app, jpeg)
        async with anyio.create_task_group() as tasks:
            for client in slow:
                tasks.start_soon(client.ask)
            await until(lambda: held.service.uploads.count == len(slow))
            assert not held.service.full
            await quick.ask()
            for client in slow:
                client.gone.set()
        assert quick.status == 200
        assert {client.status for client in slow} == {499}

    anyio.run(scenario)


def test_a_queue_that_filled_during_an_upload_is_told(held: Held, jpeg: bytes) -> None:
    async def scenario() -> None:
        late, *others = (Client(held.app, jpeg) for _ in range(3))
        late.bodies = [
            {"type": "http.request", "body": jpeg[100:], "more_body": False},
            {"type": "http.request", "body": jpeg[:100], "more_body": True},
        ]
        arrived = late.receive

        async def after_the_others() -> Message:
            if len(late.bodies) == 1:
                await until(lambda: held.service.limiter.full)
            return await arrived()

        late.receive = after_the_others  # type: ignore[method-assign]
        async with anyio.create_task_group() as tasks:
            for client in (late, *others):
                tasks.start_soon(client.ask)
            await until(lambda: late.status)
            held.release.set()
        assert [client.status for client in (late, *others)] == [503, 200, 200]

    anyio.run(scenario)


def test_what_work_raises_comes_out_as_it_is() -> None:
    async def never() -> Message:
        await anyio.sleep_forever()
        raise AssertionError

    def fail() -> None:
        raise KeyError("work")

    async def scenario() -> None:
        with pytest.raises(KeyError, match="work"):
            await WorkLimiter(1, 0).run(never, fail)

    anyio.run(scenario)


class UnsentHeld:
    """As much of a transport as is counted."""

    def __init__(self, size: int) -> None:
        self.size = size

    def get_write_buffer_size(self) -> int:
        return self.size


def unsent_held(pending: PendingResponses, size: int) -> UnsentHeld:
    transport = UnsentHeld(size)
    pending.add(transport)
    return transport


def test_what_waits_is_counted_until_it_has_gone() -> None:
    pending = PendingResponses(100)
    one, other = unsent_held(pending, 60), unsent_held(pending, 40)
    assert pending.size == 100
    with pytest.raises(BusyError, match="clients to take them"):
        pending.check()
    one.size = 59
    pending.check()
    pending.discard(other)
    pending.discard(other)
    assert pending.size == 59


@pytest.fixture
def unsent_client(estimator: Estimator) -> TestClient:
    return client_of(estimator, unsent_bytes=1000)


def test_requests_are_503_while_too_much_waits(unsent_client: TestClient, jpeg: bytes) -> None:
    service = service_of(unsent_client)
    service.ready = True
    waiting = unsent_held(service.pending, 1000)
    problem(unsent_client.get("/v1/envmap", params={**SKY, "height": 16}), 503, "busy")
    problem(unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 503, "busy")
    problem(unsent_client.get("/readyz"), 503, "busy")
    assert unsent_client.get("/livez").status_code == 200
    service.pending.discard(waiting)
    assert unsent_client.get("/readyz").status_code == 200
    assert unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()).status_code == 200


def test_one_that_was_admitted_before_is_503_too_when_its_turn_comes(
    unsent_client: TestClient, jpeg: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = service_of(unsent_client)
    run = service.limiter.run

    async def late(*arguments: object) -> object:
        unsent_held(service.pending, 1000)
        return await run(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(service.limiter, "run", late)
    monkeypatch.setattr(Service, "read_photo", lambda *_: pytest.fail("work has begun"))
    problem(unsent_client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 503, "busy")

"""Places: so many run, so many wait, the next is told at once, and whoever goes away leaves his to others."""

import json
import threading
from collections.abc import Callable
from typing import Any

import anyio
import pytest
from fastapi import FastAPI
from starlette.types import Message

from lighting.photo.read import Photo
from lighting.pipeline import Estimator
from lighting.records import Estimate
from server import uploads
from server.app import create_app
from server.limiter import BusyError, Limiter
from server.service import Service
from server.settings import Settings


class Held:
    """A service with one place and one waiting place whose readings of photos last until `release`."""

    def __init__(self, estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
        self.app: FastAPI = create_app(Settings(concurrency=1, queue=1), estimator)
        self.service: Service = self.app.state.service
        self.release = threading.Event()
        self.estimates = 0
        read, estimate = self.service.read, self.service.estimate

        def held_read(*arguments: Any) -> Photo:
            assert self.release.wait(30)
            photo: Photo = read(*arguments)
            return photo

        def counted_estimate(*arguments: Any) -> list[Estimate]:
            self.estimates += 1
            answer: list[Estimate] = estimate(*arguments)
            return answer

        monkeypatch.setattr(self.service, "read", held_read)
        monkeypatch.setattr(self.service, "estimate", counted_estimate)


@pytest.fixture
def held(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> Held:
    return Held(estimator, monkeypatch)


class Client:
    """One request with a photo, by hand, so that it can break off."""

    def __init__(self, app: FastAPI, photo: bytes, sent: int | None = None, kind: str = "image/jpeg") -> None:
        self.app = app
        self.kind = kind
        self.gone = anyio.Event()
        self.bodies = [{"type": "http.request", "body": photo[:sent], "more_body": sent is not None}]
        self.sent: list[Message] = []

    async def receive(self) -> Message:
        if self.bodies:
            return self.bodies.pop()
        await self.gone.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Message) -> None:
        self.sent.append(message)

    async def ask(self) -> None:
        headers = [(b"content-type", self.kind.encode())]
        scope = {"type": "http", "http_version": "1.1", "method": "POST", "path": "/v1/lighting", "query_string": b""}
        scope["headers"] = headers
        await self.app(scope, self.receive, self.send)

    @property
    def status(self) -> int:
        return int(self.sent[0]["status"]) if self.sent else 0

    @property
    def headers(self) -> dict[bytes, bytes]:
        return dict(self.sent[0]["headers"])


async def until(condition: Callable[[], Any]) -> None:
    with anyio.fail_after(30):
        while not condition():
            await anyio.sleep(0.002)


def test_places_run_out_and_come_back() -> None:
    limiter = Limiter(1, 1)
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
            await until(lambda: held.service.arrivals.count == 1)
            assert held.service.limiter.admitted == 0
            client.gone.set()
        assert client.status == 499
        assert held.service.arrivals.count == 0

    anyio.run(scenario)


def test_an_upload_that_takes_too_long_is_408_and_frees_its_place(estimator: Estimator, jpeg: bytes) -> None:
    async def scenario() -> None:
        app = create_app(Settings(upload_seconds=0.05), estimator)
        client = Client(app, jpeg, sent=100)
        await client.ask()
        assert client.status == 408
        assert client.headers[b"connection"] == b"close"
        assert app.state.service.arrivals.count == 0

    anyio.run(scenario)


def test_an_upload_that_is_slower_than_the_least_rate_is_408(
    estimator: Estimator, jpeg: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(uploads, "GRACE", 0.05)

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
            await until(lambda: held.service.arrivals.count == len(slow))
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
            await Limiter(1, 0).run(never, fail)

    anyio.run(scenario)

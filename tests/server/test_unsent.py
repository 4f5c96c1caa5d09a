"""Answers that clients have not taken: so many bytes, and no further ones are made until some have gone."""

import pytest
from starlette.testclient import TestClient

from lighting.pipeline import Estimator
from server.limiter import BusyError
from server.service import Service
from server.unsent import Unsent
from tests.server.conftest import SKY, client_of, jpeg_headers, service_of
from tests.server.test_problems import problem


class Held:
    """As much of a transport as is counted."""

    def __init__(self, size: int) -> None:
        self.size = size

    def get_write_buffer_size(self) -> int:
        return self.size


def held(unsent: Unsent, size: int) -> Held:
    transport = Held(size)
    unsent.add(transport)
    return transport


def test_what_waits_is_counted_until_it_has_gone() -> None:
    unsent = Unsent(100)
    one, other = held(unsent, 60), held(unsent, 40)
    assert unsent.size == 100
    with pytest.raises(BusyError, match="clients to take them"):
        unsent.check()
    one.size = 59
    unsent.check()
    unsent.discard(other)
    unsent.discard(other)
    assert unsent.size == 59


@pytest.fixture
def client(estimator: Estimator) -> TestClient:
    return client_of(estimator, unsent_bytes=1000)


def test_requests_are_503_while_too_much_waits(client: TestClient, jpeg: bytes) -> None:
    service = service_of(client)
    service.ready = True
    waiting = held(service.unsent, 1000)
    problem(client.get("/v1/envmap", params={**SKY, "height": 16}), 503, "busy")
    problem(client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 503, "busy")
    problem(client.get("/readyz"), 503, "busy")
    assert client.get("/livez").status_code == 200
    service.unsent.discard(waiting)
    assert client.get("/readyz").status_code == 200
    assert client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()).status_code == 200


def test_one_that_was_admitted_before_is_503_too_when_its_turn_comes(
    client: TestClient, jpeg: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = service_of(client)
    run = service.limiter.run

    async def late(*arguments: object) -> object:
        held(service.unsent, 1000)
        return await run(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(service.limiter, "run", late)
    monkeypatch.setattr(Service, "read", lambda *_: pytest.fail("work has begun"))
    problem(client.post("/v1/lighting", content=jpeg, headers=jpeg_headers()), 503, "busy")

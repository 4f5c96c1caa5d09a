"""Bodies under way: so many in all, so many of one client."""

from typing import Any

import pytest
from starlette.testclient import TestClient

from lighting.pipeline import Estimator
from server.arrivals import Arrivals, CrowdedError
from server.limiter import BusyError
from tests.server.conftest import client_of, jpeg_headers, service_of
from tests.server.test_problems import problem


def test_places_run_out_and_come_back() -> None:
    arrivals = Arrivals(3, 2)
    with arrivals.one_of("a"), arrivals.one_of("a"):
        with pytest.raises(CrowdedError), arrivals.one_of("a"):
            raise AssertionError("there was no place")
        with arrivals.one_of("b"):
            assert arrivals.full
            with pytest.raises(BusyError), arrivals.one_of("c"):
                raise AssertionError("there was no place")
        with arrivals.one_of("c"):
            assert arrivals.count == 3
    assert (arrivals.count, arrivals.full) == (0, False)


@pytest.fixture
def client(estimator: Estimator) -> TestClient:
    return client_of(estimator, uploads=3, uploads_per_client=2)


def test_too_many_from_one_address_are_429_and_from_all_503(client: TestClient, jpeg: bytes) -> None:
    arrivals = service_of(client).arrivals

    def post() -> Any:
        return client.post("/v1/lighting", content=jpeg, headers=jpeg_headers())

    with arrivals.one_of("unknown"):
        assert post().status_code == 200
        with arrivals.one_of("unknown"):
            answer = post()
            assert "from this address" in problem(answer, 429, "too-many-uploads")["detail"]
            assert answer.headers["retry-after"] == "1"
            assert client.get("/v1/model").status_code == 200
    with arrivals.one_of("a"), arrivals.one_of("b"), arrivals.one_of("c"):
        problem(post(), 503, "busy")
    assert post().status_code == 200
    assert arrivals.count == 0


def test_the_sentence_says_what_there_is_no_room_for() -> None:
    arrivals = Arrivals(1, 1)
    with arrivals.one_of("a"), pytest.raises(BusyError, match="bodies are arriving"), arrivals.one_of("b"):
        pass

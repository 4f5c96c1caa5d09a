"""The recipe of CONTRIBUTING.md for a route, carried out: one function, one model of its parameters.

The recipes for a sky model and a scene tool are carried out by tests/test_registries.py, the one for a metadata rule by
tests/lighting/fusion/test_time_zones.py, the one for an augmentation by tests/export/crops/test_augmentation.py.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import pytest
from fastapi import Query, Response
from pydantic import Field
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.model import Model
from server import query_params
from server.app import create_app
from server.dependencies import AdmissionDep
from server.routes import router
from server.settings import Settings

KEY = "0123456789abcdef"


class ToyQuery(query_params.Query):
    """The parameters of a toy route."""

    count: int = Field(1, ge=1, le=3, description="how many times the toy speaks")


def speak(count: int) -> str:
    """The work, which runs beside the event loop."""
    return "toy " * count


async def run_toy(admission: AdmissionDep, query: Annotated[ToyQuery, Query()]) -> Response:
    """What a contributor writes in server/routes.py."""
    return Response(await admission.run(speak, query.count), media_type="text/plain")


@pytest.fixture(autouse=True)
def _toy_route() -> Iterator[None]:
    before = len(router.routes)
    router.get("/toy", summary="A toy", response_class=Response)(run_toy)
    yield
    del router.routes[before:]


@pytest.fixture
def client(network: Path) -> TestClient:
    return TestClient(create_app(Settings(api_keys=KEY), Estimator(Model.load(network, threads=1))))


def test_a_route_answers_what_its_function_gives(client: TestClient) -> None:
    answer = client.get("/v1/toy?count=2", headers={"Authorization": f"Bearer {KEY}"})
    assert (answer.status_code, answer.text) == (200, "toy toy ")


def test_a_route_has_keys_problems_and_a_description_without_another_line(client: TestClient) -> None:
    assert client.get("/v1/toy").status_code == 401
    client.headers["Authorization"] = f"Bearer {KEY}"
    for query, field in (("count=9", "count"), ("cuont=2", "cuont"), ("count=1&count=2", "count")):
        answer = client.get(f"/v1/toy?{query}")
        assert answer.headers["content-type"] == "application/problem+json"
        assert answer.status_code == 422
        assert field in answer.text
    operation = client.get("/openapi.json").json()["paths"]["/v1/toy"]["get"]
    assert operation["summary"] == "A toy"
    assert {parameter["name"] for parameter in operation["parameters"]} >= {"count"}
    assert {"401", "422"} <= set(operation["responses"])

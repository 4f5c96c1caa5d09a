"""The service with the tiny network, in this process."""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from lighting.model import Model
from server.app import create_app
from server.dependencies import Service
from server.settings import PREFIX, Settings
from tests.conftest import encode, scene


@pytest.fixture(autouse=True)
def no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith(PREFIX)]:
        monkeypatch.delenv(name)


@pytest.fixture(scope="session")
def estimator(network: Path) -> Estimator:
    return Estimator(Model.load(network, threads=1))


@pytest.fixture(scope="session")
def jpeg() -> bytes:
    return encode(scene(320, 240))


@pytest.fixture
def app(estimator: Estimator) -> FastAPI:
    return create_app(Settings(), estimator)


@pytest.fixture
def client(app: FastAPI) -> Iterator[TestClient]:
    with serving(app) as client:
        yield client


def serving(app: FastAPI) -> TestClient:
    """A client that sees a 500 instead of the error behind it."""
    return TestClient(app, raise_server_exceptions=False)


def client_of(estimator: Estimator, **settings: Any) -> TestClient:
    """A client of a service with other settings; the network counts as loaded."""
    return serving(create_app(Settings(**settings), estimator))


def service_of(client: TestClient) -> Service:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    return service


SKY: dict[str, Any] = {"sun_azimuth": -41.2, "sun_elevation": 33.0, "turbidity": 3.4, "exposure": 0.021}


def jpeg_headers() -> dict[str, str]:
    return {"Content-Type": "image/jpeg"}


def together(client: TestClient, *files: bytes, **query: Any) -> Any:
    """The answer for several photos in one form."""
    form = [("photo", (f"{number}.jpg", data, "image/jpeg")) for number, data in enumerate(files)]
    return client.post(f"/v1/lighting?{urlencode(query)}", files=form)


def sample(client: TestClient, name: str) -> float:
    """The value of a metric, written with its labels."""
    match = re.search(rf"^{re.escape(name)} (\S+)$", client.get("/metrics").text, re.MULTILINE)
    return float(match[1]) if match else 0.0

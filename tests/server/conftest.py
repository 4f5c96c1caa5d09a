"""The service with the tiny network, in this process."""

import io
import json
import os
import re
import time
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import urlencode, urljoin

import anyio
import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient
from starlette.types import Message

from lighting.estimator import Estimator
from lighting.model import Model
from lighting.scene import EXPORTERS
from lighting.sky import SKY_MODELS
from server.app import create_app
from server.dependencies import Service
from server.problems import ProblemError, ProblemKind
from server.schemas import Problem
from server.settings import PREFIX, Settings
from tests.conftest import encode, scene


@pytest.fixture(autouse=True)
def no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in os.environ if name.startswith(PREFIX)]:
        monkeypatch.delenv(name)


@pytest.fixture(scope="session", autouse=True)
def one_document() -> Iterator[None]:
    """Services of the same settings and registries share the document of their routes, which takes 0.1 s to make."""
    describe, documents = FastAPI.openapi, dict[str, dict[str, Any]]()

    def openapi(app: FastAPI) -> dict[str, Any]:
        key = repr((app.state.service.settings, list(EXPORTERS), list(SKY_MODELS)))
        if key not in documents:
            documents[key] = describe(app)
        return documents[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FastAPI, "openapi", openapi)
        yield


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
    return client.post(f"/v1/lightings?{urlencode(query)}", files=form)


def sample(client: TestClient, name: str) -> float:
    """The value of a metric, written with its labels."""
    match = re.search(rf"^{re.escape(name)} (\S+)$", client.get("/metrics").text, re.MULTILINE)
    return float(match[1]) if match else 0.0


@contextmanager
def refused(kind: ProblemKind, detail: str = "") -> Iterator[None]:
    """What is refused with a problem of this kind, whose detail has these words."""
    with pytest.raises(ProblemError, match=detail or None) as caught:
        yield
    assert caught.value.kind is kind


def problem(answer: Any, status: int, name: str) -> dict[str, Any]:
    """The body of an answer that is this problem."""
    assert answer.status_code == status, answer.content[:300]
    assert answer.headers["content-type"] == "application/problem+json"
    body: dict[str, Any] = answer.json()
    text = re.sub(r"\\ud[89ab]..", "?", json.dumps(body))  # pydantic reads no half of a pair of surrogates
    Problem.model_validate_json(text, strict=True)
    assert body["status"] == status
    assert body["type"] == f"tag:outdoor-lighting,2026:{name}"
    assert body["request_id"] == answer.headers["x-request-id"]
    assert answer.headers["x-content-type-options"] == "nosniff"
    return body


class Client:
    """One request with a photo, by hand, so that it can break off."""

    def __init__(self, app: FastAPI, photo: bytes, sent: int | None = None, kind: str = "image/jpeg") -> None:
        self.app = app
        self.kind = kind
        self.gone = anyio.Event()
        self.bodies = [{"type": "http.request", "body": photo[:sent], "more_body": sent is not None}]
        self.sent: list[Message] = []
        self.source = ""  # its address
        self.path = "/v1/lighting"

    async def receive(self) -> Message:
        if self.bodies:
            return self.bodies.pop()
        await self.gone.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Message) -> None:
        self.sent.append(message)

    async def ask(self) -> None:
        headers = [(b"content-type", self.kind.encode())]
        scope: dict[str, Any] = {"type": "http", "http_version": "1.1", "method": "POST", "path": self.path}
        scope |= {"query_string": b"", "headers": headers, "client": (self.source, 1) if self.source else None}
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


def pack(**files: bytes) -> bytes:
    """A ZIP of files by name."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return stream.getvalue()


def wait(client: TestClient, address: str) -> dict[str, Any]:
    """The record of a job that has ended, by its `Location`."""
    deadline = time.monotonic() + 300
    while True:
        answer = client.get(urljoin("/v1/jobs", address))
        record: dict[str, Any] = answer.json()
        if record["state"] in ("finished", "failed"):
            assert "retry-after" not in answer.headers
            return record
        assert answer.headers["retry-after"] == "2"
        assert 0 <= record["progress"] <= 1
        assert time.monotonic() < deadline
        time.sleep(0.1)

"""Health, metrics, request ids."""

import logging
import re
from pathlib import Path

import pytest
from fastapi import FastAPI
from starlette.testclient import TestClient

from lighting.errors import ModelError
from lighting.pipeline import Estimator
from server.app import create_app
from server.settings import Settings
from tests.server.conftest import client_of

JPEG = {"Content-Type": "image/jpeg"}


def sample(client: TestClient, name: str) -> float:
    """The value of a metric, written with its labels."""
    match = re.search(rf"^{re.escape(name)} (\S+)$", client.get("/metrics").text, re.MULTILINE)
    return float(match[1]) if match else 0.0


def test_it_is_ready_once_the_network_has_answered(app: FastAPI, estimator: Estimator) -> None:
    before = client_of(estimator)
    assert (before.get("/livez").status_code, before.get("/readyz").status_code) == (200, 503)
    with TestClient(app) as client:
        app.state.service.answer_once()
        assert client.get("/readyz").json() == client.get("/healthz").json() == {"status": "ok"}
        assert sample(client, 'lighting_model_info{name="tiny",version="0.0.1"}') == 1


def test_a_network_that_cannot_answer_is_never_ready(
    estimator: Estimator, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(*_: object) -> None:
        raise ModelError("The network failed.")

    app = create_app(Settings(), estimator)
    monkeypatch.setattr(app.state.service, "answer_once", fail)
    with caplog.at_level(logging.ERROR), TestClient(app) as client:
        assert client.get("/readyz").status_code == 503
        assert client.get("/livez").status_code == 200
    assert "cannot answer" in caplog.text


def test_the_network_is_loaded_once_at_the_start_with_the_threads_set(network: Path) -> None:
    app = create_app(Settings(model=network, threads=3))
    service = app.state.service
    assert service.loaded is None
    with TestClient(app):
        estimator = service.estimator
        assert estimator.model.session.get_session_options().intra_op_num_threads == 3
        service.load()
        assert service.estimator is estimator


def test_a_service_without_a_network_does_not_start(tmp_path: Path) -> None:
    app = create_app(Settings(model=tmp_path / "none.onnx"))
    with pytest.raises(ModelError, match="no network"), TestClient(app):
        pass


def test_requests_are_counted_by_route_and_status(client: TestClient, jpeg: bytes) -> None:
    client.post("/v1/lighting", content=jpeg, headers=JPEG)
    client.post("/v1/lighting", content=b"text", headers=JPEG)
    client.get("/v1/envmap")
    client.get("/nowhere/1")
    client.get("/nowhere/2")
    client.request("MADE-UP", "/nowhere/3")
    client.head("/v1/model")
    counts = {
        ("POST", "/v1/lighting", 200): 1,
        ("POST", "/v1/lighting", 400): 1,
        ("GET", "/v1/envmap", 422): 1,
        ("any", "unmatched", 404): 3,
        ("HEAD", "/v1/model", 200): 1,
    }
    for (method, route, status), count in counts.items():
        labels = f'{{method="{method}",route="{route}",status="{status}"}}'
        assert sample(client, f"lighting_requests_total{labels}") == count, labels
    assert sample(client, 'lighting_request_seconds_count{route="/v1/lighting"}') == 2
    assert sample(client, "lighting_inference_seconds_count") == 1
    assert sample(client, "lighting_photo_bytes_total") == len(jpeg)
    assert sample(client, "lighting_photo_pixels_total") == 320 * 240
    assert sample(client, "lighting_queue_depth") == sample(client, "lighting_running") == 0


def test_health_is_neither_counted_nor_logged(client: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, "server.access"):
        for path in ("/livez", "/readyz", "/healthz", "/metrics"):
            client.get(path)
    assert "lighting_requests_total{" not in client.get("/metrics").text
    assert not caplog.records


def test_two_services_count_apart(estimator: Estimator) -> None:
    one, other = client_of(estimator), client_of(estimator)
    one.get("/v1/model")
    assert sample(one, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 1
    assert sample(other, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 0


def test_a_request_id_is_echoed_or_made(client: TestClient) -> None:
    assert client.get("/livez", headers={"X-Request-ID": "trace-1.2_3"}).headers["x-request-id"] == "trace-1.2_3"
    made = client.get("/livez").headers["x-request-id"]
    assert re.fullmatch(r"[0-9a-f]{16}", made)
    for bad in ("x" * 65, "a b", "<b>", "é", ""):
        answer = client.get("/livez", headers={b"X-Request-ID": bad.encode("latin-1")})
        assert re.fullmatch(r"[0-9a-f]{16}", answer.headers["x-request-id"])
    assert client.get("/livez").headers["x-request-id"] != made

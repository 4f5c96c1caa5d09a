"""The Open Inference Protocol, spoken by Triton's client."""

import json
from collections.abc import Iterator
from threading import Thread
from time import sleep

import numpy as np
import pytest
import uvicorn
from fastapi import FastAPI
from fastapi.testclient import TestClient

from tests.conftest import encode, scene

PHOTO = encode(scene(64, 48))


def test_health_and_metadata(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    service = client.app.state.service  # type: ignore[attr-defined]
    service.warm_up()
    assert client.get("/v2/health/live").status_code == 200
    assert client.get("/v2/health/ready").status_code == 200
    with monkeypatch.context() as patch:
        patch.setattr(service, "ready", False)
        assert client.get("/v2/health/ready").status_code == 503
    name = client.get("/v1/model").json()["name"]
    assert client.get(f"/v2/models/{name}/ready").status_code == 200
    described = client.get(f"/v2/models/{name}").json()
    assert described["inputs"] == [{"name": "photo", "datatype": "BYTES", "shape": [1]}]
    assert described["outputs"] == [{"name": "lighting", "datatype": "BYTES", "shape": [1]}]
    (version,) = described["versions"]
    assert client.get(f"/v2/models/{name}/versions/{version}").json() == described
    assert client.get(f"/v2/models/{name}/versions/{version}/ready").status_code == 200
    for unknown in ("other/ready", f"{name}/versions/0/ready"):
        problem = client.get(f"/v2/models/{unknown}")
        assert problem.status_code == 404
        assert problem.json()["error"] == problem.json()["detail"]
    assert client.get("/v2").json()["extensions"] == ["binary_tensor_data"]
    assert "error" not in client.get("/v1/none").json()


def test_tritons_client_gets_the_record(client: TestClient) -> None:
    http = pytest.importorskip("tritonclient.http")
    tensor = http.InferInput("photo", [1], "BYTES")
    tensor.set_data_from_numpy(np.array([PHOTO], dtype=object), binary_data=True)
    body, length = http.InferenceServerClient.generate_request_body([tensor])
    name = client.get("/v1/model").json()["name"]
    headers = {"Inference-Header-Content-Length": str(length)}
    answer = client.post(f"/v2/models/{name}/infer", content=body, headers=headers)
    assert answer.status_code == 200, answer.text
    result = http.InferResult.from_response_body(answer.content)
    record = json.loads(result.as_numpy("lighting")[0])
    assert record == client.post("/v1/lighting", content=PHOTO, headers={"Content-Type": "image/jpeg"}).json()


@pytest.fixture
def address(app: FastAPI) -> Iterator[str]:
    """Of the service on a socket."""
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="error"))
    thread = Thread(target=server.run)
    thread.start()
    while not server.started:
        sleep(0.01)
    app.state.service.warm_up()
    yield "{}:{}".format(*server.servers[0].sockets[0].getsockname())
    server.should_exit = True
    thread.join()


def test_tritons_client_asks_over_a_socket(address: str, app: FastAPI) -> None:
    http = pytest.importorskip("tritonclient.http")
    spec = app.state.service.estimator.model.spec
    client = http.InferenceServerClient(address)
    assert client.is_server_live()
    assert client.is_server_ready()
    assert client.is_model_ready(spec.name)
    assert client.get_server_metadata()["name"] == "outdoor-lighting"
    assert client.get_model_metadata(spec.name)["versions"] == [spec.version]
    photo, other = (http.InferInput("photo", [1], "BYTES") for _ in range(2))
    photo.set_data_from_numpy(np.array([PHOTO], dtype=object))
    other.set_data_from_numpy(np.array([b"no photo"], dtype=object))
    outputs = [http.InferRequestedOutput("lighting")]
    result = client.infer(spec.name, [photo], spec.version, outputs=outputs, request_id="a")
    assert result.get_response()["id"] == "a"
    assert set(json.loads(result.as_numpy("lighting")[0])) >= {"sun", "sky", "camera", "light_probe"}
    with pytest.raises(Exception, match=r"^\[400\] This is a text"):
        client.infer(spec.name, [other])
    client.close()


@pytest.mark.parametrize(
    ("body", "length", "status"),
    [
        (b"", "", 400),
        (b"{}", "9", 400),
        (b"{}", "2", 400),
        (b"[" * 9000, "9000", 400),
        (b'{"inputs": [{"name": "photo", "datatype": "BYTES", "shape": [1]}]}', "66", 422),
        (b'{"inputs": [{"name": "photo", "datatype": "BYTES", "shape": [1]}]}\x09\0\0\0abc', "66", 422),
        (b'{"inputs": [{"name": "image", "datatype": "BYTES", "shape": [1]}]}\x03\0\0\0abc', "66", 422),
        (b'{"inputs": [{"name": "photo", "datatype": "BYTES", "shape": [1]}]}\x03\0\0\0abc', "66", 400),
    ],
)
def test_other_bodies_are_refused(client: TestClient, body: bytes, length: str, status: int) -> None:
    name = client.get("/v1/model").json()["name"]
    headers = {"Inference-Header-Content-Length": length} if length else {}
    answer = client.post(f"/v2/models/{name}/infer", content=body, headers=headers)
    assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json")

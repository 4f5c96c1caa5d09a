"""The Open Inference Protocol, spoken by Triton's client."""

import json

import numpy as np
import pytest
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
    assert client.get("/v2/models/other/ready").status_code == 404


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

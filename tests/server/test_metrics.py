"""What is counted, and under which labels."""

from prometheus_client import generate_latest
from starlette.testclient import TestClient

from lighting.estimator import Estimator
from server.identity import UNKNOWN
from server.limits import ArrivingBody, ConnectionLimiter, PendingResponses, UploadLimiter
from server.metrics import Metrics
from server.scheduling import WorkLimiter
from tests.server.conftest import client_of, jpeg_headers, sample


def test_requests_are_counted_by_route_and_status(client: TestClient, jpeg: bytes) -> None:
    client.post("/v1/lighting", content=jpeg, headers=jpeg_headers())
    client.post("/v1/lighting", content=b"text", headers=jpeg_headers())
    client.get("/v1/envmap")
    client.get("/nowhere/1")
    client.get("/nowhere/2")
    client.request("MADE-UP", "/nowhere/3")
    client.head("/v1/model")
    client.request("MADE-UP", "/v1/model")
    client.request("MADE-UP-TOO", "/v1/model")
    counts = {
        ("POST", "/v1/lighting", 200): 1,
        ("POST", "/v1/lighting", 400): 1,
        ("GET", "/v1/envmap", 422): 1,
        ("any", "unmatched", 404): 3,
        ("HEAD", "/v1/model", 200): 1,
        ("other", "/v1/model", 405): 2,
    }
    for (method, route, status), count in counts.items():
        labels = f'{{method="{method}",route="{route}",status="{status}"}}'
        assert sample(client, f"lighting_requests_total{labels}") == count, labels
    assert sample(client, 'lighting_request_seconds_count{route="/v1/lighting"}') == 2
    assert sample(client, "lighting_inference_seconds_count") == 1
    assert sample(client, "lighting_photo_bytes_total") == len(jpeg)
    assert sample(client, "lighting_photo_pixels_total") == 320 * 240
    assert sample(client, "lighting_queue_depth") == sample(client, "lighting_running") == 0


def test_two_services_count_apart(estimator: Estimator) -> None:
    one, other = client_of(estimator), client_of(estimator)
    one.get("/v1/model")
    assert sample(one, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 1
    assert sample(other, 'lighting_requests_total{method="GET",route="/v1/model",status="200"}') == 0


class Waiting:
    """A connection whose client has not taken 700 bytes yet."""

    def unsent_bytes(self) -> int:
        return 700

    def seconds_left(self) -> float:
        return 7.0

    def drop_answer(self) -> None:
        raise AssertionError

    def give_way(self) -> None:
        raise AssertionError


def test_the_gauges_follow_the_limits() -> None:
    limiter, uploads, pending = WorkLimiter(1, 2), UploadLimiter(3, 2), PendingResponses(1000)
    connections = ConnectionLimiter(9, 9)
    metrics = Metrics(limiter, uploads, pending, connections)
    pending.add(Waiting(), UNKNOWN)
    connections.open(Waiting(), UNKNOWN)
    with limiter.admission(), limiter.admission(), uploads.count_upload(ArrivingBody(UNKNOWN, lambda: None)):
        text = generate_latest(metrics.registry).decode()
    assert "lighting_queue_depth 2.0" in text
    assert "lighting_running 0.0" in text
    assert "lighting_uploads 1.0" in text
    assert "lighting_unsent_bytes 700.0" in text
    assert "lighting_connections 1.0" in text

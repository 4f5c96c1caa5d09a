"""Traces of requests, as a collector gets them by OTLP."""

import subprocess
import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Thread
from typing import Any

import pytest
from pydantic import ValidationError
from starlette.testclient import TestClient

from lighting.errors import MissingExtraError
from lighting.estimator import Estimator
from server.app import create_app
from server.settings import Settings
from tests.server.conftest import SKY, client_of

trace_service = pytest.importorskip("opentelemetry.proto.collector.trace.v1.trace_service_pb2")
pytest.importorskip("opentelemetry.exporter.otlp.proto.http")

TRACE, PARENT = "4bf92f3577b34da6a3ce929d0e0e4736", "00f067aa0ba902b7"


class Collector(ThreadingHTTPServer):
    """An OTLP receiver that keeps what it gets."""

    def __init__(self) -> None:
        self.paths: list[str] = []
        self.resource: dict[str, str] = {}
        self.spans: list[Any] = []
        super().__init__(("127.0.0.1", 0), _Receiver)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    def find(self, name: str) -> list[Any]:
        return [span for span in self.spans if span.name == name]


class _Receiver(BaseHTTPRequestHandler):
    server: Collector

    def do_POST(self) -> None:
        request = trace_service.ExportTraceServiceRequest()
        request.ParseFromString(self.rfile.read(int(self.headers["Content-Length"])))
        self.server.paths.append(self.path)
        for part in request.resource_spans:
            self.server.resource = {pair.key: pair.value.string_value for pair in part.resource.attributes}
            self.server.spans += [span for scope in part.scope_spans for span in scope.spans]
        self.send_response(200)
        self.send_header("Content-Type", "application/x-protobuf")
        self.send_header("Content-Length", "0")
        self.end_headers()

    def log_message(self, format: str, *args: Any) -> None:
        pass


@pytest.fixture
def collector() -> Iterator[Collector]:
    with Collector() as server:
        Thread(target=server.serve_forever, args=(0.01,), daemon=True).start()
        yield server
        server.shutdown()


def attributes(span: Any) -> dict[str, Any]:
    return {pair.key: getattr(pair.value, pair.value.WhichOneof("value")) for pair in span.attributes}


def traced(estimator: Estimator, collector: Collector) -> TestClient:
    return client_of(estimator, otlp_endpoint=collector.url)


def test_a_request_continues_its_callers_trace_with_a_span_a_step(
    estimator: Estimator, collector: Collector, jpeg: bytes
) -> None:
    headers = {"Content-Type": "image/jpeg", "traceparent": f"00-{TRACE}-{PARENT}-01"}
    with traced(estimator, collector) as client:
        assert client.post("/v1/envmap?height=16", content=jpeg, headers=headers).status_code == 200
        client.get("/livez")
        client.get("/v2/health/ready")
    assert set(collector.paths) == {"/v1/traces"}
    assert collector.resource["service.name"] == "outdoor-lighting"
    (request,) = collector.find("POST /v1/envmap")
    assert (request.trace_id.hex(), request.parent_span_id.hex(), request.kind) == (TRACE, PARENT, 2)
    expected = {"http.request.method": "POST", "http.route": "/v1/envmap", "http.response.status_code": 200}
    assert expected.items() <= attributes(request).items()
    steps = [span for span in collector.spans if span is not request]
    assert {span.name for span in steps} == {"decode", "network", "map", "encode"}
    assert {span.trace_id.hex() for span in steps} == {TRACE}
    (network,), (encode,) = collector.find("network"), collector.find("encode")
    assert {network.parent_span_id, encode.parent_span_id} == {request.span_id}
    decode = min(collector.find("decode"), key=lambda span: int(span.start_time_unix_nano))
    ends = [request.start_time_unix_nano, decode.start_time_unix_nano, decode.end_time_unix_nano]
    ends += [network.start_time_unix_nano, network.end_time_unix_nano, encode.start_time_unix_nano]
    assert ends == sorted(ends)


@pytest.mark.parametrize("header", [{}, {"traceparent": "00-0-0-01"}, {"traceparent": f"00-{TRACE}-{PARENT}-zz"}])
def test_without_a_callers_trace_it_is_one_of_its_own(
    estimator: Estimator, collector: Collector, header: dict[str, str]
) -> None:
    with traced(estimator, collector) as client:
        client.get("/v1/light-probe", params=SKY, headers=header)
    (request,) = collector.find("GET /v1/light-probe")
    assert request.parent_span_id == b""
    assert request.trace_id.hex() != TRACE
    assert [span.parent_span_id for span in collector.find("map")] == [request.span_id]


def test_a_callers_trace_that_is_not_sampled_is_not_sent(estimator: Estimator, collector: Collector) -> None:
    with traced(estimator, collector) as client:
        client.get("/v1/model", headers={"traceparent": f"00-{TRACE}-{PARENT}-00"})
    assert collector.spans == []


def test_problems_are_named_without_files_and_sentences(estimator: Estimator, collector: Collector) -> None:
    files = [("photo", ("secret.jpg", b"no photo", "image/jpeg"))]
    with traced(estimator, collector) as client:
        assert client.post("/v1/lighting?latitude=48&longitude=11", files=files).status_code == 400
        assert client.get("/none").status_code == 404
    (request,), (decode,) = collector.find("POST /v1/lighting"), collector.find("decode")
    assert attributes(request)["http.response.status_code"] == 400
    assert attributes(decode) == {"error.type": "PhotoError"}
    assert (decode.status.code, request.status.code) == (2, 0)
    (unmatched,) = collector.find("GET")
    assert attributes(unmatched)["http.response.status_code"] == 404
    told = b"".join(span.SerializeToString() for span in collector.spans)
    assert not any(word in told for word in (b"secret", b"latitude", b"JPEG", b"/none"))


def test_another_name_of_the_service_is_the_operators(
    estimator: Estimator, collector: Collector, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OTEL_SERVICE_NAME", "light")
    with traced(estimator, collector) as client:
        client.get("/v1/model")
    assert collector.resource["service.name"] == "light"


def test_a_collector_that_is_gone_hurts_no_request(estimator: Estimator, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("server.tracing._CLOSE_SECONDS", 0.1)
    with client_of(estimator, otlp_endpoint="http://127.0.0.1:9") as client:
        assert client.get("/v1/model").status_code == 200


@pytest.mark.parametrize("url", ["collector:4318", "ftp://collector", "http://", "http://a b", "http://a?b", "on"])
def test_another_endpoint_than_a_url_is_refused(url: str) -> None:
    with pytest.raises(ValidationError, match="is not a URL such as"):
        Settings(otlp_endpoint=url)


def test_without_opentelemetry_the_setting_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "opentelemetry.exporter.otlp.proto.http.trace_exporter", None)
    sentence = r"^Traces need OpenTelemetry's SDK and its OTLP exporter: pip install 'outdoor-lighting\[all\]'\.$"
    with pytest.raises(MissingExtraError, match=sentence):
        create_app(Settings(otlp_endpoint="http://127.0.0.1:9"))


def test_nothing_of_it_is_imported_while_it_is_off() -> None:
    code = "import sys; from server.app import create_app; create_app()\nprint(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "server.tracing" in done.stdout.split()
    assert not any(name.startswith(("opentelemetry.sdk", "opentelemetry.exporter")) for name in done.stdout.split())

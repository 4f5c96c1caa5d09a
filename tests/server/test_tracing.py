"""Traces of requests, as a collector gets them by OTLP."""

import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from opentelemetry.proto.collector.trace.v1 import trace_service_pb2 as trace_service
from pydantic import ValidationError
from starlette.testclient import TestClient

from lighting.errors import MissingExtraError
from lighting.estimator import Estimator
from server.app import create_app
from server.settings import Settings
from server.tracing import RequestTracer
from tests.server.conftest import SKY, client_of, pack, wait

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
        client.get("/readyz")
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


@pytest.mark.slow
def test_a_job_has_its_steps_in_the_trace_of_who_submitted_it(
    estimator: Estimator, network: Path, collector: Collector, tmp_path: Path, jpeg: bytes
) -> None:
    settings = {"otlp_endpoint": collector.url, "jobs_folder": tmp_path, "model": network}
    headers = {"traceparent": f"00-{TRACE}-{PARENT}-01", "tracestate": "vendor=1"}
    upload = {"file": ("p.zip", pack(**{"secret.jpg": jpeg, "b.jpg": b"no photo"}))}
    with client_of(estimator, **settings) as client:
        answer = client.post("/v1/jobs?kind=photos&envmap=true&height=16", files=upload, headers=headers)
        assert wait(client, answer.headers["location"])["state"] == "finished"
    (request,), (job,) = collector.find("POST /v1/jobs"), collector.find("job photos")
    assert (request.trace_id.hex(), request.parent_span_id.hex()) == (TRACE, PARENT)
    assert (job.trace_id, job.parent_span_id, job.kind) == (request.trace_id, request.span_id, 5)
    assert job.trace_state == "vendor=1"
    told = attributes(job)
    assert (told["job.kind"], told["job.state"], told["job.decode.count"]) == ("photos", "finished", 2)
    assert 0 <= told["job.waited"] < 60
    steps = [span for span in collector.spans if span.parent_span_id == job.span_id]
    assert Counter(span.name for span in steps) == {"decode": 2, "network": 1, "map": 2, "encode": 2}
    assert [attributes(span) for span in steps if span.status.code] == [{"error.type": "PhotoError"}]
    for span in steps:
        assert job.start_time_unix_nano <= span.start_time_unix_nano <= span.end_time_unix_nano
        assert span.end_time_unix_nano <= job.end_time_unix_nano
        assert span.trace_id == request.trace_id
    told_bytes = b"".join(span.SerializeToString() for span in collector.spans)
    assert not any(word in told_bytes for word in (b"secret", answer.json()["id"].encode()))


def test_a_job_that_fails_says_the_code(estimator: Estimator, collector: Collector, tmp_path: Path) -> None:
    with client_of(estimator, otlp_endpoint=collector.url, jobs_folder=tmp_path) as client:
        answer = client.post("/v1/jobs?kind=photos", files={"file": ("p.zip", b"no ZIP")})
        assert wait(client, answer.headers["location"])["state"] == "failed"
    (job,) = collector.find("job photos")
    assert (job.status.code, attributes(job)["error.type"], attributes(job)["job.state"]) == (2, "unreadable", "failed")


@pytest.mark.parametrize(
    "told", [None, [], ["decode"], ["rm", 1, 2, ""], ["map", "1", 2, ""], ["map", 1.5, 2, ""], {"name": "map"}]
)
def test_what_is_no_step_is_left_out(collector: Collector, told: object) -> None:
    tracer = RequestTracer(collector.url)
    span = tracer.begin_job("video", 0.0, {"traceparent": "nonsense"})
    span.add_step(told)
    span.add_step(["map", -5, 1 << 70, "no class!"])
    span.end("finished")
    tracer.close()
    step, job = collector.spans
    assert (step.name, step.parent_span_id, len(step.attributes)) == ("map", job.span_id, 0)
    assert job.start_time_unix_nano <= step.start_time_unix_nano <= step.end_time_unix_nano <= job.end_time_unix_nano


def test_spans_of_a_long_jobs_steps_are_bounded(collector: Collector) -> None:
    tracer = RequestTracer(collector.url)
    span = tracer.begin_job("video", 0.0, {})
    for _ in range(1000):
        span.add_step(["decode", time.time_ns(), time.time_ns(), ""])
    span.end("finished")
    tracer.close()
    assert len(collector.find("decode")) == 100
    assert attributes(collector.find("job video")[0])["job.decode.count"] == 1000


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

"""Traces of requests and jobs by OpenTelemetry: off, and none of its SDK imported, unless a setting names a collector.

FastAPI gives each request a span, which continues the trace of the header `traceparent`. The steps of its work have
spans in it. A job at work has a span within the request that submitted it, though that is over. No span holds a query,
a path, a file's name or an error's sentence. OpenTelemetry's own variables, OTEL_..., set sampling, limits and the
exporter's headers.

References:
    W3C Trace Context. OpenTelemetry, semantic conventions for HTTP spans.
"""

import time
from collections import Counter
from collections.abc import Callable, Mapping, MutableMapping
from contextlib import AbstractContextManager
from threading import Thread
from typing import TYPE_CHECKING, Any

from fastapi.telemetry import TelemetryConfig

from lighting.errors import require_extra
from lighting.tracing import STEP_NAMES, Step, listen_to_steps
from lighting.version import __version__

if TYPE_CHECKING:
    from opentelemetry.context import Context
    from opentelemetry.sdk.trace import Span, SpanProcessor
    from opentelemetry.trace import Tracer
    from opentelemetry.util.types import AnyValue

_SERVICE_NAME = "outdoor-lighting"  # unless OTEL_SERVICE_NAME or OTEL_RESOURCE_ATTRIBUTES name another
NO_TELEMETRY: TelemetryConfig = {"tracing": False, "metrics": False, "logs": False, "auto_configure": False}

_EXTRA = ("Traces need OpenTelemetry's SDK and its OTLP exporter", "all")
_TRACES_PATH = "/v1/traces"  # of a collector
_CLOSE_SECONDS = 2.0  # for the last spans, where the collector does not answer
_PRIVATE = ("url.path", "url.query", "http.request.method_original")  # attributes; `http.route` has the path's template

_MAX_SPANS = 100  # of a job's steps of one name; its own span counts all
_MAX_ERROR = 64  # letters of the name of an error's class


class RequestTracer:
    """Sends the spans of requests to a collector, in batches from a thread of its own.

    Args:
        endpoint: URL of the collector, for OTLP over HTTP; spans go to its /v1/traces.

    Raises:
        MissingExtraError: OpenTelemetry is not installed.
    """

    def __init__(self, endpoint: str) -> None:
        exporter = require_extra("opentelemetry.exporter.otlp.proto.http.trace_exporter", *_EXTRA)
        resources = require_extra("opentelemetry.sdk.resources", *_EXTRA)
        sdk = require_extra("opentelemetry.sdk.trace", *_EXTRA)
        batches = require_extra("opentelemetry.sdk.trace.export", *_EXTRA)
        ours = resources.Resource.create({"service.name": _SERVICE_NAME, "service.version": __version__})
        resource = ours.merge(resources.OTELResourceDetector().detect())  # which has precedence
        url = endpoint.rstrip("/").removesuffix(_TRACES_PATH) + _TRACES_PATH
        self._exporter: Any = exporter.OTLPSpanExporter(endpoint=url)
        self._provider: Any = sdk.TracerProvider(resource=resource, shutdown_on_exit=False)
        self._provider.add_span_processor(_make_redactor())
        self._provider.add_span_processor(batches.BatchSpanProcessor(self._exporter))
        self._tracer: Tracer = self._provider.get_tracer("server", __version__)

    def telemetry(self, exclude: Callable[[MutableMapping[str, Any]], bool]) -> TelemetryConfig:
        """How FastAPI traces requests; it counts and logs none.

        Args:
            exclude: tells by the ASGI scope which requests have no span.
        """
        tracing: TelemetryConfig = {"tracing": True, "tracer_provider": self._provider, "operation_spans": False}
        return {**NO_TELEMETRY, **tracing, "exclude": exclude}

    def trace_steps(self) -> AbstractContextManager[None]:
        """Have the steps of the block traced within the request's span."""
        return listen_to_steps(lambda step: _send_step(self._tracer, step))

    def current_context(self) -> dict[str, str]:
        """Return the request's place in its trace, as the headers `traceparent` and `tracestate`."""
        from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

        headers: dict[str, str] = {}
        TraceContextTextMapPropagator().inject(headers)
        return headers

    def begin_job(self, kind: str, waited: float, submitter: Mapping[str, str]) -> "JobSpan":
        """Begin the span of a job.

        Args:
            kind: one of JOB_KINDS.
            waited: s, for its turn.
            submitter: `current_context` of the request that submitted it; empty: it begins a trace.
        """
        return JobSpan(self._tracer, kind, waited, submitter)

    def close(self) -> None:
        """Send what is left, if the collector answers, and end the thread."""
        closing = Thread(target=self._provider.shutdown, daemon=True)
        closing.start()
        closing.join(_CLOSE_SECONDS)
        if closing.is_alive():
            self._exporter.shutdown()
            closing.join(_CLOSE_SECONDS)


class JobSpan:
    """The span of a job at work. It has spans of the first steps of each name, and the count and time of all.

    Args:
        tracer: makes the spans.
        kind: one of JOB_KINDS.
        waited: s, for its turn.
        submitter: the headers of the request that submitted it.
    """

    def __init__(self, tracer: "Tracer", kind: str, waited: float, submitter: Mapping[str, str]) -> None:
        from opentelemetry.trace import SpanKind, set_span_in_context
        from opentelemetry.trace.propagation.tracecontext import TraceContextTextMapPropagator

        self._tracer, self._began = tracer, time.time_ns()
        self._counts = Counter[str]()
        self._seconds = dict.fromkeys(STEP_NAMES, 0.0)
        parent = TraceContextTextMapPropagator().extract(submitter)
        attributes: dict[str, AnyValue] = {"job.kind": kind, "job.waited": waited}
        self._span = tracer.start_span(f"job {kind}", parent, SpanKind.CONSUMER, attributes, start_time=self._began)
        self._context: Context = set_span_in_context(self._span)

    def add_step(self, told: object) -> None:
        """Trace a step within the job.

        Args:
            told: the fields of a Step, as the job's process says them; what is none is left out.
        """
        if (step := self._check_step(told)) is None:
            return
        self._counts[step.name] += 1
        self._seconds[step.name] += (step.end - step.start) / 1e9
        if self._counts[step.name] <= _MAX_SPANS:
            _send_step(self._tracer, step, self._context)

    def end(self, state: str, error: str = "") -> None:
        """End the span.

        Args:
            state: that the job is in now.
            error: the code of the error that it failed with; empty if it did not.
        """
        from opentelemetry.trace import StatusCode

        self._span.set_attribute("job.state", state)
        for name, count in self._counts.items():
            self._span.set_attributes({f"job.{name}.count": count, f"job.{name}.seconds": self._seconds[name]})
        if error:
            self._span.set_attribute("error.type", error)
            self._span.set_status(StatusCode.ERROR)
        self._span.end()

    def _check_step(self, told: object) -> Step | None:
        """The step that a process tells of, within the job's time; None for another thing."""
        match told:
            case [str(name), int(start), int(end), str(error)] if name in STEP_NAMES:
                now = time.time_ns()
                start, end = (min(max(moment, self._began), now) for moment in (start, end))
                is_class = error.isidentifier() and len(error) <= _MAX_ERROR
                return Step(name, start, max(start, end), error if is_class else "")
        return None


def _send_step(tracer: "Tracer", step: Step, context: "Context | None" = None) -> None:
    """Make the span of a step, within the current one or that of a context. Of an error it says the class alone."""
    from opentelemetry.trace import StatusCode

    span = tracer.start_span(step.name, context, start_time=step.start)
    if step.error:
        span.set_attribute("error.type", step.error)
        span.set_status(StatusCode.ERROR)
    span.end(step.end)


def _make_redactor() -> "SpanProcessor":
    """What takes _PRIVATE out of spans, as they start."""
    from opentelemetry.sdk.trace import SpanProcessor

    class Redactor(SpanProcessor):
        def on_start(self, span: "Span", parent_context: Any = None) -> None:  # noqa: ARG002
            span.set_attributes({name: "REDACTED" for name in _PRIVATE if name in (span.attributes or {})})

    return Redactor()

"""Traces of requests by OpenTelemetry: off, and none of its SDK imported, unless a setting names a collector.

FastAPI gives each request a span, which continues the trace of the header `traceparent`. The steps of its work have
spans in it. No span holds a query, a path, a file's name or an error's sentence. OpenTelemetry's own variables,
OTEL_..., set sampling, limits and the exporter's headers.

References:
    W3C Trace Context. OpenTelemetry, semantic conventions for HTTP spans.
"""

from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Thread
from typing import TYPE_CHECKING, Any

from fastapi.telemetry import TelemetryConfig

from lighting.errors import require_extra
from lighting.version import __version__

if TYPE_CHECKING:
    from opentelemetry.sdk.trace import Span, SpanProcessor
    from opentelemetry.trace import Tracer

SERVICE_NAME = "outdoor-lighting"  # unless OTEL_SERVICE_NAME or OTEL_RESOURCE_ATTRIBUTES name another
NO_TELEMETRY: TelemetryConfig = {"tracing": False, "metrics": False, "logs": False, "auto_configure": False}

_EXTRA = ("Traces need OpenTelemetry's SDK and its OTLP exporter", "all")
_TRACES_PATH = "/v1/traces"  # of a collector
_CLOSE_SECONDS = 2.0  # for the last spans, where the collector does not answer
_PRIVATE = ("url.path", "url.query", "http.request.method_original")  # attributes; `http.route` has the path's template

_TRACER: ContextVar["Tracer | None"] = ContextVar("tracer", default=None)  # of the work of a request


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
        ours = resources.Resource.create({"service.name": SERVICE_NAME, "service.version": __version__})
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

    @contextmanager
    def trace_steps(self) -> Iterator[None]:
        """Have `trace_step` trace, until the end of the block, within the request's span."""
        token = _TRACER.set(self._tracer)
        try:
            yield
        finally:
            _TRACER.reset(token)

    def close(self) -> None:
        """Send what is left, if the collector answers, and end the thread."""
        closing = Thread(target=self._provider.shutdown, daemon=True)
        closing.start()
        closing.join(_CLOSE_SECONDS)
        self._exporter.shutdown()
        closing.join(_CLOSE_SECONDS)


@contextmanager
def trace_step(name: str) -> Iterator[None]:
    """Trace what is done until the end of the block as a step of a request's work, where requests are traced.

    Of an error the span says the class alone.

    Args:
        name: `decode`, `network`, `map` or `encode`.
    """
    if (tracer := _TRACER.get()) is None:
        yield
        return
    from opentelemetry.trace import StatusCode

    with tracer.start_as_current_span(name, record_exception=False, set_status_on_exception=False) as span:
        try:
            yield
        except BaseException as error:
            span.set_attribute("error.type", type(error).__name__)
            span.set_status(StatusCode.ERROR)
            raise


def _make_redactor() -> "SpanProcessor":
    """What takes _PRIVATE out of spans, as they start."""
    from opentelemetry.sdk.trace import SpanProcessor

    class Redactor(SpanProcessor):
        def on_start(self, span: "Span", parent_context: Any = None) -> None:  # noqa: ARG002
            span.set_attributes({name: "REDACTED" for name in _PRIVATE if name in (span.attributes or {})})

    return Redactor()

"""Prometheus metrics; each app has its own registry."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

from server.limits import ConnectionLimiter, PendingResponses, UploadLimiter
from server.scheduling import WorkLimiter

LATENCY_BUCKETS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)  # upper ends of the histograms' buckets


class Metrics:
    """The metrics of one app; routes are labeled by template, so that labels stay few."""

    def __init__(
        self,
        limiter: WorkLimiter,
        uploads: UploadLimiter,
        pending: PendingResponses,
        connections: ConnectionLimiter,
    ) -> None:
        self.registry = registry = CollectorRegistry()
        self.requests = Counter(
            "lighting_requests", "Requests answered.", ["method", "route", "status"], registry=registry
        )
        self.latency = Histogram(
            "lighting_request_seconds",
            "Time from a request's first byte to its answer's last.",
            ["route"],
            buckets=LATENCY_BUCKETS,
            registry=registry,
        )
        self.inference = Histogram(
            "lighting_inference_seconds",
            "Time to estimate the light of one request's photos.",
            buckets=LATENCY_BUCKETS,
            registry=registry,
        )
        self.photo_bytes = Counter("lighting_photo_bytes", "Bytes of photos read.", registry=registry)
        self.photo_pixels = Counter("lighting_photo_pixels", "Pixels of photos read.", registry=registry)
        self.model = Gauge("lighting_model_info", "The network that answers.", ["name", "version"], registry=registry)
        self._gauge("lighting_uploads", "Bodies that are arriving.", lambda: uploads.count)
        self._gauge("lighting_queue_depth", "Requests that wait.", lambda: limiter.waiting)
        self._gauge("lighting_running", "Requests that are running.", lambda: limiter.running)
        self._gauge("lighting_unsent_bytes", "Bytes of answers that wait for their clients.", lambda: pending.size)
        self._gauge("lighting_connections", "Open connections.", lambda: connections.count)

    def _gauge(self, name: str, meaning: str, value: Callable[[], int]) -> None:
        Gauge(name, meaning, registry=self.registry).set_function(value)

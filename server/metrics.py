"""Counters for Prometheus, in a registry of each app's own."""

from collections.abc import Callable

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram

from server.limiter import Limiter

SECONDS = (0.005, 0.01, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)


class Metrics:
    """What the service counts; routes are labelled by template, so that labels stay few."""

    def __init__(self, limiter: Limiter) -> None:
        self.registry = registry = CollectorRegistry()
        self.requests = Counter(
            "lighting_requests", "Requests answered.", ["method", "route", "status"], registry=registry
        )
        self.latency = Histogram(
            "lighting_request_seconds", "From first byte to last.", ["route"], buckets=SECONDS, registry=registry
        )
        self.inference = Histogram(
            "lighting_inference_seconds",
            "The network and the metadata, on the photos of one request.",
            buckets=SECONDS,
            registry=registry,
        )
        self.photo_bytes = Counter("lighting_photo_bytes", "Bytes of photos read.", registry=registry)
        self.photo_pixels = Counter("lighting_photo_pixels", "Pixels of photos read.", registry=registry)
        self.model = Gauge("lighting_model_info", "The network that answers.", ["name", "version"], registry=registry)
        self._gauge("lighting_queue_depth", "Requests admitted that wait or upload.", lambda: limiter.waiting)
        self._gauge("lighting_running", "Requests worked on.", lambda: limiter.running)

    def _gauge(self, name: str, meaning: str, value: Callable[[], int]) -> None:
        Gauge(name, meaning, registry=self.registry).set_function(value)

"""FastAPI dependencies: service, admission, matching; and the Prometheus metrics of an app, in its own registry."""

import logging
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, TypeVar

import numpy as np
from anyio import from_thread
from anyio.from_thread import check_cancelled
from fastapi import Depends, Request
from fastapi.security import HTTPAuthorizationCredentials, HTTPBearer
from fastapi.security.utils import get_authorization_scheme_param
from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram
from starlette.datastructures import Headers
from starlette.types import Scope

from lighting.checksum import verify_checksums
from lighting.errors import CodedWarning, LightingError, MissingExtraError, WarningCode
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.model import Model
from lighting.photo.reader import TARGET, Photo
from lighting.photo.sandbox import read_photo_isolated, start_decoder_pool
from lighting.photo_estimate import Estimate
from lighting.records import Lighting
from lighting.registration import features, photo_set
from lighting.tracing import trace_step
from server import problems
from server.job_store import JobStore
from server.jobs import JobRunner
from server.limits import (
    ApiKeys,
    Client,
    ConnectionLimiter,
    PendingResponses,
    RateLimiter,
    UploadLimiter,
    client_of_address,
    client_of_key,
    client_of_request,
    count_possible_connections,
)
from server.problems import ProblemError
from server.request_body import JSON_TYPE, RequestBody, Upload, announced_size, media_type, parse_record
from server.scheduling import WorkLimiter
from server.settings import Settings
from server.tracing import RequestTracer

_LATENCIES = (0.005, 0.01, 0.025, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)  # upper ends of the histograms' buckets


class ServiceMetrics:
    """The metrics of one app; routes are labeled by template, so that labels stay few."""

    def __init__(
        self, limiter: WorkLimiter, uploads: UploadLimiter, pending: PendingResponses, connections: ConnectionLimiter
    ) -> None:
        self.registry = registry = CollectorRegistry()
        counter = partial(Counter, registry=registry)
        histogram = partial(Histogram, buckets=_LATENCIES, registry=registry)
        self.requests = counter("lighting_requests", "Requests answered.", ["method", "route", "status"])
        meaning = "Time from a request's first byte to its answer's last."
        self.latency = histogram("lighting_request_seconds", meaning, ["route"])
        self.inference = histogram("lighting_inference_seconds", "Time to estimate the light of one request's photos.")
        self.photo_bytes = counter("lighting_photo_bytes", "Bytes of photos read.")
        self.photo_pixels = counter("lighting_photo_pixels", "Pixels of photos read.")
        self.model = Gauge("lighting_model_info", "The network that answers.", ["name", "version"], registry=registry)
        self._gauge("lighting_uploads", "Bodies that are arriving.", lambda: uploads.count)
        self._gauge("lighting_queue_depth", "Requests that wait.", lambda: limiter.waiting)
        self._gauge("lighting_running", "Requests that are running.", lambda: limiter.running)
        self._gauge("lighting_unsent_bytes", "Bytes of answers that wait for their clients.", lambda: pending.size)
        self._gauge("lighting_connections", "Open connections.", lambda: connections.count)

    def _gauge(self, name: str, meaning: str, value: Callable[[], int]) -> None:
        Gauge(name, meaning, registry=self.registry).set_function(value)


_T = TypeVar("_T")

NO_OPENCV = "The service lacks OpenCV to match photos."
ROTATION_INFERRED = "Compasses or light say where each points."

log = logging.getLogger(__name__)


@dataclass
class PhotoMatcher:
    """Registers the photos of one request with each other, in a process of their own."""

    seconds: float  # time limit
    failure: str = ""  # why they were not registered

    @property
    def target(self) -> int:
        """Pixels along the longer side that the photos should have."""
        return features.MATCH_SIDE if features.has_opencv() else TARGET

    def __call__(self, views: Sequence[photo_set.View]) -> Sequence[photo_set.RegisteredView] | None:
        """The registered views; None if that failed. Stops with its request when the client disconnects."""
        try:
            if features.has_opencv():
                return photo_set.register_views_isolated(views, self.seconds, check_cancelled)
            self.failure = NO_OPENCV
        except MissingExtraError:
            self.failure = NO_OPENCV
        except LightingError as error:
            self.failure = str(error)
        return None

    def add_warnings(self, estimates: list[Estimate]) -> list[Estimate]:
        """The estimates, each with a warning if the photos were not registered."""
        if not self.failure:
            return estimates
        warning = CodedWarning(f"{self.failure} {ROTATION_INFERRED}", WarningCode.TURN_INFERRED)
        warned = [replace(e.lighting, warnings=(*e.lighting.warnings, warning)) for e in estimates]
        return [replace(e, lighting=one, photo_lighting=one) for e, one in zip(estimates, warned, strict=True)]


class Service:
    """The state of one app: settings, network, limits, keys and metrics."""

    def __init__(self, settings: Settings, estimator: Estimator | None = None) -> None:
        self.settings = settings
        self.keys = ApiKeys(settings.all_keys())
        self.rate_limiter = RateLimiter(settings.rate_limit)
        self.cpu_limiter = RateLimiter(settings.cpu_limit)
        self.limiter = WorkLimiter(
            settings.workers,
            settings.queue,
            self.cpu_limiter.charge,
            max_bytes=settings.max_bytes,
            short=["POST /v1/lighting"],
        )
        self.uploads = UploadLimiter(settings.uploads, settings.uploads_per_client)
        self.pending = PendingResponses(settings.unsent_bytes)
        possible = count_possible_connections(settings.workers)
        self.connections = ConnectionLimiter(min(settings.connections, possible), settings.connections_per_client)
        self.metrics = ServiceMetrics(self.limiter, self.uploads, self.pending, self.connections)
        self.tracer = RequestTracer(settings.otlp_endpoint) if settings.otlp_endpoint else None
        self.jobs: JobRunner | None = None
        self.ready = False
        self.ending = False  # whether the process was told to end: answers are the last of their connections
        self.loaded_estimator = estimator

    def load(self) -> None:
        """Load the network and start a decoder per worker, unless the app got an estimator.

        Raises:
            ModelError: the network cannot be loaded, or a file of the package is damaged.
            PhotoError: no decoder starts.
            SettingsError: the folder of jobs cannot be used.
        """
        if self.settings.jobs_folder and self.jobs is None:
            store = JobStore(self.settings.jobs_folder, self.settings.jobs)
            limits = self.settings.job_bytes, self.settings.job_seconds
            self.jobs = JobRunner(store, *limits, self.limiter.usage.load, self._charge_job, self.tracer)
        if self.loaded_estimator is None:
            verify_checksums()
            self.loaded_estimator = Estimator(Model.load(self.settings.model, self.settings.threads))
            start_decoder_pool(self.settings.workers)

    def _charge_job(self, client: Client, seconds: float) -> None:
        self.limiter.usage.add(client, seconds)
        self.cpu_limiter.charge(client, seconds)

    def warm_up(self) -> None:
        """Estimate the light of a gray image; the service is ready afterwards."""
        gray = np.full((64, 96, 3), 128, dtype=np.uint8)
        self.estimator(Photo(gray, 96, 64, "JPEG"))
        self.metrics.model.labels(self.estimator.model.spec.name, self.estimator.model.spec.version).set(1)
        self.ready = True
        log.info("ready: network %s, %d at once", self.model_name, self.settings.workers)

    @property
    def estimator(self) -> Estimator:
        """The loaded estimator; raises ProblemError (503) before it is loaded."""
        if self.loaded_estimator is None:
            raise ProblemError(problems.NOT_READY)
        return self.loaded_estimator

    @property
    def model_name(self) -> str:
        """Name and version of the network, for the header; empty before it is loaded."""
        spec = self.loaded_estimator.model.spec if self.loaded_estimator else None
        return f"{spec.name} {spec.version}" if spec else ""

    def find_fault(self) -> ProblemError | None:
        """Why a new client's photo would be refused with 503, or a job wait in vain; None if all is well."""
        if not self.ready:
            return ProblemError(problems.NOT_READY, "The network has not answered yet.")
        if self.ending:
            return ProblemError(problems.BUSY, "The service shuts down.")
        if self.limiter.full:
            return ProblemError(problems.BUSY)
        if self.jobs and (fault := self.jobs.fault):
            return ProblemError(problems.BUSY, f"Jobs stand still: {fault}.")
        return None

    def identify_client(self, scope: Scope) -> Client:
        """Who asks: the holder of an API key of the service, else an address.

        Args:
            scope: of an HTTP request; its client is the one that a trusted proxy names.
        """
        scheme, key = get_authorization_scheme_param(Headers(scope=scope).get("authorization"))
        if self.keys and scheme.lower() == "bearer" and (number := self.keys.find(key)) is not None:
            return client_of_key(number)
        return client_of_address((scope.get("client") or ("",))[0])

    def refuses_connection(self, host: str) -> bool:
        """Whether an address gets no further connection; a proxy always does.

        Args:
            host: an IP address.
        """
        return not self.settings.is_trusted_proxy(host) and self.connections.refuses(client_of_address(host))

    def read_photo(self, data: bytes, seconds: float | None = None, target: int = TARGET) -> Photo:
        """Decode an upload and count it; raises PhotoError.

        Args:
            data: the bytes of an image file.
            seconds: time limit; None is that of a request.
            target: pixels along the longer side, at least, if the photo has them.
        """
        photo = read_photo_isolated(
            data,
            max_bytes=self.settings.max_bytes,
            max_pixels=self.settings.max_pixels,
            target=target,
            seconds=self.settings.decode_seconds if seconds is None else seconds,
        )
        self.metrics.photo_bytes.inc(len(data))
        self.metrics.photo_pixels.inc(photo.width * photo.height)
        return photo

    def estimate(
        self,
        photos: Sequence[Photo],
        user_input: UserInput,
        headings: Sequence[float] | None = None,
        matcher: PhotoMatcher | None = None,
    ) -> list[Estimate]:
        """Estimate the light of photos of one place and light; raises ParameterError.

        Args:
            photos: one or more.
            user_input: what the client states.
            headings: deg clockwise from any common direction, one a photo; None if unknown.
            matcher: registers the photos; None leaves that out.
        """
        with self.metrics.inference.time(), trace_step("network"):
            estimates = self.estimator.estimate_views(photos, user_input, headings, register=matcher or False)
        return matcher.add_warnings(estimates) if matcher else estimates


class Admission:
    """A request that there is room for; it occupies a worker only once its body has arrived."""

    def __init__(self, request: Request, service: Service) -> None:
        limits = service.settings
        self.request = request
        self.service = service
        self.body = RequestBody(
            request, limits.max_bytes, limits.upload_seconds, limits.upload_rate, service.uploads.count_upload
        )

    async def run(self, work: Callable[..., _T], *arguments: Any) -> _T:
        """The result of work in a thread, as soon as one is free; it is dropped when the client disconnects.

        Raises ProblemError (429 or 503) if the queue has filled meanwhile, or too many bytes wait for clients.
        """
        client = client_of_request(self.request)

        def checked() -> _T:
            from_thread.run_sync(self.service.pending.check, client)
            with self.service.tracer.trace_steps() if self.service.tracer else nullcontext():
                return work(*arguments)

        with self.service.limiter.admission(client, _route(self.request), self.body.size) as job:
            return await self.service.limiter.run(job, self.request.receive, checked)


def _route(request: Request) -> str:
    """The method and the template of the path of a request, by which its work is expected to be long or short."""
    return f"{request.method} {getattr(request.scope.get('route'), 'path', '')}"


async def _get_service(request: Request) -> Service:  # not in FastAPI's threads, which would wait for one another
    service: Service = request.app.state.service
    return service


ServiceDep = Annotated[Service, Depends(_get_service)]


async def _admit(request: Request, service: ServiceDep) -> Admission:
    """Admit a request before its body is read; raises ProblemError (429 or 503) if there is no room."""
    client = client_of_request(request)
    service.limiter.check(client, _route(request), announced_size(request))
    service.pending.check(client)
    return Admission(request, service)


AdmissionDep = Annotated[Admission, Depends(_admit)]


async def _read_photo_bytes(request: AdmissionDep) -> bytes:
    """The photo that a request brings; raises ProblemError."""
    return await request.body.photo()


PhotoDep = Annotated[bytes, Depends(_read_photo_bytes)]


async def _read_photo_or_record(request: AdmissionDep) -> bytes | Lighting:
    """The photo that a request brings, or the lighting of a JSON record; raises ProblemError."""
    if media_type(request.request) == JSON_TYPE:
        return parse_record(await request.body.record())
    return await request.body.photo(JSON_TYPE)


PhotoOrLightingDep = Annotated[bytes | Lighting, Depends(_read_photo_or_record)]


async def _read_uploads(request: AdmissionDep) -> list[Upload]:
    """The photos of one place that a request brings; raises ProblemError."""
    return await request.body.photos(request.service.settings.max_photos)


UploadsDep = Annotated[list[Upload], Depends(_read_uploads)]


_bearer = HTTPBearer(auto_error=False, description="One of the service's API keys")

_Credentials = Annotated[HTTPAuthorizationCredentials | None, Depends(_bearer)]


async def require_api_key(request: Request, credentials: _Credentials) -> None:
    """Refuse a request without a valid API key.

    Args:
        request: its app holds the service with the valid keys.
        credentials: the bearer token; None if there is none.

    Raises:
        ProblemError: 401 without a key, 403 with a wrong one.
    """
    challenge = {"WWW-Authenticate": "Bearer"}
    if credentials is None or not credentials.credentials:
        raise ProblemError(problems.UNAUTHORIZED, headers=challenge)
    if request.app.state.service.keys.find(credentials.credentials) is None:
        raise ProblemError(problems.FORBIDDEN, headers=challenge)


async def enforce_rate_limit(request: Request) -> None:
    """Refuse a request that exceeds its client's limits in requests or processor time.

    Args:
        request: its app holds the service with the limits.

    Raises:
        ProblemError: 429, with the seconds to wait.
    """
    service, client = request.app.state.service, client_of_request(request)
    wait = service.cpu_limiter.seconds_to_wait(client) or service.rate_limiter.seconds_to_wait(client)
    if wait:
        detail = f"The rate limit is reached; wait {wait} s."
        raise ProblemError(problems.TOO_MANY_REQUESTS, detail, {"Retry-After": str(wait)})
    service.rate_limiter.charge(client, 1.0)

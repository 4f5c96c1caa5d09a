"""FastAPI dependencies: service, admission, matching."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from anyio import from_thread
from anyio.from_thread import check_cancelled
from fastapi import Depends, Request

from lighting.envmap.latlong import Image
from lighting.errors import LightingError, MissingExtraError, PhotoError, PhotoExtraError
from lighting.estimator import Estimator
from lighting.fusion.user_input import UserInput
from lighting.model import Model, packaged_model
from lighting.photo.reader import TARGET, Photo
from lighting.photo.sandbox import read_photo_isolated, start_decoder_pool
from lighting.records import CodedWarning, Estimate, WarningCode
from lighting.registration import features, photo_set
from server import problems
from server.auth import Keys, Rate, client_name
from server.limits import BusyError, Limiter, PendingResponses, UploadLimiter
from server.metrics import Metrics
from server.problems import ProblemError
from server.request_body import Body, Limits, Upload
from server.settings import Settings

# Several photos of a request matched with each other, in a process of their own; or why they were not.

NO_OPENCV = "The photos were not matched with each other, because the service has no OpenCV."
INFERRED = "How they are turned is inferred from their compasses, if all have one, or from their light alone."


@dataclass
class Matching:
    """Finds where a request's photos look, as `Estimator.together` asks for it; `failure` says why it did not."""

    seconds: float  # that it may take
    failure: str = ""

    @property
    def target(self) -> int:
        """Pixels along the longer side in which it wants its photos."""
        return features.MAX_SIDE if features.has_opencv() else TARGET

    def __call__(self, views: Sequence[photo_set.View]) -> Sequence[photo_set.RegisteredView] | None:
        """Where they look; None where that was not found. It ends with the request if the client goes away."""
        if not features.has_opencv():
            self.failure = NO_OPENCV
            return None
        try:
            return photo_set.register_views_isolated(views, self.seconds, check_cancelled)
        except MissingExtraError:
            self.failure = NO_OPENCV
            return None
        except LightingError as error:
            self.failure = str(error)
            return None

    def explained(self, estimates: list[Estimate]) -> list[Estimate]:
        """The estimates, with a warning each where the photos were not matched."""
        if not self.failure:
            return estimates
        warning = CodedWarning(f"{self.failure} {INFERRED}", WarningCode.TURN_INFERRED)
        return [_warned(estimate, warning) for estimate in estimates]


def _warned(estimate: Estimate, warning: CodedWarning) -> Estimate:
    lighting = estimate.lighting
    return replace(estimate, lighting=replace(lighting, warnings=(*lighting.warnings, warning)))


# What the requests of one app share, and the admission of one of them.

T = TypeVar("T")

NO_HEIC = "The service does not read HEIC; send the photo as JPEG."  # the one kind that needs more than Pillow

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PhotoAnswer:
    """An estimate, and what the place makes of the cells (R, 2R, 3) of its bare map where that was asked for."""

    estimate: Estimate
    factors: Image | None = None


class Service:
    """Settings, the network, the limit on CPU work, keys and counters."""

    def __init__(self, settings: Settings, estimator: Estimator | None = None) -> None:
        self.settings = settings
        self.limiter = Limiter(settings.places, settings.queue)
        self.arrivals = UploadLimiter(settings.uploads, settings.uploads_per_client)
        self.unsent = PendingResponses(settings.unsent_bytes)
        self.metrics = Metrics(self.limiter, self.arrivals, self.unsent)
        self.keys = Keys(settings.all_keys())
        self.rate = Rate(settings.rate_limits)
        self.ready = False
        self.loaded = estimator

    def load(self) -> None:
        """Load the network and start a decoder per place, unless the app was given a network.

        Raises ModelError, and PhotoError where no decoder starts.
        """
        if self.loaded is None:
            self.loaded = Estimator(Model.load(self.settings.model, self.settings.threads))
            start_decoder_pool(self.settings.places)

    def answer_once(self) -> None:
        """Estimate the light of a grey picture; from then on the service is ready."""
        grey = np.full((64, 96, 3), 128, dtype=np.uint8)
        self.estimator(Photo(grey, 96, 64, "JPEG"))
        self.metrics.model.labels(self.estimator.model.spec.name, self.estimator.model.spec.version).set(1)
        self.ready = True
        log.info("ready: network %s, %d at once", self.model_name, self.settings.places)

    @property
    def estimator(self) -> Estimator:
        if self.loaded is None:
            raise ProblemError(
                problems.NOT_READY, "The network is not loaded yet.", {"Retry-After": problems.RETRY_SECONDS}
            )
        return self.loaded

    @property
    def model_name(self) -> str:
        """Name and version, as answers carry them; empty while there is none."""
        spec = self.loaded.model.spec if self.loaded else None
        return f"{spec.name} {spec.version}" if spec else ""

    @property
    def model_folder(self) -> Path:
        return (self.settings.model or packaged_model()).parent

    @property
    def full(self) -> bool:
        """Whether the next photo would be refused."""
        return self.limiter.full or self.arrivals.full or self.unsent.full

    def read(self, data: bytes, seconds: float | None = None, target: int = TARGET) -> Photo:
        """The photo in an upload, by default within the time that a request has; raises PhotoError."""
        photo = self._decoded(data, target, seconds)
        self.metrics.photo_bytes.inc(len(data))
        self.metrics.photo_pixels.inc(photo.width * photo.height)
        return photo

    def read_finer(self, data: bytes, target: int) -> Photo:
        """The same photo in more pixels, `target` along its longer side if it has them, for people to look at."""
        return self._decoded(data, target)

    def _decoded(self, data: bytes, target: int, seconds: float | None = None) -> Photo:
        limits = self.settings
        seconds = limits.decode_seconds if seconds is None else seconds
        size = {"max_bytes": limits.max_bytes, "max_pixels": limits.max_pixels}
        try:
            return read_photo_isolated(data, **size, target=target, seconds=seconds)
        except PhotoExtraError as error:
            raise PhotoError(NO_HEIC) from error

    def estimate(
        self,
        photos: Sequence[Photo],
        given: UserInput,
        headings: Sequence[float] | None = None,
        matching: Matching | None = None,
    ) -> list[Estimate]:
        """What pixels, metadata and client say about photos of one place and light; raises ParameterError."""
        with self.metrics.inference.time():
            found = self.estimator.estimate_views(photos, given, headings, register=matching or False)
        return matching.explained(found) if matching else found


def _service_of(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


class _Admission:
    """A request that there is room for: it takes a place when its body has arrived and its work is asked for."""

    def __init__(self, request: Request, service: Service) -> None:
        limits = service.settings
        self.request = request
        self.service = service
        self.body = Body(
            request,
            Limits(limits.max_bytes, limits.upload_seconds, limits.upload_rate),
            lambda: service.arrivals.one_of(client_name(request)),
        )

    async def run(self, work: Callable[..., T], *arguments: Any) -> T:
        """What the work returns, done in a thread when its turn comes; dropped when the client goes away.

        Raises BusyError where the queue has filled while the body arrived, or too much waits for clients by then.
        """

        def checked() -> T:
            from_thread.run_sync(self.service.unsent.check)
            return work(*arguments)

        with self.service.limiter.admission():
            return await self.service.limiter.run(self.request.receive, checked)


Services = Annotated[Service, Depends(_service_of)]


async def _admitted(request: Request, service: Services) -> _Admission:
    """Admit a request; raises BusyError at once where the queue is full or too much waits, before the body is read."""
    if service.limiter.full:
        raise BusyError
    service.unsent.check()
    return _Admission(request, service)


Admitted = Annotated[_Admission, Depends(_admitted)]


async def _photo_bytes(request: Admitted) -> bytes:
    """The photo that a request brings; raises ProblemError."""
    return await request.body.photo()


PhotoBytes = Annotated[bytes, Depends(_photo_bytes)]


async def _uploads(request: Admitted) -> list[Upload]:
    """The photos of one place that a request brings; raises ProblemError."""
    return await request.body.photos(request.service.settings.max_photos)


Uploads = Annotated[list[Upload], Depends(_uploads)]

"""What the requests of one app share, and the admission of one of them."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
from anyio import from_thread
from fastapi import Depends, Request

from lighting.envmap import Image
from lighting.errors import PhotoError, PhotoExtraError
from lighting.evidence import Given
from lighting.model import Model, packaged_model
from lighting.photo import TARGET, Photo, read_apart, start_decoders
from lighting.pipeline import Estimator
from lighting.records import Estimate
from server import problems
from server.arrivals import Arrivals
from server.limiter import BusyError, Limiter
from server.matching import Matching
from server.metrics import Metrics
from server.problems import ProblemError
from server.security import Keys, Rate, client_name
from server.settings import Settings
from server.unsent import Unsent
from server.uploads import Body, Limits, Upload

T = TypeVar("T")

NO_HEIC = "The service does not read HEIC; send the photo as JPEG."  # the one kind that needs more than Pillow

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Answer:
    """An estimate, and what the place makes of the cells (R, 2R, 3) of its bare map where that was asked for."""

    estimate: Estimate
    factors: Image | None = None


class Service:
    """Settings, the network, the limit on CPU work, keys and counters."""

    def __init__(self, settings: Settings, estimator: Estimator | None = None) -> None:
        self.settings = settings
        self.limiter = Limiter(settings.places, settings.queue)
        self.arrivals = Arrivals(settings.uploads, settings.uploads_per_client)
        self.unsent = Unsent(settings.unsent_bytes)
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
            start_decoders(self.settings.places)

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
            return read_apart(data, **size, target=target, seconds=seconds)
        except PhotoExtraError as error:
            raise PhotoError(NO_HEIC) from error

    def estimate(
        self,
        photos: Sequence[Photo],
        given: Given,
        headings: Sequence[float] | None = None,
        matching: Matching | None = None,
    ) -> list[Estimate]:
        """What pixels, metadata and client say about photos of one place and light; raises ParameterError."""
        with self.metrics.inference.time():
            found = self.estimator.together(photos, given, headings, match=matching or False)
        return matching.explained(found) if matching else found


def service_of(request: Request) -> Service:
    service: Service = request.app.state.service
    return service


class Admission:
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


Services = Annotated[Service, Depends(service_of)]


async def admitted(request: Request, service: Services) -> Admission:
    """Admit a request; raises BusyError at once where the queue is full or too much waits, before the body is read."""
    if service.limiter.full:
        raise BusyError
    service.unsent.check()
    return Admission(request, service)


Admitted = Annotated[Admission, Depends(admitted)]


async def photo_bytes(request: Admitted) -> bytes:
    """The photo that a request brings; raises ProblemError."""
    return await request.body.photo()


PhotoBytes = Annotated[bytes, Depends(photo_bytes)]


async def uploads(request: Admitted) -> list[Upload]:
    """The photos of one place that a request brings; raises ProblemError."""
    return await request.body.photos(request.service.settings.max_photos)


Uploads = Annotated[list[Upload], Depends(uploads)]

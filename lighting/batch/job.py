"""What a batch does: its settings, one photo's light, and its summary."""

import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from lighting.batch.photo_search import PhotoTable, format_counts
from lighting.batch.results import SETTINGS
from lighting.errors import BatchError, ModelError, ParameterError, PhotoError, describe_error
from lighting.files import DEFAULT_FILE, FileOptions
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.map_options import DEFAULT_MAP, MapOptions
from lighting.runtime import ONE_BLAS_THREAD
from lighting.tracing import trace_step

if TYPE_CHECKING:
    from lighting.estimator import Estimator
    from lighting.photo_estimate import Estimate, RenderedMap
    from lighting.records import Lighting, LightProbe

DECODE_SECONDS = 60.0  # of a photo; more than the service's, since nobody waits and other work may slow the machine


@dataclass(frozen=True)
class MapOutput:
    """How a photo's map is rendered and written."""

    view: MapOptions = DEFAULT_MAP
    """Of the map."""
    file: FileOptions = DEFAULT_FILE
    """Of its file."""

    def file_name(self, photo: str) -> str:
        """Return the name of a photo's map: that of the photo with the format's suffix behind it.

        Args:
            photo: its name, in the batch's folder.
        """
        return f"{photo}.{self.file.format}"


@dataclass(frozen=True)
class BatchJob:
    """What is done with each photo."""

    source: str
    """The folder that the photos' names are relative to."""
    out: str
    """The folder of the results."""
    model: str | None = None
    """A network's file; the one in this package by default."""
    maps: MapOutput | None = None
    """None are written by default."""
    engine: str = "pool"
    """Engine, or "ray"."""
    user_input: UserInput = NO_USER_INPUT
    """Of all photos."""
    table: PhotoTable | None = None
    """Of single photos. None: nothing is known of them."""
    pick: int | None = None
    """Number of the sun that shines, of `Lighting.sun_candidates`. None: the answer's."""

    def for_photo(self, name: str) -> "BatchJob":
        """Return the same with what is known of one photo.

        Args:
            name: of the photo, relative to the folder.

        Raises:
            ParameterError: that contradicts what is stated of all.
        """
        row = None if self.table is None else self.table.rows.get(name)
        if row is None:
            return self
        return replace(self, user_input=row.over(self.user_input), pick=row.pick)


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """The light of a photo, its probe, its map, if one is made, and its crop in a border."""

    lighting: "Lighting"
    """The light."""
    probe: "LightProbe"
    """The light probe."""
    rendered: "RenderedMap | None"
    """The map. None: none is made."""
    crop: dict[str, int] | None = None
    """The fields of PhotoCrop."""


@dataclass(frozen=True)
class Summary:
    """Numbers of photos, and how long this run took."""

    succeeded: int
    """With a light, in all results."""
    failed: int
    """How many photos have no answer, 0 or more."""
    earlier: int
    """Of both, by the runs before."""
    seconds: float
    """How long it took, 0 or more."""
    skipped: Counter[str] = field(default_factory=Counter)
    """Pictures and clips that are not taken, by the reason."""

    def to_dict(self) -> dict[str, object]:
        """Return the numbers for JSON."""
        return {
            "succeeded": self.succeeded,
            "failed": self.failed,
            "earlier": self.earlier,
            "skipped": self.skipped.total(),
            "seconds": round(self.seconds, 3),
        }

    def __str__(self) -> str:
        rate = (self.succeeded + self.failed - self.earlier) / max(self.seconds, 1e-3)
        before = f"{self.earlier} by an earlier run, " if self.earlier else ""
        skipped = f"{self.skipped.total()} skipped{format_counts(self.skipped)}"
        return f"{self.succeeded} done, {self.failed} failed, {skipped}; {before}{rate:.1f} photos a second."


def job_settings(job: BatchJob) -> dict[str, object]:
    """Return what the results depend on, for SETTINGS; the network is identified by its SHA-256.

    Args:
        job: the batch.

    Raises:
        ModelError: there is no network.
    """
    from lighting.model import network_sha256, packaged_model

    network = packaged_model() if job.model is None else Path(job.model)
    if not network.is_file():
        raise ModelError(f"There is no network at {network}.")
    return {
        "engine": job.engine,
        "source": job.source if "://" in job.source else os.path.realpath(job.source),
        "network": network.name,
        "sha256": network_sha256(network),
        "maps": json.loads(json.dumps(asdict(job.maps))) if job.maps else None,
        "metadata": job.user_input.explicit_fields() or None,
        "table": job.table and job.table.sha256,
    }


def check_settings(existing: bytes | None, settings: dict[str, object], has_results: bool, out: str) -> None:
    """Raise BatchError if a folder holds results of other settings, or results without settings.

    Args:
        existing: what the folder's SETTINGS holds; None where there is none.
        settings: of this batch, by `job_settings`.
        has_results: whether the folder holds any.
        out: the folder, for the error.
    """
    try:
        earlier = dict(json.loads(existing or b"{}"))
    except (ValueError, TypeError, RecursionError):
        earlier = {}
    if not has_results:
        if existing is not None and earlier.keys().isdisjoint(settings):
            raise BatchError(f"{out} holds a {SETTINGS} that no batch wrote; choose another folder, or --overwrite.")
        return
    if existing is None:
        raise BatchError(f"{out} holds results, but no {SETTINGS}; choose another folder, or --overwrite.")
    changed = ", ".join(name for name in settings if earlier.get(name) != settings[name])
    if changed:
        raise BatchError(f"{out} holds results of other settings ({changed}); choose another folder, or --overwrite.")


def load_worker_estimator(job: BatchJob) -> "Estimator":
    """Load an estimator of one thread, since there is a process per CPU.

    Args:
        job: whose network it is.
    """
    from lighting.estimator import Estimator
    from lighting.model import Model

    return Estimator(Model.load(job.model, threads=1))


def estimate_or_error(
    estimator: "Estimator",
    source: Path | bytes,
    job: BatchJob,
    sidecar: Mapping[str, str] | None = None,
    name: str = "",
) -> PhotoLight | str:
    """Estimate the light of a photo, or return one sentence that says why it has none; other errors are raised.

    The photo is decoded in a process of its own: one that would take too long or too much memory fails alone.

    Args:
        estimator: of this worker.
        source: the photo's file, or its bytes.
        job: the batch.
        sidecar: what `read_sidecar` returned; None: look beside a file.
        name: of the photo, relative to the batch's folder, for the job's table.
    """
    from lighting.photo.sandbox import read_photo_isolated

    try:
        photo = read_photo_isolated(source, seconds=DECODE_SECONDS, sidecar=sidecar)
        own = job.for_photo(name)
        with trace_step("network"), ONE_BLAS_THREAD:
            estimate: Estimate = estimator(photo, own.user_input)
        estimate = estimate if own.pick is None else estimate.replace(pick=own.pick)
        rendered = estimate.render(job.maps.view) if job.maps else None
        crop = asdict(photo.crop) if photo.crop else None
        return PhotoLight(estimate.lighting, estimate.probe(), rendered, crop)
    except (PhotoError, ParameterError, ModelError, OSError) as error:
        return describe_error(error)

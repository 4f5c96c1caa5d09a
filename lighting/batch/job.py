"""What a batch does: its settings, one photo's light, and its summary."""

import json
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lighting.batch.results import SETTINGS, format_counts
from lighting.errors import BatchError, ModelError, ParameterError, PhotoError, describe_error
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.runtime import ONE_BLAS_THREAD
from lighting.tracing import trace_step

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap.relighting import Adjustments
    from lighting.envmap.surroundings import PhotoContext
    from lighting.estimator import Estimator
    from lighting.files.exr import WriteTarget
    from lighting.light_probe import LightProbe
    from lighting.photo.reader import Photo
    from lighting.photo_estimate import Estimate
    from lighting.records import Lighting

DECODE_SECONDS = 60.0  # of a photo; more than the service's, since nobody waits and other work may slow the machine


@dataclass(frozen=True)
class MapOptions:
    """How environment maps are rendered and written; see `render_view` and `write_exr`."""

    height: int = 512
    """Height, rows."""
    sun: bool | None = None
    """None: where direct sunlight is likely."""
    yaw: float = 0.0
    """Deg to the right."""
    sky: str | None = None
    """Of SKY_MODELS; None: the lighting's."""
    compression: str = "zip"
    """Of EXR files, one of COMPRESSIONS."""
    surroundings: bool | None = None
    """Whether they show the photo; None: where the network predicts the rest."""
    detail: bool = True
    """Whether they have detail all around the photo, where they show it."""
    colours: str = "rec709"
    """Of EXR files, one of COLOR_SPACES."""
    adjustments: "Adjustments | None" = None
    """Of the light by hand, in maps alone; None: none."""


@dataclass(frozen=True)
class BatchJob:
    """What is done with each photo."""

    source: str
    """The folder that the photos' names are relative to."""
    out: str
    """The folder of the results."""
    model: str | None = None
    """A network's file; the one in this package by default."""
    maps: MapOptions | None = None
    """None are written by default."""
    engine: str = "pool"
    """Engine, or "ray"."""
    user_input: UserInput = NO_USER_INPUT
    """Of all photos."""


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """The light of a photo, its probe, the surroundings that its map shows, if any, and its crop in a border."""

    lighting: "Lighting"
    """The light."""
    probe: "LightProbe"
    """The light probe."""
    context: "PhotoContext | None"
    """What the map shows of the place. None: the sky alone."""
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
        "maps": _plain_settings(job.maps) if job.maps else None,
        "metadata": job.user_input.explicit_fields() or None,
    }


def _plain_settings(maps: MapOptions) -> Any:
    """Options of maps as JSON reads them again; without adjustments where there are none, as in older batches."""
    settings = json.loads(json.dumps(asdict(maps)))
    return {name: value for name, value in settings.items() if name != "adjustments" or value is not None}


def check_settings(existing: bytes | None, settings: dict[str, object], has_results: bool, out: str) -> None:
    """Raise BatchError if a folder holds results of other settings, or results without settings.

    Args:
        existing: what the folder's SETTINGS holds; None where there is none.
        settings: of this batch, by `job_settings`.
        has_results: whether the folder holds any.
        out: the folder, for the error.
    """
    if not has_results:
        return
    if existing is None:
        raise BatchError(f"{out} holds results, but no {SETTINGS}; choose another folder, or --overwrite.")
    try:
        earlier = dict(json.loads(existing))
    except (ValueError, TypeError):
        earlier = {}
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


def write_photo_map(target: "WriteTarget", answer: PhotoLight, maps: MapOptions) -> None:
    """Render and write an environment map.

    Args:
        target: a path or a binary stream.
        answer: the photo's light.
        maps: how it is rendered and written.

    Raises:
        EnvironmentMapError: it cannot be written.
    """
    from lighting.envmap.relighting import adjust_lighting
    from lighting.envmap.surroundings import render_view
    from lighting.files.exr import write_exr
    from lighting.light_probe import compute_light_probe

    light = adjust_lighting(answer.lighting, maps.adjustments) if maps.adjustments else answer.lighting
    view: Any = {"sun": maps.sun, "yaw": maps.yaw, "sky": maps.sky, "context": answer.context}
    with trace_step("map"), ONE_BLAS_THREAD:
        image, lighting = render_view(light, maps.height, **view)
        probe = compute_light_probe(light, **view)
    file: Any = {"compression": maps.compression, "colours": maps.colours, "overwrite": True}
    with trace_step("encode"):
        write_exr(target, image, lighting, probe=probe, **file)


def estimate_or_error(
    estimator: "Estimator", source: Path | bytes, job: BatchJob, sidecar: Mapping[str, str] | None = None
) -> PhotoLight | str:
    """Estimate the light of a photo, or return one sentence that says why it has none; other errors are raised.

    The photo is decoded in a process of its own: one that would take too long or too much memory fails alone.

    Args:
        estimator: of this worker.
        source: the photo's file, or its bytes.
        job: the batch.
        sidecar: what `read_sidecar` returned; None: look beside a file.
    """
    from lighting.photo.sandbox import read_photo_isolated

    try:
        with trace_step("decode"):
            photo = read_photo_isolated(source, seconds=DECODE_SECONDS, sidecar=sidecar)
        with trace_step("network"), ONE_BLAS_THREAD:
            estimate = estimator(photo, job.user_input)
        with trace_step("map"):
            context = _map_context(source, photo, estimate, job.maps) if job.maps else None
            probe = estimate.light_probe()
        crop = asdict(photo.crop) if photo.crop else None
        return PhotoLight(estimate.lighting, probe, context, crop)
    except (PhotoError, ParameterError, ModelError, OSError) as error:
        return describe_error(error)


def _map_context(source: Path | bytes, photo: "Photo", estimate: "Estimate", maps: MapOptions) -> "PhotoContext | None":
    from lighting.envmap.surroundings import photo_context_for_height
    from lighting.photo.sandbox import read_photo_isolated

    def finer(side: int) -> "NDArray[np.uint8]":
        with trace_step("decode"):
            return read_photo_isolated(source, target=side, seconds=DECODE_SECONDS).pixels

    return photo_context_for_height(
        estimate, photo.pixels, maps.height, finer, surroundings=maps.surroundings, detail=maps.detail
    )

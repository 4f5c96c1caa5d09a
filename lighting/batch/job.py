"""What a batch does with each photo, and when an interrupted batch may be resumed."""

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lighting.errors import BatchError, ModelError, ParameterError, PhotoError, reason

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap import Place
    from lighting.evidence import Given
    from lighting.files import Target
    from lighting.photo import Photo
    from lighting.pipeline import Estimator
    from lighting.records import Estimate, Lighting

SETTINGS = "batch.json"
DECODE_SECONDS = 60.0  # of a photo; more than the service's, since nobody waits and other work may slow the machine


@dataclass(frozen=True)
class Maps:
    """How environment maps are rendered and written; see envmap.view and files.write_exr."""

    height: int = 512
    sun: bool | None = None
    yaw: float = 0.0
    sky: str | None = None
    compression: str = "zip"
    surroundings: bool | None = None  # whether they show the place, by default where the network predicts it


@dataclass(frozen=True)
class Job:
    """What is done with each photo."""

    source: str  # the folder that the photos' names are relative to
    out: str
    model: str | None = None  # a network's file; the one in this package by default
    maps: Maps | None = None  # none are written by default
    engine: str = "pool"  # or "ray"
    given: dict[str, Any] = field(default_factory=dict)  # what the user says of all photos, as evidence.Given takes it


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """The light of a photo, and the place that its map shows, if it shows any."""

    lighting: "Lighting"
    place: "Place | None"


def settings(job: Job) -> dict[str, object]:
    """What the results depend on, for SETTINGS; the network is identified by its SHA-256. Raises ModelError."""
    from lighting.model import network_sha256, packaged_model

    network = packaged_model() if job.model is None else Path(job.model)
    if not network.is_file():
        raise ModelError(f"There is no network at {network}.")
    return {
        "engine": job.engine,
        "source": job.source if "://" in job.source else os.path.realpath(job.source),
        "network": network.name,
        "sha256": network_sha256(network),
        "maps": asdict(job.maps) if job.maps else None,
        "metadata": job.given or None,
    }


def check_settings(found: bytes | None, asked: dict[str, object], has_results: bool, out: str) -> None:
    """Raise BatchError if the folder `out` holds results of other settings, or results without settings."""
    if not has_results:
        return
    if found is None:
        raise BatchError(f"{out} holds results, but no {SETTINGS}; choose another folder, or --overwrite.")
    try:
        there = dict(json.loads(found))
    except (ValueError, TypeError):
        there = {}
    changed = ", ".join(name for name in asked if there.get(name) != asked[name])
    if changed:
        raise BatchError(f"{out} holds results of other settings ({changed}); choose another folder, or --overwrite.")


def load_estimator(job: Job) -> "tuple[Estimator, Given]":
    """An estimator of one thread, since there is a process per CPU, and what is given of all photos."""
    from lighting.evidence import Given
    from lighting.model import Model
    from lighting.pipeline import Estimator

    return Estimator(Model.load(job.model, threads=1)), Given(**job.given)


def write_map(target: "Target", answer: PhotoLight, maps: Maps) -> None:
    """Render and write an environment map; raises EnvironmentMapError."""
    from lighting.envmap import view
    from lighting.files import write_exr

    image, turned = view(answer.lighting, maps.height, sun=maps.sun, yaw=maps.yaw, sky=maps.sky, place=answer.place)
    write_exr(target, image, turned, compression=maps.compression)


def light_or_reason(
    estimator: "Estimator", source: Path | bytes, given: "Given", maps: Maps | None
) -> PhotoLight | str:
    """The light of a photo, or one sentence that says why the photo has none; other errors are raised.

    The photo is decoded in a process of its own: one that would take too long or too much memory fails alone.
    """
    from lighting.photo import read_apart

    try:
        photo = read_apart(source, seconds=DECODE_SECONDS)
        estimate = estimator(photo, given)
        return PhotoLight(estimate.lighting, _place(source, photo, estimate, maps) if maps else None)
    except (PhotoError, ParameterError, ModelError, OSError) as error:
        return reason(error)


def _place(source: Path | bytes, photo: "Photo", estimate: "Estimate", maps: Maps) -> "Place | None":
    from lighting.envmap import place_of
    from lighting.photo import read_apart

    def finer(side: int) -> "NDArray[np.uint8]":
        return read_apart(source, target=side, seconds=DECODE_SECONDS).pixels

    return place_of(estimate, photo.pixels, maps.height, finer, wanted=maps.surroundings)

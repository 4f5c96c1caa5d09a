"""What a batch does: its settings, the photos it is of, one photo's light, and its summary."""

import glob
import json
import os
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from lighting.errors import BatchError, ModelError, ParameterError, PhotoError, describe_error
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.photo.linear import RAW_SUFFIXES

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.envmap.surroundings import PhotoContext
    from lighting.estimator import Estimator
    from lighting.files.exr import WriteTarget
    from lighting.photo.reader import Photo
    from lighting.records import Estimate, Lighting

SETTINGS = "batch.json"
DECODE_SECONDS = 60.0  # of a photo; more than the service's, since nobody waits and other work may slow the machine
PHOTO_SUFFIXES = (  # of photos in a folder; a glob may match any file
    ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".heic", ".heif", ".hif", ".tif", ".tiff", ".avif",
    *RAW_SUFFIXES, ".x3f",
)  # fmt: skip
UNREAD_SUFFIXES = (  # of pictures that are no photos, or that nothing here is known to read
    ".heics", ".heifs", ".avifs",
    ".srw", ".3fr", ".fff", ".iiq", ".erf", ".kdc", ".dcr", ".mrw", ".mef", ".mos",
    ".gif", ".bmp", ".jxl", ".jp2", ".j2k", ".jxr", ".psd", ".svg", ".exr", ".hdr", ".tga", ".ppm", ".xcf", ".ico",
)  # fmt: skip


@dataclass(frozen=True)
class MapOptions:
    """How environment maps are rendered and written; see `render_view` and `write_exr`."""

    height: int = 512  # rows
    sun: bool | None = None  # None: where direct sunlight is likely
    yaw: float = 0.0  # deg to the right
    sky: str | None = None  # of SKY_MODELS; None: the lighting's
    compression: str = "zip"
    surroundings: bool | None = None  # whether they show the photo; None: where the network predicts the rest


@dataclass(frozen=True)
class BatchJob:
    """What is done with each photo."""

    source: str  # the folder that the photos' names are relative to
    out: str
    model: str | None = None  # a network's file; the one in this package by default
    maps: MapOptions | None = None  # none are written by default
    engine: str = "pool"  # or "ray"
    user_input: UserInput = NO_USER_INPUT  # of all photos


@dataclass(frozen=True, eq=False)
class PhotoLight:
    """The light of a photo, and the surroundings that its map shows, if it shows any."""

    lighting: "Lighting"
    context: "PhotoContext | None"


@dataclass(frozen=True)
class Summary:
    """Numbers of photos, and how long this run took."""

    succeeded: int  # with a light, in all results
    failed: int
    earlier: int  # of both, by the runs before
    seconds: float
    unread: Counter[str] = field(default_factory=Counter)  # pictures of kinds that are not read, by suffix

    def __str__(self) -> str:
        rate = (self.succeeded + self.failed - self.earlier) / max(self.seconds, 1e-3)
        before = f"{self.earlier} by an earlier run, " if self.earlier else ""
        skipped = f"{self.unread.total()} skipped{_format_suffixes(self.unread)}"
        return f"{self.succeeded} done, {self.failed} failed, {skipped}; {before}{rate:.1f} photos a second."


def find_photos(pattern: str) -> tuple[str, list[str]]:
    """Find a batch's photos: their folder, and their sorted names relative to it.

    Args:
        pattern: a folder, whose photos count at any depth, or a glob, whose folder is the part before its first
            wildcard.

    Raises:
        BatchError: there is no photo, or the pattern is empty, as an unset variable of a shell is.
    """
    if not pattern:
        raise BatchError("The input is empty; it must be a folder or a pattern.")
    if Path(pattern).is_dir():
        source, names = pattern, list(_files_below(Path(pattern), PHOTO_SUFFIXES))
    else:
        source = _fixed_part(pattern)
        names = list(_matches(pattern, Path(source)))
    if not names:
        unread = _format_suffixes(count_unread_pictures(pattern))
        hint = f"; its pictures are of kinds that are not read{unread}" if unread else ""
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any{hint}.")
    return source, sorted(names)


def count_unread_pictures(pattern: str) -> Counter[str]:
    """Count the pictures in a folder that are of kinds that are not read, by suffix; none for a glob.

    Maps that a batch wrote beside their photos are no such pictures.

    Args:
        pattern: a folder or a glob.
    """
    folder = Path(pattern)
    names = _files_below(folder, UNREAD_SUFFIXES) if folder.is_dir() else ()
    return Counter(Path(name).suffix.lower() for name in names if not _is_map(name))


def _is_map(name: str) -> bool:
    """Whether a file is named as a batch names a photo's map."""
    return name.endswith(".exr") and name.removesuffix(".exr").lower().endswith(PHOTO_SUFFIXES)


def _files_below(source: Path, suffixes: tuple[str, ...]) -> Iterator[str]:
    """Names of the files at any depth that end so, without hidden files and folders."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        for name in files:
            if name.lower().endswith(suffixes) and name[0] != "." and not _is_pipe_or_device(Path(parent, name)):
                yield (below / name).as_posix()


def _is_pipe_or_device(path: Path) -> bool:
    """Whether a file is a pipe, a socket or a device, from which reading may not end; a broken link is none."""
    return path.exists() and not path.is_file()


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once; hidden ones only where the glob names a dot.

    No link to a folder is followed by `**`, for it may lead back to where it stands. Raises BatchError for a name that
    holds `**` beside other letters.
    """
    parts = Path(pattern).parts[len(source.parts) :]
    if any("**" in part and part != "**" for part in parts):
        raise BatchError(f"{pattern} is no pattern: ** stands for folders, between slashes alone.")
    if parts[-1] == "**":
        parts = (*parts, "*")
    hidden = any(part.startswith(".") for part in parts)
    names = {path.relative_to(source) for path in source.glob(str(Path(*parts))) if path.is_file()}
    yield from (name.as_posix() for name in names if hidden or not any(part.startswith(".") for part in name.parts))


def _fixed_part(pattern: str) -> str:
    parts = Path(pattern).parts[:-1]
    plain = next((index for index, part in enumerate(parts) if glob.has_magic(part)), len(parts))
    return str(Path(*parts[:plain]))


def _format_suffixes(counts: Counter[str]) -> str:
    """The kinds in brackets after a space, such as "(2 .gif, 1 .jxl)", the most frequent first; nothing for none."""
    ordered = sorted(counts.items(), key=lambda kind: (-kind[1], kind[0]))
    listed = ", ".join(f"{count} {suffix}" for suffix, count in ordered)
    return f" ({listed})" if listed else ""


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
        "maps": asdict(job.maps) if job.maps else None,
        "metadata": job.user_input.explicit_fields() or None,
    }


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
    from lighting.envmap.surroundings import render_view
    from lighting.files.exr import write_exr

    image, lighting = render_view(
        answer.lighting, maps.height, sun=maps.sun, yaw=maps.yaw, sky=maps.sky, context=answer.context
    )
    write_exr(target, image, lighting, compression=maps.compression)


def estimate_or_error(estimator: "Estimator", source: Path | bytes, job: BatchJob) -> PhotoLight | str:
    """Estimate the light of a photo, or return one sentence that says why it has none; other errors are raised.

    The photo is decoded in a process of its own: one that would take too long or too much memory fails alone.

    Args:
        estimator: of this worker.
        source: the photo's file, or its bytes.
        job: the batch.
    """
    from lighting.photo.sandbox import read_photo_isolated

    try:
        photo = read_photo_isolated(source, seconds=DECODE_SECONDS)
        estimate = estimator(photo, job.user_input)
        return PhotoLight(estimate.lighting, _map_context(source, photo, estimate, job.maps) if job.maps else None)
    except (PhotoError, ParameterError, ModelError, OSError) as error:
        return describe_error(error)


def _map_context(source: Path | bytes, photo: "Photo", estimate: "Estimate", maps: MapOptions) -> "PhotoContext | None":
    from lighting.envmap.surroundings import photo_context_for_height
    from lighting.photo.sandbox import read_photo_isolated

    def finer(side: int) -> "NDArray[np.uint8]":
        return read_photo_isolated(source, target=side, seconds=DECODE_SECONDS).pixels

    return photo_context_for_height(estimate, photo.pixels, maps.height, finer, surroundings=maps.surroundings)

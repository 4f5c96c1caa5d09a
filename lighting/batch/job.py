"""Many photos: a folder or a glob in; a line of JSON, and perhaps an environment map, for each out.

The folder of results holds `batch.json`, what the batch was asked for; `lighting.jsonl`, a line a photo in the order in
which they were finished; and with maps `NAME.exr` under each photo's own relative name. A batch that was stopped goes
on where it was, and tries again what failed; one that was asked for something else refuses the folder.
"""

import errno
import glob
import hashlib
import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lighting.batch.journal import Journal, open_journal
from lighting.batch.workers import work_through
from lighting.errors import BatchError, EnvironmentMapError, ModelError, ParameterError, PhotoError, reason
from lighting.files import json_line, replacing

if TYPE_CHECKING:
    from lighting.evidence import Given
    from lighting.photo import Source
    from lighting.pipeline import Estimator
    from lighting.records import Lighting

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif")  # of photos in a folder; a glob may match any
JOURNAL, SETTINGS = "lighting.jsonl", "batch.json"
LOST = "The photo ended the process that worked on it, twice."


@dataclass(frozen=True)
class Maps:
    """How environment maps are rendered; see envmap.view."""

    height: int = 512
    sun: bool | None = None
    yaw: float = 0.0


@dataclass(frozen=True)
class Job:
    """What is done with each photo."""

    source: str  # the folder that the photos' names are relative to
    out: str
    model: str | None = None  # a network's file, by default the one in this package
    maps: Maps | None = None  # none are written by default
    engine: str = "pool"  # or "ray"
    given: dict[str, Any] = field(default_factory=dict)  # what is known of all photos, as metadata.Given takes it


def find_photos(pattern: str) -> tuple[str, list[str]]:
    """A folder and the names in it, relative and sorted, of its photos at any depth or of what a glob matches.

    The folder of a glob is the part before its first wildcard. Raises BatchError where there is no photo.
    """
    if Path(pattern).is_dir():
        source, names = pattern, list(_photos_below(Path(pattern)))
    else:
        source = _fixed_part(pattern)
        names = list(_matches(pattern, Path(source)))
    if not names:
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any.")
    return source, sorted(names)


def _photos_below(source: Path) -> Iterator[str]:
    """Names of photos at any depth; what is hidden is left alone."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        yield from ((below / name).as_posix() for name in files if name.lower().endswith(SUFFIXES) and name[0] != ".")


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once."""
    matches = glob.iglob(pattern, recursive=True)  # noqa: PTH207, a pattern may be absolute
    yield from (Path(path).relative_to(source).as_posix() for path in set(matches) if Path(path).is_file())


def _fixed_part(pattern: str) -> str:
    parts = Path(pattern).parts[:-1]
    plain = next((index for index, part in enumerate(parts) if glob.has_magic(part)), len(parts))
    return str(Path(*parts[:plain]))


@contextmanager
def open_batch(job: Job, *, overwrite: bool = False) -> Iterator[Journal]:
    """The journal of a job's results, where a stopped batch of the same settings left it; `overwrite` starts anew.

    Raises BatchError where the folder holds something else, or another process is at work in it.
    """
    from lighting.batch.table import FILE

    out = Path(job.out)
    out.mkdir(parents=True, exist_ok=True)
    asked = settings(job)
    if not overwrite:
        found = out / SETTINGS
        refuse_other(found.read_bytes() if found.exists() else None, asked, (out / JOURNAL).exists(), job.out)
    with open_journal(out / JOURNAL) as journal:
        if overwrite:
            journal.clear()
            (out / FILE).unlink(missing_ok=True)
        with replacing(out / SETTINGS) as path:
            path.write_text(json.dumps(asked, indent=2) + "\n")
        yield journal


def settings(job: Job) -> dict[str, object]:
    """What decides about the results, for `batch.json`; the network is known by its content."""
    from lighting.model import packaged_model

    network = packaged_model() if job.model is None else Path(job.model)
    if not network.is_file():
        raise ModelError(f"There is no network at {network}.")
    return {
        "engine": job.engine,
        "source": job.source if "://" in job.source else os.path.realpath(job.source),
        "network": network.name,
        "sha256": hashlib.sha256(network.read_bytes()).hexdigest(),
        "maps": asdict(job.maps) if job.maps else None,
        "metadata": job.given or None,
    }


def refuse_other(found: bytes | None, asked: dict[str, object], results: bool, out: str) -> None:
    """Raise BatchError unless the settings that a folder holds, or its lack of any `results`, allow to go on."""
    if found is None:
        if results:
            raise BatchError(f"{out} holds results, but no {SETTINGS}; choose another folder, or --overwrite.")
        return
    try:
        there = dict(json.loads(found))
    except (ValueError, TypeError):
        there = {}
    changed = " and ".join(name for name in asked if there.get(name) != asked[name])
    if changed:
        raise BatchError(f"{out} holds results of another {changed}; choose another folder, or --overwrite.")


def run_pool(job: Job, names: Sequence[str], journal: Journal, workers: int) -> Iterator[str]:
    """Work through the photos that the journal lacks, in processes of one thread each; yields each finished name."""
    missing = [name for name in names if name not in journal.done]
    for name, result in work_through(missing, partial(prepare, job), min(workers, len(missing))):
        line, failed = result or (json_line(name, LOST), True)
        journal.append(name, line, failed=failed)
        yield name


def prepare(job: Job) -> Callable[[str], tuple[str, bool]]:
    """The work on one photo, with a network loaded: from its name to its line, and whether that tells of a failure."""
    from lighting.evidence import Given

    estimator, given = load_estimator(job.model), Given(**job.given)

    def work(name: str) -> tuple[str, bool]:
        light = light_of(estimator, Path(job.source, name), given)
        if isinstance(light, str):
            return json_line(name, light), True
        if job.maps:
            try:
                _write_map(Path(job.out, f"{name}.exr"), light, job.maps)
            except EnvironmentMapError as error:
                if not _name_is_too_long(error.__cause__):
                    raise
                return json_line(name, "The photo's name is too long for a map of that name."), True
        return json_line(name, light), False

    return work


def load_estimator(model: str | None) -> "Estimator":
    """An estimator of one thread, since there are as many processes as CPUs."""
    from lighting.model import Model
    from lighting.pipeline import Estimator

    return Estimator(Model.load(model, threads=1))


def light_of(estimator: "Estimator", source: "Source", given: "Given") -> "Lighting | str":
    """The light of a photo, or the reason why there is none; an error that is not the photo's is raised."""
    from lighting.photo import read_photo

    try:
        return estimator(read_photo(source), given).lighting
    except (PhotoError, ParameterError, ModelError, OSError) as error:
        return reason(error)


def _name_is_too_long(cause: BaseException | None) -> bool:
    return isinstance(cause, OSError) and cause.errno == errno.ENAMETOOLONG


def _write_map(path: Path, light: "Lighting", maps: Maps) -> None:
    from lighting.envmap import view
    from lighting.files import write_exr

    path.parent.mkdir(parents=True, exist_ok=True)
    write_exr(path, *view(light, **asdict(maps)))

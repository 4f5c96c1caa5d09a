"""A batch on one machine, in a process per CPU.

The output folder holds `batch.json`, the settings; `lighting.jsonl`, one line per photo in the order in which they were
finished; and, if maps are asked for, `NAME.exr` under each photo's own relative name. The same batch started again
resumes an interrupted one and retries the photos that failed.
"""

import errno
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

from lighting.batch.job import (
    SETTINGS,
    Job,
    Maps,
    PhotoLight,
    check_settings,
    light_or_reason,
    load_estimator,
    settings,
    write_map,
)
from lighting.batch.journal import JOURNAL, Journal, has_lights, open_journal
from lighting.batch.table import TABLE, check_table
from lighting.batch.workers import work_through
from lighting.errors import BatchError, EnvironmentMapError
from lighting.files import json_line, leftovers, replacing

LOST = "The process that worked on this photo ended, twice."
NO_MAP = {  # why the system takes no map of a photo's name, where that is so of this photo alone
    errno.ENAMETOOLONG: "The photo's name is too long for a map of that name.",
    errno.EISDIR: "A folder in the results has the name of the photo's map.",
}


@contextmanager
def open_batch(job: Job, *, overwrite: bool = False) -> Iterator[Journal]:
    """The journal of a job, with the results of an interrupted run; `overwrite` discards them.

    Raises BatchError if the folder holds results of another job that are not discarded (or of Ray, which never are), or
    is a file, or another process is writing to it.
    """
    out = Path(job.out)
    if out.exists() and not out.is_dir():
        raise BatchError(f"{job.out} is a file; the results need a folder.")
    if overwrite:
        check_table(out)
    out.mkdir(parents=True, exist_ok=True)
    asked = settings(job)
    if not overwrite:
        found = out / SETTINGS
        check_settings(found.read_bytes() if found.exists() else None, asked, _has_results(out), job.out)
    with open_journal(out / JOURNAL) as journal:
        if overwrite:
            journal.clear()
            (out / TABLE).unlink(missing_ok=True)
        with replacing(out / SETTINGS) as path:
            path.write_text(json.dumps(asked, indent=2) + "\n")
        yield journal


def _has_results(out: Path) -> bool:
    """Whether a folder holds the light of a photo, by either engine, or, without settings, any line."""
    journal, parts = out / JOURNAL, out / TABLE
    if parts.is_dir() and any(parts.iterdir()):
        return True
    if not journal.exists():
        return False
    with journal.open("rb") as lines:
        return has_lights(lines) if (out / SETTINGS).exists() else any(lines)


def run_pool(job: Job, names: Sequence[str], journal: Journal, workers: int) -> Iterator[str]:
    """Process the photos that are not in the journal, in `workers` processes; yields the name of each finished one."""
    missing = [name for name in names if name not in journal.done]
    _tidy(job, missing)
    for name, result in work_through(missing, partial(prepare, job), min(workers, len(missing))):
        line, failed = result or (json_line(name, LOST), True)
        journal.append(name, line, failed=failed)
        yield name


def _tidy(job: Job, names: Sequence[str]) -> None:
    """Remove what killed runs left unfinished under temporary names: the batch that holds the journal is alone here."""
    files = {Path(job.out, name) for name in (SETTINGS, JOURNAL, TABLE)}
    folders = {name.rpartition("/")[0] for name in names} if job.maps else set()
    maps = {Path(job.out, folder, "map.exr") for folder in folders}
    own = (file for file in files | maps if not file.is_symlink())  # a link may lead to where others write
    for path in (left for file in own for left in leftovers(file)):
        path.unlink(missing_ok=True)


def prepare(job: Job) -> Callable[[str], tuple[str, bool]]:
    """Load the network; returns a function from a photo's name to its line of JSON and whether the photo failed."""
    estimator, given = load_estimator(job)

    def work(name: str) -> tuple[str, bool]:
        answer = light_or_reason(estimator, Path(job.source, name), given, job.maps)
        if isinstance(answer, str):
            return json_line(name, answer), True
        if job.maps and (objection := _write_map(Path(job.out, f"{name}.exr"), answer, job.maps)):
            return json_line(name, objection), True
        return json_line(name, answer.lighting), False

    return work


def _write_map(path: Path, answer: PhotoLight, maps: Maps) -> str | None:
    """Write a map, or say why the system takes none of that name; raises EnvironmentMapError for other failures."""
    path.parent.mkdir(parents=True, exist_ok=True)
    try:
        write_map(path, answer, maps)
    except EnvironmentMapError as error:
        if isinstance(error.__cause__, OSError) and error.__cause__.errno in NO_MAP:
            return NO_MAP[error.__cause__.errno]
        raise
    return None

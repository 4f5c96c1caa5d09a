"""A batch on Ray (extra `ray`): Ray reads the photos, runs one estimator per actor and writes Parquet.

The output folder holds `batch.json`; `lighting.parquet`, a folder with one part file per finished block of photos; and,
if maps are asked for, `NAME.exr`. Folders are local paths that every node sees, or URIs that pyarrow supports (s3://,
gs://). Ray restarts an actor that it lost and repeats its block; the repeated block replaces its own part file.
"""

import json
import posixpath
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import monotonic
from typing import Any

from lighting.batch import job as jobs
from lighting.batch.photo_search import PHOTO_SUFFIXES, find_photos, is_set_aside
from lighting.batch.pool import FOREIGN_MAP
from lighting.batch.results import JOURNAL, SETTINGS, TABLE, has_lights, table_row, table_schema
from lighting.errors import BatchError, MissingExtraError, require_extra
from lighting.fields import Json
from lighting.files import escape_undecodable, is_own_map
from lighting.photo.sidecars import MAX_SIDECAR_BYTES, read_sidecar

_EXTRA = ("The engine ray needs Ray and pyarrow", "ray")

_ACTOR_CPUS = 0.9  # reserved for an actor; the rest of its CPU is left for the tasks that read and write
_TASK_CPUS = 0.05  # reserved for such a task


def find_photos_at(source: str) -> tuple[str, list[str]]:
    """Find photos as `find_photos` does, also for the URI of a folder, without wildcards.

    Args:
        source: a folder, a glob, or a URI that pyarrow supports.

    Raises:
        BatchError: there is no photo.
    """
    if "://" not in source:
        return find_photos(source)
    filesystem, base = _filesystem_at(source)
    from pyarrow.fs import FileSelector

    files = (file.path for file in filesystem.get_file_info(FileSelector(base, recursive=True)) if file.is_file)
    photos = (posixpath.relpath(path, base) for path in files if path.lower().endswith(PHOTO_SUFFIXES))
    names = sorted(name for name in photos if not is_set_aside(name, source))
    if not names:
        raise BatchError(f"{source} holds no photos.")
    return source, names


def run_ray(
    job: jobs.BatchJob,
    names: Sequence[str],
    *,
    address: str | None,
    workers: int | None,
    overwrite: bool,
    progress: bool,
) -> jobs.Summary:
    """Process the photos that are not in the results.

    Args:
        job: the batch.
        names: of photos, relative to its folder.
        address: of a cluster; None starts a local one.
        workers: number of actors; None is one per CPU.
        overwrite: discard earlier results.
        progress: show Ray's bars.

    Raises:
        MissingExtraError: Ray or pyarrow is not installed.
        BatchError: the folder holds results of another job.
    """
    began = monotonic()
    if find_spec("ray") is None:  # which is not imported yet
        raise MissingExtraError.of(*_EXTRA)
    filesystem, out = _filesystem_at(job.out)
    _open_results(filesystem, out, job, overwrite)
    earlier = _failed_by_name(filesystem, f"{out}/{TABLE}")
    missing = [name for name in names if escape_undecodable(name) not in earlier]
    if missing:
        with _connected(address):
            _map_photos(job, missing, workers, progress)
    failures = _failed_by_name(filesystem, f"{out}/{TABLE}").values()
    return jobs.Summary(len(failures) - sum(failures), sum(failures), len(earlier), monotonic() - began)


class PhotoActor:
    """One estimator, from the bytes of photos to rows of the table."""

    def __init__(self, job: jobs.BatchJob) -> None:
        self.job = job
        self.estimator = jobs.load_worker_estimator(job)
        self.filesystem, self.base = _filesystem_at(job.source)
        self._folders: dict[str, frozenset[str]] = {}  # the files in folders where photos were

    def __call__(self, photo: Json) -> Json:
        name = posixpath.relpath(photo["path"], self.base)
        sidecar = read_sidecar(photo["path"], self._read_beside)
        answer = jobs.estimate_or_error(self.estimator, photo["bytes"], self.job, sidecar, name)
        if isinstance(answer, str):
            return table_row(name, answer)
        if self.job.maps and (sentence := _write_map(self.job, name, answer)):
            return table_row(name, sentence)
        row = table_row(name, answer.lighting, answer.crop, answer.probe.to_dict())
        if row["utc_time"] is not None:
            row["utc_time"] = row["utc_time"].isoformat()  # Ray would pickle it; the schema makes a time of it
        return row

    def _read_beside(self, file: Path) -> bytes | None:
        """What a small file of a photo's folder holds; None where there is none."""
        path = file.as_posix()
        if path not in self._files_in(posixpath.dirname(path)):
            return None
        try:
            with self.filesystem.open_input_stream(path) as stream:
                return bytes(stream.read(MAX_SIDECAR_BYTES + 1))
        except OSError:
            return None

    def _files_in(self, folder: str) -> frozenset[str]:
        from pyarrow.fs import FileSelector

        if folder not in self._folders:
            entries = self.filesystem.get_file_info(FileSelector(folder))
            self._folders[folder] = frozenset(entry.path for entry in entries if entry.is_file)
        return self._folders[folder]


def _map_photos(job: jobs.BatchJob, names: Sequence[str], workers: int | None, progress: bool) -> None:
    import ray

    filesystem, base = _filesystem_at(job.source)
    actors = min(workers or int(ray.cluster_resources()["CPU"]), len(names))
    context = ray.data.DataContext.get_current()
    context.enable_progress_bars = progress
    paths = [f"{base}/{name}" for name in names]
    photos = ray.data.read_binary_files(paths, filesystem=filesystem, include_paths=True, num_cpus=_TASK_CPUS)
    rows = photos.map(
        PhotoActor,
        fn_constructor_args=(job,),
        num_cpus=_ACTOR_CPUS,
        compute=ray.data.ActorPoolStrategy(min_size=1, max_size=actors, initial_size=actors),
    )
    target, folder = _filesystem_at(job.out)
    cpus = {"num_cpus": _TASK_CPUS}
    rows.write_parquet(f"{folder}/{TABLE}", filesystem=target, schema=table_schema(), ray_remote_args=cpus)


@contextmanager
def _connected(address: str | None) -> Iterator[None]:
    """A connection to Ray, which is closed at the end unless this process already had one."""
    import ray

    if ray.is_initialized():
        yield
        return
    try:
        ray.init(address=address, logging_level="warning")
    except (ConnectionError, ValueError) as error:
        raise BatchError(f"There is no Ray cluster at {address}: {error}.") from error
    try:
        yield
    finally:
        ray.shutdown()


def _filesystem_at(path: str) -> tuple[Any, str]:
    """The filesystem of a local path or a URI, and the path in it; raises MissingExtraError without pyarrow."""
    from os.path import realpath

    fs = require_extra("pyarrow.fs", *_EXTRA)
    return fs.FileSystem.from_uri(path) if "://" in path else (fs.LocalFileSystem(), realpath(path))


def _open_results(filesystem: Any, out: str, job: jobs.BatchJob, overwrite: bool) -> None:
    """Check that the folder is for this job, and write its settings."""
    from pyarrow.fs import FileType

    new = jobs.job_settings(job)
    file, parts = (filesystem.get_file_info(f"{out}/{name}") for name in (SETTINGS, TABLE))
    existing = filesystem.open_input_file(file.path).read() if file.is_file else None
    if not overwrite:
        jobs.check_settings(existing, new, _has_results(filesystem, out), job.out)
    elif parts.type is FileType.Directory:
        for part in _part_files(filesystem, parts.path):
            filesystem.delete_file(part)
    elif parts.is_file:
        filesystem.delete_file(parts.path)
    filesystem.create_dir(f"{out}/{TABLE}", recursive=True)
    with filesystem.open_output_stream(file.path) as stream:
        stream.write(json.dumps(new, indent=2).encode() + b"\n")


def _has_results(filesystem: Any, out: str) -> bool:
    """Whether a folder holds part files, or what a pool wrote: its table, or the light of a photo."""
    from pyarrow.fs import FileSelector

    journal, parts = (filesystem.get_file_info(f"{out}/{name}") for name in (JOURNAL, TABLE))
    if parts.is_file or filesystem.get_file_info(FileSelector(parts.path, allow_not_found=True)):
        return True
    return journal.is_file and has_lights(filesystem.open_input_file(journal.path).read().splitlines(keepends=True))


def _part_files(filesystem: Any, parts: str) -> list[str]:
    """The paths of the files that Ray wrote to a folder, whole or not; others may lie there, too."""
    from pyarrow.fs import FileSelector

    files = [info for info in filesystem.get_file_info(FileSelector(parts)) if info.is_file]
    return [info.path for info in files if info.extension == "parquet"]


def _failed_by_name(filesystem: Any, parts: str) -> dict[str, bool]:
    """The photos in complete part files, and whether each failed; an incomplete part file is deleted."""
    from pyarrow import ArrowInvalid
    from pyarrow.parquet import read_table

    failures: dict[str, bool] = {}
    for part in _part_files(filesystem, parts):
        try:
            table = read_table(part, columns=["file", "error"], filesystem=filesystem)
        except ArrowInvalid:
            filesystem.delete_file(part)
            continue
        failed = (error is not None for error in table["error"].to_pylist())
        failures.update(zip(table["file"].to_pylist(), failed, strict=True))
    return failures


def _write_map(job: jobs.BatchJob, name: str, answer: jobs.PhotoLight) -> str | None:
    """Write a map, or say why there can be none of that name."""
    assert job.maps
    assert answer.rendered
    filesystem, out = _filesystem_at(job.out)
    target = f"{out}/{job.maps.file_name(name)}"
    if filesystem.get_file_info(target).is_file and not is_own_map(filesystem.open_input_stream(target)):
        return FOREIGN_MAP
    filesystem.create_dir(posixpath.dirname(target), recursive=True)
    with filesystem.open_output_stream(f"{target}.part") as stream:
        stream.write(answer.rendered.encode(job.maps.file))
    filesystem.move(f"{target}.part", target)
    return None

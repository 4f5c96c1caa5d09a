"""The kinds of long jobs: what each takes, and its work, in a process of its own (`run_worker`).

The process gets a request as JSON on stdin and writes lines of JSON to stdout. Now and then a line is
`{"progress": 0.5}`, and for a traced job `{"step": [...]}`, the fields of a Step. The last one is `{"warnings": [...]}`
or `{"error": ..., "code": ...}`. It works in the job's folder, where the upload lies.
"""

import json
import os
import stat
import sys
import traceback
import zipfile
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO, TypeVar

from lighting.envmap.relighting import Adjustments
from lighting.errors import ErrorCode, LightingError, VideoError
from lighting.fusion.user_input import UserInput
from lighting.records import Json
from lighting.runtime import begin_helper, confine_to_folder, limit_address_space
from lighting.tracing import listen_to_steps, trace_step

T = TypeVar("T")
Report = Callable[[float], None]  # takes the part that is done, 0 to 1

UPLOAD_STEM, RESULT_FILE = "upload", "result.zip"
MAX_FILES = 2000  # in a ZIP of photos
_PHOTOS, _OUT, _PART = Path("photos"), Path("out"), Path("result.part")
_SLICE = 1 << 20  # bytes that are unpacked at once
_MEMORY = 4_000_000_000  # bytes of address space for clips and normals; photos are decoded in processes with their own
_MAX_WARNINGS, _MAX_WARNING = 50, 500  # of a job, and letters of one
_NICENESS = 10  # so that photos that somebody waits for go first
_WORK_SHARE = 0.9  # of a job's progress; the rest packs the result
_READ_SHARE = 0.2  # of the progress of normals, for reading the photos


class _UploadError(LightingError):
    """An upload that is no ZIP of photos, or holds too much."""

    default_code = ErrorCode.UNREADABLE


@dataclass(frozen=True)
class _JobKind:
    """A kind of job."""

    upload: str  # what it takes, for people
    options: frozenset[str]  # fields of _JobQuery that count, of UserInput by their names there
    work: Callable[[Json, Report], Sequence[str]]  # takes the request; returns warnings
    processes: bool = False  # whether it starts some, which decode its photos


def run_worker() -> None:
    """Carry out the request on stdin."""
    request = json.loads(sys.stdin.buffer.read())
    answers = begin_helper()
    os.chdir(request["folder"])
    _limit_process(request["max_bytes"])
    network = [Path(request["model"])] if request["model"] else []
    confine_to_folder(Path(request["folder"]), network, processes=JOB_KINDS[request["kind"]].processes)

    def report(part: float) -> None:
        _answer(answers, {"progress": round(min(max(part, 0.0), 1.0), 3)})

    traced = bool(request.get("traced"))
    try:
        with listen_to_steps(lambda step: _answer(answers, {"step": step})) if traced else nullcontext():
            warnings = JOB_KINDS[request["kind"]].work(request, lambda part: report(_WORK_SHARE * part))
            _pack(_OUT)
        _answer(answers, {"warnings": [text[:_MAX_WARNING] for text in warnings[:_MAX_WARNINGS]]})
    except LightingError as error:
        _answer(answers, {"error": str(error), "code": error.code.value})
    except (OSError, MemoryError) as error:
        reason = "memory" if isinstance(error, MemoryError) else "disk"
        _answer(answers, {"error": f"The job needs more {reason} than it may have.", "code": "unreadable"})
    except Exception:
        _answer(answers, {"log": traceback.format_exc()})


def _answer(answers: BinaryIO, content: Json) -> None:
    answers.write(json.dumps(content).encode() + b"\n")
    answers.flush()


def _limit_process(max_bytes: int) -> None:
    """Bound the size of each file, and stand back for requests that somebody waits for."""
    if sys.platform == "win32":
        return
    import resource

    os.nice(_NICENESS)
    for limit, value in ((resource.RLIMIT_FSIZE, max_bytes), (resource.RLIMIT_CORE, 0)):
        hard = resource.getrlimit(limit)[1]
        bound = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(limit, (bound, bound))


def _pack(folder: Path) -> None:
    """Put a folder into RESULT_FILE, which appears when it is whole."""
    with trace_step("encode"):
        with zipfile.ZipFile(_PART, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for path in sorted(path for path in folder.rglob("*") if path.is_file()):
                archive.write(path, path.relative_to(folder))
        _PART.replace(RESULT_FILE)


def _user_input(request: Json) -> UserInput:
    stated = dict(request["user_input"])
    time = stated.get("time")
    return UserInput(**{**stated, "time": datetime.fromisoformat(time) if time else None})


def _adjustments(options: Json) -> Adjustments | None:
    stated = options["adjustments"]
    return stated and Adjustments(**{**stated, "sun": stated["sun"] and tuple(stated["sun"])})


def _map_options(options: Json) -> Any:
    detail = options.get("detail", True)  # requests of earlier versions, which wait on disk, have none
    return {"sun": options["sun"], "detail": detail, "adjustments": _adjustments(options)}


def _process_clip(request: Json, report: Report) -> Sequence[str]:
    """`lighting video`."""
    from lighting.model import Model
    from lighting.video.decode import Clip
    from lighting.video.output import OutputOptions, VideoJob, process_video

    limit_address_space(_MEMORY)
    options = request["options"]
    view = _map_options(options)
    outputs = OutputOptions(options["height"], tool=options["tool"], film=options["preview"], **view)
    curve = options.get("curve")  # requests of earlier versions have none
    job = VideoJob(Path(request["upload"]), _OUT, _user_input(request), options["every"], outputs, curve)
    with Clip(job.source) as clip:
        duration = max(clip.info.duration, 1e-3)
    model = Model.load(Path(request["model"]) if request["model"] else None, threads=1)
    result = process_video(job, model, lambda time: report(time / duration))
    if all(isinstance(shot, VideoError) for shot in result.shots):
        raise next((shot for shot in result.shots if isinstance(shot, VideoError)), VideoError(result.damage))
    numbered = enumerate(result.shots, 1)
    warnings = [
        f"Shot {number}: {text}"
        for number, shot in numbered
        for text in ((str(shot),) if isinstance(shot, VideoError) else result.warnings(number))
    ]
    return [*warnings, result.damage] if result.damage else warnings


def _estimate_photos(request: Json, report: Report) -> Sequence[str]:
    """`lighting batch`."""
    from lighting.batch.job import BatchJob, MapOptions
    from lighting.batch.pool import open_batch, run_pool
    from lighting.batch.results import find_photos

    _unpack(Path(request["upload"]), request["max_bytes"] // 2)
    source, names = find_photos(str(_PHOTOS))
    options = request["options"]
    maps = MapOptions(options["height"], **_map_options(options)) if options["envmap"] else None
    job = BatchJob(source, str(_OUT), request["model"], maps, user_input=_user_input(request))
    with open_batch(job) as journal:
        for done, _ in enumerate(run_pool(job, names, journal, workers=1), 1):
            report(done / len(names))
        failed = journal.failed
    return [f"{failed} of {len(names)} photos cannot be read; lighting.jsonl says why."] if failed else []


def _estimate_normals(request: Json, report: Report) -> Sequence[str]:
    """`lighting stereo normals`."""
    from lighting.stereo.output import NormalsOptions, NormalsProgress, estimate_normals, write_normals
    from lighting.stereo.solver import Network

    limit_address_space(_MEMORY)
    _unpack(Path(request["upload"]), request["max_bytes"] // 2)
    stated = request["user_input"]
    known = {name: stated[name] for name in ("latitude", "longitude", "heading", "utc_offset")}
    pose = {"pitch": request["options"]["camera_elevation"], "roll": request["options"]["camera_roll"]}

    def photos(paths: Sequence[Path]) -> Iterator[Path]:
        return _watch(paths, len(paths), lambda part: report(_READ_SHARE * part))

    def pixels(parts: Iterable[Any], count: int) -> Iterator[Any]:
        return _watch(parts, count, lambda part: report(_READ_SHARE + (1 - _READ_SHARE) * part))

    day = _only_folder(_PHOTOS)
    result = estimate_normals(day, NormalsOptions(**known, **pose), Network.load(), NormalsProgress(photos, pixels))
    write_normals(_OUT, result)
    return result.warnings


def _watch(items: Iterable[T], count: int, report: Report) -> Iterator[T]:
    for done, item in enumerate(items):
        report(done / max(count, 1))
        yield item


def _only_folder(folder: Path) -> Path:
    """A folder, or the only folder in it, as archives of a folder have."""
    inside = list(folder.iterdir())
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else folder


def _unpack(archive: Path, max_bytes: int) -> None:
    """Unpack a ZIP of photos into _PHOTOS, whatever its names and sizes say; raises _UploadError."""
    left = max_bytes
    try:
        with zipfile.ZipFile(archive) as source:
            files = [info for info in source.infolist() if not info.is_dir() and not _is_link(info)]
            if len(files) > MAX_FILES:
                raise _UploadError(f"The ZIP holds {len(files)} files; at most {MAX_FILES} are taken.")
            for info in files:
                with source.open(info) as packed, _create_file(info.filename) as target:
                    while block := packed.read(min(_SLICE, left + 1)):
                        left -= len(block)
                        if left < 0:
                            raise _UploadError(f"The ZIP holds more than {max_bytes / 1e6:g} MB of photos.")
                        target.write(block)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, ValueError) as error:
        raise _UploadError("The upload is no ZIP that can be read.") from error
    _PHOTOS.mkdir(exist_ok=True)


def _is_link(info: zipfile.ZipInfo) -> bool:
    return stat.S_ISLNK(info.external_attr >> 16)


def _create_file(name: str) -> BinaryIO:
    """A new file below _PHOTOS, under the name in an archive as far as that stays there."""
    parts = [part[-100:] for part in PurePosixPath(name.replace("\\", "/")).parts if part.strip("./ ")]
    path = _PHOTOS.joinpath(*parts[-4:] or ["photo"])
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("xb")
    except OSError as error:
        raise _UploadError("The ZIP holds a name that is no file's, or one twice.") from error


_USER_INPUT = frozenset({"metadata", "time", "utc_offset", "latitude", "longitude", "heading", "vertical_fov"})
MAP_OPTIONS = frozenset({"height", "detail", "sun", "exposure", "haze", "overcast"})
JOB_KINDS = {
    "video": _JobKind(
        "a clip",
        _USER_INPUT | MAP_OPTIONS | {"camera_height", "keep_location", "every", "curve", "for", "preview"},
        _process_clip,
    ),
    "photos": _JobKind(
        "a ZIP of photos, each by itself",
        _USER_INPUT - {"time", "heading"} | MAP_OPTIONS | {"camera_height", "keep_location", "envmap"},
        _estimate_photos,
        processes=True,
    ),
    "normals": _JobKind(
        "a ZIP of photos of one day, from a camera that did not move",
        frozenset({"latitude", "longitude", "heading", "utc_offset", "camera_elevation", "camera_roll"}),
        _estimate_normals,
    ),
}

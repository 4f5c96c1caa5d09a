"""The kinds of long jobs: what each takes, and its work, in a process of its own (`run_worker`).

The process gets a request as JSON on stdin and writes lines of JSON to stdout. Now and then a line is
`{"progress": 0.5}`, and for a traced job `{"step": [...]}`, the fields of a Step. The last one is `{"warnings": [...]}`
or `{"error": ..., "code": ...}`. It works in the job's folder, where the upload lies.
"""

import errno
import json
import os
import stat
import sys
import traceback
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from datetime import datetime
from itertools import count
from pathlib import Path, PurePosixPath
from typing import Any, BinaryIO, TypeVar

from lighting.confinement import confine_to_folder
from lighting.errors import ErrorCode, LightingError, VideoError
from lighting.fields import Json
from lighting.files import FileOptions, escape_undecodable
from lighting.fusion.user_input import UserInput
from lighting.map_options import Adjustments, Around, MapOptions, around_of_switches, option_texts
from lighting.onnx_session import weights_path
from lighting.runtime import begin_helper, limit_address_space
from lighting.tracing import listen_to_steps, trace_step

_T = TypeVar("_T")
Report = Callable[[float], None]  # takes the part that is done, 0 to 1

UPLOAD_STEM, RESULT_FILE = "upload", "result.zip"
MAX_FILES = 2000  # in a ZIP of photos
_PHOTOS, _OUT, _PART = Path("photos"), Path("out"), Path("result.part")
_SLICE = 1 << 20  # bytes that are unpacked at once
_MEMORY = 4_000_000_000  # bytes of address space for clips and normals; photos are decoded in processes with their own
MAX_WARNINGS, MAX_WORDS = 50, 500  # of a job, and letters of one and of an error
_MAX_LOG, _MAX_NAME = 4000, 100  # letters of a traceback and of a name
DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)  # errors of the system
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
    network = [Path(request["model"]), weights_path(Path(request["model"]))] if request["model"] else []
    confine_to_folder(Path(request["folder"]), network, processes=JOB_KINDS[request["kind"]].processes)

    def report(part: float) -> None:
        _answer(answers, {"progress": round(min(max(part, 0.0), 1.0), 3)})

    traced = bool(request.get("traced"))
    try:
        with listen_to_steps(lambda step: _answer(answers, {"step": step})) if traced else nullcontext():
            warnings = JOB_KINDS[request["kind"]].work(request, lambda part: report(_WORK_SHARE * part))
            _pack(_OUT)
        _answer(answers, {"warnings": [_as_words(text) for text in warnings[:MAX_WARNINGS]]})
    except LightingError as error:
        _answer(answers, {"error": _as_words(str(error)), "code": error.code.value})
    except MemoryError:
        _answer(answers, {"error": "The job needs more memory than it may have.", "code": "unreadable"})
    except Exception as error:
        told = {"log": escape_undecodable(traceback.format_exc())[-_MAX_LOG:]}
        if _is_disk_full(error):
            told = {"error": "The job needs more disk than it may have, or than there is.", "code": "unreadable"}
        _answer(answers, told)


def _is_disk_full(error: Exception) -> bool:
    return isinstance(error, OSError) and error.errno in DISK_FULL


def _as_words(text: str) -> str:
    """A sentence as an answer holds it: short, and without the half characters that names of files may have."""
    return escape_undecodable(text)[:MAX_WORDS]


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


def _view(options: Json, without_detail: str) -> MapOptions:
    """The options of maps, also of a request of 0.2.0, which waits on disk."""
    if "view" in options:
        return MapOptions.of_json(options["view"])
    around = around_of_switches(None, options.get("detail", True), without_detail)
    return MapOptions.of_json({**{name: options[name] for name in ("height", "sun", "adjustments")}, "around": around})


def _process_clip(request: Json, report: Report) -> Sequence[str]:
    """`lighting video`."""
    from lighting.model import Model
    from lighting.video.decode import Clip
    from lighting.video.output import OutputOptions, VideoJob, process_video

    limit_address_space(_MEMORY)
    options = request["options"]
    outputs = OutputOptions(_view(options, Around.PLAIN), options["tool"], film=options["preview"])
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
    from lighting.batch.job import BatchJob, MapOutput
    from lighting.batch.photo_search import find_photos
    from lighting.batch.pool import open_batch, run_pool

    renamed = _unpack(Path(request["upload"]), request["max_bytes"] // 2)
    source, names = find_photos(str(_PHOTOS))
    options = request["options"]
    file = FileOptions(**options.get("file", {}))
    maps = MapOutput(_view(options, Around.PHOTO), file) if options["envmap"] else None
    job = BatchJob(source, str(_OUT), request["model"], maps, user_input=_user_input(request))
    with open_batch(job) as journal:
        for done, _ in enumerate(run_pool(job, names, journal, workers=1), 1):
            report(done / len(names))
        failed = journal.failed
    told = [f"{failed} of {len(names)} photos cannot be read; lighting.jsonl says why."] if failed else []
    return [*told, *renamed]


def _estimate_normals(request: Json, report: Report) -> Sequence[str]:
    """`lighting stereo normals`."""
    from lighting.stereo.normal_network import Network
    from lighting.stereo.output import NormalsOptions, NormalsProgress, estimate_normals, write_normals

    limit_address_space(_MEMORY)
    renamed = _unpack(Path(request["upload"]), request["max_bytes"] // 2)
    stated = request["user_input"]
    known = {name: stated[name] for name in ("latitude", "longitude", "heading", "utc_offset")}
    pose = {name: request["options"][name] for name in ("camera_elevation", "camera_roll")}

    def photos(paths: Sequence[Path]) -> Iterator[Path]:
        return _watch(paths, len(paths), lambda part: report(_READ_SHARE * part))

    def pixels(parts: Iterable[Any], count: int) -> Iterator[Any]:
        return _watch(parts, count, lambda part: report(_READ_SHARE + (1 - _READ_SHARE) * part))

    day = _only_folder(_PHOTOS)
    result = estimate_normals(day, NormalsOptions(**known, **pose), Network.load(), NormalsProgress(photos, pixels))
    write_normals(_OUT, result)
    return [*result.warnings, *renamed]


def _watch(items: Iterable[_T], count: int, report: Report) -> Iterator[_T]:
    for done, item in enumerate(items):
        report(done / max(count, 1))
        yield item


def _only_folder(folder: Path) -> Path:
    """A folder, or the only folder in it, as archives of a folder have."""
    inside = list(folder.iterdir())
    return inside[0] if len(inside) == 1 and inside[0].is_dir() else folder


def _unpack(archive: Path, max_bytes: int) -> list[str]:
    """Unpack a ZIP of photos into _PHOTOS, whatever its names and sizes say; raises _UploadError.

    Args:
        archive: the upload.
        max_bytes: of all its photos.

    Returns:
        Sentences about photos of one name, which get different ones.
    """
    left, renamed = max_bytes, list[str]()
    with _zip_errors(), zipfile.ZipFile(archive) as source:
        files = [info for info in source.infolist() if not info.is_dir() and not stat.S_ISLNK(info.external_attr >> 16)]
        if len(files) > MAX_FILES:
            raise _UploadError(f"The ZIP holds {len(files)} files; at most {MAX_FILES} are taken.")
        for info in files:
            path = _path_of(info.filename)
            with _create_file(path, info.filename) as target, source.open(info) as packed:
                while block := packed.read(_SLICE):
                    left -= len(block)
                    if left < 0:
                        raise _UploadError(f"The ZIP holds more than {max_bytes / 1e6:g} MB of photos.")
                    target.write(block)
            if (name := Path(target.name).name) != path.name:
                renamed.append(f"The ZIP holds {path.name} more than once in a folder; one is {name} now.")
    _PHOTOS.mkdir(exist_ok=True)
    return renamed


@contextmanager
def _zip_errors() -> Iterator[None]:
    """Say that a ZIP is none, unless the disk failed: each way of packing has errors of its own."""
    try:
        yield
    except (LightingError, MemoryError):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):  # bz2's, and of a wrong offset
            raise
        raise _UploadError("The upload is no ZIP that can be read.") from error


def _path_of(name: str) -> Path:
    """The path below _PHOTOS of a name in an archive, as far as that stays there."""
    parts = [part[-100:] for part in PurePosixPath(name.replace("\\", "/")).parts if part.strip("./ ")]
    return _PHOTOS.joinpath(*parts[-4:] or ["photo"])


def _create_file(path: Path, name: str) -> BinaryIO:
    """A new file for a name in an archive; where there is one, under the next number."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        for number in count(1):
            with suppress(FileExistsError):
                return path.with_stem(f"{path.stem}-{number}" if number > 1 else path.stem).open("xb")
    except (OSError, ValueError) as error:
        if _is_disk_full(error):
            raise
        raise _UploadError(f"The ZIP holds a name that is no file's: {name[-_MAX_NAME:]}.") from error
    raise AssertionError


_USER_INPUT = frozenset({"metadata", "time", "utc_offset", "latitude", "longitude", "heading", "vertical_fov"})
_CLIP_OPTIONS = frozenset({"height", "around", "sun", *option_texts(Adjustments)})
MAP_OPTIONS = _CLIP_OPTIONS | frozenset({*option_texts(MapOptions), *option_texts(FileOptions)})
JOB_KINDS = {
    "video": _JobKind(
        "a clip",
        _USER_INPUT | _CLIP_OPTIONS | {"camera_height", "keep_location", "every", "curve", "for", "preview"},
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

"""The files of a batch: which of a folder are its photos, and its results.

Results are a journal of JSON lines, appended so that a killed batch can be resumed, and a Parquet table.
"""

import glob
import json
import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, fields
from datetime import datetime
from itertools import islice
from pathlib import Path, PurePath
from types import NoneType, UnionType
from typing import Any, BinaryIO, get_args, get_origin

from lighting.errors import BatchError, ParameterError, require_extra
from lighting.files import MAP_FORMATS, atomic_write, escape_undecodable
from lighting.photo.linear import RAW_SUFFIXES
from lighting.records import Json, Lighting, SunCandidate

SETTINGS = "batch.json"
JOURNAL = "lighting.jsonl"
TABLE = "lighting.parquet"
ROW_GROUP_SIZE = 8192  # of a row group, which is held in memory


class Journal:
    """The `names` of the finished photos, and the open file to which their lines are appended."""

    def __init__(self, file: BinaryIO) -> None:
        """Truncate the file after its last whole line; a photo whose line was cut short counts as not finished.

        Args:
            file: open to read and append, at its start.
        """
        self.names: set[str] = set()
        self.failed = 0
        self.ragged = False  # whether there is something else between the lines
        self._file = file
        end = 0
        for line in file:
            if not line.endswith(b"\n"):
                break  # what a killed batch or a power cut left
            end += len(line)
            if (record := _record(line)) is None or escape_undecodable(record["file"]) in self.names:
                self.ragged = True
            else:
                self._count(escape_undecodable(record["file"]), "error" in record)
        file.truncate(end)

    def append(self, name: str, line: str, *, failed: bool) -> None:
        """Add a photo's line and flush it to the operating system, so that killing this process does not lose it.

        Args:
            name: of the photo.
            line: JSON, without an end of line.
            failed: whether it holds an error.
        """
        self._file.write(line.encode() + b"\n")
        self._file.flush()
        self._count(name, failed)

    def clear(self) -> None:
        """Discard all lines."""
        self._file.truncate(0)
        self.names.clear()
        self.failed = 0

    def _count(self, name: str, failed: bool) -> None:
        self.names.add(name)
        self.failed += failed


@contextmanager
def open_journal(path: Path) -> Iterator[Journal]:
    """Open the journal in a file, which is created if it does not exist.

    The lines of photos that failed are removed, so that these photos are tried again. What somebody else wrote between
    the lines moves to a file of that name with `.removed`.

    Args:
        path: the file.

    Raises:
        BatchError: another process holds it open.
    """
    with path.open("a+b") as file:
        _lock(file, path)
        file.seek(0)
        journal = Journal(file)
        if not journal.failed and not journal.ragged:
            yield journal
            return
        with _without_failures(file, path) as rest:
            yield Journal(rest)


@contextmanager
def _without_failures(file: BinaryIO, path: Path) -> Iterator[BinaryIO]:
    """A locked file with the first line of each photo that did not fail alone, which has replaced the first one."""
    file.seek(0)
    with ExitStack() as stack:
        with atomic_write(path) as temporary:
            rest = stack.enter_context(temporary.open("a+b"))
            _lock(rest, path)
            rest.writelines(_sort_lines(file, path))
            rest.flush()
        rest.seek(0)
        yield rest


def _sort_lines(file: Iterable[bytes], path: Path) -> Iterator[bytes]:
    """The lines that stay; those that no batch wrote are appended to the file with `.removed`."""
    names, removed = set[str](), list[bytes]()
    for line in file:
        record = _record(line)
        if record and "error" in record:
            continue
        if record and record["file"] not in names:
            names.add(record["file"])
            yield line
        elif line.strip(b"\0\r\n"):
            removed.append(line)
    if removed:
        with path.with_name(f"{path.name}.removed").open("ab") as others:
            others.writelines(removed)


def has_lights(lines: Iterable[bytes]) -> bool:
    """Tell whether a photo that did not fail is among a journal's lines.

    Args:
        lines: each with its end.
    """
    return any("error" not in record for line in lines if (record := _record(line)))


def _read_records(path: Path) -> Iterator[Json]:
    """The records of a journal, in the order in which the photos were finished."""
    with path.open("rb") as file:
        yield from map(json.loads, file)


def _record(line: bytes) -> Json | None:
    """The record in a line; None for an incomplete one, and for what no batch writes."""
    try:
        record = json.loads(line)
    except (ValueError, RecursionError):
        return None
    named = isinstance(record, dict) and isinstance(record.get("file"), str)
    answers = named and isinstance(record.get("error", ""), str) and isinstance(record.get("lighting", {}), dict)
    return record if answers and line.endswith(b"\n") else None


def _lock(file: BinaryIO, path: Path) -> None:
    if sys.platform == "win32":
        return
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        raise BatchError(f"Another batch is running in {path.parent}.") from error


def table_row(
    name: str, light: Lighting | str, crop: Mapping[str, int] | None = None, probe: Mapping[str, Any] | None = None
) -> Json:
    """Make the row of a photo.

    Args:
        name: of the photo.
        light: its light, or the reason why it has none.
        crop: the fields of its PhotoCrop; None where the whole picture is the photo.
        probe: the record's `light_probe`; None where it has none.
    """
    trust = None if isinstance(light, str) else light.trust.value
    file, beside = escape_undecodable(name), {"trust": trust, "crop": crop, "light_probe": probe}
    if isinstance(light, str):
        return {"file": file, "error": light, **dict.fromkeys(field.name for field in fields(Lighting)), **beside}
    return {"file": file, "error": None, **asdict(light), **beside}


def require_parquet(out: Path) -> None:
    """Raise MissingExtraError if pyarrow is not installed, BatchError if a folder takes no TABLE.

    Args:
        out: the folder.
    """
    table_schema()
    check_table(out)


def check_table(out: Path) -> None:
    """Raise BatchError if TABLE in a folder is a folder, or a link into a folder that does not exist.

    Args:
        out: the folder.
    """
    table = out / TABLE
    if table.is_dir():
        raise BatchError(f"{table} is a folder, as --engine ray writes it; choose another one for the results.")
    if table.is_symlink() and not (parent := Path(os.path.realpath(table)).parent).is_dir():
        raise BatchError(f"{table} is a link to a file in {parent}, which is no folder.")


def write_parquet(out: Path) -> None:
    """Write TABLE (extra `all`) from the JOURNAL in a folder; the file appears only when it is whole.

    Args:
        out: the folder.

    Raises:
        BatchError: a light cannot be, for somebody edited its line, whose number the error has.
    """
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    # absolute, since a name such as `s3:...` would be an address
    with atomic_write(out / TABLE) as path, ParquetWriter(path.absolute(), table_schema()) as writer:
        rows, done = _rows(out / JOURNAL), 0
        while part := list(islice(rows, ROW_GROUP_SIZE)):
            try:
                writer.write_table(pyarrow.Table.from_pylist(part, table_schema()))
            except _arrow_errors(pyarrow) as error:
                raise _misfit_error(out / JOURNAL, part, done) from error
            done += len(part)


def _arrow_errors(pyarrow: Any) -> tuple[type[Exception], ...]:
    """What pyarrow raises for values that are none of a schema's."""
    return pyarrow.ArrowException, TypeError, ValueError, OverflowError, AttributeError


def _misfit_error(journal: Path, rows: Sequence[Json], done: int) -> BatchError:
    """The error that names the line of the first row whose `crop` or `light_probe` is none; `done` lines went before.

    All else of a line is checked as its record is read.
    """
    import pyarrow

    schema = table_schema()
    for number, row in enumerate(rows, start=done + 1):
        for name in ("crop", "light_probe"):
            try:
                pyarrow.array([row[name]], schema.field(name).type)
            except _arrow_errors(pyarrow):
                return BatchError(f"{journal}, line {number}: {name} is not what a batch writes.")
    return BatchError(f"{journal} holds what is not what a batch writes.")


def read_suitable(results: Path) -> Iterator[float | None]:
    """Return `suitable` of each photo; None where the photo failed or the network does not say it.

    Args:
        results: a JOURNAL or a TABLE.

    Raises:
        BatchError: somebody edited a line of the journal, whose number the error has.
    """
    if results.name == JOURNAL:
        for number, record in enumerate(_read_records(results), start=1):
            share = record.get("lighting", {}).get("suitable")
            if share is not None and not (isinstance(share, int | float) and 0 <= share <= 1):
                raise BatchError(f"{results}, line {number}: suitable is not what a batch writes.")
            yield share
        return
    from pyarrow.parquet import read_table

    yield from read_table(results, columns=["suitable"]).column(0).to_pylist()


def read_trust(results: Path) -> Iterator[str | None]:
    """Return `trust` of each photo; None where the photo failed.

    Args:
        results: a JOURNAL or a TABLE.

    Raises:
        BatchError: somebody edited a line of the journal, whose number the error has.
    """
    if results.name == JOURNAL:
        yield from (row["trust"] for row in _rows(results))
        return
    from pyarrow.parquet import read_table

    yield from read_table(results, columns=["trust"]).column(0).to_pylist()


def table_schema() -> Any:
    """Return the table's pyarrow.Schema; raises MissingExtraError if pyarrow is not installed."""
    from lighting.photo.reader import PhotoCrop

    pyarrow = require_extra("pyarrow", "Parquet needs pyarrow", "all")
    kinds = {field.name: _kind(pyarrow, field.type) for field in fields(Lighting)}
    crop = pyarrow.struct({field.name: pyarrow.int64() for field in fields(PhotoCrop)})
    number, numbers = pyarrow.float64(), pyarrow.list_(pyarrow.float64())
    main_light = pyarrow.struct({"direction": numbers, "irradiance": numbers, "lux": number, "kelvin": number})
    probe = pyarrow.struct({"coefficients": pyarrow.list_(numbers), "main_light": main_light})
    names = {"file": pyarrow.string(), "error": pyarrow.string()}
    return pyarrow.schema({**names, **kinds, "trust": pyarrow.string(), "crop": crop, "light_probe": probe})


def _kind(pyarrow: Any, hint: Any) -> Any:
    """The pyarrow type of a field of Lighting: text, time, number, candidate, or a list of one; any may be absent."""
    if get_origin(hint) is UnionType:
        return _kind(pyarrow, next(kind for kind in get_args(hint) if kind is not NoneType))
    if get_origin(hint) is tuple:
        return pyarrow.list_(_kind(pyarrow, get_args(hint)[0]))
    if hint is SunCandidate:
        return pyarrow.struct({field.name: _kind(pyarrow, field.type) for field in fields(hint)})
    if hint is datetime:
        return pyarrow.timestamp("us", tz="UTC")
    return pyarrow.string() if hint is str else pyarrow.float64()


def _rows(journal: Path) -> Iterator[Json]:
    for number, record in enumerate(_read_records(journal), start=1):
        stored = record.get("lighting", {})
        try:
            light = record["error"] if "error" in record else Lighting.from_dict(stored)
        except ParameterError as error:
            raise BatchError(f"{journal}, line {number}: {error}") from error
        yield table_row(record["file"], light, record.get("crop"), stored.get("light_probe"))


PHOTO_SUFFIXES = (  # of photos in a folder; a glob may match any file
    ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".heic", ".heif", ".hif", ".tif", ".tiff", ".avif",
    *RAW_SUFFIXES, ".x3f",
)  # fmt: skip
_OTHER_SUFFIXES = (  # of pictures that are no photos or that nothing here is known to read, and of clips
    ".heics", ".heifs", ".avifs", ".insp", ".jps", ".pns", ".thm", ".lri",
    ".gpr", ".srw", ".sr2", ".srf", ".3fr", ".fff", ".iiq", ".eip", ".erf", ".kdc", ".dcr", ".dcs", ".k25",
    ".mrw", ".mef", ".mos", ".mdc", ".crw", ".bay", ".pxn", ".ptx", ".r3d", ".ari", ".braw", ".rwz", ".raw", ".cin",
    ".gif", ".bmp", ".dib", ".jxl", ".jp2", ".j2k", ".j2c", ".jpf", ".jpx", ".jpm", ".jxr", ".wdp", ".hdp", ".jls",
    ".psd", ".psb", ".svg", ".svgz", ".pdf", ".eps", ".ai", ".exr", ".hdr", ".dpx", ".tga", ".dds", ".ktx",
    ".ppm", ".pgm", ".pbm", ".pnm", ".pam", ".pfm", ".xcf", ".kra", ".ora", ".ico", ".icns", ".pcx", ".sgi", ".qoi",
    ".flif", ".bpg", ".fits", ".djvu", ".wmf", ".emf", ".apng",
    ".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".wmv", ".3gp", ".3g2", ".mts", ".m2ts", ".mpg", ".mpeg", ".flv",
    ".insv", ".360", ".lrv", ".lrf", ".livp",
)  # fmt: skip
IN_CACHES = "in caches"  # the reason of pictures that programs made of others, or that a user threw away
_CACHE_NAMES = {  # of folders, in small letters
    "@eadir", "@tmp", "#recycle", "#snapshot", "@recycle", "@recently-snapshot", "@transcode",  # of Synology and QNAP
    "@synoresource", "~snapshot", "files_trashbin", "files_versions",  # of Synology, NetApp and Nextcloud
    "system volume information", "network trash folder", "temporary items",
    "papierkorb", "corbeille", "papelera", "cestino", "prullenbak", "papperskorg", "lixeira", "kosz",
    "$recycle.bin", "recycle.bin", "recycler", "recycled", "recycle bin", "trash", "trash folder", "lost+found",
    "recently deleted", "deleted items", "__macosx", "thevolumesettingsfolder", "@sharesnap", "@recently",
    "корзина", "ごみ箱", "ゴミ箱", "回收站", "휴지통", "_vti_cnf", "node_modules",
}  # fmt: skip
_CACHE_NAME = re.compile(
    r"thumbnail|(?:^|[._@-])thumbs?$|(?:^|[ ._@-]|image|photo|preview)caches?$|^appdata_|\.lrdata$"
)
_LIBRARIES = (".photoslibrary", ".photolibrary", ".aplibrary", ".migratedphotolibrary")  # of Apple's programs
_ORIGINALS = ("originals", "masters")  # the folders of libraries that hold photos
_DERIVATIVES = ("derivatives", "renders")  # below a library's "resources"
_INDEX_FOLDERS = ("thm", "idx")  # below a camera's "misc"


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
    source, candidates = _candidates(pattern)
    suffixes = PHOTO_SUFFIXES if Path(pattern).is_dir() else ("",)
    names = sorted(name for name in candidates if name.lower().endswith(suffixes) and not is_set_aside(name, pattern))
    if not names:
        skipped = format_counts(count_skipped(pattern))
        hint = f"; what it holds is not taken{skipped}" if skipped else ""
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any{hint}.")
    return source, names


def count_skipped(pattern: str) -> Counter[str]:
    """Count the pictures and clips that are not taken: by suffix, and those in caches.

    A batch's own maps are none of them. Of a glob, which says what is wanted, those in caches count alone.

    Args:
        pattern: a folder or a glob.
    """
    folder, (_, candidates) = Path(pattern).is_dir(), _candidates(pattern)
    skipped = Counter[str]()
    for name in candidates:
        known = name.lower().endswith((*PHOTO_SUFFIXES, *_OTHER_SUFFIXES)) and not _is_own_output(name)
        if known and _is_in_cache(PurePath(name).parts[:-1], pattern):
            skipped[IN_CACHES] += 1
        elif known and folder and not name.lower().endswith(PHOTO_SUFFIXES):
            skipped[PurePath(name).suffix.lower()] += 1
    return skipped


def is_set_aside(name: str, pattern: str) -> bool:
    """Tell whether a file is never a photo, by its name: a batch's own, or in a cache that the pattern does not name.

    Args:
        name: of a file, relative to the batch's folder.
        pattern: a folder, its URI or a glob.
    """
    return _is_own_output(name) or _is_in_cache(PurePath(name).parts[:-1], pattern)


def format_counts(counts: Counter[str]) -> str:
    """Return the reasons in brackets after a space, such as "(2 .gif, 1 .jxl)", the most frequent first; "" for none.

    Args:
        counts: by the reason.
    """
    ordered = sorted(counts.items(), key=lambda kind: (-kind[1], kind[0]))
    listed = ", ".join(f"{count} {reason}" for reason, count in ordered)
    return f" ({listed})" if listed else ""


def _is_own_output(name: str) -> bool:
    """Whether a file is named as a batch names its results and a photo's map."""
    if PurePath(name).name in (SETTINGS, JOURNAL, TABLE):
        return True
    photo, _, suffix = name.rpartition(".")
    return suffix in MAP_FORMATS and MAP_FORMATS[suffix].read is not None and photo.lower().endswith(PHOTO_SUFFIXES)


def _is_in_cache(folders: Sequence[str], pattern: str) -> bool:
    """Whether a folder on the way to a file holds what programs made of photos, or a user threw away.

    Folders that the pattern names itself are none.
    """
    lower = [folder.lower() for folder in folders]
    named = {part.lower() for part in PurePath(pattern).parts}
    for index, folder in enumerate(lower):
        parent = lower[index - 1] if index else ""
        cache = folder in _CACHE_NAMES or _CACHE_NAME.search(folder)
        derived = (parent == "resources" and folder in _DERIVATIVES) or (parent == "misc" and folder in _INDEX_FOLDERS)
        beside = parent.endswith(_LIBRARIES) and folder not in _ORIGINALS
        if (cache or derived or beside) and folder not in named:
            return True
    return False


def _candidates(pattern: str) -> tuple[str, Iterator[str]]:
    """A batch's folder, and names of all files in it at any depth, or of those that a glob matches."""
    if Path(pattern).is_dir():
        return pattern, _files_below(Path(pattern))
    source = _fixed_part(pattern)
    return source, _matches(pattern, Path(source))


def _files_below(source: Path) -> Iterator[str]:
    """Names of the files at any depth, without hidden files and folders."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        for name in files:
            relevant = name.lower().endswith((*PHOTO_SUFFIXES, *_OTHER_SUFFIXES)) and name[0] != "."
            if relevant and not _is_pipe_or_device(Path(parent, name)):
                yield (below / name).as_posix()


def _is_pipe_or_device(path: Path) -> bool:
    """Whether a file is a pipe, a socket or a device, from which reading may not end; a broken link is none."""
    return path.exists() and not path.is_file()


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once; hidden ones only where the glob names a dot.

    A part that exists as it is written is no pattern, so that "[2024] trip" is that folder, never "2 trip". Nor are
    brackets: "a[1].*" is "a[1].jpg" where there is one, never "a1.jpg". No link to a folder is followed by `**`, for it
    may lead back to where it stands. Raises BatchError for a name that holds `**` beside other letters.
    """
    parts = Path(pattern).parts[len(source.parts) :]
    if any("**" in part and part != "**" for part in parts):
        raise BatchError(f"{pattern} is no pattern: ** means folders; write it between slashes, as in photos/**/*.jpg.")
    if parts[-1:] == ("**",):
        parts = (*parts, "*")
    hidden = any(part.startswith(".") for part in parts)
    found = {source}
    for part in parts:
        found = _match_part(found, part)
    names = {path.relative_to(source) for path in found if path.is_file()}
    yield from (name.as_posix() for name in names if hidden or not any(part.startswith(".") for part in name.parts))


def _match_part(folders: set[Path], part: str) -> set[Path]:
    """What a part of a glob matches in folders; if any of them holds it, or its brackets, as written, that alone."""
    if part == "**":
        return {Path(parent) for folder in folders for parent, _, _ in os.walk(folder)}
    written = {folder / part for folder in folders if _exists(folder / part)}
    return written or _glob_part(folders, part.replace("[", "[[]")) or _glob_part(folders, part)


def _glob_part(folders: set[Path], part: str) -> set[Path]:
    return {path for folder in folders if folder.is_dir() for path in folder.glob(part)}


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that the system does not take, such as one that is too long
        return False


def _fixed_part(pattern: str) -> str:
    """The folder before a glob's first part that is a pattern."""
    folder = Path()
    for part in Path(pattern).parts[:-1]:
        if glob.has_magic(part) and not _exists(folder / part):
            break
        folder /= part
    return str(folder)

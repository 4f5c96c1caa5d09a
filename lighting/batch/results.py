"""The results of a batch.

They are a journal of JSON lines, appended so that a killed batch can be resumed, and a Parquet table.
"""

import json
import os
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, fields
from datetime import datetime
from itertools import islice
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, BinaryIO, get_args, get_origin

from lighting.errors import BatchError, ParameterError, require_extra
from lighting.fields import Json
from lighting.files import atomic_write, escape_undecodable
from lighting.records import Lighting, SunCandidate

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
    name: str, light: Lighting | str, crop: Mapping[str, int] | None = None, probe: Mapping[str, object] | None = None
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


def read_answers(results: Path) -> Iterator[tuple[float | None, str | None]]:
    """Return `suitable` and `trust` of each photo; None where the photo failed, or the network says no `suitable`.

    Args:
        results: a JOURNAL or a TABLE.

    Raises:
        BatchError: somebody edited a line of the journal, whose number the error has.
    """
    if results.name == JOURNAL:
        for _, light in _read_lights(results):
            yield (None, None) if isinstance(light, str) else (light.suitable, light.trust.value)
        return
    from pyarrow.parquet import read_table

    table = read_table(results, columns=["suitable", "trust"])
    yield from zip(table["suitable"].to_pylist(), table["trust"].to_pylist(), strict=True)


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


def _read_lights(journal: Path) -> Iterator[tuple[Json, Lighting | str]]:
    """The records of a journal, in the order in which the photos were finished, each with its light or its error."""
    with journal.open("rb") as lines:
        for number, record in enumerate(map(json.loads, lines), start=1):
            try:
                yield record, record["error"] if "error" in record else Lighting.from_dict(record.get("lighting", {}))
            except ParameterError as error:
                raise BatchError(f"{journal}, line {number}: {error}") from error


def _rows(journal: Path) -> Iterator[Json]:
    for record, light in _read_lights(journal):
        yield table_row(record["file"], light, record.get("crop"), record.get("lighting", {}).get("light_probe"))

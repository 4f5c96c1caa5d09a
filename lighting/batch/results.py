"""Results of a batch: a journal of JSON lines, appended so that a killed batch can be resumed, and a Parquet table."""

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
from lighting.files.atomic import atomic_write
from lighting.records import Json, Lighting

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
        self._file = file
        kept = end = 0
        for record, line in _first(_whole_lines(file)):
            self._count(record["file"], "error" in record)
            kept += len(line)
            end = file.tell()
        file.truncate(end)
        self.ragged = kept < end  # whether there is something else between the lines

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

    The lines of photos that failed are removed, so that these photos are tried again, and so is what is no line.

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
    """A locked file with the lines of photos that did not fail alone, which has replaced the first one."""
    file.seek(0)
    with ExitStack() as stack:
        with atomic_write(path) as temporary:
            rest = stack.enter_context(temporary.open("a+b"))
            _lock(rest, path)
            rest.writelines(line for _, line in _first(pair for pair in _whole_lines(file) if "error" not in pair[0]))
            rest.flush()
        rest.seek(0)
        yield rest


def has_lights(lines: Iterable[bytes]) -> bool:
    """Tell whether a photo that did not fail is among a journal's lines.

    Args:
        lines: each with its end.
    """
    return any("error" not in record for record, _ in _whole_lines(lines))


def _whole_lines(lines: Iterable[bytes]) -> Iterator[tuple[Json, bytes]]:
    """The records in whole lines, with these."""
    for line in lines:
        if (record := _record(line)) is not None:
            yield record, line


def _first(pairs: Iterable[tuple[Json, bytes]]) -> Iterator[tuple[Json, bytes]]:
    """Of records with their lines the first one of each photo."""
    names: set[str] = set()
    for record, line in pairs:
        if record["file"] not in names:
            names.add(record["file"])
            yield record, line


def _read_records(path: Path) -> Iterator[Json]:
    """The records of a journal, in the order in which the photos were finished."""
    with path.open("rb") as file:
        yield from map(json.loads, file)


def _record(line: bytes) -> Json | None:
    """The record in a line; None for an incomplete one."""
    try:
        record = json.loads(line)
    except ValueError:
        return None
    named = isinstance(record, dict) and isinstance(record.get("file"), str)
    return record if named and line.endswith(b"\n") else None


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
    file = name.encode(errors="backslashreplace").decode()  # file names need not be Unicode, Parquet's text must be
    beside = {"crop": crop, "light_probe": probe}
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
    """
    if results.name == JOURNAL:
        yield from (record.get("lighting", {}).get("suitable") for record in _read_records(results))
        return
    from pyarrow.parquet import read_table

    yield from read_table(results, columns=["suitable"]).column(0).to_pylist()


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
    return pyarrow.schema({**names, **kinds, "crop": crop, "light_probe": probe})


def _kind(pyarrow: Any, hint: Any) -> Any:
    """The pyarrow type of a field of Lighting: text, time, number, or a list of one; any may be absent."""
    if get_origin(hint) is UnionType:
        return _kind(pyarrow, next(kind for kind in get_args(hint) if kind is not NoneType))
    if get_origin(hint) is tuple:
        return pyarrow.list_(_kind(pyarrow, get_args(hint)[0]))
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

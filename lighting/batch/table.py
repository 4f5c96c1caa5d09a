"""Results as a Parquet table (extra `parquet`): a row per photo, a column per field of Lighting."""

import os
from collections.abc import Iterator
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, get_args, get_origin

from lighting.batch.journal import JOURNAL, read_records
from lighting.errors import BatchError, ParameterError, require_extra
from lighting.files import replacing
from lighting.records import Lighting

TABLE = "lighting.parquet"
ROWS = 8192  # of a row group, which is held in memory


def row(name: str, light: Lighting | str) -> dict[str, Any]:
    """The row of a photo: its light, or the reason why it has none."""
    file = name.encode(errors="backslashreplace").decode()  # file names need not be Unicode, Parquet's text must be
    if isinstance(light, str):
        return {"file": file, "error": light, **dict.fromkeys(field.name for field in fields(Lighting))}
    return {"file": file, "error": None, **asdict(light)}


def require_parquet(out: Path) -> None:
    """Raise MissingExtraError if pyarrow is not installed, BatchError if the folder `out` takes no TABLE."""
    schema()
    check_table(out)


def check_table(out: Path) -> None:
    """Raise BatchError if TABLE in the folder `out` is a folder, or a link into a folder that does not exist."""
    table = out / TABLE
    if table.is_dir():
        raise BatchError(f"{table} is a folder, as --engine ray writes it; choose another one for the results.")
    if table.is_symlink() and not (parent := Path(os.path.realpath(table)).parent).is_dir():
        raise BatchError(f"{table} is a link to a file in {parent}, which is no folder.")


def write_table(out: Path) -> None:
    """Write TABLE from the JOURNAL in the folder `out`; the file appears only when it is whole.

    Raises BatchError, with the number of the line, for a light that cannot be: somebody edited it.
    """
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    with replacing(out / TABLE) as path, ParquetWriter(path, schema()) as writer:
        for part in _parts(_rows(out / JOURNAL)):
            writer.write_table(pyarrow.Table.from_pylist(part, schema()))


def schema() -> Any:
    """The table's pyarrow.Schema; raises MissingExtraError if pyarrow is not installed."""
    pyarrow = require_extra("pyarrow", "Parquet needs pyarrow", "parquet")
    kinds = {field.name: _kind(pyarrow, field.type) for field in fields(Lighting)}
    return pyarrow.schema({"file": pyarrow.string(), "error": pyarrow.string(), **kinds})


def _kind(pyarrow: Any, hint: Any) -> Any:
    """The pyarrow type of a field of Lighting: text, number, or a list of either; any may be absent."""
    if get_origin(hint) is UnionType:
        return _kind(pyarrow, next(kind for kind in get_args(hint) if kind is not NoneType))
    if get_origin(hint) is tuple:
        return pyarrow.list_(_kind(pyarrow, get_args(hint)[0]))
    return pyarrow.string() if hint is str else pyarrow.float64()


def _rows(journal: Path) -> Iterator[dict[str, Any]]:
    for number, record in enumerate(read_records(journal), start=1):
        try:
            light = record["error"] if "error" in record else Lighting.from_dict(record.get("lighting", {}))
        except ParameterError as error:
            raise BatchError(f"{journal}, line {number}: {error}") from error
        yield row(record["file"], light)


def _parts(rows: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while part := list(islice(rows, ROWS)):
        yield part

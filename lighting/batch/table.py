"""Results as a table: one row a photo, the fields of a Lighting as columns, in Parquet (extra `parquet`)."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, fields
from itertools import islice
from pathlib import Path
from typing import Any, get_args, get_origin

from lighting.errors import BatchError
from lighting.files import replacing
from lighting.records import Lighting

FILE = "lighting.parquet"
ROWS = 8192  # held in memory at once, and of a row group


def row(name: str, light: Lighting | str) -> dict[str, Any]:
    """The row of a photo: its light, or why there is none."""
    file = name.encode(errors="backslashreplace").decode()  # file names need not be Unicode, Parquet's text must be
    if isinstance(light, str):
        return {"file": file, "error": light, **dict.fromkeys(field.name for field in fields(Lighting))}
    return {"file": file, "error": None, **asdict(light)}


def write_parquet(target: Path, records: Iterable[Mapping[str, Any]]) -> None:
    """Write the records of a journal as Parquet; the file appears only when it is whole."""
    import pyarrow
    from pyarrow.parquet import ParquetWriter

    with replacing(target) as path, ParquetWriter(path, schema()) as writer:
        for part in _parts(map(_row_of, records)):
            writer.write_table(pyarrow.Table.from_pylist(part, schema()))


def schema() -> Any:
    """The columns of the table, as pyarrow has them; BatchError where it is not installed."""
    try:
        import pyarrow
    except ImportError as error:
        raise BatchError("Parquet needs pyarrow: pip install 'outdoor-lighting[parquet]'.") from error
    kinds = {field.name: _kind(pyarrow, field.type) for field in fields(Lighting)}
    return pyarrow.schema({"file": pyarrow.string(), "error": pyarrow.string(), **kinds})


def _kind(pyarrow: Any, hint: Any) -> Any:
    """The column type of a field of a Lighting: text or numbers, or lists of either."""
    if get_origin(hint) is tuple:
        return pyarrow.list_(_kind(pyarrow, get_args(hint)[0]))
    return pyarrow.string() if hint is str else pyarrow.float64()


def _row_of(record: Mapping[str, Any]) -> dict[str, Any]:
    light = record["error"] if "error" in record else Lighting.from_dict(record["lighting"])
    return row(record["file"], light)


def _parts(rows: Iterator[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    while part := list(islice(rows, ROWS)):
        yield part

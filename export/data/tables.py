"""CSV tables with a header, read and written whole."""

import csv
from collections.abc import Iterable, Sequence
from pathlib import Path

from lighting.errors import LightingError
from lighting.files import replacing


class DataError(LightingError):
    """Panoramas, labels or a training run are missing, incomplete or contradict each other."""


def read_table(path: str | Path, required: Iterable[str] = ()) -> list[dict[str, str]]:
    """The rows by column, with "" for missing fields; DataError if the file or a `required` column is missing."""
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, restval="")
            missing = [name for name in required if name not in (reader.fieldnames or ())]
            if missing:
                raise DataError(f"{path} has no column {', '.join(missing)}.")
            return list(reader)
    except OSError as error:
        raise DataError(f"{path} cannot be read: {error.strerror or error}.") from error
    except (ValueError, csv.Error) as error:
        raise DataError(f"{path} cannot be read: {error}.") from error


def write_table(path: str | Path, header: Sequence[str], rows: Iterable[Iterable[object]]) -> None:
    """Write rows in the order of `header`; the file appears whole or not at all. DataError if it cannot be written."""
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows(rows)
    except OSError as error:
        raise DataError(f"{path} cannot be written: {error.strerror or error}.") from error

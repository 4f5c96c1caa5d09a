"""A table in CSV of what a person knows of single photos of a batch: a row a photo, columns by the options' names."""

import csv
import hashlib
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

from lighting.errors import BatchError, LightingError
from lighting.fields import option_name
from lighting.fusion.fspy import read_fspy
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.map_options import Adjustments

_FILE = "file"
_NUMBERS = ("latitude", "longitude", "heading", "vertical_fov", "camera_height")
_TEXTS = ("time", "utc_offset", "horizon", "reference")
_LISTS = {"shadow": "shadows", "vertical": "verticals"}  # separated by ;
_SHORT = {"lat": "latitude", "lon": "longitude", "fov": "vertical_fov"}
_COLUMNS = (_FILE, *_TEXTS, *_NUMBERS, *_LISTS, "camera", "pick")


@dataclass(frozen=True)
class PhotoInput:
    """What is known of one photo."""

    user_input: UserInput = NO_USER_INPUT
    """Replaces what is stated of all photos, field by field."""
    pick: int | None = None
    """Number of the sun in `Lighting.sun_candidates` that shines. None: the answer's."""

    def over(self, common: UserInput) -> UserInput:
        """Return what is known of the photo, with what is stated of all.

        Args:
            common: of all photos.
        """
        stated: Any = {**common.explicit_fields(), **self.user_input.explicit_fields()}
        return UserInput(**stated)


@dataclass(frozen=True)
class PhotoTable:
    """The rows of a table, by the photo's name."""

    rows: Mapping[str, PhotoInput]
    """Names are relative to the batch's folder."""
    sha256: str
    """Of the file."""


def read_photo_table(path: str) -> PhotoTable:
    """Read a table.

    Args:
        path: of the CSV, in UTF-8; the first line names the columns, of _COLUMNS. Cameras of fSpy lie beside it.

    Raises:
        BatchError: it is no such table; the sentence names file and line.
        OSError: it cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        lines = list(csv.reader(StringIO(data.decode("utf-8-sig"))))
    except (ValueError, csv.Error) as error:
        raise BatchError(f"{path} is no table of text in UTF-8, with commas.") from error
    written = [cell.strip().lower().replace("-", "_") for cell in (lines[0] if lines else [])]
    header = [_SHORT.get(name, name) for name in written]
    if unknown := next((name for name in header if name not in _COLUMNS), None):
        raise BatchError(f"{path} has a column {unknown!r}; it may have {', '.join(_COLUMNS)}.")
    if header.count(_FILE) != 1 or len(set(header)) < len(header):
        raise BatchError(f"{path} needs one column {_FILE!r}, and each other one once at most.")
    rows: dict[str, PhotoInput] = {}
    for number, cells in enumerate(lines[1:], start=2):
        values = {name: cell.strip() for name, cell in zip(header, cells, strict=False) if cell.strip()}
        if not values:
            continue
        name = values.pop(_FILE, None)
        if name is None or len(cells) > len(header) or name in rows:
            sentence = "a row has a photo's name, which no other has, and no cell without a column."
            raise BatchError(f"{path}, line {number}: {sentence}")
        try:
            rows[name] = _read_row(values, Path(path).parent)
        except (LightingError, ValueError, OSError) as error:
            text = str(error.renamed(option_name)) if isinstance(error, LightingError) else str(error)
            raise BatchError(f"{path}, line {number}: {text}") from error
    return PhotoTable(rows, hashlib.sha256(data).hexdigest())


def check_photo_names(table: PhotoTable, names: Collection[str]) -> None:
    """Raise BatchError for a row about a photo that the batch does not have.

    Args:
        table: of the batch.
        names: of its photos.
    """
    known = frozenset(names)
    if (name := next((name for name in table.rows if name not in known), None)) is not None:
        raise BatchError(f"The table has a row about {name}, which is none of the photos.")


def _read_row(values: Mapping[str, str], folder: Path) -> PhotoInput:
    stated: dict[str, Any] = {name: values[name] for name in _TEXTS if name in values}
    stated |= {name: float(values[name]) for name in _NUMBERS if name in values}
    stated |= {field: values[name].split(";") for name, field in _LISTS.items() if name in values}
    if "camera" in values:
        stated["camera"] = read_fspy((folder / values["camera"]).read_bytes())
    pick: Any = values.get("pick")
    return PhotoInput(UserInput(**stated), Adjustments(pick=pick).pick)

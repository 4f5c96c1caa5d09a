"""Labels of panoramas, as a CSV file: where the sun is, and the Hosek-Wilkie sky that fits."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from export.data.panoramas import Panorama
from export.data.tables import DataError, read_table, write_table


@dataclass(frozen=True)
class Label:
    """What training takes from a panorama; NaN where it has no value."""

    name: str
    sun_azimuth: float
    sun_elevation: float
    sun_uncertainty: float  # deg, one sigma
    sun_source: str  # "given" in the index, "found" in the picture, "none" if it has none or none is known
    found_azimuth: float  # what `find_sun` returned, whatever the source
    found_elevation: float
    turbidity: float
    exposure: float
    fit_residual: float
    fit_ok: bool
    direct: str


_COLUMNS = [field.name for field in fields(Label)]


def write_labels(labels: Iterable[Label], path: str | Path) -> None:
    """Write one row per label; the file appears whole or not at all. DataError if it cannot be written."""
    write_table(path, _COLUMNS, ([_text(getattr(label, name)) for name in _COLUMNS] for label in labels))


def read_labels(path: str | Path) -> list[Label]:
    """The labels that `write_labels` wrote; DataError if the file is missing or has another layout."""
    rows = read_table(path, _COLUMNS)
    try:
        return [Label(**{field.name: _value(row[field.name], field.type) for field in fields(Label)}) for row in rows]
    except ValueError as error:
        raise DataError(f"The labels {path} cannot be read: {error}.") from error


def labels_of(panoramas: Sequence[Panorama], path: str | Path) -> list[Label]:
    """The label of each panorama, from a file of labels; DataError if one is missing."""
    known = {label.name: label for label in read_labels(path)}
    missing = [p.name for p in panoramas if p.name not in known]
    if missing:
        raise DataError(f"{path} has no label for {missing[0]}; run `python -m export label` again.")
    return [known[p.name] for p in panoramas]


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def _value(text: str, kind: Any) -> Any:
    if kind is bool:
        return text == "yes"
    return float(text or "nan") if kind is float else text

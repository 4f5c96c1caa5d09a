"""Ordinary photos whose true sun is known from time, place and heading: `photos_train.csv`, to learn from."""

import math
from dataclasses import dataclass
from pathlib import Path

from export.data.panoramas import DataError, is_permissive, read_table

PHOTOS = "photos_train.csv"
COLUMNS = ("file", "group", "sun_azimuth", "sun_elevation", "direct", "hfov", "expected_azimuth_error")


@dataclass(frozen=True)
class PhotoRow:
    """One row; NaN where it does not tell. Angles in deg."""

    path: Path
    group: str  # one scene and hour of one photographer
    sun_azimuth: float  # relative to the camera, positive right
    sun_elevation: float
    azimuth_std: float
    direct: str  # "yes", "partly", "no", or "" where not known
    horizontal_fov: float
    licence: str = ""


def read_photo_rows(folder: str | Path) -> list[PhotoRow]:
    """The rows of a folder's photos, none if it has no such table; DataError if a row cannot be used.

    Args:
        folder: with `photos_train.csv`.
    """
    table = Path(folder) / PHOTOS
    if not table.exists():
        return []
    return [_row(row, table, line) for line, row in enumerate(read_table(table, COLUMNS), start=2)]


def require_photo_rows(folder: str | Path, *, licensed_only: bool = False) -> list[PhotoRow]:
    """As `read_photo_rows`, for those who cannot do without photos; DataError if there is none.

    Args:
        folder: with `photos_train.csv`.
        licensed_only: keep the rows that `is_permissive` accepts.
    """
    rows = [row for row in read_photo_rows(folder) if not licensed_only or is_permissive(row.licence)]
    if not rows:
        which = "photo with a permissive licence" if licensed_only else "photo"
        raise DataError(f"There is no {which} to learn from in {Path(folder) / PHOTOS}.")
    return rows


def _row(row: dict[str, str], table: Path, line: int) -> PhotoRow:
    try:
        numbers = {name: float(row[name] or "nan") for name in COLUMNS[2:] if name != "direct"}
    except ValueError as error:
        raise DataError(f"{table}, line {line}: {error}.") from error
    if math.isnan(numbers["sun_elevation"]):
        raise DataError(f"{table}, line {line}: sun_elevation is empty.")
    path = table.parent / row["file"]
    if not path.is_file():
        raise DataError(f"{table}, line {line}: there is no photo {path}.")
    direct = row["direct"] if row["direct"] in ("yes", "partly", "no") else ""
    azimuth, elevation, fov, azimuth_std = numbers.values()
    return PhotoRow(path, row["group"], azimuth, elevation, azimuth_std, direct, fov, row.get("licence", ""))

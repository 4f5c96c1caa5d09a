"""When the photos of a day were taken: by `times.csv` beside them, columns `file` and `time` (ISO 8601), or by EXIF."""

import csv
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.errors import PhotoError
from lighting.photo import in_utc, read_time
from lighting.stereo.normals.images import Shot

TIMES = "times.csv"
SPAN = 20.0  # min, the shortest day


def times_of(folder: Path, shots: list[Shot], utc_offset: float | None) -> NDArray[np.datetime64]:
    """UTC times (T,) of the photos; `utc_offset` [h] is of clocks that do not say it. PhotoError if one is missing."""
    listed = _listed_times(folder / TIMES)
    moments = [_moment(shot, listed.get(shot.name), utc_offset) for shot in shots]
    return np.array([moment.replace(tzinfo=None) for moment in moments], dtype="datetime64[us]")


def absent(folder: Path, names: Sequence[str]) -> list[str]:
    """The files that `times.csv` lists and that are not among the names."""
    return [name for name in _listed_times(folder / TIMES) if name not in names]


def _listed_times(file: Path) -> dict[str, datetime]:
    if not file.exists():
        return {}
    try:
        with file.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream))
    except (UnicodeDecodeError, csv.Error) as error:
        raise PhotoError(f"{file} is not a CSV file in UTF-8.") from error
    if rows and not {"file", "time"} <= rows[0].keys():
        raise PhotoError(f"{file} needs the columns file and time.")
    return {row["file"]: read_time(row["time"] or "") for row in rows}


def _moment(shot: Shot, listed: datetime | None, utc_offset: float | None) -> datetime:
    """When a photo was taken, in UTC."""
    local = listed or shot.facts.local_time
    if listed is None and shot.facts.utc_time is not None:
        return shot.facts.utc_time.astimezone(UTC)
    if local is None:
        raise PhotoError(f"{shot.name} does not say when it was taken; list the times in {TIMES}.")
    if local.tzinfo is not None:
        return local.astimezone(UTC)
    if utc_offset is None:
        raise PhotoError(f"The clock of {shot.name} does not say its offset from UTC; give --utc-offset.")
    return in_utc(local, utc_offset)


def check_times(times: NDArray[np.datetime64]) -> None:
    """PhotoError unless the times (T,), in order, differ, and by enough for the sun to move."""
    gaps = np.diff(times) / np.timedelta64(1, "m")
    if (gaps <= 0).any():
        raise PhotoError("The photos' times do not differ; photos of several moments of a day are needed.")
    if gaps.sum() < SPAN:
        raise PhotoError(f"The photos span {gaps.sum():.0f} minutes; the sun hardly moved. Take them over hours.")
    if gaps.sum() > 24 * 60:
        raise PhotoError("The photos are of more than one day.")

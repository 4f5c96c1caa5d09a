"""Which files make a bracket, and when it was taken."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path

from lighting.errors import ErrorCode, ProbeError
from lighting.photo import RAW_SUFFIXES, PhotoFacts, facts_of, in_utc
from lighting.probe.exposures import PICTURES

GAP = timedelta(seconds=20)  # between the starts of two exposures from which on another bracket begins

_STAMP = re.compile(r"(20\d{2})(\d{2})(\d{2})\D?(\d{2})(\d{2})(\d{2})")


@dataclass(frozen=True)
class Shot:
    """The files of one bracket and what they say of when and where."""

    files: tuple[Path, ...]
    time: datetime | None  # naive where the zone is not known
    latitude: float | None
    longitude: float | None

    def aware(self, utc_offset: float | None) -> datetime:
        """The time with its zone, which `utc_offset` [h] tells if the files do not; ProbeError without either."""
        if self.time is None:
            raise ProbeError(
                f"{self.files[0]} does not say when it was taken; tell the time.", "time", ErrorCode.MISSING
            )
        if self.time.tzinfo is None and utc_offset is None:
            raise ProbeError(
                f"{self.files[0]} has a local time of no known zone; tell its offset from UTC.",
                "utc_offset",
                ErrorCode.MISSING,
            )
        return self.time if self.time.tzinfo else in_utc(self.time, utc_offset or 0.0)


def shot_of(files: Sequence[Path]) -> Shot:
    """A bracket's files, with the first time and place that one of them or their folder's name says."""
    facts = [facts_of(file)[0] for file in files]
    times = [time for fact in facts if (time := _time(fact)) is not None]
    named = _named(files[0].parent)
    placed = next((fact for fact in facts if fact.latitude is not None), PhotoFacts())
    return Shot(tuple(files), times[0] if times else named, placed.latitude, placed.longitude)


def shots_of(inputs: Sequence[Path]) -> list[Shot]:
    """The brackets of a series: each folder given is one, and files are split where their EXIF times leave a gap.

    Raises ProbeError for a folder without pictures and for files without times.
    """
    folders, files = ([path for path in inputs if path.is_dir() is kind] for kind in (True, False))
    shots = [shot_of(pictures_in(folder)) for folder in folders]
    return shots + [shot_of(group) for group in _by_time(files)]


def pictures_in(folder: Path) -> list[Path]:
    """The pictures directly in a folder, by name; ProbeError where there is none."""
    files = sorted(path for path in folder.iterdir() if path.suffix.lower() in (*PICTURES, *RAW_SUFFIXES))
    if not files:
        raise ProbeError(f"{folder} holds no pictures.")
    return files


def _by_time(files: Sequence[Path]) -> list[list[Path]]:
    timed = []
    for file in files:
        time = _time(facts_of(file)[0])
        if time is None:
            raise ProbeError(f"{file} has no time in EXIF; give each bracket of a series as a folder of its own.")
        timed.append((time, file))
    timed.sort(key=lambda pair: (pair[0].replace(tzinfo=None), pair[1]))
    groups = [[timed[0][1]]] if timed else []
    for (before, _), (time, file) in pairwise(timed):
        if time.replace(tzinfo=None) - before.replace(tzinfo=None) > GAP:
            groups.append([])
        groups[-1].append(file)
    return groups


def _time(facts: PhotoFacts) -> datetime | None:
    return facts.utc_time or facts.local_time


def _named(folder: Path) -> datetime | None:
    """The naive time in the names of a folder and its parent, such as 20240601/143000 or 2024060114_3000."""
    stamp = _STAMP.search("".join(folder.absolute().parts[-2:]))
    try:
        return datetime(*(int(part) for part in stamp.groups())) if stamp else None  # type: ignore[arg-type]
    except ValueError:
        return None

"""A folder of 360° x 180° panoramas with what is known about each: `panoramas.csv` and the pictures it names.

Only the columns `name`, `file`, `kind`, `place` and `split` are required; export/README.md documents the format.
Pictures of one place share sky and ground, so all of a place belong to one split. `labels_patch.csv`, beside this
file, corrects given labels that turned out to be wrong.
"""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from export.data.tables import DataError, read_table, write_table

INDEX = "panoramas.csv"
REQUIRED = ("name", "file", "kind", "place", "split")
OPTIONAL = ("sun", "direct", "scene", "label", "licence", "notes")  # and the numbers below
CHOICES = {
    "kind": ("ldr", "hdr"),
    "split": ("train", "val"),
    "sun": ("visible", "inferred", "none", "unknown"),
    "direct": ("", "yes", "partly", "no"),
}
NUMBERS = {"sun_azimuth": (-180.0, 180.0), "sun_elevation": (-90.0, 90.0), "sun_uncertainty": (0.0, 180.0)}  # deg

PATCH = Path(__file__).with_name("labels_patch.csv")
PATCHED = ("sun", *NUMBERS, "direct")

_PERMISSIVE = re.compile(r"\b(cc0|cc[- ]by|mit|apache|bsd|public domain)\b")
_RESTRICTED = re.compile(r"\b(none|unknown|as repo|likely|nc|nd|sa|non-?commercial|no ?derivatives|share-?alike)\b")
_ALTERED_SKY = re.compile(  # drones see no zenith
    r"tone[- ]mapp|painted|\bfill|synthetic|replaced|colou?r cast|\bdrone\b"
)


@dataclass(frozen=True)
class Panorama:
    """One row of the index; None or an empty string where the index says nothing."""

    name: str
    path: Path  # of the picture, absolute
    kind: str  # "ldr" (sRGB, 8 bits) or "hdr" (OpenEXR, linear Rec.709)
    place: str
    split: str  # "train" or "val"
    sun: str = "unknown"  # "visible", "inferred" (from shadows and glow), "none" (overcast) or "unknown"
    sun_azimuth: float | None = None  # deg, 0 = centre column, positive to the right
    sun_elevation: float | None = None  # deg above the horizon
    sun_uncertainty: float | None = None  # deg, one sigma
    direct: str = ""  # direct sunlight reaches the scene: "yes", "partly", "no" or "" where not known
    scene: str = ""
    label: str = ""  # how the sun's direction was found
    licence: str = ""
    notes: str = ""  # known defects

    @property
    def sky_is_altered(self) -> bool:
        """Whether the notes say that the sky is no measurement: tone-mapped, painted in, or with a colour cast."""
        return bool(_ALTERED_SKY.search(self.notes.lower()))

    @property
    def sun_is_unclipped(self) -> bool:
        """Whether the notes say that the values hold the sun as bright as it was."""
        return "sun unclipped" in self.notes


def read_index(folder: str | Path, split: str | None = None, *, licensed_only: bool = False) -> list[Panorama]:
    """The folder's panoramas, in the index's order; DataError if the folder or a row cannot be used.

    `split` keeps one split, which must not be empty; `licensed_only` keeps the rows that `is_permissive` accepts.
    """
    root = Path(folder).resolve()
    patch = read_patch(PATCH)
    panoramas = [
        _panorama(root, {**row, **patch.get(row["name"].strip(), {})}, f"{root / INDEX}, line {line}")
        for line, row in enumerate(_rows(root), start=2)
    ]
    _check_unique(panoramas)
    _check_places(panoramas)
    kept = [p for p in panoramas if split in (None, p.split)]
    if split and not kept:
        raise DataError(f"No row of {root / INDEX} is of the split {split}.")
    return [p for p in kept if not licensed_only or is_permissive(p.licence)]


def write_index(panoramas: Sequence[Panorama], folder: Path) -> None:
    """Write the index of a folder that holds the panoramas' pictures; the file appears whole or not at all."""
    columns = (*REQUIRED, *OPTIONAL[:1], *NUMBERS, *OPTIONAL[1:])
    root = folder.resolve()
    write_table(
        folder / INDEX, columns, ([_text(panorama, column, root) for column in columns] for panorama in panoramas)
    )


def _text(panorama: Panorama, column: str, root: Path) -> str:
    if column == "file":
        return panorama.path.relative_to(root).as_posix()
    value = getattr(panorama, column)
    return f"{value:.3f}" if isinstance(value, float) else value or ""


def is_permissive(licence: str) -> bool:
    """Whether the licence field states a permissive licence: CC0, CC-BY, MIT, Apache, BSD or public domain.

    A licence inferred from the file's name counts as stated. Refused: one that is absent, unknown or only likely, one
    that is the repository's and not the picture's ("as repo"), and any that forbids commercial use or changes or asks
    for the same licence (NC, ND, SA).
    """
    text = licence.lower().replace("_", " ")
    return bool(_PERMISSIVE.search(text)) and not _RESTRICTED.search(text)


def _rows(root: Path) -> list[dict[str, str]]:
    if not root.is_dir():
        raise DataError(f"There is no folder {root}.")
    if not (root / INDEX).exists():
        raise DataError(f"The folder {root} has no {INDEX}.")
    return read_table(root / INDEX, REQUIRED)


def read_patch(path: Path) -> dict[str, dict[str, str]]:
    """Corrected fields by the panorama's name; a sun that becomes "none" or "unknown" loses its direction."""
    patch: dict[str, dict[str, str]] = {}
    for line, row in enumerate(read_table(path, ("name", *PATCHED, "reason")), start=2):
        where = f"{path}, line {line}"
        name = row["name"].strip()
        if not name or not row["reason"].strip():
            raise DataError(f"{where}: a correction needs the panorama's name and a reason.")
        if name in patch:
            raise DataError(f"{where}: the panorama {name} is already corrected above.")
        given = {key: row[key].strip() for key in PATCHED if row[key].strip()}
        _values(given, where)
        lost = dict.fromkeys(NUMBERS, "") if given.get("sun") in ("none", "unknown") else {}
        patch[name] = {**lost, **given}
    return patch


def _panorama(root: Path, row: Mapping[str, str], where: str) -> Panorama:
    text = {key: (row.get(key) or "").strip() for key in (*REQUIRED, *OPTIONAL)}
    text["sun"] = text["sun"] or "unknown"
    for key in REQUIRED:
        if not text[key]:
            raise DataError(f"{where}: the column {key} is empty.")
    numbers = _values({**row, **text}, where)
    path = root / text.pop("file")
    if not path.is_file():
        raise DataError(f"{where}: there is no picture {path}.")
    values: dict[str, Any] = {**text, **numbers}
    return Panorama(path=path, **values)


def _values(row: Mapping[str, str], where: str) -> dict[str, float | None]:
    """The numbers of a row; DataError if one of them or one of its choices is malformed."""
    for key, allowed in CHOICES.items():
        if key in row and row[key] not in allowed:
            raise DataError(f"{where}: {key} is {row[key]!r}, not one of {', '.join(filter(None, allowed))}.")
    return {key: _number(row, key, where) for key in NUMBERS}


def _number(row: Mapping[str, str], key: str, where: str) -> float | None:
    text = (row.get(key) or "").strip()
    if not text:
        return None
    low, high = NUMBERS[key]
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise DataError(f"{where}: {key} is {text!r}, not a number from {low:g} to {high:g}.")
    return value


def _check_unique(panoramas: Iterable[Panorama]) -> None:
    seen: set[str] = set()
    for panorama in panoramas:
        if panorama.name in seen:
            raise DataError(f"The panorama {panorama.name} appears twice in the index.")
        seen.add(panorama.name)


def _check_places(panoramas: Iterable[Panorama]) -> None:
    split: dict[str, str] = {}
    for panorama in panoramas:
        if split.setdefault(panorama.place, panorama.split) != panorama.split:
            raise DataError(f"The place {panorama.place} is in both splits, so val would not be unseen.")

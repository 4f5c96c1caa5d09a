"""A folder of 360° x 180° panoramas: `panoramas.csv`, corrections to it, and the pictures that it names.

Only the columns `name`, `file`, `kind`, `place` and `split` are required; export/README.md documents the format.
Pictures of one place share sky and ground, so all of a place belong to one split. `labels_patch.csv`, beside this
file, corrects labels that turned out to be wrong.
"""

import csv
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from lighting.color import SRGB_LINEAR
from lighting.envmap.latlong import shrink_envmap
from lighting.errors import LightingError
from lighting.files import atomic_write


class DataError(LightingError):
    """Panoramas, labels or a training run are missing, incomplete or contradict each other."""


def read_table(path: str | Path, required: Iterable[str] = ()) -> list[dict[str, str]]:
    """The rows by column, with "" for missing fields; DataError if the file or a column is missing.

    Args:
        path: the CSV file, with a header.
        required: columns that it must have.
    """
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
    """Write a CSV file, which appears whole or not at all; DataError if it cannot be written.

    Args:
        path: the file; its folder is made.
        header: names of the columns.
        rows: values in the order of `header`.
    """
    try:
        Path(path).parent.mkdir(parents=True, exist_ok=True)
        with atomic_write(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows(rows)
    except OSError as error:
        raise DataError(f"{path} cannot be written: {error.strerror or error}.") from error


INDEX = "panoramas.csv"
REQUIRED = ("name", "file", "kind", "place", "split")
_OPTIONAL = ("sun", "direct", "scene", "label", "licence", "notes", "source")  # and the numbers below
_CHOICES = {
    "kind": ("ldr", "hdr"),
    "split": ("train", "val"),
    "sun": ("visible", "inferred", "none", "unknown"),
    "direct": ("", "yes", "partly", "no"),
}
_NUMBERS = {"sun_azimuth": (-180.0, 180.0), "sun_elevation": (-90.0, 90.0), "sun_uncertainty": (0.0, 180.0)}  # deg

COLUMNS_OF_INDEX = (*REQUIRED, "sun", *_NUMBERS, *_OPTIONAL[1:])

LABELS_PATCH = Path(__file__).with_name("labels_patch.csv")
_PATCHED = ("sun", *_NUMBERS, "direct")

_PERMISSIVE = re.compile(r"\b(cc0|cc[- ]by|mit|apache|bsd|public domain)\b")
_RESTRICTED = re.compile(r"\b(none|unknown|as repo|likely|nc|nd|sa|non-?commercial|no ?derivatives|share-?alike)\b")
# Drones see no zenith.
_ALTERED_SKY = re.compile(r"tone[- ]mapp|painted|\bfill|synthetic|replaced|colou?r cast|\bdrone\b")
_MAX_HALF = 65504.0  # half floats end here


@dataclass(frozen=True)
class Panorama:
    """One row of the index; None or an empty string where the index is empty."""

    name: str
    path: Path  # of the picture, absolute
    kind: str  # "ldr" (sRGB, 8 bits) or "hdr" (OpenEXR, linear Rec.709)
    place: str  # pictures of one place share sky and ground
    split: str  # "train" or "val"
    sun: str = "unknown"  # "visible", "inferred" (from shadows and glow), "none" (overcast) or "unknown"
    sun_azimuth: float | None = None  # deg, 0 = center column, positive to the right
    sun_elevation: float | None = None  # deg above the horizon
    sun_uncertainty: float | None = None  # deg, one standard deviation
    direct: str = ""  # direct sunlight reaches the scene: "yes", "partly", "no" or "" if unknown
    scene: str = ""
    label: str = ""  # who or what determined the sun's direction
    licence: str = ""
    notes: str = ""  # known defects
    source: str = ""  # where the picture was published, as the index states it

    @property
    def sky_is_altered(self) -> bool:
        """Whether the notes say that the sky is no measurement: tone-mapped, painted in, or with a color cast."""
        return bool(_ALTERED_SKY.search(self.notes.lower()))

    @property
    def sun_is_unclipped(self) -> bool:
        """Whether the notes say that the values hold the sun as bright as it was."""
        return "sun unclipped" in self.notes


def read_index(folder: str | Path, split: str | None = None, *, licensed_only: bool = False) -> list[Panorama]:
    """The folder's panoramas, in the index's order; DataError if the folder or a row cannot be used.

    Args:
        folder: with `panoramas.csv`.
        split: "train" or "val", which must not be empty; None for both.
        licensed_only: keep the rows that `is_permissive` accepts.
    """
    root = Path(folder).resolve()
    if not root.is_dir():
        raise DataError(f"There is no folder {root}.")
    if not (root / INDEX).exists():
        raise DataError(f"The folder {root} has no {INDEX}.")
    patch = _read_patch(LABELS_PATCH)
    panoramas = [
        _parse_panorama(root, {**row, **patch.get(row["name"].strip(), {})}, f"{root / INDEX}, line {line}")
        for line, row in enumerate(read_table(root / INDEX, REQUIRED), start=2)
    ]
    _check_names_and_places(panoramas)
    kept = [p for p in panoramas if split in (None, p.split)]
    if split and not kept:
        raise DataError(f"No row of {root / INDEX} is of the split {split}.")
    return [p for p in kept if not licensed_only or is_permissive(p.licence)]


def is_permissive(licence: str) -> bool:
    """Whether the licence field states a permissive licence: CC0, CC-BY, MIT, Apache, BSD or public domain.

    A licence inferred from the file's name counts as stated. Refused is a licence that is absent, unknown or only
    likely, or that is the repository's and not the picture's ("as repo"). So is any that forbids commercial use or
    changes or asks for the same licence (NC, ND, SA).

    Args:
        licence: the field of a row.
    """
    text = licence.lower().replace("_", " ")
    return bool(_PERMISSIVE.search(text)) and not _RESTRICTED.search(text)


def _read_patch(path: Path) -> dict[str, dict[str, str]]:
    """Corrected fields by the panorama's name; a sun that becomes "none" or "unknown" loses its direction."""
    patch: dict[str, dict[str, str]] = {}
    for line, row in enumerate(read_table(path, ("name", *_PATCHED, "reason")), start=2):
        where = f"{path}, line {line}"
        name = row["name"].strip()
        if not name or not row["reason"].strip():
            raise DataError(f"{where}: a correction needs the panorama's name and a reason.")
        if name in patch:
            raise DataError(f"{where}: the panorama {name} is already corrected above.")
        corrected = {key: row[key].strip() for key in _PATCHED if row[key].strip()}
        _check_values(corrected, where)
        removed = dict.fromkeys(_NUMBERS, "") if corrected.get("sun") in ("none", "unknown") else {}
        patch[name] = {**removed, **corrected}
    return patch


def _parse_panorama(root: Path, row: Mapping[str, str], where: str) -> Panorama:
    text = {key: (row.get(key) or "").strip() for key in (*REQUIRED, *_OPTIONAL)}
    text["sun"] = text["sun"] or "unknown"
    for key in REQUIRED:
        if not text[key]:
            raise DataError(f"{where}: the column {key} is empty.")
    numbers = _check_values({**row, **text}, where)
    path = root / text.pop("file")
    if not path.is_file():
        raise DataError(f"{where}: there is no picture {path}.")
    values: dict[str, Any] = {**text, **numbers}
    return Panorama(path=path, **values)


def _check_values(row: Mapping[str, str], where: str) -> dict[str, float | None]:
    """The numbers of a row; DataError if one of them or one of its choices is malformed."""
    for key, allowed in _CHOICES.items():
        if key in row and row[key] not in allowed:
            raise DataError(f"{where}: {key} is {row[key]!r}, not one of {', '.join(filter(None, allowed))}.")
    numbers: dict[str, float | None] = dict.fromkeys(_NUMBERS)
    for key, (low, high) in _NUMBERS.items():
        if text := (row.get(key) or "").strip():
            try:
                numbers[key] = value = float(text)
            except ValueError:
                value = math.nan
            if not low <= value <= high:
                raise DataError(f"{where}: {key} is {text!r}, not a number from {low:g} to {high:g}.")
    return numbers


def _check_names_and_places(panoramas: Iterable[Panorama]) -> None:
    names: set[str] = set()
    split: dict[str, str] = {}
    for panorama in panoramas:
        if panorama.name in names:
            raise DataError(f"The panorama {panorama.name} appears twice in the index.")
        names.add(panorama.name)
        if split.setdefault(panorama.place, panorama.split) != panorama.split:
            raise DataError(f"The place {panorama.place} is in both splits, so val would not be unseen.")


def read_picture(panorama: Panorama) -> NDArray[Any]:
    """Pixels (H, 2H, 3) as published: uint8 sRGB of an LDR picture, float32 linear Rec.709 of an HDR one.

    Args:
        panorama: its path and kind are read.

    Raises:
        DataError: if the picture cannot be read or is not twice as wide as high.
    """
    try:
        pixels = _read_ldr(panorama.path) if panorama.kind == "ldr" else _read_hdr(panorama.path)
    except DataError:
        raise
    except Exception as error:  # the EXR reader raises bare RuntimeErrors, Pillow half a dozen kinds
        reason = getattr(error, "strerror", None) or error
        if isinstance(error, UnidentifiedImageError):  # its text names the file once more
            reason = "it is no JPEG, PNG or WebP"
        raise DataError(f"The panorama {panorama.path} cannot be read: {reason}.") from error
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise DataError(f"The panorama {panorama.path} is {width} x {height} pixels, not twice as wide as high.")
    return pixels


def read_linear_panorama(panorama: Panorama, height: int) -> NDArray[np.float32]:
    """Linear Rec.709 float32 (H, 2H, 3).

    Args:
        panorama: whose picture is read.
        height: rows to which the picture is reduced if it has more.
    """
    return shrink_envmap(linearize(panorama, read_picture(panorama)), height)


def linearize(panorama: Panorama, pixels: NDArray[Any]) -> NDArray[np.float32]:
    """Linear values of pixels.

    Args:
        panorama: whose kind tells how the pixels are encoded.
        pixels: of any shape, as `read_picture` returns them.
    """
    return decode_srgb(pixels) if panorama.kind == "ldr" else pixels


def decode_srgb(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear values in [0, 1] of sRGB pixels.

    Args:
        picture: of any shape, 8 bits.
    """
    return SRGB_LINEAR[picture]


def _read_ldr(path: Path) -> NDArray[np.uint8]:
    with Image.open(path, formats=["JPEG", "PNG", "WEBP"]) as image:
        return np.asarray(image.convert("RGB"), dtype=np.uint8)


def _read_hdr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        name = next((key for key in ("RGB", "RGBA") if key in channels), None)
        if name is None:
            raise DataError(f"The panorama {path} has no channels R, G and B.")
        pixels = np.array(channels[name].pixels[..., :3], dtype=np.float32)
    return np.maximum(np.nan_to_num(pixels, nan=0.0, posinf=_MAX_HALF, neginf=0.0), 0.0)

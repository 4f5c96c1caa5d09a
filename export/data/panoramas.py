"""A folder of 360° x 180° panoramas with what is known about each: `panoramas.csv` and the pictures it names.

Only the columns `name`, `file`, `kind`, `place` and `split` are required; the folder's format is documented in
the README beside this file. Pictures of one place share sky and ground, so a place belongs to one split only.
Given labels that turned out wrong are corrected by `labels_patch.csv`, also beside this file.
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
from PIL import Image

from lighting.colour import srgb_decode
from lighting.errors import LightingError
from lighting.files import replacing

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
_ALTERED_SKY = re.compile(
    r"tone[- ]mapp|painted|\bfill|synthetic|replaced|colou?r cast|\bdrone\b"
)  # drones see no zenith


class DataError(LightingError):
    """A folder of panoramas is missing, incomplete or contradicts itself."""


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
        """Whether the notes say that the sky measures no light: tone-mapped, painted in, or with a colour cast."""
        return bool(_ALTERED_SKY.search(self.notes.lower()))


def read_index(folder: str | Path, split: str | None = None, *, licensed_only: bool = False) -> list[Panorama]:
    """The folder's panoramas, in the index's order; DataError if the folder or a row cannot be used.

    `split` keeps one split; `licensed_only` keeps the rows that `is_permissive` accepts.
    """
    root = Path(folder).resolve()
    patch = read_patch(PATCH)
    panoramas = [
        _panorama(root, {**row, **patch.get(row["name"].strip(), {})}, f"{root / INDEX}, line {line}")
        for line, row in enumerate(_rows(root), start=2)
    ]
    _check_unique(panoramas)
    _check_places(panoramas)
    kept = (p for p in panoramas if split in (None, p.split))
    return [p for p in kept if not licensed_only or is_permissive(p.licence)]


def write_index(rows: Sequence[Mapping[str, str]], folder: Path) -> None:
    """Write the index of a folder, from rows that all have the first one's columns; it appears whole or not at all."""
    with replacing(folder / INDEX) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def is_permissive(licence: str) -> bool:
    """Whether the licence field states a permissive licence: CC0, CC-BY, MIT, Apache, BSD or public domain.

    One inferred from the file's name counts as stated. Refused: a licence that is absent, unknown or only likely, one
    that is the repository's and not the picture's ("as repo"), and any that forbids commercial use or changes or asks
    for the same licence (NC, ND, SA).
    """
    text = licence.lower().replace("_", " ")
    return bool(_PERMISSIVE.search(text)) and not _RESTRICTED.search(text)


def read_picture(panorama: Panorama) -> NDArray[Any]:
    """Pixels (H, 2H, 3) as published: uint8 sRGB of an LDR picture, float32 linear Rec.709 of an HDR one."""
    try:
        pixels = _read_ldr(panorama.path) if panorama.kind == "ldr" else _read_hdr(panorama.path)
    except DataError:
        raise
    except Exception as error:  # the EXR reader raises bare RuntimeErrors, Pillow half a dozen kinds
        raise DataError(f"The panorama {panorama.path} cannot be read: {error}.") from error
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise DataError(f"The panorama {panorama.path} is {width} x {height} pixels, not twice as wide as high.")
    return pixels


def read_linear(panorama: Panorama, height: int | None = None) -> NDArray[np.float32]:
    """Linear Rec.709 float32 (H, 2H, 3), averaged over areas down to `height` rows where that is fewer."""
    linear = linear_of(panorama, read_picture(panorama))
    return linear if height is None else shrink(linear, height)


def linear_of(panorama: Panorama, pixels: NDArray[Any]) -> NDArray[np.float32]:
    """Linear values of a panorama's pixels, any shape, as `read_picture` has them."""
    return decode(pixels) if panorama.kind == "ldr" else pixels


def decode(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear values in [0, 1] of an sRGB picture of 8 bits, any shape."""
    return _DECODED[picture]


def shrink(image: NDArray[np.float32], height: int) -> NDArray[np.float32]:
    """A lat-long image (H, 2H, C) averaged over areas down to `height` rows; the same image if it has no more."""
    if height >= image.shape[0]:
        return image
    size = (2 * height, height)
    planes = (np.ascontiguousarray(image[..., c], dtype=np.float32) for c in range(image.shape[2]))
    return np.stack([np.asarray(Image.fromarray(p).resize(size, Image.Resampling.BOX)) for p in planes], axis=-1)


_DECODED: NDArray[np.float32] = srgb_decode(np.arange(256) / 255.0).astype(np.float32)


def _rows(root: Path) -> list[Mapping[str, str]]:
    if not root.is_dir():
        raise DataError(f"There is no folder {root}.")
    if not (root / INDEX).exists():
        raise DataError(f"The folder {root} has no {INDEX}.")
    return _table(root / INDEX, REQUIRED)


def _table(path: Path, required: Iterable[str]) -> list[Mapping[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.DictReader(file, restval="")
            missing = [name for name in required if name not in (reader.fieldnames or ())]
            if missing:
                raise DataError(f"{path} has no column {', '.join(missing)}.")
            return list(reader)
    except (OSError, ValueError, csv.Error) as error:
        raise DataError(f"{path} cannot be read: {error}.") from error


def read_patch(path: Path) -> dict[str, dict[str, str]]:
    """Corrected fields by the panorama's name; a sun of which nothing is known any more loses its direction."""
    patch: dict[str, dict[str, str]] = {}
    for line, row in enumerate(_table(path, ("name", *PATCHED, "reason")), start=2):
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
    finite = np.nan_to_num(pixels, nan=0.0, posinf=65504.0, neginf=0.0)  # half floats end at 65504
    return np.maximum(finite, 0.0)

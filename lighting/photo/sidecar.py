"""Metadata that lie beside a photo: XMP of raw developers, and the JSON of Google Takeout.

Both end as XMP properties, which count where the photo's own metadata say nothing. They are hostile input, too.
"""

import json
import math
import os
import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from lighting.photo.tags import EXIF_NAMESPACE, MAX_XMP_BYTES, read_number, read_xmp

MAX_SIDECAR_BYTES = MAX_XMP_BYTES  # of a file that is read; larger ones count as absent
TAKEOUT_TIME = "https://takeout.google.com photoTakenTime"  # property of a time in UTC, as Google guessed it

_CAPTURE = (  # how the names of properties of the exposure begin
    *(f"{EXIF_NAMESPACE} {name}" for name in ("DateTime", "GPS", "FocalLength")),
    "http://cipa.jp/exif/1.0 OffsetTime",
    "http://ns.adobe.com/photoshop/1.0 DateCreated",
    "http://ns.adobe.com/xap/1.0 CreateDate",
)
_TAKEOUT_SUFFIX = "supplemental-metadata"  # of which long names leave less
_MAX_TAKEOUT_STEM = 46  # characters of a JSON file's name without its suffix
_COPY_NUMBERS = ("(", ")")  # around the number of a photo whose name is there already
_EDITED = re.compile(  # how Google calls the copy that a user changed, which shares its original's JSON
    "-(?:edited|bearbeitet|bewerkt|editado|editada|edytowane|modifié|modificato|redigerad|redigert|redigeret|muokattu"
    "|upraveno|изменено|düzenlendi|編集済み|已修改|已編輯|수정됨)(?=(?:[(][0-9]+[)])?$)"
)


def read_sidecar(path: str | os.PathLike[str], read: Callable[[Path], bytes | None] | None = None) -> dict[str, str]:
    """The XMP properties, by namespace and name, of the files that lie beside a photo. Never raises.

    Args:
        path: of the photo.
        read: returns what a file holds, of which MAX_SIDECAR_BYTES count; None where there is none. None: of this
            machine's files.
    """
    photo = Path(path)
    properties: dict[str, str] = {}

    def small(file: Path) -> bytes | None:
        data = (read or _read_start)(file)
        return data if data is not None and len(data) <= MAX_SIDECAR_BYTES else None

    for file in _xmp_files(photo):
        properties = {**_of_capture(read_xmp(small(file))), **properties}
    for file in _takeout_files(photo):
        properties = {**_takeout_properties(small(file)), **properties}
    return properties


def _of_capture(properties: Mapping[str, str]) -> dict[str, str]:
    """The properties of how a photo was taken, without those of how it is to be developed and cropped."""
    return {name: value for name, value in properties.items() if name.startswith(_CAPTURE)}


def _xmp_files(photo: Path) -> Iterator[Path]:
    """Where raw developers write XMP: in place of the photo's suffix, or behind it."""
    for name in (f"{photo.name}.xmp", f"{photo.stem}.xmp"):
        yield photo.with_name(name)
        yield photo.with_name(name.removesuffix("xmp") + "XMP")


def _takeout_files(photo: Path) -> Iterator[Path]:
    """Where Google Takeout writes JSON, which is cut for long names and counts copies behind the suffix."""
    stem, suffix = _original(photo.stem), photo.suffix
    names = [(stem, "")]
    opening, closing = _COPY_NUMBERS
    if stem.endswith(closing) and opening in stem:
        before, _, digits = stem.removesuffix(closing).rpartition(opening)
        if digits.isdigit():
            names.insert(0, (before, f"{opening}{digits}{closing}"))
    for name, number in names:
        for length in range(len(_TAKEOUT_SUFFIX), -1, -1):
            whole = f"{name}{suffix}.{_TAKEOUT_SUFFIX[:length]}".rstrip(".")
            yield photo.with_name(f"{whole}{number}.json")
        yield photo.with_name(f"{f'{name}{suffix}'[:_MAX_TAKEOUT_STEM]}{number}.json")
    yield photo.with_name(f"{_original(photo.stem)}.json")


def _original(stem: str) -> str:
    """A name without Google's word for a copy that was changed."""
    composed = unicodedata.normalize("NFC", stem)  # macOS writes letters and accents apart
    original = _EDITED.sub("", composed)
    return stem if original == composed else original


def _read_start(file: Path) -> bytes | None:
    """The start of a file; None for one that is absent or not to be read."""
    try:
        with file.open("rb") as stream:
            return stream.read(MAX_SIDECAR_BYTES + 1)
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return None


def _takeout_properties(data: bytes | None) -> dict[str, str]:
    """The time and the place in Google Takeout's JSON, as XMP has them; empty for any other."""
    try:
        record = json.loads(data or b"")
    except (ValueError, RecursionError):
        return {}
    if not isinstance(record, dict) or "photoTakenTime" not in record:
        return {}
    places = (_takeout_place(record.get(name)) for name in ("geoData", "geoDataExif"))
    place = next((found for found in places if found), {})
    return {**place, **_takeout_time(record["photoTakenTime"])}


def _takeout_time(value: Any) -> dict[str, str]:
    try:
        time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=float(value["timestamp"]))
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return {}
    return {TAKEOUT_TIME: f"{time:%Y-%m-%dT%H:%M:%SZ}"}


def _takeout_place(value: Any) -> dict[str, str]:
    """Latitude and longitude in XMP's degrees and minutes; 0, 0 is Google's word for an unknown place."""
    if not isinstance(value, Mapping):
        return {}
    try:
        latitude, longitude = read_number(value["latitude"]), read_number(value["longitude"])
    except (LookupError, TypeError, ValueError):
        return {}
    if latitude == longitude == 0.0 or abs(latitude) > 90.0 or abs(longitude) > 180.0:
        return {}
    return {
        f"{EXIF_NAMESPACE} GPSLatitude": _degrees_and_minutes(latitude, "NS"),
        f"{EXIF_NAMESPACE} GPSLongitude": _degrees_and_minutes(longitude, "EW"),
    }


def _degrees_and_minutes(angle: float, signs: str) -> str:
    minutes, degrees = math.modf(abs(angle))
    return f"{degrees:.0f},{60.0 * minutes:.6f}{signs[angle < 0]}"

"""XMP properties of the files that lie beside a photo; all is hostile input.

They are the XMP of raw developers, and JSON of Google Takeout and of ExifTool [1]. They count where the photo's own
metadata say nothing.

References:
    [1] ExifTool's documentation, options -json, -n, -G and -g.
"""

import json
import math
import os
import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from io import FileIO
from pathlib import Path
from typing import Any

from lighting.photo.tags import EXIF_NAMESPACE, MAX_XMP_BYTES, read_number, read_xmp

TAKEOUT_TIME = "https://takeout.google.com photoTakenTime"  # property of a time in UTC, as Google guessed it
MAX_SIDECAR_BYTES = MAX_XMP_BYTES  # of a file that is read; larger ones count as absent
_CAPTURE = (  # how the names of properties of the exposure begin; others tell how it is to be developed
    *(f"{EXIF_NAMESPACE} {name}" for name in ("DateTime", "OffsetTime", "GPS", "FocalLength")),
    "http://cipa.jp/exif/1.0 OffsetTime",
    "http://ns.adobe.com/photoshop/1.0 DateCreated",
    "http://ns.adobe.com/xap/1.0 CreateDate",
)
_TAKEOUT_SUFFIX = "supplemental-metadata"  # of which long names leave less
_MAX_TAKEOUT_STEM = 46  # characters of a JSON file's name without its suffix
_COPY = re.compile(r"(?s)(.*)(\(\d+\))")  # the number of a photo whose name is there already
_EDITED = re.compile(  # how Google calls the copy that a user changed, which shares its original's JSON
    "-(?:edited|bearbeitet|bewerkt|editado|editada|edytowane|modifié|modificato|redigerad|redigert|redigeret|muokattu"
    "|upraveno|изменено|düzenlendi|編集済み|已修改|已編輯|수정됨)(?=(?:[(][0-9]+[)])?$)"
)
_EXIFTOOL_NAMES = {  # of properties, by the names that ExifTool has for them; the first that is there counts
    "DateTimeOriginal": ("SubSecDateTimeOriginal", "DateTimeOriginal"),
    "DateTimeDigitized": ("SubSecCreateDate", "CreateDate", "DateTimeDigitized"),
    "OffsetTimeOriginal": ("OffsetTimeOriginal", "TimeZoneOffset"),
    "GPSTimeStamp": ("GPSDateTime", "GPSTimeStamp"),
    "FocalLengthIn35mmFilm": ("FocalLengthIn35mmFormat", "FocalLengthIn35mmFilm"),
    **{name: (name,) for name in ("OffsetTimeDigitized", "OffsetTime", "FocalLength", "GPSDateStamp")},
    **{f"GPS{name}{end}": (f"GPS{name}{end}",) for name in ("Latitude", "Longitude") for end in ("", "Ref")},
    **{name: (name,) for name in ("GPSImgDirection", "GPSImgDirectionRef")},
}


def read_sidecar(path: str | os.PathLike[str], read: Callable[[Path], bytes | None] | None = None) -> dict[str, str]:
    """The XMP properties, by namespace and name, of the files that lie beside a photo. Never raises.

    Args:
        path: of the photo.
        read: returns what a file holds, of which MAX_SIDECAR_BYTES count; None where there is none. None: of this
            machine's files.
    """
    photo = Path(path)
    properties: dict[str, str] = {}

    folder = str(photo.parent)

    def contents(names: Iterator[str]) -> Iterator[bytes]:
        for name in names:
            data = read(photo.with_name(name)) if read else _read_start(f"{folder}{os.sep}{name}")
            if data and len(data) <= MAX_SIDECAR_BYTES:
                yield data

    for data in contents(_xmp_files(photo)):
        of_capture = {name: value for name, value in read_xmp(data).items() if name.startswith(_CAPTURE)}
        properties = {**of_capture, **properties}
    for record in map(_parse_json, contents(_json_files(photo))):
        properties = {**_takeout_properties(record), **_exiftool_properties(record, photo.name), **properties}
    return properties


def _xmp_files(photo: Path) -> Iterator[str]:
    """Where raw developers write XMP: in place of the photo's suffix, or behind it."""
    other_case = photo.stem + photo.suffix.swapcase()  # of a copy from a machine that tells no case
    for name in (f"{photo.name}.xmp", f"{photo.stem}.xmp", f"{other_case}.xmp"):
        yield name
        yield name.removesuffix("xmp") + "XMP"


def _json_files(photo: Path) -> Iterator[str]:
    """Where ExifTool and Google Takeout write JSON.

    Takeout's is cut for long names and counts copies behind the suffix.
    """
    stem, suffix = _original(photo.stem), photo.suffix
    copy = _COPY.fullmatch(stem)
    for name, number in ([(copy[1], copy[2])] if copy else []) + [(stem, "")]:
        for length in range(len(_TAKEOUT_SUFFIX), -1, -1):
            whole = f"{name}{suffix}.{_TAKEOUT_SUFFIX[:length]}".rstrip(".")
            yield f"{whole}{number}.json"
        yield f"{f'{name}{suffix}'[:_MAX_TAKEOUT_STEM]}{number}.json"
    yield f"{stem}.json"


def _original(stem: str) -> str:
    """A name without Google's word for a copy that was changed."""
    composed = unicodedata.normalize("NFC", stem)  # macOS writes letters and accents apart
    original = _EDITED.sub("", composed)
    return stem if original == composed else original


def _read_start(file: str) -> bytes | None:
    """The start of a file; None for one that is absent, as nearly all are, or not to be read."""
    try:
        with FileIO(file) as stream:
            return stream.read(MAX_SIDECAR_BYTES + 1)
    except (OSError, ValueError):  # ValueError: a NUL in the name
        return None


def _parse_json(data: bytes) -> object:
    """What JSON holds; None where it is none."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def _takeout_properties(record: object) -> dict[str, str]:
    """The time and the place in Google Takeout's JSON, as XMP has them; empty for any other."""
    if not isinstance(record, dict) or "photoTakenTime" not in record:
        return {}
    places = (_takeout_place(record.get(name)) for name in ("geoData", "geoDataExif"))
    properties = next((found for found in places if found), {})
    with suppress(ArithmeticError, LookupError, TypeError, ValueError):
        time = datetime(1970, 1, 1, tzinfo=UTC) + timedelta(seconds=float(record["photoTakenTime"]["timestamp"]))
        properties[TAKEOUT_TIME] = f"{time:%Y-%m-%dT%H:%M:%SZ}"
    return properties


def _takeout_place(value: Any) -> dict[str, str]:
    """Latitude and longitude in XMP's degrees and minutes; 0, 0 is Google's word for an unknown place."""
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


def _exiftool_properties(record: object, photo: str) -> dict[str, str]:
    """Time, place and lens in ExifTool's JSON of a photo, as XMP has them; empty for any other.

    Args:
        record: of JSON.
        photo: name of the photo's file, which the JSON of several tells apart.
    """
    entries = [entry for entry in (record if isinstance(record, list) else [record]) if isinstance(entry, dict)]
    if len(entries) > 1:
        entries = [entry for entry in entries if Path(str(entry.get("SourceFile"))).name == photo]
    values = dict[str, str | int | float]()
    for name, value in sorted(
        _ungrouped(entries[0] if entries else {}), key=lambda item: not item[0].startswith("Composite:")
    ):
        if isinstance(value, str | int | float) and not isinstance(value, bool):
            values.setdefault(name.rpartition(":")[2], value)
    for name, letters in (("GPSLatitude", "NS"), ("GPSLongitude", "EW")):
        if isinstance(angle := values.get(name), int | float):
            values.setdefault(f"{name}Ref", letters[angle < 0])
    texts = {name: f"{v:.10f}" if isinstance(v, float) else str(v).removesuffix(" mm") for name, v in values.items()}
    return {
        f"{EXIF_NAMESPACE} {name}": next(texts[key] for key in keys if key in texts)
        for name, keys in _EXIFTOOL_NAMES.items()
        if any(key in texts for key in keys)
    }


def _ungrouped(entry: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Names, with their groups, and values of an entry, and of the groups of tags that it may have."""
    for name, value in entry.items():
        if isinstance(value, dict):
            yield from ((f"{name}:{inner}", inside) for inner, inside in value.items())
        else:
            yield name, value

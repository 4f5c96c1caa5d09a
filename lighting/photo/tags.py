"""A photo's EXIF tags and XMP properties, and those of files beside it, as plain values; all is hostile input.

Beside a photo lie the XMP of raw developers, and JSON of Google Takeout and of ExifTool [3]. They count where the
photo's own metadata say nothing.

References:
    [1] ExifTool's documentation, PNG Tags, TextualData.
    [2] ImageMagick's documentation, Format and Print Image Properties: `%[EXIF:tag]`.
    [3] ExifTool's documentation, options -json, -n, -G and -g.
"""

import json
import math
import os
import re
import struct
import unicodedata
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import ExifTags, Image, ImageFile

from lighting.photo.tiff import TIFF_STARTS, is_moderate

Tags = Mapping[int, Any]
# What reading a value raises where its tag is absent, damaged or impossible.
TAG_ERRORS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, struct.error)
UTF_16 = (b"\xff\xfe", b"\xfe\xff")

_DIRECTORIES = (None, ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo, ExifTags.IFD.Interop)  # None: the main one
_EXIF_PREFIX, _XMP_PREFIX = b"Exif\0\0", b"http://ns.adobe.com/xap/1.0/\0"  # of a JPEG's segments
_FLIR_PREFIX = b"FLIR\0"  # of a JPEG's segments
_XMP_KEYWORD = "XML:com.adobe.xmp"  # of a PNG's text
_MAX_EXIF_BLOCKS = _MAX_XMP_PACKETS = 4  # that are read
_IPTC_TAG = 33723  # of a TIFF
_PHOTOSHOP_PREFIX = b"Photoshop 3.0\0"  # of a JPEG's segment of resources
_SMALLEST_FRAME = b"\xff\xc0\0\x0b\x08\0\1\0\1\1\1\x11\0\xff\xda\0\x08\1\1\0\0\x3f\0"  # of a gray pixel
_MAX_SEGMENT = (1 << 16) - 1  # bytes of a JPEG's segment, its length among them
_MAX_IPTC_LENGTH = 1 << 16  # bytes, or numbers of four bytes, that are read; a segment of a JPEG has as many
_CREATION_KEYWORD = "creation time"  # of a PNG's text
_EXIF_TEXT = "exif:"  # how the names of a PNG's texts begin that ImageMagick makes of EXIF
PNG_CREATION_TIME = "http://www.w3.org/TR/png CreationTime"  # property that it becomes
TAKEOUT_TIME = "https://takeout.google.com photoTakenTime"  # property of a time in UTC, as Google guessed it
_SHOWN = "LocationShown"  # of IPTC's XMP: the place of what is seen, not of the camera
EXIF_NAMESPACE = "http://ns.adobe.com/exif/1.0"  # of XMP, without a slash at its end
_MAX_XMP_BYTES = 1 << 18  # of a packet that is read; what fits into one segment of a JPEG is a quarter of it
MAX_SIDECAR_BYTES = _MAX_XMP_BYTES  # of a file that is read; larger ones count as absent
_CAPTURE = (  # how the names of properties of the exposure begin
    *(f"{EXIF_NAMESPACE} {name}" for name in ("DateTime", "OffsetTime", "GPS", "FocalLength")),
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


@dataclass(frozen=True, eq=False, repr=False)
class PhotoTags:
    """What a picture's metadata hold, as plain values."""

    format: str | None
    """Of the picture, as Pillow names it."""
    orientation: int | None
    """1 to 8 by EXIF, or else by XMP, which Pillow reads for it. None: absent."""
    main: Tags
    """Of EXIF's main directory."""
    camera: Tags
    """Of EXIF's directory of the camera."""
    gps: Tags
    """Of EXIF's GPS directory."""
    interoperability: Tags
    """Of EXIF's directory of interoperability."""
    xmp: Mapping[str, str]
    """Properties of the XMP packet by "namespace name"."""
    iptc: Mapping[Any, Any]
    """IPTC's datasets by record and number, bytes or lists of them."""
    has_temperatures: bool = False
    """Whether a JPEG holds temperatures in segments of FLIR."""


def _read_exif(image: Image.Image) -> Image.Exif:
    """An image's EXIF as Pillow reads it; an empty one in place of one that is costly to read.

    Args:
        image: opened by Pillow. A PNG's text counts before its pixels are decoded and after.
    """
    is_decoded_png = image.format == "PNG" and not getattr(
        image, "tile", None
    )  # whose own method would decode it again
    exif = Image.Exif()
    with suppress(Exception):  # Pillow raises nearly anything on hostile bytes
        exif = Image.Image.getexif(image) if is_decoded_png else image.getexif()
    if not exif and (block := _raw_profile(image, "exif") or _raw_profile(image, "app1")):
        block = block.removeprefix(_EXIF_PREFIX)
        exif = _load_exif(_EXIF_PREFIX + block) if block.startswith(TIFF_STARTS) else exif
    return exif if _is_cheap(exif) else Image.Exif()


def _is_cheap(exif: Image.Exif) -> bool:
    block = getattr(exif, "fp", None)  # what Pillow reads it from: the block, or a TIFF itself
    return not isinstance(block, BytesIO) or is_moderate(block.getbuffer())


def _load_exif(block: bytes) -> Image.Exif:
    exif = Image.Exif()
    with suppress(Exception):
        exif.load(block)
    return exif


def _raw_profile(image: Image.Image, name: str) -> bytes:
    """What ImageMagick and ExifTool write as text into a PNG: a name, a length, and hexadecimal digits [1].

    Args:
        image: opened by Pillow.
        name: of the profile, in small letters.
    """
    wanted = f"raw profile type {name}"
    text = next((text for key, text in image.info.items() if str(key).lower() == wanted), None)
    if not isinstance(text, str):
        return b""
    try:
        return bytes.fromhex("".join(text.split("\n")[3:]))
    except ValueError:
        return b""


def _later_exif(image: Image.Image) -> Iterator[Image.Exif]:
    """The EXIF blocks of a JPEG behind its first, which a program put before the camera's; Pillow reads one alone."""
    blocks: list[bytes] = []
    for name, segment in getattr(image, "applist", ()):
        if name != "APP1" or not segment.startswith(_EXIF_PREFIX):
            continue
        body = segment[len(_EXIF_PREFIX) :]
        if blocks and not body.startswith(TIFF_STARTS):
            blocks[-1] += body  # one that goes on
        elif len(blocks) < _MAX_EXIF_BLOCKS:
            blocks.append(body)
    for block in blocks[1:]:
        if is_moderate(block):
            yield _load_exif(_EXIF_PREFIX + block)


def read_tags(image: Image.Image) -> PhotoTags:
    """What an image's EXIF blocks, XMP packet and IPTC datasets hold; empty where it cannot be read. Never raises.

    Of two tags with one number, in different blocks, the first counts.

    Args:
        image: opened by Pillow.
    """
    blocks = [_read_exif(image), *_later_exif(image)]
    main, camera, gps, interoperability = (_merge_directories(blocks, ifd) for ifd in _DIRECTORIES)
    value = main.get(ExifTags.Base.Orientation)
    orientation, xmp, iptc = value if isinstance(value, int) else None, _read_packet(image), _read_iptc(image)
    segments = (data for name, data in getattr(image, "applist", ()) if name == "APP1")
    has_temperatures = any(data.startswith(_FLIR_PREFIX) for data in segments)
    return PhotoTags(image.format, orientation, main, camera, gps, interoperability, xmp, iptc, has_temperatures)


def _merge_directories(blocks: Sequence[Image.Exif], ifd: int | None) -> dict[int, Any]:
    """The tags of one directory of EXIF blocks; None: the main one."""
    merged: dict[int, Any] = {}
    for exif in blocks:
        with suppress(Exception):
            merged = {**dict(exif if ifd is None else exif.get_ifd(ifd)), **merged}
    return merged


def _read_packet(image: Image.Image) -> dict[str, str]:
    """The properties of an image's XMP packet, as `_read_xmp` returns them."""
    segments = (data for name, data in getattr(image, "applist", ()) if name == "APP1")
    packets = [data.removeprefix(_XMP_PREFIX) for data in segments if data.startswith(_XMP_PREFIX)]
    if len(packets) > 1:  # of which Pillow has the last
        properties: dict[str, str] = {}
        for packet in packets[:_MAX_XMP_PACKETS]:
            properties = {**_read_xmp(packet), **properties}
        return properties
    return {**_png_properties(image), **_read_xmp(_single_packet(image))}


def _single_packet(image: Image.Image) -> Any:
    packet = image.info.get("xmp")
    if packet is None and isinstance(text := image.info.get(_XMP_KEYWORD), str):
        packet = text.encode()
    if packet is None:
        packet = _raw_profile(image, "xmp") or _raw_profile(image, "app1").removeprefix(_XMP_PREFIX)
    return packet


def _png_properties(image: Image.Image) -> dict[str, str]:
    """The time that a PNG's text states, and the EXIF tags that ImageMagick writes there [2], as properties."""
    if image.format != "PNG":
        return {}
    texts = {str(key).lower(): (str(key), text) for key, text in image.info.items() if isinstance(text, str)}
    properties = {
        f"{EXIF_NAMESPACE} {name[len(_EXIF_TEXT) :]}": text
        for key, (name, text) in texts.items()
        if key.startswith(_EXIF_TEXT)
    }
    if _CREATION_KEYWORD in texts:
        properties[PNG_CREATION_TIME] = texts[_CREATION_KEYWORD][1]
    return properties


def _read_iptc(image: Image.Image) -> Mapping[Any, Any]:
    """The IPTC datasets of an image; empty without."""
    if image.format == "PNG" and (block := _raw_profile(image, "iptc") or _raw_profile(image, "8bim")):
        try:
            image = Image.open(BytesIO(_jpeg_header_with(block)), formats=("JPEG",))
        except Exception:  # Pillow raises nearly anything on hostile bytes
            return {}
    has_iptc = "photoshop" in image.info or image.format == "TIFF"
    if not (has_iptc and isinstance(image, ImageFile.ImageFile)):
        return {}
    from PIL.IptcImagePlugin import getiptcinfo

    with suppress(Exception):
        if len(getattr(image, "tag_v2", {}).get(_IPTC_TAG, ())) <= _MAX_IPTC_LENGTH:
            return getiptcinfo(image) or {}
    return {}


def _jpeg_header_with(resources: bytes) -> bytes:
    """The header of a JPEG with Photoshop's resources, of which Pillow reads IPTC; empty where they are too long."""
    segment = _PHOTOSHOP_PREFIX + resources.removeprefix(_PHOTOSHOP_PREFIX)
    if len(segment) + 2 > _MAX_SEGMENT:
        return b""
    return b"\xff\xd8\xff\xed" + struct.pack(">H", len(segment) + 2) + segment + _SMALLEST_FRAME


def read_number(value: Any) -> float:
    """A finite number in a tag's value.

    Args:
        value: of a tag.

    Raises:
        ValueError: it is none, as 0/0 is.
    """
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    return number


def read_xmp_number(text: str) -> float:
    """A finite number in an XMP property, such as "17" or "22329/100".

    Args:
        text: of the property.

    Raises:
        ValueError: it is none.
        ZeroDivisionError: its denominator is 0.
    """
    numerator, _, denominator = text.strip().partition("/")
    return read_number(numerator) / (read_number(denominator) if denominator else 1.0)


def read_text(value: Any) -> str:
    """The text in a tag's value, without blanks and NULs at its ends.

    Args:
        value: of a tag.

    Raises:
        TypeError: it is no text.
    """
    text = value.decode("ascii") if isinstance(value, bytes) else value
    if not isinstance(text, str):
        raise TypeError("not a text")
    return text.strip("\0 ")


def _read_xmp(packet: Any) -> dict[str, str]:
    """Attributes and elements of an XMP packet by "namespace name", the first of each; empty for what is no XMP.

    Namespaces have no slash at their ends, since writers disagree about it. Never raises.

    Args:
        packet: bytes of XML.
    """
    if not packet or not isinstance(packet, bytes) or len(packet) > _MAX_XMP_BYTES:
        return {}
    from xml.parsers import expat

    reader = _Reader()
    blanks = b" \t\r\n" if packet.startswith(UTF_16) else b"\0 \t\r\n"
    try:
        reader.parser.Parse(packet.rstrip(blanks), True)
    except expat.ExpatError:
        return reader.properties if reader.is_complete else {}
    except (ValueError, LookupError):  # LookupError: an encoding that nobody knows
        return {}
    return reader.properties


class _Reader:
    """Collects the properties while expat reads; nothing of it nests, however deep the packet is."""

    def __init__(self) -> None:
        from xml.parsers import expat

        self.properties: dict[str, str] = {}
        self.is_complete = False  # whether the packet's outermost element has ended; junk may follow
        self._depth = 0
        self._shown_depth = 0  # of the element of a place that is seen, whose properties do not count
        self._text: list[str] = []
        self.parser = expat.ParserCreate(namespace_separator=" ")
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self._refuse  # without a document type there are no entities to expand
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.CharacterDataHandler = self._text.append

    def _refuse(self, *_: object) -> None:
        raise ValueError("A packet has no document type.")

    def _start(self, element: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if element.endswith(f" {_SHOWN}"):
            self._shown_depth = self._shown_depth or self._depth
        self._text.clear()
        for name, value in attributes.items():
            self._keep(name, value)

    def _end(self, name: str) -> None:
        self._keep(name, "".join(self._text))
        self._text.clear()
        if self._depth == self._shown_depth:
            self._shown_depth = 0
        self._depth -= 1
        self.is_complete = self._depth == 0

    def _keep(self, name: str, value: str) -> None:
        namespace, _, local = name.rpartition(" ")
        if (text := value.strip()) and not self._shown_depth:
            self.properties.setdefault(f"{namespace.rstrip('/')} {local}", text)


# Files beside the photo.


def read_sidecar(path: str | os.PathLike[str], read: Callable[[Path], bytes | None] | None = None) -> dict[str, str]:
    """The XMP properties, by namespace and name, of the files that lie beside a photo. Never raises.

    Args:
        path: of the photo.
        read: returns what a file holds, of which MAX_SIDECAR_BYTES count; None where there is none. None: of this
            machine's files.
    """
    photo = Path(path)
    properties: dict[str, str] = {}

    def contents(files: Iterator[Path]) -> Iterator[bytes]:
        found = map(read or _read_start, files)
        return (data for data in found if data and len(data) <= MAX_SIDECAR_BYTES)

    for data in contents(_xmp_files(photo)):
        properties = {**_of_capture(_read_xmp(data)), **properties}
    for record in map(_parse_json, contents(_json_files(photo))):
        properties = {**_takeout_properties(record), **_exiftool_properties(record, photo.name), **properties}
    return properties


def _of_capture(properties: Mapping[str, str]) -> dict[str, str]:
    """The properties of how a photo was taken, without those of how it is to be developed and cropped."""
    return {name: value for name, value in properties.items() if name.startswith(_CAPTURE)}


def _xmp_files(photo: Path) -> Iterator[Path]:
    """Where raw developers write XMP: in place of the photo's suffix, or behind it."""
    other_case = photo.stem + photo.suffix.swapcase()  # of a copy from a machine that tells no case
    for name in (f"{photo.name}.xmp", f"{photo.stem}.xmp", f"{other_case}.xmp"):
        yield photo.with_name(name)
        yield photo.with_name(name.removesuffix("xmp") + "XMP")


def _json_files(photo: Path) -> Iterator[Path]:
    """Where ExifTool and Google Takeout write JSON.

    Takeout's is cut for long names and counts copies behind the suffix.
    """
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


def _parse_json(data: bytes) -> Any:
    """What JSON holds; None where it is none."""
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def _takeout_properties(record: Any) -> dict[str, str]:
    """The time and the place in Google Takeout's JSON, as XMP has them; empty for any other."""
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


def _exiftool_properties(record: Any, photo: str) -> dict[str, str]:
    """Time, place and lens in ExifTool's JSON of a photo, as XMP has them; empty for any other.

    Args:
        record: of JSON.
        photo: name of the photo's file, which the JSON of several tells apart.
    """
    entries = [entry for entry in (record if isinstance(record, list) else [record]) if isinstance(entry, dict)]
    if len(entries) > 1:
        entries = [entry for entry in entries if Path(str(entry.get("SourceFile"))).name == photo]
    values = dict[str, str | int | float]()
    for name, value in sorted(_ungrouped(entries[0] if entries else {}), key=_is_not_composite):
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


def _ungrouped(entry: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Names, with their groups, and values of an entry, and of the groups of tags that it may have."""
    for name, value in entry.items():
        if isinstance(value, dict):
            yield from ((f"{name}:{inner}", inside) for inner, inside in value.items())
        else:
            yield name, value


def _is_not_composite(item: tuple[str, Any]) -> bool:
    """Whether a name is not of the group whose coordinates have signs."""
    return not item[0].startswith("Composite:")

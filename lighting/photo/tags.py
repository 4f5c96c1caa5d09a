"""A photo's EXIF tags and XMP properties as plain values; all is hostile input.

References:
    [1] ExifTool's documentation, PNG Tags, TextualData.
    [2] ImageMagick's documentation, Format and Print Image Properties: `%[EXIF:tag]`.
"""

import math
import struct
from collections import ChainMap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from typing import Any, SupportsFloat, SupportsIndex

from PIL import ExifTags, Image, ImageFile

from lighting.photo.tiff import TIFF_STARTS, is_moderate

Tags = Mapping[int, Any]
IptcRecords = Mapping[tuple[int, int], object]
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
_SHOWN = "LocationShown"  # of IPTC's XMP: the place of what is seen, not of the camera
EXIF_NAMESPACE = "http://ns.adobe.com/exif/1.0"  # of XMP, without a slash at its end
MAX_XMP_BYTES = 1 << 18  # of a packet that is read; what fits into one segment of a JPEG is a quarter of it


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
    iptc: IptcRecords
    """IPTC's datasets by record and number, bytes or lists of them."""
    has_temperatures: bool = False
    """Whether a JPEG holds temperatures in segments of FLIR."""


def _read_exif(image: Image.Image) -> Image.Exif:
    """An image's EXIF as Pillow reads it; an empty one in place of one that is costly to read.

    Args:
        image: opened by Pillow. A PNG's text counts before its pixels are decoded and after.
    """
    # The own method of a PNG that is decoded would decode it again.
    is_decoded_png = image.format == "PNG" and not getattr(image, "tile", None)
    exif = Image.Exif()
    with suppress(Exception):  # Pillow raises nearly anything on hostile bytes
        exif = Image.Image.getexif(image) if is_decoded_png else image.getexif()
    if not exif and (block := _raw_profile(image, "exif") or _raw_profile(image, "app1")):
        block = block.removeprefix(_EXIF_PREFIX)
        exif = _load_exif(_EXIF_PREFIX + block) if block.startswith(TIFF_STARTS) else exif
    source = getattr(exif, "fp", None)  # what Pillow reads it from: the block, or a TIFF itself
    return Image.Exif() if isinstance(source, BytesIO) and not is_moderate(source.getbuffer()) else exif


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


def _app1_segments(image: Image.Image) -> list[bytes]:
    """What a JPEG's segments hold in which EXIF, XMP and FLIR's data lie; none of other pictures."""
    return [data for name, data in getattr(image, "applist", ()) if name == "APP1"]


def _later_exif(image: Image.Image) -> Iterator[Image.Exif]:
    """The EXIF blocks of a JPEG behind its first, which a program put before the camera's; Pillow reads one alone."""
    blocks: list[bytes] = []
    for segment in _app1_segments(image):
        if not segment.startswith(_EXIF_PREFIX):
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
    has_temperatures = any(data.startswith(_FLIR_PREFIX) for data in _app1_segments(image))
    return PhotoTags(image.format, orientation, main, camera, gps, interoperability, xmp, iptc, has_temperatures)


def _merge_directories(blocks: Sequence[Image.Exif], ifd: int | None) -> dict[int, object]:
    """The tags of one directory of EXIF blocks; None: the main one."""
    merged: dict[int, object] = {}
    for exif in blocks:
        with suppress(Exception):
            merged = {**dict(exif if ifd is None else exif.get_ifd(ifd)), **merged}
    return merged


def _read_packet(image: Image.Image) -> dict[str, str]:
    """The properties of an image's XMP packet, as `read_xmp` returns them."""
    segments = _app1_segments(image)
    packets = [data.removeprefix(_XMP_PREFIX) for data in segments if data.startswith(_XMP_PREFIX)]
    if len(packets) > 1:  # of which Pillow has the last
        return dict(ChainMap(*map(read_xmp, packets[:_MAX_XMP_PACKETS])))
    packet = image.info.get("xmp")
    if packet is None and isinstance(text := image.info.get(_XMP_KEYWORD), str):
        packet = text.encode()
    if packet is None:
        packet = _raw_profile(image, "xmp") or _raw_profile(image, "app1").removeprefix(_XMP_PREFIX)
    return {**_png_properties(image), **read_xmp(packet)}


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


def _read_iptc(image: Image.Image) -> IptcRecords:
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


def read_number(value: object) -> float:
    """A finite number in a tag's value.

    Args:
        value: of a tag.

    Raises:
        ValueError: it is none, as 0/0 is.
        TypeError: it is nothing that may be one.
    """
    if not isinstance(value, str | bytes | SupportsFloat | SupportsIndex):
        raise TypeError("not a number")
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not a finite number")
    return number


def read_first_number(value: object) -> float:
    """A finite number in a tag's value, or the first of several; raises as `read_number`, and for none LookupError.

    Args:
        value: of a tag.
    """
    return read_number(value[0] if isinstance(value, tuple | list) else value)


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


def read_make(main: Tags) -> str:
    """Who made the camera, in small letters, such as "apple"; "" where the file does not say.

    Args:
        main: tags of EXIF's main directory.
    """
    return text_or_empty(main.get(ExifTags.Base.Make)).lower()


def read_text(value: object) -> str:
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


def text_or_empty(value: object) -> str:
    """The text in a tag's value as of `read_text`; empty where it is none.

    Args:
        value: of a tag; None: absent.
    """
    with suppress(TypeError, ValueError):
        return read_text(value)
    return ""


def read_xmp(packet: object) -> dict[str, str]:
    """Attributes and elements of an XMP packet by "namespace name", the first of each; empty for what is no XMP.

    Namespaces have no slash at their ends, since writers disagree about it. Never raises.

    Args:
        packet: bytes of XML.
    """
    if not packet or not isinstance(packet, bytes) or len(packet) > MAX_XMP_BYTES:
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

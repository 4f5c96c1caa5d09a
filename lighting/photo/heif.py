"""HEIF files, which are HEIC and AVIF: which of the two, opened, how they are turned, and their colours.

A HEIF is turned by properties of its picture (`irot` and `imir` [1]), which decoders apply; its EXIF orientation then
says the same once more, and does not count. Some programs write the latter alone: then it counts.

References:
    [1] ISO/IEC 23008-12, 6.5.10 and 6.5.12; boxes by ISO/IEC 14496-12, 4.2 and 8.11.
"""

import struct
from collections.abc import Iterator
from io import BytesIO
from typing import Any, Literal

from PIL import ExifTags, Image

HeifKind = Literal["HEIF", "AVIF"]

_HEIC_BRANDS = {b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs"}
_AVIF_BRANDS = {b"avif", b"avis"}
_ANY_CODEC_BRANDS = {b"mif1", b"msf1", b"mif2", b"miaf"}
_MAX_BRANDS = 64  # that are read
_MAX_BOXES = 4096  # beside each other that are read
_MAX_ITEMS = 1 << 16  # whose properties are read; a tile of a picture is an item

_Box = tuple[bytes, int, int]  # kind, and where its content begins and ends


def heif_kind(data: bytes) -> HeifKind | None:
    """Which kind of HEIF a file is, by its brands; None for what is none that is read.

    Args:
        data: of any file.
    """
    brands = ftyp_brands(data)
    if not brands or brands[0] not in _HEIC_BRANDS | _AVIF_BRANDS | _ANY_CODEC_BRANDS:
        return None
    if brands[0] not in _HEIC_BRANDS and _AVIF_BRANDS.intersection(brands):
        return "AVIF"
    return "HEIF"


def ftyp_brands(data: bytes) -> list[bytes]:
    """The brands of an ISO media file, the main one first; none of other files.

    Args:
        data: of any file.
    """
    if data[4:8] != b"ftyp":
        return []
    end = min(int.from_bytes(data[:4]), 4 * _MAX_BRANDS)
    return [data[8:12], *(data[start : start + 4] for start in range(16, end, 4))]


def open_heif(data: bytes) -> Image.Image:
    """The picture of a HEIC, not decoded; its EXIF orientation is what is left to be done.

    No plugin is registered with Pillow, where a program that uses this one may have registered its own.

    Args:
        data: of a HEIC; SyntaxError where it cannot be read.
    """
    from pi_heif import HeifImageFile

    image: Image.Image = HeifImageFile(BytesIO(data))
    _restore_orientation(image, data, image.info.get("original_orientation"))
    return image


def complete_avif(image: Image.Image, data: bytes) -> None:
    """Add to an AVIF's picture what Pillow leaves out: its `nclx_profile`, and an orientation by EXIF alone.

    Args:
        image: opened by Pillow; changed in place.
        data: of its file.
    """
    import pi_heif

    try:
        other = pi_heif.open_heif(BytesIO(data))
    except Exception:  # what Pillow opened is a photo, whatever another reader says of its boxes
        return
    if nclx := other.info.get("nclx_profile"):
        image.info["nclx_profile"] = nclx
    exif = Image.Exif()
    exif.load(other.info.get("exif") or b"")
    _restore_orientation(image, data, exif.get(ExifTags.Base.Orientation))


def _restore_orientation(image: Image.Image, data: bytes, orientation: Any) -> None:
    """Give a picture that its container does not turn the orientation of its EXIF block, which readers take away."""
    if isinstance(orientation, int) and 1 < orientation <= 8 and not _turns_picture(data):
        image.getexif()[ExifTags.Base.Orientation] = orientation


def _turns_picture(data: bytes) -> bool:
    """Whether the primary picture has a property that turns or mirrors it."""
    try:
        meta = dict(_children(data, *_find(data, (0, len(data)), b"meta"), skip=4))
        properties = dict(_children(data, *meta[b"iprp"]))
        kinds = [(kind, span) for kind, span in _children(data, *properties[b"ipco"])]
        chosen = _property_indices(data, *properties[b"ipma"], item=_primary_item(data, *meta[b"pitm"]))
        own = [kinds[index - 1] for index in chosen if 0 < index <= len(kinds)]
    except (KeyError, StopIteration, struct.error):
        return False
    return any(kind == b"imir" or (kind == b"irot" and data[start] & 3) for kind, (start, _) in own)


def _find(data: bytes, span: tuple[int, int], wanted: bytes) -> tuple[int, int]:
    return next(inner for kind, inner in _children(data, *span) if kind == wanted)


def _children(data: bytes, start: int, end: int, skip: int = 0) -> Iterator[tuple[bytes, tuple[int, int]]]:
    """Kinds and contents of the boxes in a part of the file, behind `skip` bytes."""
    position = start + skip
    for _ in range(_MAX_BOXES):
        if position + 8 > end:
            return
        size, kind = struct.unpack_from(">I4s", data, position)
        head = 8
        if size == 1:
            (size,), head = struct.unpack_from(">Q", data, position + 8), 16
        size = size or end - position
        if size < head or position + size > end:
            return
        yield kind, (position + head, position + size)
        position += size


def _primary_item(data: bytes, start: int, _end: int) -> int:
    (item,) = struct.unpack_from(">I" if data[start] else ">H", data, start + 4)
    return int(item)


def _property_indices(data: bytes, start: int, end: int, item: int) -> list[int]:
    """Indices, from 1, of an item's properties."""
    version, wide = data[start], data[start + 3] & 1
    (count,) = struct.unpack_from(">I", data, start + 4)
    entry = struct.Struct(">IB" if version else ">HB")
    position = start + 8
    for _ in range(min(count, _MAX_ITEMS)):
        if position >= end:
            break
        number, length = entry.unpack_from(data, position)
        position += entry.size
        if number == item:
            masks = struct.unpack_from(f">{length}{'H' if wide else 'B'}", data, position)
            return [value & (0x7FFF if wide else 0x7F) for value in masks]
        position += length * (2 if wide else 1)
    return []

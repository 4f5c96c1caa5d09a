"""The EXIF block of RAW files that Pillow does not open: Canon's CR3, Fujifilm's RAF, Olympus' ORF, Panasonic's RW2,
and DNG without a preview.

ORF and RW2 are TIFF files under another number. A RAF begins with a whole JPEG. A CR3 is an ISO media file with a
directory of tags in a box each.
"""

import struct
import warnings
from io import BytesIO
from typing import Any

from PIL import ExifTags, Image

from lighting.errors import PhotoError
from lighting.photo.containers import embedded_preview

_TIFF_LIKE = {  # first bytes, and how TIFF files begin
    **{b"IIRO": b"II*\0", b"IIRS": b"II*\0", b"MMOR": b"MM\0*", b"IIU\0": b"II*\0"},
    **{b"II*\0": b"II*\0", b"MM\0*": b"MM\0*"},  # of DNG whose first picture is the mosaic, as phones write it
}
_RAF_START, _RAF_JPEG = b"FUJIFILMCCD-RAW", 84  # where a RAF says the beginning and the length of its JPEG
_CR3_BOXES = {b"CMT1": None, b"CMT2": ExifTags.IFD.Exif, b"CMT4": ExifTags.IFD.GPSInfo}  # None: of the picture itself
_HEAD = 1 << 22  # bytes that hold all directories
_USUAL_SHAPE = (3, 2)


def open_raw_header(data: bytes) -> Image.Image:
    """The preview in a RAW file, not decoded, with the EXIF block of the file; its own where it has one.

    Args:
        data: of a RAW file; one without a preview has an empty one of the usual shape.
    """
    try:
        preview: Image.Image = Image.open(BytesIO(embedded_preview(data)), formats=["JPEG"])
    except (PhotoError, OSError):  # UnidentifiedImageError is an OSError
        preview = Image.new("L", _USUAL_SHAPE)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what is damaged counts as absent
        add_raw_exif(preview, data)
    return preview


def add_raw_exif(preview: Image.Image, data: bytes) -> None:
    """Give a preview that lacks an EXIF block the one of its RAW file. Never raises; Pillow may warn.

    Args:
        preview: opened by Pillow; changed in place.
        data: of the RAW file.
    """
    try:
        block = None if dict(preview.getexif()) else _read_block(data)
    except Exception:  # EXIF is hostile input
        return
    if block is not None:
        preview.info["exif"] = block
        preview.getexif().clear()
        preview.getexif().load(block)


def _read_block(data: bytes) -> bytes | None:
    """An EXIF block as a JPEG would hold it; None where there is none."""
    if start := _TIFF_LIKE.get(data[:4]):
        return b"Exif\0\0" + start + data[4:_HEAD]
    if data.startswith(_RAF_START):
        begin, length = struct.unpack_from(">II", data, _RAF_JPEG)
        with Image.open(BytesIO(data[begin : begin + length]), formats=["JPEG"]) as photo:
            return photo.info.get("exif")
    return _cr3_block(data[:_HEAD]) if data[4:12] == b"ftypcrx " else None


def _cr3_block(head: bytes) -> bytes:
    """One block of the directories that a CR3 holds apart."""
    block = Image.Exif()
    for name, ifd in _CR3_BOXES.items():
        position = head.find(name)
        if position < 4:
            continue
        (size,) = struct.unpack_from(">I", head, position - 4)
        directory = Image.Exif()
        directory.load(b"Exif\0\0" + head[position + 4 : position - 4 + size])
        target: Any = block if ifd is None else block.get_ifd(ifd)
        target.update({tag: value for tag, value in directory.items() if tag not in tuple(ExifTags.IFD)})
    return block.tobytes()

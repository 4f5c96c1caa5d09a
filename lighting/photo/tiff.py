"""TIFF directories, and RAW files, which mostly are TIFF: pages, previews and EXIF blocks.

Of each directory only what decides is read, so that hostile files cost nothing; Pillow reads the chosen page.

A preview is found by its markers, not by the maker's tables; cameras store it whole and in one piece. Of files that
Pillow does not open the EXIF block is read here: Canon's CR3, Fujifilm's RAF, Olympus' ORF, Panasonic's RW2, and DNG
without a preview. ORF and RW2 are TIFF files under another number. A RAF begins with a whole JPEG. A CR3 is an ISO
media file with a directory of tags in a box each.
"""

import struct
import warnings
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from typing import Any

from PIL import ExifTags, Image

from lighting.errors import PhotoError
from lighting.photo.containers import frame_size

RAW_FORMAT = "RAW"
# TIFF
_MAX_PAGES = 16  # that are read
_MAX_TAGS = 1000  # of a page that are read; they are in ascending order, and the highest that counts is 34665
_SENSOR_PHOTOMETRICS = (32803, 34892)  # photometric: color filter array, linear RAW
_RAW_COMPRESSIONS = (32767, 32769, 34713, 65000, 65535)  # compressions of Sony, Epson, Nikon, Kodak, Pentax
_SUBFILE, _WIDTH, _HEIGHT, _COMPRESSION, _PHOTOMETRIC = 0xFE, 0x100, 0x101, 0x103, 0x106
_ORIENTATION, _SUBDIRECTORIES, _EXIF = 0x112, 0x14A, 0x8769
_PIECES = (0x111, 0x144)  # offsets of strips and of tiles
_JPEG, _COLOR_PHOTOMETRICS = 7, (2, 6)  # compression, and photometric: RGB, YCbCr
_REDUCED_BIT, _MASK_BIT = 1, 4  # bits of NewSubfileType
_MAX_THUMBNAIL_SIDE = 640  # pixels along the longer side of a thumbnail that does not say that it is one
_BIG_TIFF, _CLASSIC_TIFF = 43, 42  # in the header of a TIFF with offsets of 64 and of 32 bits
_INTEGER_TYPES = {3: "H", 4: "I", 13: "I", 16: "Q", 18: "Q"}  # a tag's types of whole numbers, as struct names them
_GPS, _INTEROPERABILITY = 0x8825, 0xA005
_TAG_BYTES = {  # of a value, by the tag's type
    **dict.fromkeys((1, 2, 6, 7), 1),
    **dict.fromkeys((3, 8), 2),
    **dict.fromkeys((4, 9, 11, 13), 4),
    **dict.fromkeys((5, 10, 12, 16, 17, 18), 8),
}
_BYTE_TYPES = (1, 2, 7)  # of which Pillow makes one object, whatever their number
_MAX_NUMBER_BYTES = 1 << 21  # of a picture's own directory: a large TIFF lists its strips, a DNG its color tables
_MAX_EXIF_NUMBER_BYTES = 1 << 16  # of its EXIF and GPS directories, which hold a few hundred
_Tags = dict[int, tuple[int, ...]]
# RAW
_MAX_JPEGS = 64  # beginnings of a JPEG that are tried
_RAW_STARTS = (  # CR2, Olympus, Panasonic, Fujifilm, Sigma
    b"II*\0\x10\0\0\0CR", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILMCCD-RAW", b"FOVb",
)  # fmt: skip
TIFF_STARTS = (b"II*\0", b"MM\0*")  # and how an EXIF block begins
_JPEG_START = b"\xff\xd8\xff"
_PREVIEW_HEAD = 1 << 18  # bytes that must hold a preview's size
_DNG_VERSION = 0xC612
_TIFF_LIKE = {  # first bytes, and how TIFF files begin
    **{b"IIRO": b"II*\0", b"IIRS": b"II*\0", b"MMOR": b"MM\0*", b"IIU\0": b"II*\0"},
    **{b"II*\0": b"II*\0", b"MM\0*": b"MM\0*"},  # of DNG whose first picture is the mosaic, as phones write it
}
_RAF_START, _RAF_JPEG = b"FUJIFILMCCD-RAW", 84  # where a RAF says the beginning and the length of its JPEG
_CR3_BOXES = {b"CMT1": None, b"CMT2": ExifTags.IFD.Exif, b"CMT4": ExifTags.IFD.GPSInfo}  # None: of the picture itself
_HEAD = 1 << 22  # bytes that hold all directories
_USUAL_SHAPE = (3, 2)


@dataclass(frozen=True, eq=False, repr=False)
class _Page:
    """A page of a TIFF."""

    offset: bytes  # of its directory, as the TIFF writes it; that of the first one stands at as many bytes as it has
    tags: _Tags  # of whole numbers
    has_orientation: bool  # whether the page itself has an orientation
    has_exif: bool  # whether the page itself has an EXIF block

    @property
    def pixel_count(self) -> int:
        return _first_value(self.tags, _WIDTH) * _first_value(self.tags, _HEIGHT)

    def as_first(self, data: bytes) -> bytes:
        """A copy of the TIFF that has this page as its first."""
        size = len(self.offset)
        return b"".join((memoryview(data)[:size], self.offset, memoryview(data)[2 * size :]))


@dataclass(frozen=True, eq=False, repr=False)
class _Layout:
    """How a TIFF writes offsets and counts."""

    order: str  # of bytes, as struct names it
    offset: struct.Struct  # a position in the file; that of the first directory stands at as many bytes as it has
    count: struct.Struct  # the number of a directory's tags
    tag: struct.Struct  # a tag's number, type, count of values, and the values or their offset


def photo_page(data: bytes) -> _Page | None:
    """The page that is the photo, where that is not the first; None for all other bytes, damaged ones too.

    A first page is a thumbnail if it says that it is reduced, or if it is small and another one has its shape and at
    least twice its size.

    Args:
        data: of any file.
    """
    pages = list(_pages(data))
    photos = [page for page in pages[1:] if _is_photo(page) and _is_thumbnail(pages[0].tags, page.tags)]
    return max(photos, key=lambda page: page.pixel_count, default=None)


def preview_page(data: bytes) -> _Page | None:
    """The page that is a RAW file's preview, if that is stored in pieces: strips or tiles, each a JPEG of its own.

    None where a JPEG in one piece is as large, which `embedded_preview` finds.

    Args:
        data: of a RAW file.
    """
    pages = (page for page in _pages(data) if _is_preview_in_pieces(page.tags))
    largest = max(pages, key=lambda page: page.pixel_count, default=None)
    return largest if largest and largest.pixel_count > _largest_jpeg(data)[0] else None


def _is_preview_in_pieces(tags: _Tags) -> bool:
    color = _first_value(tags, _PHOTOMETRIC) in _COLOR_PHOTOMETRICS and _first_value(tags, _COMPRESSION) == _JPEG
    return color and not _first_value(tags, _SUBFILE) & _MASK_BIT and any(len(tags.get(tag, ())) > 1 for tag in _PIECES)


def _layout(data: bytes | memoryview) -> _Layout | None:
    order = {b"II": "<", b"MM": ">"}.get(bytes(data[:2]))
    if order is None or len(data) < 16:
        return None
    formats = {_CLASSIC_TIFF: ("I", "H", "HHI4s"), _BIG_TIFF: ("Q", "Q", "HHQ8s")}
    fields = formats.get(max(data[2:4]))  # whichever comes first, as Pillow reads it
    return None if fields is None else _Layout(order, *(struct.Struct(order + field) for field in fields))


def _pages(data: bytes) -> Iterator[_Page]:
    """The first _MAX_PAGES pages of a TIFF, those below others too; none of other files."""
    if (layout := _layout(data)) is None:
        return
    waiting, visited = deque(layout.offset.unpack_from(data, layout.offset.size)), set[int]()
    while waiting and len(visited) < _MAX_PAGES:
        offset = waiting.popleft()
        if offset == 0 or offset in visited:
            continue
        visited.add(offset)
        try:
            tags, following = _directory(data, offset, layout)
        except (struct.error, OverflowError):  # it ends behind the file's end
            continue
        yield _Page(layout.offset.pack(offset), tags, _ORIENTATION in tags, _EXIF in tags)
        waiting.extend((following, *tags.get(_SUBDIRECTORIES, ())))


def _directory(data: bytes, offset: int, layout: _Layout) -> tuple[_Tags, int]:
    """The tags of whole numbers in a directory, and the offset of the next one."""
    (count,) = layout.count.unpack_from(data, offset)
    begin = offset + layout.count.size
    (following,) = layout.offset.unpack_from(data, begin + count * layout.tag.size)
    relevant = (_SUBFILE, _WIDTH, _HEIGHT, _COMPRESSION, _PHOTOMETRIC, _ORIENTATION, _SUBDIRECTORIES, _EXIF, *_PIECES)
    tags = dict[int, tuple[int, ...]]()
    for entry in layout.tag.iter_unpack(data[begin : begin + min(count, _MAX_TAGS) * layout.tag.size]):
        if entry[0] in relevant and entry[1] in _INTEGER_TYPES:
            tags[entry[0]] = _values(data, layout, *entry[1:])
    return tags, following


def _values(data: bytes | memoryview, layout: _Layout, kind: int, count: int, inside: bytes) -> tuple[int, ...]:
    """The first _MAX_PAGES values of a tag, which are inside it if they have room."""
    numbers = struct.Struct(f"{layout.order}{min(count, _MAX_PAGES)}{_INTEGER_TYPES[kind]}")
    if count * struct.calcsize(layout.order + _INTEGER_TYPES[kind]) <= len(inside):
        return numbers.unpack_from(inside)
    return numbers.unpack_from(data, layout.offset.unpack(inside)[0])


def _is_photo(page: _Page) -> bool:
    """Whether a page is a whole picture in colors, not a sensor's, and no mask of another one."""
    whole = not _first_value(page.tags, _SUBFILE) & (_REDUCED_BIT | _MASK_BIT)
    return whole and not _is_sensor(page.tags) and page.pixel_count > 0


def _is_sensor(tags: _Tags) -> bool:
    """Whether a page holds a sensor's values, before any color is made of them."""
    sensor = _first_value(tags, _PHOTOMETRIC) in _SENSOR_PHOTOMETRICS
    return sensor or _first_value(tags, _COMPRESSION) in _RAW_COMPRESSIONS


def _is_thumbnail(first: _Tags, whole: _Tags) -> bool:
    """Whether a TIFF's first page is a thumbnail of another one."""
    if _first_value(first, _SUBFILE) & _REDUCED_BIT:
        return True
    width, height = _first_value(first, _WIDTH), _first_value(first, _HEIGHT)
    scale = _first_value(whole, _WIDTH) / max(width, 1)
    fits = abs(_first_value(whole, _HEIGHT) - scale * height) <= scale  # to a pixel of the thumbnail
    return 0 < max(width, height) <= _MAX_THUMBNAIL_SIDE and scale >= 2 and fits


def _first_value(tags: _Tags, tag: int) -> int:
    """A tag's first value; 0 where it is absent."""
    return next(iter(tags.get(tag, ())), 0)


def without_costly_exif(data: bytes) -> bytes:
    """A TIFF without those of its EXIF and GPS directories that are not moderate; other bytes as they are.

    Args:
        data: of any file; PhotoError for a TIFF whose own first directory is not moderate.
    """
    is_costly, inner = _costly_directories(data)
    if is_costly:
        raise PhotoError("The TIFF has more tags, or more numbers in them, than any camera or editor writes.")
    if not inner:
        return data
    changed = bytearray(data)
    for entry in inner:
        changed[entry + 2 : entry + 4] = b"\0\0"  # a type of tag that there is not: the tag counts as absent
    return bytes(changed)


def is_moderate(block: bytes | memoryview) -> bool:
    """Whether a photo's own, EXIF and GPS directories hold few enough tags and numbers to be read at little cost.

    Pillow makes an object of each number: 64 MB of them would become gigabytes. Damaged directories pass.

    Args:
        block: of a TIFF or of an EXIF block, without a prefix; other bytes pass.
    """
    return _costly_directories(block) == (False, [])


def _costly_directories(block: bytes | memoryview) -> tuple[bool, list[int]]:
    """Whether a photo's own directory is costly, and the positions of its tags that name others which are."""
    if (layout := _layout(block)) is None:
        return False, []
    (offset,) = layout.offset.unpack_from(block, layout.offset.size)
    is_costly, inner = _examine_directory(block, offset, layout, _MAX_NUMBER_BYTES)
    verdicts = ((entry, *_examine_directory(block, at, layout, _MAX_EXIF_NUMBER_BYTES)) for entry, at in inner)
    return is_costly, [entry for entry, is_inner_costly, _ in verdicts if is_inner_costly]


def _examine_directory(
    block: bytes | memoryview, offset: int, layout: _Layout, limit: int
) -> tuple[bool, list[tuple[int, int]]]:
    """Whether a directory has more tags than photos have, or over `limit` bytes of numbers.

    Then positions of the tags that name other directories, and of these.
    """
    size, inner = 0, list[tuple[int, int]]()
    try:
        (count,) = layout.count.unpack_from(block, offset)
        begin = offset + layout.count.size
        for entry in range(begin, begin + min(count, _MAX_TAGS) * layout.tag.size, layout.tag.size):
            tag, kind, values, inside = layout.tag.unpack_from(block, entry)
            length = 0 if kind in _BYTE_TYPES else values * _TAG_BYTES.get(kind, 0)
            size += length if length <= len(block) else 0  # Pillow leaves out what cannot be there
            if tag in (_EXIF, _GPS, _INTEROPERABILITY) and kind in _INTEGER_TYPES:
                inner.append((entry, _values(block, layout, kind, 1, inside)[0]))
    except (struct.error, OverflowError):  # it ends behind the file's end
        count = 0
    return count > _MAX_TAGS or size > limit, inner


def is_raw(data: bytes) -> bool:
    """Whether the bytes begin as a camera's RAW file; TIFF files that hold a finished picture are none.

    Args:
        data: of any file.
    """
    if data.startswith(_RAW_STARTS) or data[4:12] == b"ftypcrx ":
        return True
    if not data.startswith(TIFF_STARTS) or not is_moderate(data):
        return False
    try:
        tags = Image.open(BytesIO(data), formats=["TIFF"]).getexif()
    except Exception:  # Pillow opens no sensor's values, and any other TIFF that it does not open is refused as such
        return any(_is_sensor(page.tags) for page in _pages(data))
    reduced = tags.get(_SUBFILE) == 1 and photo_page(data) is None  # a thumbnail, as RAW files begin, of no other page
    sensor = tags.get(_PHOTOMETRIC) in _SENSOR_PHOTOMETRICS or tags.get(_COMPRESSION) in _RAW_COMPRESSIONS
    return _DNG_VERSION in tags or reduced or sensor


def embedded_preview(data: bytes) -> bytes:
    """The bytes from the largest JPEG in a RAW file on.

    Args:
        data: of a RAW file; PhotoError where it holds none.
    """
    pixels, position = _largest_jpeg(data)
    if pixels <= 0:
        sentence = "The RAW photo has no readable preview; convert it to JPEG or TIFF, for example with darktable-cli."
        raise PhotoError(sentence)
    return data[position:]


def _largest_jpeg(data: bytes) -> tuple[int, int]:
    """Pixels and position of the largest of the first _MAX_JPEGS JPEGs in a file; -1 pixels where there is none."""
    largest, position = (-1, 0), -1
    for _ in range(_MAX_JPEGS):
        position = data.find(_JPEG_START, position + 1)
        if position < 0:
            break
        width, height = frame_size(data[position : position + _PREVIEW_HEAD])
        largest = max(largest, (width * height, position))
    return largest


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
        _add_raw_exif(preview, data)
    return preview


def _add_raw_exif(preview: Image.Image, data: bytes) -> None:
    """Give a preview that lacks an EXIF block the one of its RAW file. Never raises; Pillow may warn.

    Args:
        preview: opened by Pillow; changed in place.
        data: of the RAW file.
    """
    own: dict[int, Any] = {}
    with suppress(Exception):  # Pillow raises nearly anything on hostile bytes
        own = dict(preview.getexif())
    if own or (block := _read_block(data)) is None:
        return
    preview.info["exif"] = block
    with suppress(Exception):
        preview.getexif().clear()
        preview.getexif().load(block)


def _read_block(data: bytes) -> bytes | None:
    """An EXIF block as a JPEG would hold it; None where there is none."""
    if start := _TIFF_LIKE.get(data[:4]):
        return b"Exif\0\0" + start + data[4:_HEAD]
    if data.startswith(_RAF_START) and len(data) >= _RAF_JPEG + 8:
        begin, length = struct.unpack_from(">II", data, _RAF_JPEG)
        with suppress(Exception), Image.open(BytesIO(data[begin : begin + length]), formats=["JPEG"]) as photo:
            return photo.info.get("exif")
    return _join_directories(_cr3_directories(data[:_HEAD])) if data[4:12] == b"ftypcrx " else None


def _cr3_directories(head: bytes) -> dict[int | None, bytes]:
    """The directories of EXIF that a CR3 holds apart; None: the main one."""
    found: dict[int | None, bytes] = {}
    for name, ifd in _CR3_BOXES.items():
        position = head.find(name)
        if position >= 4:
            (size,) = struct.unpack_from(">I", head, position - 4)
            found[ifd] = head[position + 4 : position - 4 + size]
    return found


def _join_directories(directories: dict[int | None, bytes]) -> bytes | None:
    """One block of directories; None where Pillow cannot read them."""
    block = Image.Exif()
    try:
        for ifd, data in directories.items():
            directory = Image.Exif()
            directory.load(b"Exif\0\0" + data)
            target: Any = block if ifd is None else block.get_ifd(ifd)
            target.update({tag: value for tag, value in directory.items() if tag not in tuple(ExifTags.IFD)})
        return block.tobytes()
    except Exception:
        return None


def open_exif_source(data: bytes, preview: Image.Image) -> Image.Image:
    """The picture whose EXIF block counts: the file itself where Pillow reads its tags, else the preview.

    The preview then gets the EXIF block of a RAW file, if it has none. Never raises; Pillow may warn.

    Args:
        data: of a RAW or TIFF file.
        preview: opened; perhaps changed in place.
    """
    if is_moderate(data):
        with suppress(Exception):
            return Image.open(BytesIO(data), formats=["TIFF"])
    if is_raw(data):
        _add_raw_exif(preview, data)
    return preview

"""JPEG, PNG, WebP, TIFF, RAW headers: sizes, scans, pages, previews.

Of each directory only what decides is read, so that hostile files cost nothing; Pillow reads the page that is chosen.

A decoder goes through the whole picture once per scan, however few bytes the scan has: a picture of 4000 x 4000 pixels
whose 343 kB hold one scan 5,000 times takes 36 s. The markers are found as libjpeg finds them (ITU-T T.81, B.1.1).

A preview is found by its markers, not by the maker's own tables: cameras store it whole and in one piece.

Pillow reads each chunk in Python, however small: 64 MB of empty chunks would take it most of a minute.

Pillow reads every WebP as an animation and makes room for two of its pictures when it opens one, before it tells their
size; in a process whose memory is bounded, a large one would then look damaged.
"""

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.errors import PhotoError

# A TIFF's pages: which of them is the photo, where the first is a thumbnail of it.

_MAX_PAGES = 16  # that are looked at
_MAX_TAGS = 1000  # of a page that are looked at; they are in ascending order, and the highest one wanted is 34665
_SENSOR_PHOTOMETRICS = (32803, 34892)  # photometric: colour filter array, linear RAW
_RAW_COMPRESSIONS = (32767, 32769, 34713, 65000, 65535)  # compressions of Sony, Epson, Nikon, Kodak, Pentax

_SUBFILE, _WIDTH, _HEIGHT, _COMPRESSION, _PHOTOMETRIC = 0xFE, 0x100, 0x101, 0x103, 0x106
_ORIENTATION, _BELOW, _EXIF = 0x112, 0x14A, 0x8769
_REDUCED, _MASK = 1, 4  # bits of NewSubfileType
_SMALL = 640  # pixels along the longer side of a thumbnail that does not say that it is one, at most
_BIG, _PLAIN = 43, 42  # in the header of a TIFF with places of 64 and of 32 bits
_NUMBERS = {3: "H", 4: "I", 13: "I", 16: "Q", 18: "Q"}  # a tag's types of whole numbers, as struct names them

_Tags = dict[int, tuple[int, ...]]


@dataclass(frozen=True)
class _Page:
    """A page behind a TIFF's thumbnail."""

    place: bytes  # where its directory lies, as the TIFF writes it
    named: slice  # where the TIFF names the place of its first directory
    has_orientation: bool  # whether the page itself says how it is turned
    has_exif: bool  # whether the page itself has an EXIF block

    def as_first(self, data: bytes) -> bytes:
        """A copy of the TIFF that has this page as its first."""
        return b"".join((memoryview(data)[: self.named.start], self.place, memoryview(data)[self.named.stop :]))


@dataclass(frozen=True)
class _Layout:
    """How a TIFF writes places and counts."""

    order: str  # of bytes, as struct names it
    big: bool  # whether they have 64 bits

    @property
    def place(self) -> struct.Struct:
        """A place in the file."""
        return struct.Struct(self.order + ("Q" if self.big else "I"))

    @property
    def count(self) -> struct.Struct:
        """The number of a directory's tags."""
        return struct.Struct(self.order + ("Q" if self.big else "H"))

    @property
    def tag(self) -> struct.Struct:
        """A tag's number, type, count of values, and the values or their place."""
        return struct.Struct(self.order + ("HHQ8s" if self.big else "HHI4s"))

    @property
    def first(self) -> int:
        """Where the place of the first directory stands."""
        return 8 if self.big else 4


def photo_page(data: bytes) -> _Page | None:
    """The page that is the photo, where that is not the first; None for all other bytes, damaged ones too.

    A first page is a thumbnail if it says that it is reduced, or if it is small and another one has its shape and at
    least twice its size.
    """
    layout = _layout(data)
    pages = [] if layout is None else list(_pages(data, layout))
    if layout is None or not pages:
        return None
    found = [(place, tags) for place, tags in pages[1:] if _is_photo(tags) and _is_thumbnail(pages[0][1], tags)]
    if not found:
        return None
    place, tags = max(found, key=lambda page: _pixels(page[1]))
    named = slice(layout.first, layout.first + layout.place.size)
    return _Page(layout.place.pack(place), named, _ORIENTATION in tags, _EXIF in tags)


def _layout(data: bytes) -> _Layout | None:
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None or len(data) < 16:
        return None
    kind = struct.unpack_from(order + "H", data, 2)[0]
    return _Layout(order, kind == _BIG) if kind in (_BIG, _PLAIN) else None


def _pages(data: bytes, layout: _Layout) -> Iterator[tuple[int, _Tags]]:
    """Place and tags of the first MOST_PAGES directories, those below others too."""
    waiting, seen = deque(layout.place.unpack_from(data, layout.first)), set[int]()
    while waiting and len(seen) < _MAX_PAGES:
        place = waiting.popleft()
        if place == 0 or place in seen:
            continue
        seen.add(place)
        try:
            tags, following = _directory(data, place, layout)
        except (struct.error, OverflowError):  # it ends behind the file's end
            continue
        yield place, tags
        waiting.extend((following, *tags.get(_BELOW, ())))


def _directory(data: bytes, place: int, layout: _Layout) -> tuple[_Tags, int]:
    """The tags of whole numbers in a directory, and the place of the next one."""
    (count,) = layout.count.unpack_from(data, place)
    begin = place + layout.count.size
    (following,) = layout.place.unpack_from(data, begin + count * layout.tag.size)
    wanted = (_SUBFILE, _WIDTH, _HEIGHT, _COMPRESSION, _PHOTOMETRIC, _ORIENTATION, _BELOW, _EXIF)
    tags = dict[int, tuple[int, ...]]()
    for entry in layout.tag.iter_unpack(data[begin : begin + min(count, _MAX_TAGS) * layout.tag.size]):
        if entry[0] in wanted and entry[1] in _NUMBERS:
            tags[entry[0]] = _values(data, layout, *entry[1:])
    return tags, following


def _values(data: bytes, layout: _Layout, kind: int, count: int, inside: bytes) -> tuple[int, ...]:
    """The first MOST_PAGES values of a tag, which stand inside it if they have room."""
    numbers = struct.Struct(f"{layout.order}{min(count, _MAX_PAGES)}{_NUMBERS[kind]}")
    if count * struct.calcsize(layout.order + _NUMBERS[kind]) <= len(inside):
        return numbers.unpack_from(inside)
    return numbers.unpack_from(data, layout.place.unpack(inside)[0])


def _is_photo(tags: _Tags) -> bool:
    """Whether a page is a whole picture in colours, not a sensor's, and no mask of another one."""
    finished = (
        _one(tags, _PHOTOMETRIC) not in _SENSOR_PHOTOMETRICS and _one(tags, _COMPRESSION) not in _RAW_COMPRESSIONS
    )
    return finished and not _one(tags, _SUBFILE) & (_REDUCED | _MASK) and _pixels(tags) > 0


def _is_thumbnail(first: _Tags, whole: _Tags) -> bool:
    """Whether a TIFF's first page is a thumbnail of another one."""
    if _is_reduced(first):
        return True
    width, height = _one(first, _WIDTH), _one(first, _HEIGHT)
    scale = _one(whole, _WIDTH) / max(width, 1)
    fits = abs(_one(whole, _HEIGHT) - scale * height) <= scale  # to a pixel of the thumbnail
    return 0 < max(width, height) <= _SMALL and scale >= 2 and fits


def _is_reduced(tags: _Tags) -> bool:
    return bool(_one(tags, _SUBFILE) & _REDUCED)


def _pixels(tags: _Tags) -> int:
    return _one(tags, _WIDTH) * _one(tags, _HEIGHT)


def _one(tags: _Tags, tag: int) -> int:
    """A tag's first value; 0 where it is absent."""
    return next(iter(tags.get(tag, ())), 0)


# The scans of a JPEG, counted before it is decoded.

_MAX_SCANS = 40  # libjpeg writes 10 of a colour picture and 18 of a CMYK one, mozjpeg's search ends at about as many
_MAX_SEGMENTS = 4096  # 64 MB need 1,000 of full length; Pillow takes microseconds for each

_SOI, _EOI, _SOS = 0xD8, 0xD9, 0xDA
_SEQUENTIAL = (0xC0, 0xC1, 0xC9)  # SOF0 and SOF1, and SOF9 with arithmetic coding
_FRAMES = (*_SEQUENTIAL, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
_DCT = (0xC0, 0xC1, 0xC2)  # what any decoder reads
_FEW, _MANY = 1 << 9, 1 << 17  # bytes searched at once: first few, since segments follow each other closely


def check_scans(data: bytes) -> None:
    """Raise PhotoError for a JPEG of more than MOST_SCANS scans or MOST_SEGMENTS segments; other bytes pass.

    What follows the scan of a picture that is decoded row by row is not looked at: a decoder refuses another scan.
    """
    if not data.startswith(b"\xff\xd8\xff"):
        return
    scans, frame = 0, None
    for number, (marker, at) in enumerate(_segments(data), 1):
        if number > _MAX_SEGMENTS:
            raise PhotoError(f"The JPEG has more than {_MAX_SEGMENTS} segments, which no camera or editor writes.")
        frame = at if marker in _FRAMES else frame
        if marker != _SOS:
            continue
        if scans == 0 and _is_by_rows(data, frame, at):
            return
        scans += 1
        if scans > _MAX_SCANS:
            raise PhotoError(f"The JPEG has more than {_MAX_SCANS} scans, which no camera or editor writes.")


def dct_coefficients_per_pixel(data: bytes) -> float:
    """The DCT coefficients per pixel that a decoder holds in memory; 0 for a JPEG that it decodes row by row.

    It holds all of a progressive picture and of any whose first scan lacks a component (T.81, A.2). Chroma at half the
    resolution each way makes 1.5 of them, CMYK 4.
    """
    frame = None
    for marker, at in _segments(data):
        if marker == _SOS:
            if _is_by_rows(data, frame, at):
                return 0.0
            break
        frame = at if marker in _FRAMES else frame
    if frame is None:
        raise PhotoError("The JPEG announces no picture.")
    factors = [divmod(data[frame + 11 + 3 * i], 16) for i in range(data[frame + 9])]
    whole = max(wide for wide, _ in factors) * max(high for _, high in factors)
    return sum(wide * high for wide, high in factors) / whole


def _is_by_rows(data: bytes, frame: int | None, scan: int) -> bool:
    """Whether a first scan holds every component of a sequential frame; both are places of their markers."""
    if frame is None or data[frame + 1] not in _SEQUENTIAL:
        return False
    return data[scan + 4 : scan + 5] == data[frame + 9 : frame + 10] != b""


def _frame_size(data: bytes) -> tuple[int, int]:
    """Width and height that a JPEG's first frame announces; 0, 0 for a lossless one, and where none is found."""
    for marker, at in _segments(data):
        if marker in _DCT and len(data) >= at + 9:
            return int.from_bytes(data[at + 7 : at + 9]), int.from_bytes(data[at + 5 : at + 7])
        if marker in _FRAMES or marker == _SOS:
            break
    return 0, 0


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Marker and place of each of the first picture's segments; not what they hold, nor what follows EOI."""
    view = np.frombuffer(data, dtype=np.uint8)
    at = _next_marker(view, 2)
    while at is not None and (marker := data[at + 1]) not in (_SOI, _EOI):
        yield marker, at
        length = int.from_bytes(data[at + 2 : at + 4])
        at = _next_marker(view, at + 2 + max(2, length))


def _next_marker(view: NDArray[np.uint8], start: int) -> int | None:
    """The index of the first 0xFF from `start` on that a marker's code follows."""
    size = _FEW
    while start < view.size - 1:
        part = view[start : start + size + 1]
        found = (part[:-1] == 0xFF) & (part[1:] != 0)  # rare in a picture, where every 0xFF is stuffed with a 0
        if found.any():
            found &= _is_code(part[1:])
            first = int(found.argmax())
            if found[first]:
                return start + first
        start, size = start + size, min(2 * size, _MANY)
    return None


def _is_code(values: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Whether each byte after 0xFF begins a segment: not a stuffed byte, TEM (0 and 1), RST0 to RST7 or fill (0xFF)."""
    below, above = values - np.uint8(0x02), values - np.uint8(0xD8)  # these wrap round: one comparison for two
    return (below < 0xD0 - 0x02) | (above < 0xFF - 0xD8)


# RAW files: which bytes are one, and the JPEG preview that cameras put into it.

RAW_FORMAT = "RAW"
_MAX_JPEGS = 64  # beginnings of a JPEG that are looked at

_BEGINNINGS = (  # CR2, Olympus, Panasonic, Fujifilm, Sigma
    b"II*\0\x10\0\0\0CR", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FUJIFILMCCD-RAW", b"FOVb",
)  # fmt: skip
_TIFF = (b"II*\0", b"MM\0*")
_JPEG = b"\xff\xd8\xff"
_PREVIEW_HEAD = 1 << 18  # bytes in which a preview's size must stand
_DNG_VERSION = 0xC612


def is_raw(data: bytes) -> bool:
    """Whether the bytes begin as a camera's RAW file; TIFF files that hold a finished picture are none."""
    if data.startswith(_BEGINNINGS) or data[4:12] == b"ftypcrx ":
        return True
    if not data.startswith(_TIFF):
        return False
    try:
        tags = Image.open(BytesIO(data), formats=["TIFF"]).getexif()
    except Exception:  # a TIFF that cannot be opened is refused as such
        return False
    reduced = tags.get(_SUBFILE) == 1 and photo_page(data) is None  # a thumbnail, as RAW files begin, of no other page
    sensor = tags.get(_PHOTOMETRIC) in _SENSOR_PHOTOMETRICS or tags.get(_COMPRESSION) in _RAW_COMPRESSIONS
    return _DNG_VERSION in tags or reduced or sensor


def embedded_preview(data: bytes) -> bytes:
    """The bytes from the largest JPEG in a RAW file on; raises PhotoError where there is none."""
    found = (-1, 0)  # pixels, place
    at = -1
    for _ in range(_MAX_JPEGS):
        at = data.find(_JPEG, at + 1)
        if at < 0:
            break
        width, height = _frame_size(data[at : at + _PREVIEW_HEAD])
        found = max(found, (width * height, at))
    if found[0] <= 0:
        raise PhotoError(
            "The RAW photo holds no preview that can be read; convert it to JPEG or TIFF first, as darktable-cli does."
        )
    return data[found[1] :]


def open_exif_source(data: bytes, shown: Image.Image) -> Image.Image:
    """The picture whose EXIF block counts: the RAW file where Pillow reads its tags, else the preview."""
    try:
        return Image.open(BytesIO(data), formats=["TIFF"])
    except Exception:
        return shown


# The chunks of a PNG, counted before it is decoded.

_MAX_CHUNKS = 20_000  # libpng writes 8 KiB each: 64 MB make 7,800

_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK_OVERHEAD = 12  # bytes of a chunk beside its data: length, name, checksum


def check_chunks(data: bytes) -> None:
    """Raise PhotoError for a PNG of more than MOST_CHUNKS chunks; other bytes pass."""
    if not data.startswith(_SIGNATURE):
        return
    at = len(_SIGNATURE)
    for _ in range(_MAX_CHUNKS):
        if at >= len(data):
            return
        at += _CHUNK_OVERHEAD + int.from_bytes(data[at : at + 4])
    if at < len(data):
        raise PhotoError(f"The PNG has more than {_MAX_CHUNKS} chunks, which no camera or editor writes.")


# The size of a WebP, read before Pillow opens it.

_WEBP_HEAD = 30  # bytes
_START_OF_FRAME = b"\x9d\x01\x2a"
_LOSSLESS = 0x2F


def webp_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in pixels of a WebP (RFC 9649, 2.5 to 2.7); None for other bytes and for a head that is none."""
    if len(data) < _WEBP_HEAD or not data.startswith(b"RIFF") or data[8:12] != b"WEBP":
        return None
    kind, head = data[12:16], data[20:_WEBP_HEAD]
    if kind == b"VP8X":
        return int.from_bytes(head[4:7], "little") + 1, int.from_bytes(head[7:10], "little") + 1
    if kind == b"VP8L" and head[0] == _LOSSLESS:
        bits = int.from_bytes(head[1:5], "little")
        return (bits & 0x3FFF) + 1, (bits >> 14 & 0x3FFF) + 1
    if kind == b"VP8 " and head[3:6] == _START_OF_FRAME:
        return int.from_bytes(head[6:8], "little") & 0x3FFF, int.from_bytes(head[8:10], "little") & 0x3FFF
    return None

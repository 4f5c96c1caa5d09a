"""A TIFF's pages: which of them is the photo, where the first is a thumbnail of it.

Of each directory only what decides is read, so that hostile files cost nothing; Pillow reads the page that is chosen.
"""

import struct
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

MOST_PAGES = 16  # that are looked at
MOST_TAGS = 1000  # of a page that are looked at; they are in ascending order, and the highest one wanted is 34665
SENSOR = (32803, 34892)  # photometric: colour filter array, linear RAW
MAKERS = (32767, 32769, 34713, 65000, 65535)  # compressions of Sony, Epson, Nikon, Kodak, Pentax

_SUBFILE, _WIDTH, _HEIGHT, _COMPRESSION, _PHOTOMETRIC = 0xFE, 0x100, 0x101, 0x103, 0x106
_ORIENTATION, _BELOW, _EXIF = 0x112, 0x14A, 0x8769
_REDUCED, _MASK = 1, 4  # bits of NewSubfileType
_SMALL = 640  # pixels along the longer side of a thumbnail that does not say that it is one, at most
_BIG, _PLAIN = 43, 42  # in the header of a TIFF with places of 64 and of 32 bits
_NUMBERS = {3: "H", 4: "I", 13: "I", 16: "Q", 18: "Q"}  # a tag's types of whole numbers, as struct names them

_Tags = dict[int, tuple[int, ...]]


@dataclass(frozen=True)
class Page:
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


def photo_page(data: bytes) -> Page | None:
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
    return Page(layout.place.pack(place), named, _ORIENTATION in tags, _EXIF in tags)


def _layout(data: bytes) -> _Layout | None:
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None or len(data) < 16:
        return None
    kind = struct.unpack_from(order + "H", data, 2)[0]
    return _Layout(order, kind == _BIG) if kind in (_BIG, _PLAIN) else None


def _pages(data: bytes, layout: _Layout) -> Iterator[tuple[int, _Tags]]:
    """Place and tags of the first MOST_PAGES directories, those below others too."""
    waiting, seen = deque(layout.place.unpack_from(data, layout.first)), set[int]()
    while waiting and len(seen) < MOST_PAGES:
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
    for entry in layout.tag.iter_unpack(data[begin : begin + min(count, MOST_TAGS) * layout.tag.size]):
        if entry[0] in wanted and entry[1] in _NUMBERS:
            tags[entry[0]] = _values(data, layout, *entry[1:])
    return tags, following


def _values(data: bytes, layout: _Layout, kind: int, count: int, inside: bytes) -> tuple[int, ...]:
    """The first MOST_PAGES values of a tag, which stand inside it if they have room."""
    numbers = struct.Struct(f"{layout.order}{min(count, MOST_PAGES)}{_NUMBERS[kind]}")
    if count * struct.calcsize(layout.order + _NUMBERS[kind]) <= len(inside):
        return numbers.unpack_from(inside)
    return numbers.unpack_from(data, layout.place.unpack(inside)[0])


def _is_photo(tags: _Tags) -> bool:
    """Whether a page is a whole picture in colours, not a sensor's, and no mask of another one."""
    finished = _one(tags, _PHOTOMETRIC) not in SENSOR and _one(tags, _COMPRESSION) not in MAKERS
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

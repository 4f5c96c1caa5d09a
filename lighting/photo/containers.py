"""JPEG, PNG and WebP by their structure: scans, chunks and sizes, before a decoder sees them.

- JPEG: a decoder goes through the whole picture once per scan, however few bytes the scan has. A picture of 4000 x 4000
  pixels whose 343 kB hold one scan 5,000 times takes 36 s. Markers are found as libjpeg finds them [1].
- PNG: Pillow reads each chunk in Python, however small; 64 MB of empty chunks would take it most of a minute.
- WebP: Pillow reads every one as an animation, with room for two of its pictures before it tells their size. In a
  process whose memory is bounded, a large one would then look damaged.

References:
    [1] ITU-T T.81, B.1.1 and A.2.
    [2] RFC 9649, 2.5 to 2.7.
"""

import re
from collections.abc import Iterator
from itertools import islice

from lighting.errors import PhotoError

# JPEG
_MAX_SCANS = 40  # libjpeg writes 10 of a color picture and 18 of a CMYK one, mozjpeg's search ends at about as many
_MAX_SEGMENTS = 4096  # 64 MB need 1,000 of full length; Pillow takes microseconds for each
_MAX_EXIF_SEGMENTS = 16  # Pillow copies all of them for each one more

_SOI, _EOI, _SOS, _APP1 = 0xD8, 0xD9, 0xDA, 0xE1
_SEQUENTIAL = (0xC0, 0xC1, 0xC9)  # SOF0 and SOF1, and SOF9 with arithmetic coding
_FRAMES = (*_SEQUENTIAL, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF)
_DCT = (0xC0, 0xC1, 0xC2)  # what any decoder reads
_MARKER = re.compile(rb"\xff[^\x00\x01\xd0-\xd7\xff]")  # of a segment: no stuffed byte, TEM, RST0 to RST7 or fill

# PNG and WebP
_MAX_CHUNKS = 20_000  # libpng writes 8 KiB each: 64 MB make 7,800

_PNG_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_CHUNK_OVERHEAD = 12  # bytes of a chunk beside its data: length, name, checksum
_WEBP_HEAD = 30  # bytes
_START_OF_FRAME = b"\x9d\x01\x2a"
_LOSSLESS = 0x2F


def check_structure(data: bytes) -> None:
    """Raise PhotoError for a file of more parts than cameras write.

    Those are 40 scans, 16 EXIF or 4096 segments of any kind of a JPEG, and 20,000 chunks of a PNG.

    Args:
        data: of any file.
    """
    if data.startswith(b"\xff\xd8\xff"):
        _check_scans(data)
    elif next(islice(png_chunks(data), _MAX_CHUNKS, None), None):
        raise PhotoError(f"The PNG has more than {_MAX_CHUNKS} chunks, which no camera or editor writes.")


def png_chunks(data: bytes) -> Iterator[tuple[bytes, int, int]]:
    """Kind, position and length [bytes] of what each chunk of a PNG holds; the last may be cut short.

    Args:
        data: of any file; others than a PNG have none.
    """
    position = len(_PNG_SIGNATURE) if data.startswith(_PNG_SIGNATURE) else len(data)
    while position < len(data):
        length = int.from_bytes(data[position : position + 4])
        yield data[position + 4 : position + 8], position + 8, length
        position += _CHUNK_OVERHEAD + length


def _check_scans(data: bytes) -> None:
    """What follows the scan of a picture that is decoded row by row is not read: a decoder refuses another scan."""
    scans, blocks, frame = 0, 0, None
    for number, (marker, position) in enumerate(_segments(data), 1):
        blocks += marker == _APP1 and data[position + 4 : position + 8] == b"Exif"
        if blocks > _MAX_EXIF_SEGMENTS:
            raise PhotoError(f"The JPEG has more than {_MAX_EXIF_SEGMENTS} EXIF segments, which no camera writes.")
        if number > _MAX_SEGMENTS:
            raise PhotoError(f"The JPEG has more than {_MAX_SEGMENTS} segments, which no camera or editor writes.")
        frame = position if marker in _FRAMES else frame
        if marker != _SOS:
            continue
        if scans == 0 and _is_by_rows(data, frame, position):
            return
        scans += 1
        if scans > _MAX_SCANS:
            raise PhotoError(f"The JPEG has more than {_MAX_SCANS} scans, which no camera or editor writes.")


def dct_coefficients_per_pixel(data: bytes) -> float:
    """The DCT coefficients per pixel that a decoder holds in memory; 0 for a JPEG that it decodes row by row.

    It holds all of a progressive picture and of any whose first scan lacks a component [1]. Chroma at half the
    resolution each way makes 1.5 of them, CMYK 4.

    Args:
        data: of a JPEG; PhotoError where it has no frame.
    """
    frame = None
    for marker, position in _segments(data):
        if marker == _SOS:
            if _is_by_rows(data, frame, position):
                return 0.0
            break
        frame = position if marker in _FRAMES else frame
    if frame is None:
        raise PhotoError("The JPEG announces no picture.")
    factors = [divmod(data[frame + 11 + 3 * i], 16) for i in range(data[frame + 9])]
    whole = max(wide for wide, _ in factors) * max(high for _, high in factors)
    return sum(wide * high for wide, high in factors) / whole


def _is_by_rows(data: bytes, frame: int | None, scan: int) -> bool:
    """Whether a first scan holds every component of a sequential frame; both are positions of their markers."""
    if frame is None or data[frame + 1] not in _SEQUENTIAL:
        return False
    return data[scan + 4 : scan + 5] == data[frame + 9 : frame + 10] != b""


def frame_size(data: bytes) -> tuple[int, int]:
    """Width and height [pixels] that a JPEG's first frame announces; 0, 0 for a lossless one, and without one.

    Args:
        data: of a JPEG.
    """
    for marker, position in _segments(data):
        if marker in _DCT and len(data) >= position + 9:
            height, width = data[position + 5 : position + 7], data[position + 7 : position + 9]
            return int.from_bytes(width), int.from_bytes(height)
        if marker in _FRAMES or marker == _SOS:
            break
    return 0, 0


def _segments(data: bytes) -> Iterator[tuple[int, int]]:
    """Marker and position of each of the first picture's segments; not what they hold, nor what follows EOI."""
    end = 2
    while (found := _MARKER.search(data, end)) and (marker := data[found.end() - 1]) not in (_SOI, _EOI):
        yield marker, found.start()
        end = found.end() + max(2, int.from_bytes(data[found.end() : found.end() + 2]))


def webp_size(data: bytes) -> tuple[int, int] | None:
    """Width and height in pixels of a WebP [2]; None for other bytes and for a damaged head.

    Args:
        data: of any file.
    """
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

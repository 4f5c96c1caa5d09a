"""PNG and TIFF files that Pillow does not write: 16 bits in colour, parts of one's own, sizes that are not true."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags

from tests.conftest import exif


def write_png16(path: Path, pixels: NDArray[np.uint16], camera: dict[int, Any] | None = None) -> Path:
    """A PNG of 16-bit colours (H, W, 3), with those EXIF tags about the camera."""
    height, width, _ = pixels.shape
    rows = pixels.astype(">u2").view(np.uint8).reshape(height, -1)
    plain = np.concatenate([np.zeros((height, 1), np.uint8), rows], axis=1).tobytes()
    block = exif(camera).tobytes().removeprefix(b"Exif\0\0") if camera else b""
    path.write_bytes(png(width, height, plain, *([chunk(b"eXIf", block)] if block else []), depth=16, colour=2))
    return path


def png(width: int, height: int, rows: bytes, *extra: bytes, depth: int = 8, colour: int = 0) -> bytes:
    """A PNG that announces this size and kind, grey if not told, before these rows and further chunks."""
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0))
    body = header + b"".join(extra) + chunk(b"IDAT", zlib.compress(rows, 1))
    return b"\x89PNG\r\n\x1a\n" + body + chunk(b"IEND", b"")


def grey_tiff(width: int, height: int, bits: int, data: bytes, *, white_is_zero: bool = False) -> bytes:
    """A little-endian TIFF of one strip, as Pillow writes none: of any number of bits, its greys in either order."""
    begin = 8 + 2 + 12 * 9 + 4
    tags = ((256, width), (257, height), (258, bits), (259, 1), (262, not white_is_zero), (273, begin), (277, 1))
    entries = b"".join(
        struct.pack("<HHII", tag, 4, 1, value) for tag, value in (*tags, (278, height), (279, len(data)))
    )
    return b"II*\0" + struct.pack("<IH", 8, 9) + entries + bytes(4) + data


def chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def taken(seconds: float, time: str = "2024:06:01 11:00:00", offset: str = "+02:00") -> dict[int, Any]:
    """EXIF tags of an exposure."""
    base = ExifTags.Base
    return {base.ExposureTime: seconds, base.DateTimeOriginal: time, base.OffsetTimeOriginal: offset}

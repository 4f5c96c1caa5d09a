"""16-bit pictures as files, which Pillow cannot write in colour."""

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
    header = struct.pack(">IIBBBBB", width, height, 16, 2, 0, 0, 0)
    chunks = [
        (b"IHDR", header),
        *([(b"eXIf", block)] if block else []),
        (b"IDAT", zlib.compress(plain, 1)),
        (b"IEND", b""),
    ]
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(*chunk) for chunk in chunks))
    return path


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def taken(seconds: float, time: str = "2024:06:01 11:00:00", offset: str = "+02:00") -> dict[int, Any]:
    """EXIF tags of an exposure."""
    base = ExifTags.Base
    return {base.ExposureTime: seconds, base.DateTimeOriginal: time, base.OffsetTimeOriginal: offset}

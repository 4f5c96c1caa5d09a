"""The size in a WebP's head, whatever way it is packed."""

import struct
from typing import Any

import pytest
from PIL import Image

from lighting.errors import PhotoTooLargeError
from lighting.photo import read_photo
from lighting.photo.apart import read_apart
from lighting.photo.webp import canvas
from tests.conftest import encode

SIDE = 11300
LARGE = b"RIFF\x1a\0\0\0WEBPVP8L\x0e\0\0\0\x2f" + struct.pack("<I", SIDE - 1 | SIDE - 1 << 14) + bytes(9)


@pytest.mark.parametrize("options", [{}, {"lossless": True}, {"exif": b"Exif\0\0MM\0*\0\0\0\x08\0\0"}])
@pytest.mark.parametrize("mode", ["RGB", "RGBA"])
def test_the_size_is_found(mode: str, options: dict[str, Any]) -> None:
    assert canvas(encode(Image.new(mode, (321, 47)), "WEBP", **options)) == (321, 47)


def test_other_bytes_have_none() -> None:
    webp = encode(Image.new("RGB", (40, 40)), "WEBP")
    for data in (b"", b"RIFF", encode(Image.new("RGB", (40, 40)), "PNG"), webp[:29], webp[:12] + b"VP9 " + webp[16:]):
        assert canvas(data) is None


@pytest.mark.parametrize("read", [read_photo, read_apart])
def test_a_large_one_is_refused_as_too_large(read: Any) -> None:
    """In a process of its own, too, where the decoder has no memory to open it."""
    with pytest.raises(PhotoTooLargeError, match=r"The WebP of 11300 x 11300 pixels has more than its limit"):
        read(LARGE)

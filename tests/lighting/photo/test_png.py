"""Floods of PNG chunks."""

import time

import pytest

from lighting.errors import PhotoError
from lighting.photo import read_photo
from lighting.photo.png import MOST_CHUNKS, check_chunks
from tests.conftest import encode, scene
from tests.pictures import chunk

GOOD = encode(scene(64, 48), "PNG")
EMPTY = chunk(b"teSt", b"")
HEADER = 33  # bytes: signature and IHDR


def flooded(chunks: int) -> bytes:
    return GOOD[:HEADER] + EMPTY * chunks + GOOD[HEADER:]


def test_a_flood_of_chunks_is_refused_before_it_is_decoded() -> None:
    data = flooded(5_000_000)
    began = time.process_time()
    with pytest.raises(PhotoError, match="more than 20000 chunks"):
        read_photo(data)
    assert time.process_time() - began < 1


def test_as_many_chunks_as_libpng_writes_are_read() -> None:
    assert read_photo(flooded(8000)).width == 64


@pytest.mark.parametrize("data", [b"", b"text", b"\x89PNG\r\n\x1a\n", GOOD[:40], GOOD, b"\xff\xd8\xff" * 9])
def test_other_bytes_pass(data: bytes) -> None:
    check_chunks(data)


def test_chunks_are_counted_to_the_last() -> None:
    count = flooded(0).count(b"IDAT") + 2  # IHDR, IEND
    check_chunks(flooded(MOST_CHUNKS - count))
    with pytest.raises(PhotoError):
        check_chunks(flooded(MOST_CHUNKS - count + 1))

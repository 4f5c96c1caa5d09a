"""TIFF files whose first page is a thumbnail."""

import struct
from collections.abc import Mapping
from io import BytesIO
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo import read_photo
from lighting.photo.pages import MOST_PAGES, photo_page
from tests.conftest import encode, munich, scene

SUBFILE, BELOW, PHOTOMETRIC = 0xFE, 0x14A, 0x106
WHOLE, THUMBNAIL = scene(320, 240), scene(80, 60)
REDUCED = {SUBFILE: 1}


def tiff(*pages: tuple[NDArray[Any], Mapping[int, Any]], **options: Any) -> bytes:
    """A TIFF of these pages with their tags."""
    pictures = [Image.fromarray(pixels) for pixels, _ in pages]
    for picture, (_, tags) in zip(pictures, pages, strict=True):
        told = {"exif": tags.tobytes()} if isinstance(tags, Image.Exif) else {"tiffinfo": tags}
        picture.encoderinfo = {**told, **options}
    stream = BytesIO()
    pictures[0].save(stream, "TIFF", save_all=True, append_images=pictures[1:])
    return stream.getvalue()


def with_page_below(tags: dict[int, Any]) -> bytes:
    """A TIFF whose whole picture stands below its thumbnail, not in line with it."""
    mark = struct.pack("<I", 0xABCDEF)
    data = bytearray(tiff((THUMBNAIL, {**REDUCED, BELOW: 0xABCDEF}), (WHOLE, tags)))
    (first,) = struct.unpack_from("<I", data, 4)
    end = first + 2 + 12 * struct.unpack_from("<H", data, first)[0]
    at = data.index(mark)
    data[at : at + 4], data[end : end + 4] = data[end : end + 4], bytes(4)
    return bytes(data)


def phone() -> Image.Exif:
    """The EXIF block of a thumbnail that is to be turned."""
    block = munich()
    block[SUBFILE], block[ExifTags.Base.Orientation] = 1, 6
    return block


def with_own_exif() -> bytes:
    """A TIFF whose whole picture has the EXIF block; of its thumbnail there is the directory alone."""
    block = munich()
    block[ExifTags.Base.Orientation] = 6
    data = encode(WHOLE, "TIFF", exif=block.tobytes())
    (place,) = struct.unpack_from("<I", data, 4)
    return data[:4] + struct.pack("<I", len(data)) + data[8:] + directory("<", (SUBFILE, 4, 1, 1), following=place)


def shows(data: bytes, pixels: NDArray[Any]) -> bool:
    photo = read_photo(data)
    return photo.pixels.shape == pixels.shape and bool(np.array_equal(photo.pixels, pixels))


@pytest.mark.parametrize("options", [{}, {"compression": "tiff_lzw"}, {"big_tiff": True}], ids=repr)
def test_the_picture_behind_a_thumbnail_is_read(options: dict[str, Any]) -> None:
    assert shows(tiff((THUMBNAIL, REDUCED), (WHOLE, {}), **options), WHOLE)
    assert shows(tiff((THUMBNAIL, {}), (WHOLE, {}), **options), WHOLE)  # small, and of the same shape


def test_a_mask_is_no_picture() -> None:
    mask = np.full((480, 640), 255, np.uint8)
    assert shows(tiff((THUMBNAIL, REDUCED), (WHOLE, {}), (mask, {SUBFILE: 4})), WHOLE)


def test_the_picture_below_a_thumbnail_is_read() -> None:
    assert shows(with_page_below({}), WHOLE)


def test_the_largest_of_several_is_read() -> None:
    assert shows(tiff((THUMBNAIL, {}), (scene(160, 120), REDUCED), (scene(240, 180), {}), (WHOLE, {})), WHOLE)


@pytest.mark.parametrize(
    "others",
    [
        [],
        [(THUMBNAIL, REDUCED)],
        [(scene(160, 120), REDUCED)],  # larger, and yet reduced: there is no whole one
        [(scene(320, 320), {})],  # of another shape
        [(scene(100, 75), {})],  # hardly larger
        [(WHOLE, {PHOTOMETRIC: 32803})],
    ],
)
def test_a_series_counts_by_its_first_picture(others: list[tuple[NDArray[Any], Mapping[int, Any]]]) -> None:
    assert photo_page(tiff((THUMBNAIL, {}), *others)) is None


def test_a_large_first_picture_is_none() -> None:
    assert photo_page(tiff((scene(800, 600), {}), (scene(1600, 1200), {}))) is None


def test_the_thumbnail_s_exif_block_counts() -> None:
    photo = read_photo(tiff((THUMBNAIL, phone()), (WHOLE, {})))
    assert (photo.width, photo.height) == (240, 320)
    assert np.array_equal(photo.pixels, np.rot90(WHOLE, 3))
    assert photo.facts.latitude == pytest.approx(48.1375)


def test_the_picture_s_own_orientation_counts_before_the_thumbnail_s() -> None:
    photo = read_photo(tiff((THUMBNAIL, phone()), (WHOLE, {ExifTags.Base.Orientation: 3})))
    assert np.array_equal(photo.pixels, np.rot90(WHOLE, 2))
    assert photo.facts.latitude == pytest.approx(48.1375)


def test_the_picture_s_own_exif_block_counts_before_the_thumbnail_s() -> None:
    photo = read_photo(with_own_exif())
    assert np.array_equal(photo.pixels, np.rot90(WHOLE, 3))
    assert photo.facts.latitude == pytest.approx(48.1375)


def test_the_picture_s_size_is_what_is_limited() -> None:
    data = tiff((THUMBNAIL, REDUCED), (WHOLE, {}))
    with pytest.raises(PhotoTooLargeError, match="320 x 240"):
        read_photo(data, max_pixels=20_000)


def directory(order: str, *entries: tuple[int, int, int, int], following: int) -> bytes:
    body = b"".join(struct.pack(order + "HHII", *entry) for entry in entries)
    return struct.pack(order + "H", len(entries)) + body + struct.pack(order + "I", following)


@pytest.mark.parametrize("following", [8, 0xFFFFFFFF, 1, 0])
@pytest.mark.parametrize("values", [1, MOST_PAGES, 0xFFFFFFFF])
def test_pages_that_lead_nowhere_end(following: int, values: int) -> None:
    entries = (SUBFILE, 4, 1, 1), (BELOW, 4, values, 8)
    assert photo_page(b"II*\0\x08\0\0\0" + directory("<", *entries, following=following)) is None


def test_damaged_bytes_are_left_to_the_reader() -> None:
    data = tiff((THUMBNAIL, REDUCED), (WHOLE, {}))
    for end in range(0, len(data), 97):
        photo_page(data[:end])
    for at in range(400):
        photo_page(data[:at] + b"\xff" + data[at + 1 :])
    for big in (b"II+\0\x08\0\0\0" + b"\xff" * 8, b"II+\0\x08\0\0\0" + b"\x10" + bytes(7) + b"\xff" * 8):
        assert photo_page(big + bytes(99)) is None
    with pytest.raises(PhotoError):
        read_photo(data[: len(data) // 2])


def test_many_large_directories_take_no_time() -> None:
    """2 directories of 3 million tags, as far as the file tells: only their beginnings are read."""
    head = b"II+\0\x08\0\0\0" + struct.pack("<Q", 16)
    data = head + struct.pack("<Q", 3_000_000) + bytes(20 * 3_000_000) + struct.pack("<Q", 17)
    begin = perf_counter()
    assert photo_page(data) is None
    assert perf_counter() - begin < 1.0


def test_one_page_is_as_before() -> None:
    assert photo_page(encode(WHOLE, "TIFF")) is None
    assert photo_page(encode(WHOLE)) is None

"""TIFF directories and RAW files: which page counts, which preview, and what is costly."""

import struct
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo.pixels import make_upright
from lighting.photo.reader import read_photo
from lighting.photo.tiff import embedded_preview, is_moderate, is_raw, photo_page
from tests.conftest import encode, munich, scene
from tests.helpers.photos import (
    PHOTOMETRIC_TAG,
    SUBDIRECTORY_TAG,
    SUBFILE_TAG,
    THUMBNAIL_PAGE,
    WHOLE_PAGE,
    directory,
    tiff,
    tiff_with_exif_behind_thumbnail,
)

MAX_EXIF_NUMBER_BYTES = 65_536
MAX_PAGES = 16
MAX_TAGS = 1000

REDUCED = {SUBFILE_TAG: 1}


def with_page_below(tags: dict[int, Any]) -> bytes:
    """A TIFF whose whole picture stands below its thumbnail, not in line with it."""
    mark = struct.pack("<I", 0xABCDEF)
    data = bytearray(tiff((THUMBNAIL_PAGE, {**REDUCED, SUBDIRECTORY_TAG: 0xABCDEF}), (WHOLE_PAGE, tags)))
    (first,) = struct.unpack_from("<I", data, 4)
    end = first + 2 + 12 * struct.unpack_from("<H", data, first)[0]
    at = data.index(mark)
    data[at : at + 4], data[end : end + 4] = data[end : end + 4], bytes(4)
    return bytes(data)


def phone() -> Image.Exif:
    """The EXIF block of a thumbnail that is to be turned."""
    block = munich()
    block[SUBFILE_TAG], block[ExifTags.Base.Orientation] = 1, 6
    return block


def shows(data: bytes, pixels: NDArray[Any]) -> bool:
    photo = read_photo(data)
    return photo.pixels.shape == pixels.shape and bool(np.array_equal(photo.pixels, pixels))


@pytest.mark.parametrize("options", [{}, {"compression": "tiff_lzw"}, {"big_tiff": True}], ids=repr)
def test_the_picture_behind_a_thumbnail_is_read(options: dict[str, Any]) -> None:
    assert shows(tiff((THUMBNAIL_PAGE, REDUCED), (WHOLE_PAGE, {}), **options), WHOLE_PAGE)
    assert shows(tiff((THUMBNAIL_PAGE, {}), (WHOLE_PAGE, {}), **options), WHOLE_PAGE)  # small, and of the same shape


def test_a_mask_is_no_picture() -> None:
    mask = np.full((480, 640), 255, np.uint8)
    assert shows(tiff((THUMBNAIL_PAGE, REDUCED), (WHOLE_PAGE, {}), (mask, {SUBFILE_TAG: 4})), WHOLE_PAGE)


def test_the_picture_below_a_thumbnail_is_read() -> None:
    assert shows(with_page_below({}), WHOLE_PAGE)


def test_the_largest_of_several_is_read() -> None:
    assert shows(
        tiff((THUMBNAIL_PAGE, {}), (scene(160, 120), REDUCED), (scene(240, 180), {}), (WHOLE_PAGE, {})), WHOLE_PAGE
    )


@pytest.mark.parametrize(
    "others",
    [
        [],
        [(THUMBNAIL_PAGE, REDUCED)],
        [(scene(160, 120), REDUCED)],  # larger, and yet reduced: there is no whole one
        [(scene(320, 320), {})],  # of another shape
        [(scene(100, 75), {})],  # hardly larger
        [(WHOLE_PAGE, {PHOTOMETRIC_TAG: 32803})],
    ],
)
def test_a_series_counts_by_its_first_picture(others: list[tuple[NDArray[Any], Mapping[int, Any]]]) -> None:
    assert photo_page(tiff((THUMBNAIL_PAGE, {}), *others)) is None


def test_a_large_first_picture_is_none() -> None:
    assert photo_page(tiff((scene(800, 600), {}), (scene(1600, 1200), {}))) is None


def test_the_thumbnail_s_exif_block_counts() -> None:
    photo = read_photo(tiff((THUMBNAIL_PAGE, phone()), (WHOLE_PAGE, {})))
    assert (photo.width, photo.height) == (240, 320)
    assert np.array_equal(photo.pixels, np.rot90(WHOLE_PAGE, 3))
    assert photo.metadata.latitude == pytest.approx(48.1375)


def test_the_picture_s_own_orientation_counts_before_the_thumbnail_s() -> None:
    photo = read_photo(tiff((THUMBNAIL_PAGE, phone()), (WHOLE_PAGE, {ExifTags.Base.Orientation: 3})))
    assert np.array_equal(photo.pixels, np.rot90(WHOLE_PAGE, 2))
    assert photo.metadata.latitude == pytest.approx(48.1375)


def test_the_picture_s_own_exif_block_counts_before_the_thumbnail_s() -> None:
    photo = read_photo(tiff_with_exif_behind_thumbnail())
    assert np.array_equal(photo.pixels, np.rot90(WHOLE_PAGE, 3))
    assert photo.metadata.latitude == pytest.approx(48.1375)


def test_the_picture_s_size_is_what_is_limited() -> None:
    data = tiff((THUMBNAIL_PAGE, REDUCED), (WHOLE_PAGE, {}))
    with pytest.raises(PhotoTooLargeError, match="320 x 240"):
        read_photo(data, max_pixels=20_000)


@pytest.mark.parametrize("following", [8, 0xFFFFFFFF, 1, 0])
@pytest.mark.parametrize("values", [1, MAX_PAGES, 0xFFFFFFFF])
def test_pages_that_lead_nowhere_end(following: int, values: int) -> None:
    entries = (SUBFILE_TAG, 4, 1, 1), (SUBDIRECTORY_TAG, 4, values, 8)
    assert photo_page(b"II*\0\x08\0\0\0" + directory("<", *entries, following=following)) is None


def test_damaged_bytes_are_left_to_the_reader() -> None:
    data = tiff((THUMBNAIL_PAGE, REDUCED), (WHOLE_PAGE, {}))
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
    begin = time.process_time()
    assert photo_page(data) is None
    assert time.process_time() - begin < 1.0


def test_one_page_is_as_before() -> None:
    assert photo_page(encode(WHOLE_PAGE, "TIFF")) is None
    assert photo_page(encode(WHOLE_PAGE)) is None


DNG_VERSION, RAW_SUBFILE = 0xC612, 0xFE


PICTURE = scene(320, 240)


JPEG = encode(PICTURE, quality=95)


def raw_tiff(**more: Any) -> bytes:
    return encode(scene(64, 48), "TIFF", **more)


def dng(*behind: bytes, exif: Image.Exif | None = None) -> bytes:
    """The tags of a DNG with a thumbnail, and what lies behind them."""
    tags = exif or Image.Exif()
    tags[DNG_VERSION] = b"\1\4\0\0"
    tags[RAW_SUBFILE] = 1
    return raw_tiff(exif=tags.tobytes()) + b"".join(behind)


@pytest.mark.parametrize(
    "data",
    [
        dng(), raw_tiff(tiffinfo={RAW_SUBFILE: 1}),
        b"II*\0\x10\0\0\0CR\2\0", b"\0\0\0\x18ftypcrx \0\0\0\1", b"IIRO\x08\0",
        b"IIU\0\x18\0", b"FUJIFILMCCD-RAW 0201",
    ],
)  # fmt: skip
def test_raw_files_are_known(data: bytes) -> None:
    assert is_raw(data)


@pytest.mark.parametrize(
    "data", [b"", b"II*\0", raw_tiff(), raw_tiff(exif=munich().tobytes()), JPEG, encode(PICTURE, "PNG")]
)
def test_finished_pictures_are_none(data: bytes) -> None:
    assert not is_raw(data)


def test_the_largest_preview_is_read() -> None:
    small = encode(scene(160, 120))
    photo = read_photo(dng(small, JPEG, small))
    assert (photo.format, photo.width, photo.height) == ("RAW", 320, 240)
    assert np.abs(photo.pixels.astype(int) - PICTURE).max() < 12


def dng_with_pieces(pixels: NDArray[np.uint8], size: tuple[int, int], orientation: int = 1) -> bytes:
    """A DNG whose preview is stored as JPEGs of so many columns and rows: strips, or tiles where they are narrower."""
    height, width = pixels.shape[:2]
    columns, rows = size
    corners = [(top, left) for top in range(0, height, rows) for left in range(0, width, columns)]
    pieces = [encode(pixels[top : top + rows, left : left + columns], quality=95) for top, left in corners]
    starts = [4096 + sum(map(len, pieces[:i])) for i in range(len(pieces))]
    layout = {0x116: (4, [rows]), 0x111: (4, starts), 0x117: (4, list(map(len, pieces)))}
    if columns < width:
        layout = {0x142: (4, [columns]), 0x143: (4, [rows]), 0x144: (4, starts), 0x145: (4, list(map(len, pieces)))}
    tags = {
        **{0xFE: (4, [1]), 0x100: (4, [width]), 0x101: (4, [height]), 0x102: (3, [8, 8, 8]), 0x103: (3, [7])},
        **{0x106: (3, [6]), 0x112: (3, [orientation]), 0x115: (3, [3]), 0x212: (3, [2, 2])},
        **{DNG_VERSION: (1, [1, 4, 0, 0])},
        **layout,
    }
    head, values = struct.pack("<2sHIH", b"II", 42, 8, len(tags)), b""
    for tag, (kind, numbers) in sorted(tags.items()):
        packed = struct.pack(f"<{len(numbers)}{ {1: 'B', 3: 'H', 4: 'I'}[kind] }", *numbers)
        inside = packed.ljust(4, b"\0") if len(packed) <= 4 else struct.pack("<I", 1024 + len(values))
        head += struct.pack("<HHI", tag, kind, len(numbers)) + inside
        values += packed if len(packed) > 4 else b""
    return ((head + bytes(4)).ljust(1024, b"\0") + values).ljust(4096, b"\0") + b"".join(pieces)


@pytest.mark.parametrize("size", [(320, 64), (160, 128), (160, 64)])
@pytest.mark.parametrize("orientation", [1, 3, 6])
def test_a_preview_in_pieces_is_read_whole(size: tuple[int, int], orientation: int) -> None:
    """Each piece is a JPEG of its own, and the largest of them is not the photo."""
    pixels = scene(320, 256)
    photo = read_photo(dng_with_pieces(pixels, size, orientation))
    expected = make_upright(pixels, orientation)
    assert (photo.format, photo.width, photo.height) == ("RAW", expected.shape[1], expected.shape[0])
    assert np.abs(photo.pixels.astype(int) - expected).mean() < 3


def test_a_larger_preview_in_one_piece_is_preferred() -> None:
    photo = read_photo(dng_with_pieces(scene(160, 128), (160, 64)) + JPEG)
    assert (photo.width, photo.height) == (320, 240)


@pytest.mark.parametrize("beginning", [b"FOVb", b"IIU\0"])
def test_the_preview_of_a_file_with_a_maker_s_own_beginning_is_read(beginning: bytes) -> None:
    photo = read_photo(beginning + bytes(100) + JPEG)
    assert (photo.format, photo.width, photo.height) == ("RAW", 320, 240)


def test_the_raw_file_says_what_the_preview_does_not() -> None:
    exif = munich()
    exif[ExifTags.Base.Orientation] = 6
    photo = read_photo(dng(JPEG, exif=exif))
    assert (photo.width, photo.height) == (240, 320)
    assert photo.metadata.latitude == pytest.approx(48.1375)


def test_a_lossless_jpeg_is_the_sensor_s_and_no_preview() -> None:
    lossless = JPEG.replace(b"\xff\xc0", b"\xff\xc3")
    with pytest.raises(PhotoError, match="has no readable preview; convert it to JPEG or TIFF"):
        embedded_preview(dng(lossless))


@pytest.mark.parametrize("data", [dng(), dng(b"\xff\xd8\xff" * 1000), b"FUJIFILMCCD-RAW 0201"])
def test_without_a_preview_it_says_how_to_convert(data: bytes) -> None:
    with pytest.raises(PhotoError, match="darktable-cli"):
        read_photo(data)


def exif_block(tags: int, numbers: int, pointer: int = ExifTags.IFD.Exif) -> bytes:
    """An EXIF block: a time in the picture's own directory, and in another one tags that share some rationals."""
    values = 8 + 2 + 12 * 2 + 4 + 2 + 12 * (tags + 1) + 4
    own = [(ExifTags.Base.Orientation, 3, 1, 6), (pointer, 4, 1, 8 + 2 + 12 * 2 + 4)]
    time = (ExifTags.Base.DateTimeOriginal, 2, 20, values)
    rationals = [(40_000 + i % 20_000, 5, numbers, values + 20) for i in range(tags)]
    directories = [struct.pack("<H", len(part)) + b"".join(struct.pack("<HHII", *tag) for tag in part) + bytes(4)
                   for part in (own, [time, *rationals])]  # fmt: skip
    return b"II*\0\x08\0\0\0" + b"".join(directories) + b"2024:06:01 09:10:00\0" + b"\1\0\0\0" * 2 * numbers


COSTLY = [exif_block(MAX_TAGS, 1), exif_block(1, MAX_EXIF_NUMBER_BYTES // 8 + 1), exif_block(900, 5000)]


@pytest.mark.parametrize("file_format", ["WEBP", "PNG", "AVIF", "JPEG"])
@pytest.mark.parametrize("block", COSTLY[:1])
def test_a_costly_exif_block_counts_as_absent(file_format: str, block: bytes) -> None:
    photo = read_photo(encode(scene(64, 48), file_format, exif=b"Exif\0\0" + block))
    assert photo.metadata.local_time is None
    modest = b"Exif\0\0" + exif_block(MAX_TAGS - 1, 1)
    assert read_photo(encode(scene(64, 48), file_format, exif=modest)).metadata.local_time is not None


@pytest.mark.parametrize("pointer", [ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo])
def test_what_is_costly(pointer: int) -> None:
    for tags, numbers in ((MAX_TAGS - 1, 8), (1, MAX_EXIF_NUMBER_BYTES // 8), (0, 0)):
        assert is_moderate(exif_block(tags, numbers, pointer))
    for block in COSTLY:
        for start in (b"II*\0", b"II\0*"):  # Pillow reads both
            changed = start + block[4:]
            assert not is_moderate(changed.replace(struct.pack("<H", ExifTags.IFD.Exif), struct.pack("<H", pointer), 1))
    for data in (b"", b"II*\0", COSTLY[0][:200], b"II*\0" + bytes(100), b"MM\0+" + b"\xff" * 60):
        assert is_moderate(data)


def test_a_number_of_values_that_cannot_be_costs_nothing() -> None:
    """As damage makes it: the other tags still count."""
    damaged = bytearray(exif_block(3, 1))
    at = damaged.index(struct.pack("<HHI", 40_001, 5, 1))
    damaged[at + 4 : at + 8] = b"\xff" * 4
    photo = read_photo(encode(scene(64, 48), "WEBP", exif=b"Exif\0\0" + bytes(damaged)))
    assert photo.metadata.local_time is not None


def test_a_tiff_with_costly_exif_is_read_without_it() -> None:
    for block, known in ((exif_block(1, 8), True), (COSTLY[1], False), (COSTLY[2], False)):
        data = encode(scene(64, 48), "TIFF")
        start = len(data) + len(data) % 2
        first = struct.unpack_from("<I", data, 4)[0]
        (count,) = struct.unpack_from("<H", data, first)
        own = data[first + 2 : first + 2 + 12 * count] + struct.pack(
            "<HHII", ExifTags.IFD.Exif, 4, 1, start + 34 + 100_000
        )
        directory = struct.pack("<H", count + 1) + own + bytes(4)
        moved = bytearray(block[38:])
        for tag in range(struct.unpack_from("<H", moved)[0]):  # their values move with the block
            (offset,) = struct.unpack_from("<I", moved, 2 + 12 * tag + 8)
            struct.pack_into("<I", moved, 2 + 12 * tag + 8, offset - 38 + start + 34 + 100_000)
        whole = data[:4] + struct.pack("<I", start) + data[8:].ljust(start - 8, b"\0") + directory
        photo = read_photo(whole.ljust(start + 34 + 100_000, b"\0") + bytes(moved))
        assert np.array_equal(photo.pixels, scene(64, 48))
        assert (photo.metadata.local_time is not None) == known


def test_a_tiff_of_very_many_tags_is_refused() -> None:
    tags = b"".join(struct.pack("<HHII", 30_000 + i, 4, 1, 0) for i in range(MAX_TAGS + 1))
    with pytest.raises(PhotoError, match=r"more tags, or more numbers in them, than any camera or editor writes\.$"):
        read_photo(b"II*\0\x08\0\0\0" + struct.pack("<H", MAX_TAGS + 1) + tags + bytes(4))

"""Tests of containers."""

import struct
import time
from collections.abc import Mapping
from io import BytesIO
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo.containers import (
    _MAX_CHUNKS,
    _MAX_EXIF_NUMBER_BYTES,
    _MAX_EXIF_SEGMENTS,
    _MAX_PAGES,
    _MAX_SCANS,
    _MAX_SEGMENTS,
    _MAX_TAGS,
    check_structure,
    dct_coefficients_per_pixel,
    embedded_preview,
    is_moderate,
    is_raw,
    photo_page,
    webp_size,
)
from lighting.photo.pixels import make_upright
from lighting.photo.reader import read_photo
from lighting.photo.sandbox import read_photo_isolated
from tests.conftest import encode, munich, scene
from tests.helpers.photos import (
    PHOTOMETRIC_TAG,
    SUBDIRECTORY_TAG,
    SUBFILE_TAG,
    THUMBNAIL_PAGE,
    WHOLE_PAGE,
    chunk,
    directory,
    tiff,
    tiff_with_exif_behind_thumbnail,
)

SCENE = scene(160, 120)
SOS = b"\xff\xda"


def scans(data: bytes) -> list[bytes]:
    """The scans of a progressive JPEG, each from its first marker (perhaps of its Huffman table) to the next scan's."""
    starts = [i for i in range(len(data) - 1) if data[i : i + 2] == SOS]
    return [data[a:b] for a, b in zip(starts, [*starts[1:], len(data) - 2], strict=True)]


def repeated(times: int) -> bytes:
    """A progressive JPEG whose last scan comes `times` in all."""
    data = encode(SCENE, progressive=True)
    return data[:-2] + scans(data)[-1] * (times - 1) + data[-2:]


def test_real_files_pass() -> None:
    for options in ({}, {"progressive": True}, {"progressive": True, "optimize": True}, {"restart_marker_blocks": 1}):
        check_structure(encode(SCENE, **options))
    cmyk = encode(Image.fromarray(SCENE).convert("CMYK"), progressive=True)
    assert len(scans(cmyk)) == 18
    check_structure(cmyk)


def test_one_scan_many_times_is_refused_in_a_sentence() -> None:
    most = _MAX_SCANS - len(scans(repeated(1))) + 1
    assert read_photo(repeated(most)).width == 160
    with pytest.raises(PhotoError, match=rf"^The JPEG has more than {_MAX_SCANS} scans, .*\.$"):
        read_photo(repeated(most + 1))
    with pytest.raises(PhotoError, match="scans"):
        read_photo(repeated(5000))


def sequential(times: int, components: int = 3) -> bytes:
    """A sequential JPEG whose only scan comes `times` in all, the first time with so many components."""
    data = encode(SCENE)
    first = data.index(SOS)
    begin = data[:first] + SOS + data[first + 2 : first + 4] + bytes([components]) + data[first + 5 : -2]
    return begin + data[first:-2] * (times - 1) + data[-2:]


def test_further_scans_behind_a_sequential_picture_are_left_to_the_decoder_which_refuses_them() -> None:
    check_structure(sequential(5000))
    with pytest.raises(PhotoError, match="broken data stream"):
        read_photo(sequential(5000))


def test_a_whole_scan_behind_one_that_lacks_a_component_hides_none() -> None:
    with pytest.raises(PhotoError, match="scans"):
        check_structure(sequential(100, components=1))


def test_what_hides_scans_from_a_reader_does_not_hide_them() -> None:
    """Fill bytes, bytes between segments and restart markers, which libjpeg passes over."""
    bad = repeated(100)
    first = bad.index(SOS)
    for between in (b"\xff\xff\xff", b"\xff\xd3", b"\xff\x01", b"\0\0\0", bytes(700)):
        with pytest.raises(PhotoError, match="scans"):
            check_structure(bad[:first] + between + bad[first:])


def test_pictures_inside_and_behind_do_not_count() -> None:
    thumbnail = repeated(30)
    exif = b"\xff\xe1" + (2 + len(thumbnail)).to_bytes(2) + thumbnail
    plain = encode(SCENE)
    data = plain[:2] + exif * 5 + plain[2:]
    check_structure(data)
    assert read_photo(data).width == 160
    check_structure(plain + SOS * 1000)  # a phone's video behind its photo holds any bytes
    pictures = [Image.fromarray(SCENE)] * 12
    stream = BytesIO()
    pictures[0].save(stream, "MPO", save_all=True, append_images=pictures[1:], progressive=True)
    assert stream.getvalue().count(SOS) > _MAX_SCANS
    assert read_photo(stream.getvalue()).format == "MPO"


def test_too_many_segments_are_refused() -> None:
    plain = encode(SCENE)
    with pytest.raises(PhotoError, match=rf"more than {_MAX_SEGMENTS} segments"):
        read_photo(plain[:2] + b"\xff\xfe\x00\x02" * _MAX_SEGMENTS + plain[2:])


@pytest.mark.parametrize("data", [b"", b"\xff", b"\xff\xd8", b"\xff\xd8\xff", b"\xff\xd8\xff\xe1\xff", b"\x89PNG"])
def test_what_is_no_whole_jpeg_passes(data: bytes) -> None:
    check_structure(data)


@pytest.mark.parametrize(
    ("mode", "options", "expected"),
    [
        ("RGB", {}, 0),
        ("RGB", {"progressive": True}, 1.5),
        ("RGB", {"progressive": True, "subsampling": "4:2:2"}, 2),
        ("RGB", {"progressive": True, "subsampling": "4:4:4"}, 3),
        ("CMYK", {"progressive": True}, 4),
        ("CMYK", {}, 0),
        ("L", {"progressive": True}, 1),
    ],
)
def test_held_coefficients_are_those_of_the_components(mode: str, options: dict[str, Any], expected: float) -> None:
    data = encode(Image.fromarray(SCENE).convert(mode), **options)
    assert dct_coefficients_per_pixel(data) == expected


def test_a_sequential_picture_in_several_scans_is_held_whole() -> None:
    data = bytearray(encode(SCENE))
    data[data.index(SOS) + 4] = 1
    assert dct_coefficients_per_pixel(bytes(data)) == 1.5


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
@pytest.mark.parametrize("values", [1, _MAX_PAGES, 0xFFFFFFFF])
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
    check_structure(data)


def test_chunks_are_counted_to_the_last() -> None:
    count = flooded(0).count(b"IDAT") + 2  # IHDR, IEND
    check_structure(flooded(_MAX_CHUNKS - count))
    with pytest.raises(PhotoError):
        check_structure(flooded(_MAX_CHUNKS - count + 1))


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


SIDE = 11300
LARGE = b"RIFF\x1a\0\0\0WEBPVP8L\x0e\0\0\0\x2f" + struct.pack("<I", SIDE - 1 | SIDE - 1 << 14) + bytes(9)


@pytest.mark.parametrize("options", [{}, {"lossless": True}, {"exif": b"Exif\0\0MM\0*\0\0\0\x08\0\0"}])
@pytest.mark.parametrize("mode", ["RGB", "RGBA"])
def test_the_size_is_found(mode: str, options: dict[str, Any]) -> None:
    assert webp_size(encode(Image.new(mode, (321, 47)), "WEBP", **options)) == (321, 47)


def test_other_bytes_have_none() -> None:
    webp = encode(Image.new("RGB", (40, 40)), "WEBP")
    for data in (b"", b"RIFF", encode(Image.new("RGB", (40, 40)), "PNG"), webp[:29], webp[:12] + b"VP9 " + webp[16:]):
        assert webp_size(data) is None


@pytest.mark.parametrize("read", [read_photo, read_photo_isolated])
def test_a_large_one_is_refused_as_too_large(read: Any) -> None:
    """In a process of its own, too, where the decoder has no memory to open it."""
    with pytest.raises(PhotoTooLargeError, match=r"The WebP of 11300 x 11300 pixels has more than its limit"):
        read(LARGE)


# EXIF and directories that are costly to read.


def exif_block(tags: int, numbers: int, pointer: int = ExifTags.IFD.Exif) -> bytes:
    """An EXIF block: a time in the picture's own directory, and in another one tags that share some rationals."""
    values = 8 + 2 + 12 * 2 + 4 + 2 + 12 * (tags + 1) + 4
    own = [(ExifTags.Base.Orientation, 3, 1, 6), (pointer, 4, 1, 8 + 2 + 12 * 2 + 4)]
    time = (ExifTags.Base.DateTimeOriginal, 2, 20, values)
    rationals = [(40_000 + i % 20_000, 5, numbers, values + 20) for i in range(tags)]
    directories = [struct.pack("<H", len(part)) + b"".join(struct.pack("<HHII", *tag) for tag in part) + bytes(4)
                   for part in (own, [time, *rationals])]  # fmt: skip
    return b"II*\0\x08\0\0\0" + b"".join(directories) + b"2024:06:01 09:10:00\0" + b"\1\0\0\0" * 2 * numbers


COSTLY = [exif_block(_MAX_TAGS, 1), exif_block(1, _MAX_EXIF_NUMBER_BYTES // 8 + 1), exif_block(900, 5000)]


@pytest.mark.parametrize("file_format", ["WEBP", "PNG", "AVIF", "JPEG"])
@pytest.mark.parametrize("block", COSTLY[:1])
def test_a_costly_exif_block_counts_as_absent(file_format: str, block: bytes) -> None:
    photo = read_photo(encode(scene(64, 48), file_format, exif=b"Exif\0\0" + block))
    assert photo.metadata.local_time is None
    modest = b"Exif\0\0" + exif_block(_MAX_TAGS - 1, 1)
    assert read_photo(encode(scene(64, 48), file_format, exif=modest)).metadata.local_time is not None


@pytest.mark.parametrize("pointer", [ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo])
def test_what_is_costly(pointer: int) -> None:
    for tags, numbers in ((_MAX_TAGS - 1, 8), (1, _MAX_EXIF_NUMBER_BYTES // 8), (0, 0)):
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
    tags = b"".join(struct.pack("<HHII", 30_000 + i, 4, 1, 0) for i in range(_MAX_TAGS + 1))
    with pytest.raises(PhotoError, match=r"more tags, or more numbers in them, than any camera or editor writes\.$"):
        read_photo(b"II*\0\x08\0\0\0" + struct.pack("<H", _MAX_TAGS + 1) + tags + bytes(4))


def test_many_exif_segments_are_refused() -> None:
    data, segment = encode(scene(64, 48)), b"\xff\xe1\0\x10Exif\0\0" + bytes(8)
    assert read_photo(data[:2] + _MAX_EXIF_SEGMENTS * segment + data[2:]).width == 64
    with pytest.raises(PhotoError, match=r"more than 16 EXIF segments, which no camera writes\.$"):
        read_photo(data[:2] + (_MAX_EXIF_SEGMENTS + 1) * segment + data[2:])

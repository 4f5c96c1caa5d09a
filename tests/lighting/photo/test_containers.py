"""JPEG, PNG and WebP whose structure costs a decoder much."""

import struct
import time
from io import BytesIO
from typing import Any

import pytest
from PIL import Image

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo.containers import check_structure, dct_coefficients_per_pixel, webp_size
from lighting.photo.reader import read_photo
from lighting.photo.sandbox import read_photo_isolated
from tests.conftest import encode, scene
from tests.helpers.photos import chunk

MAX_CHUNKS = 20_000  # of a PNG
MAX_EXIF_SEGMENTS = 16
MAX_SCANS = 40
MAX_SEGMENTS = 4096

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
    most = MAX_SCANS - len(scans(repeated(1))) + 1
    assert read_photo(repeated(most)).width == 160
    with pytest.raises(PhotoError, match=rf"^The JPEG has more than {MAX_SCANS} scans, .*\.$"):
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
    assert stream.getvalue().count(SOS) > MAX_SCANS
    assert read_photo(stream.getvalue()).format == "MPO"


def test_too_many_segments_are_refused() -> None:
    plain = encode(SCENE)
    with pytest.raises(PhotoError, match=rf"more than {MAX_SEGMENTS} segments"):
        read_photo(plain[:2] + b"\xff\xfe\x00\x02" * MAX_SEGMENTS + plain[2:])


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
    check_structure(flooded(MAX_CHUNKS - count))
    with pytest.raises(PhotoError):
        check_structure(flooded(MAX_CHUNKS - count + 1))


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


def test_many_exif_segments_are_refused() -> None:
    data, segment = encode(scene(64, 48)), b"\xff\xe1\0\x10Exif\0\0" + bytes(8)
    assert read_photo(data[:2] + MAX_EXIF_SEGMENTS * segment + data[2:]).width == 64
    with pytest.raises(PhotoError, match=r"more than 16 EXIF segments, which no camera writes\.$"):
        read_photo(data[:2] + (MAX_EXIF_SEGMENTS + 1) * segment + data[2:])

"""Scans counted before decoding."""

from io import BytesIO
from typing import Any

import pytest
from PIL import Image

from lighting.errors import PhotoError
from lighting.photo import read_photo
from lighting.photo.jpeg import MOST_SCANS, MOST_SEGMENTS, check_scans, coefficients
from tests.conftest import encode, scene

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
        check_scans(encode(SCENE, **options))
    cmyk = encode(Image.fromarray(SCENE).convert("CMYK"), progressive=True)
    assert len(scans(cmyk)) == 18
    check_scans(cmyk)


def test_one_scan_many_times_is_refused_in_a_sentence() -> None:
    most = MOST_SCANS - len(scans(repeated(1))) + 1
    assert read_photo(repeated(most)).width == 160
    with pytest.raises(PhotoError, match=rf"^The JPEG has more than {MOST_SCANS} scans, .*\.$"):
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
    check_scans(sequential(5000))
    with pytest.raises(PhotoError, match="broken data stream"):
        read_photo(sequential(5000))


def test_a_whole_scan_behind_one_that_lacks_a_component_hides_none() -> None:
    with pytest.raises(PhotoError, match="scans"):
        check_scans(sequential(100, components=1))


def test_what_hides_scans_from_a_reader_does_not_hide_them() -> None:
    """Fill bytes, bytes between segments and restart markers, which libjpeg passes over."""
    bad = repeated(100)
    first = bad.index(SOS)
    for between in (b"\xff\xff\xff", b"\xff\xd3", b"\xff\x01", b"\0\0\0", bytes(700)):
        with pytest.raises(PhotoError, match="scans"):
            check_scans(bad[:first] + between + bad[first:])


def test_pictures_inside_and_behind_do_not_count() -> None:
    thumbnail = repeated(30)
    exif = b"\xff\xe1" + (2 + len(thumbnail)).to_bytes(2) + thumbnail
    plain = encode(SCENE)
    data = plain[:2] + exif * 5 + plain[2:]
    check_scans(data)
    assert read_photo(data).width == 160
    check_scans(plain + SOS * 1000)  # a phone's video behind its photo holds any bytes
    pictures = [Image.fromarray(SCENE)] * 12
    stream = BytesIO()
    pictures[0].save(stream, "MPO", save_all=True, append_images=pictures[1:], progressive=True)
    assert stream.getvalue().count(SOS) > MOST_SCANS
    assert read_photo(stream.getvalue()).format == "MPO"


def test_too_many_segments_are_refused() -> None:
    plain = encode(SCENE)
    with pytest.raises(PhotoError, match=rf"more than {MOST_SEGMENTS} segments"):
        read_photo(plain[:2] + b"\xff\xfe\x00\x02" * MOST_SEGMENTS + plain[2:])


@pytest.mark.parametrize("data", [b"", b"\xff", b"\xff\xd8", b"\xff\xd8\xff", b"\xff\xd8\xff\xe1\xff", b"\x89PNG"])
def test_what_is_no_whole_jpeg_passes(data: bytes) -> None:
    check_scans(data)


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
    assert coefficients(data) == expected


def test_a_sequential_picture_in_several_scans_is_held_whole() -> None:
    data = bytearray(encode(SCENE))
    data[data.index(SOS) + 4] = 1
    assert coefficients(bytes(data)) == 1.5

"""The table of what decoders need, against the peak memory of a process that decodes."""

import sys
from io import BytesIO
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.decoding import KINDS, cost
from lighting.errors import PhotoTooLargeError
from lighting.photo import MAX_PIXELS, read_photo
from lighting.photo.memory import BYTES, COEFFICIENT, FIXED, NAMES, PER_PIXEL, admitted, allowance
from lighting.photo.pixels import MOST_KEPT
from lighting.photo.read import _heif_format
from tests.conftest import encode, scene

SIZE = (2000, 1500)
MEASURED = {  # kind: bytes per pixel in the table
    "JPEG, baseline 4:2:0": PER_PIXEL["JPEG"],
    "JPEG, progressive 4:4:4": 3 * COEFFICIENT,
    "JPEG, progressive CMYK": 4 * COEFFICIENT,
    "PNG, RGB": PER_PIXEL["PNG"],
    "WebP, lossless": PER_PIXEL["WEBP"],
    "HEIC": PER_PIXEL["HEIF"],
    "TIFF, one strip, RGBA": PER_PIXEL["TIFF"],
    "AVIF, 4:4:4 with alpha": PER_PIXEL["AVIF"],
}
CONVERSION = 10  # bytes per pixel; pictures of fewer pixels than a strip are converted at once


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("kind", MEASURED)
def test_a_decoder_needs_no_more_than_the_table_says(kind: str, tmp_path: Path) -> None:
    _heif_format()
    large, small = tmp_path / "large", tmp_path / "small"
    large.write_bytes(KINDS[kind](*SIZE))
    small.write_bytes(KINDS[kind](96, 64))
    pixels = SIZE[0] * SIZE[1]
    conversion = CONVERSION * pixels if kind.startswith("PNG") else 4_000_000
    assert cost(large, small)[0] <= MEASURED[kind] * pixels + min(conversion, FIXED)


def limit(data: bytes) -> tuple[int, str]:
    return admitted(Image.open(BytesIO(data)), data, MAX_PIXELS)


def test_each_kind_stays_within_the_memory_that_is_stated() -> None:
    _heif_format()
    picture = Image.fromarray(scene(96, 64))
    assert limit(encode(picture)) == (MAX_PIXELS, "JPEG")
    assert limit(encode(picture, "PNG")) == (MAX_PIXELS, "PNG")
    assert limit(encode(picture, progressive=True)) == (MAX_PIXELS, "progressive JPEG")
    most, name = limit(encode(picture, progressive=True, subsampling="4:4:4"))
    assert (most, name) == (int(MAX_PIXELS * BYTES / (3 * COEFFICIENT)), "progressive JPEG")
    for file_format in ("WEBP", "HEIF", "TIFF", "AVIF"):
        most, _ = limit(encode(picture, file_format))
        assert most * PER_PIXEL[file_format] == pytest.approx(BYTES * MAX_PIXELS, rel=1e-6)


def test_every_kind_that_the_benchmark_prints_is_in_the_table() -> None:
    kinds = {kind.partition(",")[0].upper() for kind in KINDS}
    assert kinds - {"MPO"} == {name.upper() for name in NAMES.values()}
    assert set(NAMES) == set(PER_PIXEL)


def test_reading_apart_may_take_what_is_stated() -> None:
    stated = BYTES * MAX_PIXELS + FIXED
    assert allowance(0, MAX_PIXELS, 448) - stated < 5_000_000
    assert allowance(1000, MAX_PIXELS, None) == allowance(1000, MAX_PIXELS, 3840) == stated + 2000 + 6 * MOST_KEPT


def test_a_phone_s_108_megapixels_are_admitted() -> None:
    picture = Image.new("RGB", (12000, 9000), (90, 120, 200))
    photo = read_photo(encode(picture, quality=50))
    assert (photo.width, photo.height) == (12000, 9000)


def test_a_small_file_of_many_pixels_is_refused_before_it_is_decoded() -> None:
    """The lossless WebP of 5 kB that took 2.27 GB; here its header alone."""
    data = bytearray(encode(scene(96, 64), "WEBP", lossless=True))
    at = data.index(b"VP8L") + 9
    bits = int.from_bytes(data[at : at + 4], "little") & ~0xFFFFFFF
    data[at : at + 4] = (bits | (11299 << 14) | 11299).to_bytes(4, "little")
    with pytest.raises(PhotoTooLargeError, match=r"^The WebP of 11300 x 11300 pixels has more than its limit of 28\."):
        read_photo(bytes(data))

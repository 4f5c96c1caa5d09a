"""Tests of deflate."""

import io
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.files.deflate import deflate, encode_png, limit_packing_threads, pack_in_threads


def noise(*shape: int, dtype: type[np.unsignedinteger] = np.uint8) -> NDArray[np.unsignedinteger]:
    return np.random.default_rng(4).integers(0, np.iinfo(dtype).max, shape, dtype=dtype, endpoint=True)


@pytest.mark.parametrize("shape", [(24, 32), (24, 32, 1), (24, 32, 3), (24, 32, 4), (1, 1, 3), (1200, 1600, 3)])
def test_png_keeps_every_value(shape: tuple[int, ...]) -> None:
    """The last one in several bands, whose checksums Pillow checks."""
    pixels = noise(*shape)
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.asarray(picture).reshape(shape), pixels)


def test_a_png_says_the_checksum_of_all_its_bands() -> None:
    data = encode_png(noise(3000, 1000, 3))
    start = data.index(b"IDAT") + 4
    size = int.from_bytes(data[start - 8 : start - 4], "big")
    assert len(zlib.decompress(data[start : start + size])) == 3000 * 3001


def test_pngs_of_16_bits_keep_every_value(tmp_path: Path) -> None:
    OpenImageIO = pytest.importorskip("OpenImageIO")
    pixels = noise(24, 32, 3, dtype=np.uint16)
    (tmp_path / "a.png").write_bytes(encode_png(pixels))
    read = OpenImageIO.ImageBuf(str(tmp_path / "a.png"))
    np.testing.assert_array_equal(read.get_pixels(OpenImageIO.UINT16), pixels)


def test_texts_are_read() -> None:
    with Image.open(io.BytesIO(encode_png(noise(2, 2), {"Software": "A 1.0"}))) as picture:
        assert picture.info == {"Software": "A 1.0"}


def test_rows_of_any_layout() -> None:
    pixels = noise(9, 8, 4)[::-1, :, :3]
    with Image.open(io.BytesIO(encode_png(pixels))) as picture:
        np.testing.assert_array_equal(np.asarray(picture), pixels)


def test_any_library_reads_it() -> None:
    assert zlib.decompress(deflate(np.arange(256, dtype=np.uint8))) == bytes(range(256))


def test_the_same_bytes_whatever_the_threads() -> None:
    pixels = noise(1200, 1600, 3)
    first = encode_png(pixels)
    limit_packing_threads(1)
    try:
        assert encode_png(pixels) == first
    finally:
        limit_packing_threads(4)


@pytest.mark.parametrize("count", [0, 1, 2, 100])
def test_parts_stay_in_order(count: int) -> None:
    assert list(pack_in_threads(lambda part: -part, range(count))) == [-part for part in range(count)]


def test_without_igzip_zlib_packs_the_same_pixels() -> None:
    code = (
        "import sys\nsys.modules['isal'] = None\nimport numpy as np\nfrom lighting.files import deflate\n"
        "assert deflate.packer.__name__ == 'zlib'\n"
        "sys.stdout.buffer.write(deflate.encode_png(np.arange(192, dtype=np.uint8).reshape(8, 8, 3)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, timeout=60, check=True)
    with Image.open(io.BytesIO(done.stdout)) as picture:
        np.testing.assert_array_equal(np.asarray(picture), np.arange(192, dtype=np.uint8).reshape(8, 8, 3))

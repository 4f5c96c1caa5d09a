"""RAW files: told from TIFF files, and read by their preview."""

from typing import Any

import numpy as np
import pytest
from PIL import ExifTags, Image

from lighting.errors import PhotoError
from lighting.photo import read_photo
from lighting.photo.raw import is_raw, preview
from tests.conftest import encode, munich, scene

DNG_VERSION, SUBFILE = 0xC612, 0xFE
PICTURE = scene(320, 240)
JPEG = encode(PICTURE, quality=95)


def tiff(**more: Any) -> bytes:
    return encode(scene(64, 48), "TIFF", **more)


def dng(*behind: bytes, exif: Image.Exif | None = None) -> bytes:
    """The tags of a DNG with a thumbnail, and what lies behind them."""
    tags = exif or Image.Exif()
    tags[DNG_VERSION] = b"\1\4\0\0"
    tags[SUBFILE] = 1
    return tiff(exif=tags.tobytes()) + b"".join(behind)


@pytest.mark.parametrize(
    "data",
    [
        dng(), tiff(tiffinfo={SUBFILE: 1}), b"II*\0\x10\0\0\0CR\2\0", b"\0\0\0\x18ftypcrx \0\0\0\1", b"IIRO\x08\0",
        b"IIU\0\x18\0", b"FUJIFILMCCD-RAW 0201",
    ],
)  # fmt: skip
def test_raw_files_are_known(data: bytes) -> None:
    assert is_raw(data)


@pytest.mark.parametrize("data", [b"", b"II*\0", tiff(), tiff(exif=munich().tobytes()), JPEG, encode(PICTURE, "PNG")])
def test_finished_pictures_are_none(data: bytes) -> None:
    assert not is_raw(data)


def test_the_largest_preview_is_read() -> None:
    small = encode(scene(160, 120))
    photo = read_photo(dng(small, JPEG, small))
    assert (photo.format, photo.width, photo.height) == ("RAW", 320, 240)
    assert np.abs(photo.pixels.astype(int) - PICTURE).max() < 12


@pytest.mark.parametrize("beginning", [b"FOVb", b"IIU\0"])
def test_the_preview_of_a_file_with_a_maker_s_own_beginning_is_read(beginning: bytes) -> None:
    photo = read_photo(beginning + bytes(100) + JPEG)
    assert (photo.format, photo.width, photo.height) == ("RAW", 320, 240)


def test_the_raw_file_says_what_the_preview_does_not() -> None:
    exif = munich()
    exif[ExifTags.Base.Orientation] = 6
    photo = read_photo(dng(JPEG, exif=exif))
    assert (photo.width, photo.height) == (240, 320)
    assert photo.facts.latitude == pytest.approx(48.1375)


def test_a_lossless_jpeg_is_the_sensor_s_and_no_preview() -> None:
    lossless = JPEG.replace(b"\xff\xc0", b"\xff\xc3")
    with pytest.raises(PhotoError, match="holds no preview that can be read; convert it to JPEG or TIFF"):
        preview(dng(lossless))


@pytest.mark.parametrize("data", [dng(), dng(b"\xff\xd8\xff" * 1000), b"FUJIFILMCCD-RAW 0201"])
def test_without_a_preview_it_says_how_to_convert(data: bytes) -> None:
    with pytest.raises(PhotoError, match="darktable-cli"):
        read_photo(data)

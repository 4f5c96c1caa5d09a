"""Linear values of 16-bit and 8-bit pictures, against the arrays that OpenCV and Pillow wrote into them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.colour import srgb_decode
from lighting.errors import PhotoError
from lighting.photo.linear import of_floats, read_linear
from tests.conftest import exif

RANDOM = np.random.default_rng(3)
NOISE = RANDOM.integers(0, 65536, (37, 53, 3)).astype(np.uint16)
SMOOTH = np.cumsum(RANDOM.integers(0, 300, (37, 53, 3)), axis=1).astype(np.uint16)


def write_16(path: Path, pixels: NDArray[np.uint16]) -> Path:
    cv2: Any = pytest.importorskip("cv2")
    assert cv2.imwrite(str(path), pixels[..., ::-1])
    return path


@pytest.mark.parametrize("name", ["a.png", "a.tif"])
@pytest.mark.parametrize("pixels", [NOISE, SMOOTH], ids=["noise", "smooth"])
def test_sixteen_bit_colours_keep_all_their_bits(tmp_path: Path, name: str, pixels: NDArray[np.uint16]) -> None:
    photo = read_linear(write_16(tmp_path / name, pixels))
    np.testing.assert_array_equal(np.rint(photo.pixels * 65535).astype(np.uint16), pixels)
    assert photo.step == pytest.approx(1 / 65535)
    assert photo.white == pytest.approx(0.98)
    assert not photo.warnings


def test_an_uncompressed_tiff_of_either_byte_order_keeps_them_too(tmp_path: Path) -> None:
    for order, mark in (("<", b"II*\0"), (">", b"MM\0*")):
        (tmp_path / "a.tif").write_bytes(plain_tiff(SMOOTH, order, mark))
        photo = read_linear(tmp_path / "a.tif")
        np.testing.assert_array_equal(np.rint(photo.pixels * 65535).astype(np.uint16), SMOOTH)


def plain_tiff(pixels: NDArray[np.uint16], order: str, mark: bytes) -> bytes:
    """A TIFF of one strip: header, directory, three bit depths, pixels."""
    height, width, _ = pixels.shape
    bits_at, data_at = 8 + 2 + 12 * 10 + 4, 8 + 2 + 12 * 10 + 4 + 6
    short, long = 3, 4
    entries = [
        *((256, long, 1, width), (257, long, 1, height), (258, short, 3, bits_at), (259, short, 1, 1)),
        *((262, short, 1, 2), (273, long, 1, data_at), (277, short, 1, 3), (278, long, 1, height)),
        *((279, long, 1, pixels.nbytes), (284, short, 1, 1)),
    ]
    directory = np.array([len(entries)], f"{order}u2").tobytes()
    for tag, kind, count, value in entries:
        inline = f"{order}u2" if kind == short and count == 1 else f"{order}u4"
        directory += np.array([tag, kind], f"{order}u2").tobytes() + np.array([count], f"{order}u4").tobytes()
        directory += np.array([value], inline).tobytes().ljust(4, b"\0")
    start = mark + np.array([8], f"{order}u4").tobytes()
    bits = np.full(3, 16, f"{order}u2").tobytes()
    return start + directory + bytes(4) + bits + pixels.astype(f"{order}u2").tobytes()


def test_sixteen_bit_grey_becomes_three_channels(tmp_path: Path) -> None:
    Image.fromarray(NOISE[..., 0]).save(tmp_path / "a.png")
    photo = read_linear(tmp_path / "a.png")
    np.testing.assert_array_equal(np.rint(photo.pixels[..., 2] * 65535), NOISE[..., 0])


def test_eight_bits_are_srgb_with_a_warning_unless_told(tmp_path: Path) -> None:
    pixels = (NOISE >> 8).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "a.png", gamma=1 / 2.2)
    assumed, told = read_linear(tmp_path / "a.png"), read_linear(tmp_path / "a.png", "linear")
    assert assumed.pixels == pytest.approx(srgb_decode(pixels / 255.0), abs=1e-6)
    assert told.pixels == pytest.approx(pixels / 255.0, abs=1e-6)
    assert "sRGB" in assumed.warnings[0]
    assert not told.warnings
    assert assumed.white < told.white


def test_a_jpeg_comes_with_a_warning_and_its_exposure(tmp_path: Path) -> None:
    base = ExifTags.Base
    tags: dict[int, Any] = {base.ExposureTime: 1 / 500, base.ISOSpeedRatings: 200, base.FNumber: 4.0}
    Image.fromarray(np.full((40, 40, 3), 128, np.uint8)).save(tmp_path / "a.jpg", exif=exif(tags))
    photo = read_linear(tmp_path / "a.jpg")
    assert photo.exposure == pytest.approx(1 / 500 * 2 / 16)
    assert "JPEG" in photo.warnings[0]


def test_floats_are_clipped_where_many_share_the_largest_value() -> None:
    ramp = np.linspace(0, 7, 300, dtype=np.float32).reshape(10, 10, 3)
    assert of_floats(ramp).white == float("inf")
    assert of_floats(np.minimum(ramp, 5)).white == pytest.approx(4.9)
    with pytest.raises(PhotoError, match="finite"):
        of_floats(np.full((2, 2, 3), np.nan, np.float32))


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"nothing")
    with pytest.raises(PhotoError, match="cannot be read"):
        read_linear(tmp_path / "a.png")
    with pytest.raises(OSError, match="No such file"):
        read_linear(tmp_path / "none.png")


def test_raw_photos_ask_for_their_library_or_say_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "a.dng").write_bytes(b"nothing")
    with pytest.raises(PhotoError, match=r"rawpy|RAW"):
        read_linear(tmp_path / "a.dng")

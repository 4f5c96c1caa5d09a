"""Photos as linear values: 16 bits exactly, coded ones said to be, gamma tags not passed over."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lighting.colour import srgb_decode
from lighting.errors import PhotoError
from lighting.files import write_exr
from lighting.photo import read_linear
from lighting.stereo.normals.files import write_picture, write_png16
from lighting.stereo.normals.images import read_shot
from tests.lighting.photo.test_linear import plain_dng
from tests.lighting.photo.test_profile import WIDE, profile
from tests.pictures import chunk


def test_16_bit_png_and_exr_come_back_as_they_are(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 60000, (20, 30, 3)).astype(np.float64)
    write_png16(tmp_path / "a.png", values)
    write_picture(tmp_path / "a.exr", (values / 65535).astype(np.float32))
    for name in ("a.png", "a.exr"):
        shot = read_shot(tmp_path / name)
        np.testing.assert_allclose(shot.pixels, values / 65535, rtol=1e-6)
        assert not shot.coded
        assert not shot.clipped.any()


def test_16_bit_tiff_of_one_channel(tmp_path: Path) -> None:
    values = np.arange(600, dtype=np.uint16).reshape(20, 30) * 100
    Image.fromarray(values).save(tmp_path / "a.tif")
    np.testing.assert_allclose(read_shot(tmp_path / "a.tif").pixels[..., 0], values / 65535, rtol=1e-6)


def test_a_jpeg_is_decoded_from_srgb_turned_upright_and_its_white_is_clipped(tmp_path: Path) -> None:
    pixels = np.full((32, 64, 3), 188, dtype=np.uint8)
    pixels[:, :32] = 255
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned clockwise
    Image.fromarray(pixels).save(tmp_path / "a.jpg", quality=95, exif=exif)
    shot = read_shot(tmp_path / "a.jpg")
    assert shot.coded
    assert shot.pixels.shape == (64, 32, 3)
    assert abs(float(shot.pixels[50, 16, 1]) - 0.5029) < 0.02  # sRGB's 188 is half of white, IEC 61966-2-1
    assert shot.clipped[:24].all()
    assert not shot.clipped[40:].any()


def test_16_bits_that_say_they_are_coded_are_refused_unless_told(tmp_path: Path) -> None:
    write_png16(tmp_path / "a.png", np.full((8, 8, 3), 30000.0))
    data = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(data[:33] + chunk(b"sRGB", b"\0") + data[33:])
    with pytest.raises(PhotoError, match="gamma-coded"):
        read_shot(tmp_path / "a.png")
    assert abs(float(read_shot(tmp_path / "a.png", "linear").pixels[0, 0, 0]) - 30000 / 65535) < 1e-6
    assert read_shot(tmp_path / "a.png", "srgb").pixels[0, 0, 0] < 0.2


def test_a_photo_has_the_values_that_a_sky_probe_has(tmp_path: Path) -> None:
    """Wide primaries and what counts as clipped were passed over, for photos of a day had a reader of their own."""
    colours = np.full((8, 8, 3), (60, 90, 140), dtype=np.uint8)
    colours[0] = 252
    Image.fromarray(colours).save(tmp_path / "a.png", icc_profile=profile("Wide", WIDE))
    shot, photo = read_shot(tmp_path / "a.png"), read_linear(tmp_path / "a.png")
    assert np.array_equal(shot.pixels, photo.pixels)
    assert np.abs(shot.pixels[4, 4] - srgb_decode(colours[4, 4] / 255.0)).max() > 0.02
    assert shot.clipped[0].all()
    assert not shot.clipped[1:].any()


def test_grey_stays_one_channel(tmp_path: Path) -> None:
    Image.fromarray(np.full((8, 8), 90, dtype=np.uint8)).save(tmp_path / "a.png")
    assert read_shot(tmp_path / "a.png").pixels.shape == (8, 8, 1)


def test_raw_photos_keep_one_unit_whatever_their_brightest_pixel(tmp_path: Path) -> None:
    pytest.importorskip("rawpy")
    ramp = np.tile(np.linspace(100, 16000, 200), (80, 1))
    for name, part in (("noon", 1.0), ("evening", 0.8)):
        (tmp_path / f"{name}.dng").write_bytes(plain_dng(ramp * part, white=16383))
        pixels = read_shot(tmp_path / f"{name}.dng").pixels[8:-8, 8:-8]
        expected = np.repeat((ramp * part / 16383)[8:-8, 8:-8, None], 3, axis=-1)
        assert pixels == pytest.approx(expected, abs=0.003)  # half a step of the ramp, as in test_linear


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif", "a.dng"])
def test_what_is_no_photo_ends_in_a_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"nothing of the kind")
    with pytest.raises(PhotoError, match=name):
        read_shot(tmp_path / name)


def test_a_bad_exr_is_named(tmp_path: Path) -> None:
    write_picture(tmp_path / "depth.exr", np.ones((8, 8, 1), np.float32))
    with pytest.raises(PhotoError, match=r"^depth\.exr: The EXR file has no channel R, G, B"):
        read_shot(tmp_path / "depth.exr")


def test_an_exr_with_values_that_are_not_finite_is_refused(tmp_path: Path) -> None:
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[1, 2] = np.nan
    write_exr(tmp_path / "spoiled.exr", pixels)
    with pytest.raises(PhotoError, match=r"^spoiled\.exr: .* not finite"):
        read_shot(tmp_path / "spoiled.exr")

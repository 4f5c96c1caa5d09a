"""Tests of pixels."""

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms, ImageOps

from lighting.errors import PhotoError
from lighting.photo import pixels
from lighting.photo.color_encoding import _profile_to_rec709, is_gamma_encoded
from lighting.photo.linear import read_linear
from tests.conftest import scene
from tests.helpers.photos import WIDE_PRIMARIES, display_profile

SCENE = scene(90, 60)


@pytest.mark.parametrize("orientation", [None, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9])
def test_each_turn_is_the_one_that_pillow_makes(orientation: int | None) -> None:
    image = Image.fromarray(SCENE)
    image.getexif()[0x0112] = orientation or 1
    turned = pixels.upright_pixels(Image.fromarray(SCENE), 90, orientation)
    assert turned.flags["C_CONTIGUOUS"]
    assert np.array_equal(turned, np.asarray(ImageOps.exif_transpose(image)))


@pytest.mark.parametrize(("size", "target", "factor"), [((90, 60), 90, 1), ((90, 60), 45, 2), ((90, 60), 31, 2)])
def test_each_side_is_divided_by_a_whole_number(size: tuple[int, int], target: int, factor: int) -> None:
    kept = pixels.upright_pixels(Image.fromarray(SCENE).resize(size), target, 1)
    assert kept.shape == (60 // factor, 90 // factor, 3)


def test_a_strip_may_be_transparent_if_another_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pixels, "_STRIP_PIXELS", 900)
    image = Image.fromarray(np.dstack([SCENE, np.zeros((60, 90), dtype=np.uint8)]))
    with pytest.raises(PhotoError, match="fully transparent"):
        pixels.upright_pixels(image.copy(), 90, 1)
    image.putpixel((3, 50), (1, 2, 3, 255))
    kept = pixels.upright_pixels(image, 90, 1)
    assert kept[50, 3].tolist() == [1, 2, 3]
    assert (np.delete(kept.reshape(-1, 3), 50 * 90 + 3, axis=0) == 128).all()


# XYZ of red, green and blue under D50: ROMM RGB (ISO 22028-2), and a profile of sRGB, as they are published
SRGB = ((0.4361, 0.2225, 0.0139), (0.3851, 0.7169, 0.0971), (0.1431, 0.0606, 0.7141))
COLOURS = np.array([[[60, 90, 140], [200, 190, 180]]], dtype=np.uint8)


def test_values_of_wide_primaries_become_those_of_rec709(tmp_path: Path) -> None:
    Image.fromarray(COLOURS).save(tmp_path / "a.png", icc_profile=display_profile("Wide, linear", WIDE_PRIMARIES))
    found = read_linear(tmp_path / "a.png", "linear").pixels
    xyz = COLOURS / 255.0 @ np.array(WIDE_PRIMARIES)
    assert found @ np.array(SRGB) == pytest.approx(xyz, abs=1e-3)


def test_white_stays_white_and_clipped_values_stay_clipped(tmp_path: Path) -> None:
    colours = np.array([[[255, 255, 255], [120, 200, 255]]], dtype=np.uint8)
    Image.fromarray(colours).save(tmp_path / "a.png", icc_profile=display_profile("Wide", WIDE_PRIMARIES))
    photo = read_linear(tmp_path / "a.png", "linear")
    assert photo.pixels[0, 0] == pytest.approx([1, 1, 1], abs=2e-3)
    assert (photo.pixels.max(axis=-1) >= photo.white).all()


@pytest.mark.parametrize("said", [None, b"damaged", display_profile("sRGB, linear", SRGB)])
def test_the_same_primaries_and_profiles_that_say_none_change_nothing(said: bytes | None) -> None:
    assert _profile_to_rec709(said) is None
    assert _profile_to_rec709(ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()) is None


@pytest.mark.parametrize(("name", "coded"), [("Wide", False), ("sRGB", False), ("Linear", True)])
def test_a_profile_that_has_a_curve_is_told_and_not_believed(tmp_path: Path, name: str, coded: bool) -> None:
    values = np.array([[100, 40000]], dtype=np.uint16)
    curve = struct.pack(">IH", 1, 461) if coded else bytes(4)  # value^1.8, or a straight line
    Image.fromarray(values).save(tmp_path / "a.png", icc_profile=display_profile(name, WIDE_PRIMARIES, curve))
    with Image.open(tmp_path / "a.png") as header:
        assert is_gamma_encoded(header) is coded
    photo = read_linear(tmp_path / "a.png")
    assert photo.pixels[..., 0] == pytest.approx(values / 65535, abs=1e-3)
    assert any("against what the file says" in warning for warning in photo.warnings) is coded
    assert not read_linear(tmp_path / "a.png", "linear").warnings

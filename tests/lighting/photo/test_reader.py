"""Tests of reader."""

import struct
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from io import BytesIO
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageCms

from benchmarks.decoding import KINDS, cost
from lighting.errors import ParameterError, PhotoError, PhotoTooLargeError
from lighting.photo import pixels as pixels_module
from lighting.photo.metadata import PhotoMetadata
from lighting.photo.pixels import MAX_KEPT_PIXELS
from lighting.photo.reader import (
    MAX_PIXELS,
    Photo,
    Source,
    _open_photo,
    _pixel_limit,
    memory_budget,
    photo_from_array,
    read_photo,
)
from tests.conftest import encode, scene
from tests.helpers.photos import packet, png

BYTES_PER_COEFFICIENT = 2.1  # of a progressive JPEG
BYTES_PER_PIXEL = 4  # of the limit of pixels
DECODER_BYTES_PER_PIXEL = {"JPEG": 1.0, "PNG": 4.0, "WEBP": 18.0, "HEIF": 10.0, "TIFF": 16.0, "AVIF": 14.0}
FIXED_BYTES = 64_000_000

PIXELS = np.asarray(scene(160, 120))


def test_pixels_are_a_photo_as_they_are() -> None:
    photo = photo_from_array(PIXELS, PhotoMetadata(vertical_fov=50.0))
    assert (photo.width, photo.height, photo.format) == (160, 120, "PIXELS")
    assert np.shares_memory(photo.pixels, PIXELS)
    assert np.array_equal(photo.pixels, read_photo(encode(scene(160, 120), "PNG")).pixels)
    assert photo.metadata.vertical_fov == 50.0


@pytest.mark.parametrize(
    "same",
    [
        PIXELS[:, ::-1][:, ::-1],
        np.asfortranarray(PIXELS),
        np.dstack([PIXELS, PIXELS])[..., :3],
        scene(160, 120),
    ],
    ids=["turned twice", "by columns", "a part", "PIL"],
)
def test_the_layout_in_memory_does_not_matter(same: Any) -> None:
    photo = photo_from_array(same)
    assert photo.pixels.flags.c_contiguous
    assert np.array_equal(photo.pixels, PIXELS)


def test_pixels_that_are_read_only_are_taken_and_a_tensor_is() -> None:
    import torch

    frozen = PIXELS.copy()
    frozen.flags.writeable = False
    assert np.array_equal(photo_from_array(frozen).pixels, PIXELS)
    assert np.array_equal(photo_from_array(torch.tensor(PIXELS)).pixels, PIXELS)


@pytest.mark.parametrize(
    ("pixels", "words"),
    [
        (PIXELS / 255.0, "type float64"),
        (PIXELS.astype(np.float32) * np.nan, "type float32"),
        (PIXELS.astype(np.uint16) * 257, "type uint16"),
        (PIXELS > 7, "type bool"),
        (PIXELS[..., 0], r"shape \(120, 160\)"),
        (np.dstack([PIXELS, PIXELS[..., :1]]), r"shape \(120, 160, 4\)"),
        (PIXELS.transpose(2, 0, 1), r"shape \(3, 120, 160\)"),
        (PIXELS[None], r"shape \(1, 120, 160, 3\)"),
        (PIXELS[:0], r"shape \(0, 160, 3\)"),
        (PIXELS[:1, :1], "1 x 1 pixels"),
        (np.zeros((10, 10_000, 3), np.uint8), "10000 x 10 pixels"),
        (np.zeros((40, 400, 3), np.uint8), "400 x 40 pixels"),
        (np.broadcast_to(np.uint8(0), (20_000, 20_000, 3)), "128 million"),
        ("photo.jpg", "type <U9"),
        (None, "type object"),
        (Image.new("L", (99, 99)), r"shape \(99, 99\)"),
    ],
)
def test_other_types_shapes_and_sizes_are_refused_in_one_sentence(pixels: Any, words: str) -> None:
    with pytest.raises(PhotoError, match=words) as caught:
        photo_from_array(pixels)
    assert str(caught.value).endswith(".")
    assert "\n" not in str(caught.value)


def test_a_photo_is_not_read_twice() -> None:
    with pytest.raises(PhotoError, match=r"^That is a Photo already.*an Estimator takes it\.$"):
        read_photo(photo_from_array(PIXELS))  # type: ignore[arg-type]


SIZE = (2000, 1500)
MEASURED = {  # kind: bytes per pixel in the table
    "JPEG, baseline 4:2:0": DECODER_BYTES_PER_PIXEL["JPEG"],
    "JPEG, progressive 4:4:4": 3 * BYTES_PER_COEFFICIENT,
    "JPEG, progressive CMYK": 4 * BYTES_PER_COEFFICIENT,
    "PNG, RGB": DECODER_BYTES_PER_PIXEL["PNG"],
    "WebP, lossless": DECODER_BYTES_PER_PIXEL["WEBP"],
    "HEIC": DECODER_BYTES_PER_PIXEL["HEIF"],
    "TIFF, one strip, RGBA": DECODER_BYTES_PER_PIXEL["TIFF"],
    "AVIF, 4:4:4 with alpha": DECODER_BYTES_PER_PIXEL["AVIF"],
}
CONVERSION = 10  # bytes per pixel; pictures of fewer pixels than a strip are converted at once


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize(
    "kind", [next(iter(MEASURED)), *(pytest.param(k, marks=pytest.mark.thorough) for k in [*MEASURED][1:])]
)
def test_a_decoder_needs_no_more_than_the_table_says(kind: str, tmp_path: Path) -> None:
    large, small = tmp_path / "large", tmp_path / "small"
    large.write_bytes(KINDS[kind](*SIZE))
    small.write_bytes(KINDS[kind](96, 64))
    pixels = SIZE[0] * SIZE[1]
    conversion = CONVERSION * pixels if kind.startswith("PNG") else 6_000_000  # heap, a reduced picture
    assert cost(large, small)[0] <= MEASURED[kind] * pixels + min(conversion, FIXED_BYTES)


def limit(data: bytes) -> tuple[int, str]:
    return _pixel_limit(_open_photo(data), data, MAX_PIXELS)


def test_each_kind_stays_within_the_memory_that_is_stated() -> None:
    picture = Image.fromarray(scene(96, 64))
    assert limit(encode(picture)) == (MAX_PIXELS, "JPEG")
    assert limit(encode(picture, "PNG")) == (MAX_PIXELS, "PNG")
    assert limit(encode(picture, progressive=True)) == (MAX_PIXELS, "progressive JPEG")
    most, name = limit(encode(picture, progressive=True, subsampling="4:4:4"))
    assert (most, name) == (int(MAX_PIXELS * BYTES_PER_PIXEL / (3 * BYTES_PER_COEFFICIENT)), "progressive JPEG")
    for file_format in ("WEBP", "HEIF", "TIFF", "AVIF"):
        most, _ = limit(encode(picture, file_format))
        assert most * DECODER_BYTES_PER_PIXEL[file_format] == pytest.approx(BYTES_PER_PIXEL * MAX_PIXELS, rel=1e-6)


def test_every_kind_that_the_benchmark_prints_is_in_the_table() -> None:
    kinds = {kind.partition(",")[0].upper() for kind in KINDS}
    assert kinds - {"MPO"} == {"JPEG", "PNG", "WEBP", "HEIC", "TIFF", "AVIF"}


def test_reading_apart_may_take_what_is_stated() -> None:
    stated = BYTES_PER_PIXEL * MAX_PIXELS + FIXED_BYTES
    assert memory_budget(0, MAX_PIXELS, 448) - stated < 5_000_000
    assert (
        memory_budget(1000, MAX_PIXELS, None)
        == memory_budget(1000, MAX_PIXELS, 3840)
        == stated + 2000 + 6 * MAX_KEPT_PIXELS
    )


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


def test_no_limit_lets_in_more_pixels_than_are_opened_at_all() -> None:
    data = bytearray(encode(scene(96, 64), "JPEG"))
    at = data.index(b"\xff\xc0") + 5
    data[at : at + 4] = struct.pack(">HH", 12_500, 15_000)
    with pytest.raises(PhotoTooLargeError, match=r"15000 x 12500 pixels has more than its limit of 178 million"):
        read_photo(bytes(data), target=512, max_pixels=10**9)


UNDO = {  # how a camera stores an upright picture under each orientation
    1: None,
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_90,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_270,
}


LOSSLESS: dict[str, dict[str, object]] = {
    "JPEG": {"quality": 98, "subsampling": 0},
    "PNG": {},
    "WEBP": {"lossless": True},
    "HEIF": {"quality": -1},
    "TIFF": {},
    "AVIF": {"quality": 100, "subsampling": "4:4:4", "speed": 10, "max_threads": 1},
}


SCENE = scene(160, 120)


TEXTUAL_ORIENTATION = b"Exif\0\0II*\0" + struct.pack("<IHHHI4sI", 8, 1, 0x0112, 2, 2, b"6\0", 0)


def sentence(error: BaseException) -> str:
    text = str(error)
    assert text.endswith(".")
    assert "\n" not in text
    assert len(text) < 250
    return text


def refusal(data: bytes, **limits: Any) -> str:
    with pytest.raises(PhotoError) as caught:
        read_photo(data, **limits)
    return sentence(caught.value)


def assert_close(photo: Photo, expected: NDArray[np.uint8], tolerance: int = 4) -> None:
    assert photo.pixels.dtype == np.uint8
    assert photo.pixels.shape == expected.shape
    assert np.abs(photo.pixels.astype(int) - expected).max() <= tolerance


@pytest.mark.parametrize("mode", ["L", "P", "RGB", "RGBA", "I;16"])
def test_strips_make_the_same_picture(mode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    grey = (np.arange(203 * 151, dtype=np.uint16) * 3).reshape(151, 203)
    whole = Image.fromarray(grey) if mode == "I;16" else Image.fromarray(SCENE).resize((203, 151)).convert(mode)
    if mode == "RGBA":
        whole.putalpha(Image.fromarray((np.indices((151, 203)).sum(axis=0) % 256).astype(np.uint8)))
    stream = BytesIO()
    whole.save(stream, "PNG", **({"transparency": 0} if mode == "P" else {}))
    at_once = read_photo(stream.getvalue(), target=40)
    monkeypatch.setattr(pixels_module, "_STRIP_PIXELS", 1000)
    in_strips = read_photo(stream.getvalue(), target=40)
    assert at_once.pixels.shape == (31, 41, 3)
    assert np.array_equal(at_once.pixels, in_strips.pixels)


@pytest.mark.parametrize("file_format", LOSSLESS)
def test_each_format_is_read(file_format: str) -> None:
    photo = read_photo(encode(SCENE, file_format, **LOSSLESS[file_format]))
    assert (photo.width, photo.height, photo.format) == (160, 120, file_format)
    assert_close(photo, SCENE)


@pytest.mark.parametrize("file_format", LOSSLESS)
@pytest.mark.parametrize("orientation", range(1, 9))
def test_every_exif_orientation_ends_upright(file_format: str, orientation: int) -> None:
    method = UNDO[orientation]
    picture = Image.fromarray(SCENE)
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    stored = picture if method is None else picture.transpose(method)
    photo = read_photo(encode(stored, file_format, exif=exif.tobytes(), **LOSSLESS[file_format]))
    assert (photo.width, photo.height) == (160, 120)
    assert_close(photo, SCENE)


@pytest.mark.parametrize(
    "exif",
    [
        TEXTUAL_ORIENTATION,
        b"",
        b"garbage",
        b"Exif\0\0garbage",
        b"Exif\0\0II*\0\xff\xff\xff\xff",
        b"Exif\0\0MM\0*\0\0\0\x08\xff\xff\x01\x12",
    ],
    ids=repr,
)
@pytest.mark.parametrize("file_format", ["JPEG", "PNG", "WEBP"])
def test_damaged_exif_does_not_reject_a_photo(exif: bytes, file_format: str) -> None:
    assert_close(read_photo(encode(SCENE, file_format, exif=exif, **LOSSLESS[file_format])), SCENE)


@pytest.mark.parametrize("orientation", [0, 9, 65535])
def test_an_impossible_orientation_counts_as_none(orientation: int) -> None:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    assert_close(read_photo(encode(SCENE, "PNG", exif=exif.tobytes())), SCENE)


@pytest.mark.parametrize("orientation", [1, 6])
@pytest.mark.parametrize("file_format", ["JPEG", "PNG", "TIFF"])
def test_a_large_photo_is_decoded_at_reduced_scale(file_format: str, orientation: int) -> None:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = orientation
    stored = scene(2000, 1500)
    photo = read_photo(encode(stored, file_format, exif=exif.tobytes()), target=400)
    upright = (2000, 1500) if orientation == 1 else (1500, 2000)
    assert (photo.width, photo.height) == upright
    height, width = photo.pixels.shape[:2]
    assert 400 <= max(width, height) < 800
    assert width / height == pytest.approx(upright[0] / upright[1], rel=0.01)
    plain = (
        Image.fromarray(stored) if orientation == 1 else Image.fromarray(stored).transpose(Image.Transpose.ROTATE_270)
    )
    assert_close(photo, np.asarray(plain.resize((width, height), Image.Resampling.BOX)), 6)


def test_the_default_target_leaves_a_small_photo_whole() -> None:
    assert read_photo(encode(scene(447, 300))).pixels.shape == (300, 447, 3)
    assert max(read_photo(encode(scene(1792, 1344), "PNG", compress_level=1)).pixels.shape) == 448


def test_no_target_keeps_every_pixel() -> None:
    assert read_photo(encode(scene(2600, 1400)), target=None).pixels.shape == (1400, 2600, 3)
    for no_size in (-1, 0, 2.5, "a"):
        with pytest.raises(ParameterError, match=f"^target must be a whole number .* not {no_size!r}"):
            read_photo(encode(scene(64, 64)), target=no_size)  # type: ignore[arg-type]


@pytest.mark.parametrize("target", [None, 300])
def test_what_is_kept_is_bounded(target: int | None, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pixels_module, "MAX_KEPT_PIXELS", 20_000)
    photo = read_photo(encode(scene(400, 300), "PNG"), target=target)
    assert (photo.width, photo.height, photo.pixels.shape) == (400, 300, (100, 134, 3))


def test_path_stream_and_bytes_are_the_same(photo_path: Path) -> None:
    expected = read_photo(photo_path.read_bytes())
    with photo_path.open("rb") as stream:
        sources: list[Source] = [photo_path, str(photo_path), stream, BytesIO(photo_path.read_bytes())]
        for source in sources:
            assert (read_photo(source).pixels == expected.pixels).all()


def test_a_stream_that_gives_a_little_at_a_time_is_read_to_its_end(photo_path: Path) -> None:
    class Slow(BytesIO):
        def read(self, size: int | None = -1) -> bytes:
            return super().read(min(size or 0, 100))

    assert read_photo(Slow(photo_path.read_bytes())).width == 320


def test_missing_files_and_folders_are_os_errors(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_photo(tmp_path / "absent.jpg")
    with pytest.raises(IsADirectoryError):
        read_photo(tmp_path)


def test_grey_one_bit_and_palette_become_rgb() -> None:
    grey = Image.fromarray(SCENE).convert("L")
    expected = np.repeat(np.asarray(grey)[..., None], 3, axis=-1)
    assert_close(read_photo(encode(grey, "PNG")), expected, 0)
    assert_close(read_photo(encode(grey, "JPEG", quality=98)), expected)
    palette = Image.fromarray(SCENE).quantize(64)
    assert_close(read_photo(encode(palette, "PNG")), np.asarray(palette.convert("RGB")), 0)
    bits = grey.convert("1")
    assert set(np.unique(read_photo(encode(bits, "PNG")).pixels)) == {0, 255}


def test_sixteen_bit_grey_is_scaled_and_not_clipped() -> None:
    ramp = np.tile(np.linspace(0, 65535, 64).round().astype(np.uint16), (48, 1))
    photo = read_photo(encode(ramp, "PNG"))
    expected = np.tile(np.linspace(0, 255, 64), (48, 1))
    assert np.abs(photo.pixels - expected[..., None]).max() <= 1
    assert (photo.pixels[..., :1] == photo.pixels).all()


@pytest.mark.parametrize(("colour_type", "channels"), [(2, 3), (6, 4), (4, 2)])
def test_sixteen_bit_colour_and_alpha_are_scaled(colour_type: int, channels: int) -> None:
    ramp = np.linspace(0, 65535, 40).round().astype(">u2")
    samples = np.full((40, 40, channels), 65535, dtype=">u2")
    samples[..., 0] = ramp[None]
    photo = read_photo(png(40, 40, b"".join(b"\0" + row.tobytes() for row in samples), depth=16, colour=colour_type))
    assert np.abs(photo.pixels[..., 0] - np.linspace(0, 255, 40)).max() <= 1


def test_cmyk_keeps_its_colours() -> None:
    for rgb in [(255, 255, 255), (0, 0, 0), (200, 40, 90)]:
        cmyk = Image.new("RGB", (64, 48), rgb).convert("CMYK")
        photo = read_photo(encode(cmyk, "JPEG", quality=98))
        assert_close(photo, np.full((48, 64, 3), rgb, dtype=np.uint8), 6)


@pytest.mark.parametrize("file_format", ["PNG", "WEBP", "HEIF"])
def test_transparent_parts_become_mid_grey(file_format: str) -> None:
    rgba = np.dstack([SCENE, np.full(SCENE.shape[:2], 255, dtype=np.uint8)])
    rgba[:60, :40, :3] = 255
    rgba[:60, :40, 3] = 0
    photo = read_photo(encode(rgba, file_format, **LOSSLESS[file_format]))
    expected = SCENE.copy()
    expected[:60, :40] = 128
    assert_close(photo, expected)


def test_hidden_colours_do_not_bleed_when_a_photo_is_reduced() -> None:
    rgba = np.zeros((400, 400, 4), dtype=np.uint8)
    rgba[:, 200:] = 255
    photo = read_photo(encode(rgba, "PNG"), target=50)
    assert set(np.unique(photo.pixels)) == {128, 255}


def test_a_transparent_palette_entry_becomes_mid_grey() -> None:
    palette = Image.new("P", (64, 48), 1)
    palette.putpalette([255, 0, 0, 0, 255, 0])
    palette.paste(0, (0, 0, 64, 24))
    pixels = read_photo(encode(palette, "PNG", transparency=0)).pixels
    assert (pixels[0, 0] == 128).all()
    assert pixels[-1, -1].tolist() == [0, 255, 0]


def test_a_fully_transparent_photo_is_refused() -> None:
    assert refusal(encode(Image.new("RGBA", (64, 48), (9, 9, 9, 0)), "PNG")) == "The photo is fully transparent."


def swapped_profile() -> bytes:
    """A color profile of the sRGB kind whose red and green primaries changed places."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    swapped = profile.replace(b"rXYZ", b"????").replace(b"gXYZ", b"rXYZ").replace(b"????", b"gXYZ")
    renamed = swapped.replace("sRGB".encode("utf-16-be"), "Test".encode("utf-16-be"))
    assert renamed not in (swapped, profile)
    return renamed


@pytest.mark.parametrize("file_format", LOSSLESS)
def test_a_colour_profile_is_converted_to_srgb(file_format: str) -> None:
    red = Image.new("RGB", (64, 48), (255, 0, 0))
    pixels = read_photo(encode(red, file_format, icc_profile=swapped_profile(), **LOSSLESS[file_format])).pixels
    assert pixels.reshape(-1, 3).mean(axis=0) == pytest.approx([0, 255, 0], abs=8)


def linear_profile(name: str) -> bytes:
    """The profile of sRGB without its curve, under a name as long as "sRGB built-in"."""
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    curve, line = b"para" + bytes(5) + b"\3", b"para" + bytes(8) + b"\0\1\0\0"  # value^1.0
    start = profile.index(curve)
    straight = profile[:start] + line + profile[start + len(line) :]
    renamed = straight.replace("sRGB built-in".encode("utf-16-be"), name.encode("utf-16-be"))
    assert renamed != straight
    return renamed


@pytest.mark.parametrize("name", ["Linear sRGB  ", "sRGB-V4-g10  "])
def test_linear_values_with_the_primaries_of_srgb_get_its_curve(name: str) -> None:
    """GIMP and darktable write such files; their name holds "sRGB", and they were read far too dark."""
    grey = Image.new("RGB", (64, 48), (55, 55, 55))
    pixels = read_photo(encode(grey, "PNG", icc_profile=linear_profile(name))).pixels
    assert pixels.reshape(-1, 3).mean(axis=0) == pytest.approx(128, abs=1)


def test_a_grey_photo_ignores_a_profile_of_rgb() -> None:
    grey = np.full((48, 64), 77, dtype=np.uint8)
    photo = read_photo(encode(grey, "PNG", icc_profile=swapped_profile()))
    assert_close(photo, np.full((48, 64, 3), 77, dtype=np.uint8), 0)


def test_a_profile_survives_palette_reduction_and_rotation() -> None:
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    red = Image.new("RGB", (640, 480), (255, 0, 0)).quantize(4)
    data = encode(red, "PNG", icc_profile=swapped_profile(), exif=exif.tobytes())
    photo = read_photo(data, target=200)
    assert photo.pixels.shape == (214, 160, 3)
    assert photo.pixels.reshape(-1, 3).mean(axis=0) == pytest.approx([0, 255, 0], abs=8)


@pytest.mark.parametrize(
    "profile",
    [b"garbage", swapped_profile()[:200], ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()],
    ids=["garbage", "cut short", "another color space"],
)
@pytest.mark.parametrize("file_format", ["JPEG", "PNG", "WEBP"])
def test_an_unfit_profile_does_not_reject_a_photo(profile: bytes, file_format: str) -> None:
    assert_close(read_photo(encode(SCENE, file_format, icc_profile=profile, **LOSSLESS[file_format])), SCENE)


@pytest.mark.parametrize("file_format", ["PNG", "WEBP", "MPO"])
def test_of_several_pictures_the_first_counts(file_format: str) -> None:
    first, second = Image.fromarray(SCENE), Image.new("RGB", (160, 120), (255, 0, 255))
    options = {"quality": 98} if file_format == "MPO" else {"lossless": True} if file_format == "WEBP" else {}
    photo = read_photo(encode(first, file_format, save_all=True, append_images=[second], **options))
    assert_close(photo, SCENE, 8)


@pytest.mark.parametrize("source", [b"", BytesIO()], ids=["bytes", "stream"])
def test_an_empty_source_says_so(source: Source) -> None:
    with pytest.raises(PhotoError, match=r"^The photo is empty\.$"):
        read_photo(source)


@pytest.mark.parametrize("data", [b"\0", b"hello", b"\xff\xd8\xff", b"<svg/>", b"\0\0\0\x18ftypavif" + b"\0" * 99])
def test_what_is_no_photo_is_refused(data: bytes) -> None:
    refusal(data)


@pytest.mark.parametrize("mode", ["F", "I"])
def test_a_tiff_of_32_bits_is_refused_since_its_white_is_unknown(mode: str) -> None:
    assert "32 bits per color" in refusal(encode(Image.fromarray(SCENE).convert("L").convert(mode), "TIFF"))


def test_a_tiff_of_floats_in_colour_is_called_a_tiff() -> None:
    """It was said to be none, though renderers and photo editors write it."""
    eight, floats = b"\x08\x00" * 3, b"\x20\x00" * 3
    data = encode(SCENE, "TIFF")
    assert data.count(eight) == 1
    assert refusal(data.replace(eight, floats)) == (
        "The TIFF is damaged or not supported, such as 32 bits per color; convert it to 8 or 16 bits."
    )


@pytest.mark.parametrize("compression", ["tiff_lzw", "tiff_adobe_deflate", "packbits", "jpeg"])
def test_tiffs_are_read_however_they_are_packed(compression: str) -> None:
    options = {"quality": 98} if compression == "jpeg" else {}
    assert_close(read_photo(encode(SCENE, "TIFF", compression=compression, **options)), SCENE, 8)


@pytest.mark.parametrize("file_format", LOSSLESS)
@pytest.mark.parametrize("share", [0.2, 0.5, 0.9])
def test_a_photo_cut_short_is_refused(file_format: str, share: float) -> None:
    data = encode(SCENE, file_format, **LOSSLESS[file_format])
    refusal(data[: int(len(data) * share)])


def test_too_many_bytes_are_refused_without_reading_on() -> None:
    data = encode(SCENE)
    with pytest.raises(PhotoTooLargeError, match=r"larger than the limit of 0.001 MB\.$"):
        read_photo(data, max_bytes=1000)
    stream = BytesIO(data)
    with pytest.raises(PhotoTooLargeError):
        read_photo(stream, max_bytes=1000)
    assert stream.tell() == 1001
    assert read_photo(data, max_bytes=len(data)).width == 160


def test_an_endless_file_is_refused() -> None:
    with pytest.raises(PhotoTooLargeError):
        read_photo("/dev/zero", max_bytes=100_000)


@pytest.mark.parametrize("file_format", LOSSLESS)
def test_too_many_pixels_are_refused(file_format: str) -> None:
    """The limit is that of kinds which need at most BYTES per pixel; others are given fewer."""
    data = encode(SCENE, file_format, **LOSSLESS[file_format])
    enough = ceil(160 * 120 * max(1, DECODER_BYTES_PER_PIXEL[file_format] / BYTES_PER_PIXEL))
    with pytest.raises(PhotoTooLargeError, match=r"^The \w+ of 160 x 120 pixels has more than .* 0.01919\d* million"):
        read_photo(data, max_pixels=enough - 1)
    assert read_photo(data, max_pixels=enough).width == 160


@pytest.mark.parametrize(("width", "height"), [(12_000, 11_000), (60_000, 60_000), (2**31 - 1, 2**31 - 1)])
def test_a_bomb_is_refused_by_its_header(width: int, height: int) -> None:
    with pytest.raises(PhotoTooLargeError) as caught:
        read_photo(png(width, height, b"\0" * 100, colour=2))
    sentence(caught.value)


def test_a_photo_between_the_limit_of_pillow_and_ours_is_read_quietly() -> None:
    rows = (b"\0" + b"\x55" * (10_000 // 8)) * 10_000
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert read_photo(png(10_000, 10_000, rows, depth=1)).width == 10_000


@pytest.mark.parametrize(("width", "height"), [(1, 1), (31, 400), (400, 31), (100, 801), (6000, 40)])
def test_absurd_shapes_are_refused(width: int, height: int) -> None:
    assert refusal(encode(scene(width, height), "PNG")).startswith(f"The photo is {width} x {height} pixels;")


@pytest.mark.parametrize(("width", "height"), [(32, 32), (32, 256), (256, 32), (1080, 1920)])
def test_unusual_shapes_are_read(width: int, height: int) -> None:
    photo = read_photo(encode(scene(width, height)), target=None)
    assert photo.pixels.shape == (height, width, 3)


@given(st.binary(max_size=200))
def test_random_bytes_are_refused(data: bytes) -> None:
    refusal(data)


HEADS = {"JPEG": 20, "PNG": 8, "WEBP": 16, "HEIF": 12, "TIFF": 8, "AVIF": 12}


SMALL = {name: encode(scene(48, 40), name, **LOSSLESS[name]) for name in LOSSLESS}


@given(st.sampled_from(sorted(HEADS)), st.binary(max_size=300))
def test_a_good_beginning_does_not_help_random_bytes(file_format: str, data: bytes) -> None:
    refusal(SMALL[file_format][: HEADS[file_format]] + data)


@given(st.sampled_from(sorted(SMALL)), st.floats(0, 1), st.binary(min_size=1, max_size=8))
def test_damage_anywhere_gives_a_photo_or_a_refusal(file_format: str, where: float, damage: bytes) -> None:
    data = SMALL[file_format]
    start = int(where * (len(data) - len(damage)))
    damaged = data[:start] + damage + data[start + len(damage) :]
    try:
        photo = read_photo(damaged, max_pixels=1_000_000)
    except PhotoError as error:
        sentence(error)
    else:
        assert photo.pixels.dtype == np.uint8
        assert photo.pixels.shape[2:] == (3,)


@given(st.sampled_from(sorted(SMALL)), st.floats(0, 1))
def test_a_cut_anywhere_gives_a_photo_or_a_refusal(file_format: str, where: float) -> None:
    data = SMALL[file_format][: int(where * len(SMALL[file_format]))]
    try:
        photo = read_photo(data)
    except PhotoError as error:
        sentence(error)
    else:
        assert photo.pixels.shape == (40, 48, 3)


def test_threads_leave_the_warning_filters_as_they_were() -> None:
    before = list(warnings.filters)
    data = [encode(SCENE, name, exif=b"Exif\0\0garbage", **LOSSLESS[name]) for name in ("JPEG", "PNG", "WEBP")] * 10
    with ThreadPoolExecutor(4) as pool:
        assert all(photo.width == 160 for photo in pool.map(read_photo, data))
    assert list(warnings.filters) == before


@pytest.mark.parametrize("name", ["find_layout", "upright_pixels", "read_tags", "read_color_encoding", "read_metadata"])
def test_a_fault_of_ours_is_no_damaged_photo(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """It reaches whoever can repair it: of the service as status 500, which it logs."""

    def fault(*_: object, **__: object) -> None:
        raise NameError("name 'missing' is not defined")

    monkeypatch.setattr(f"lighting.photo.reader.{name}", fault)
    with pytest.raises(NameError):
        read_photo(encode(scene(64, 48)))


GAIN_XMP = packet("http://ns.adobe.com/hdr-gain-map/1.0/", {"Version": "1.0", "GainMapMax": "2.0"})
GAIN_ISO = b"urn:iso:std:iso:ts:21496:-1\0" + bytes(4)  # of a base: versions of the map's parameters


@pytest.mark.parametrize("kind", ["xmp", "iso", "both"])
def test_a_gain_map_changes_nothing_of_the_base(kind: str) -> None:
    """Ultra HDR, by XMP, by ISO 21496-1, or both."""
    base = encode(scene(320, 240))
    marked = encode(scene(320, 240), xmp=GAIN_XMP) if kind != "iso" else base
    if kind != "xmp":
        marked = marked[:2] + b"\xff\xe2" + (len(GAIN_ISO) + 2).to_bytes(2, "big") + GAIN_ISO + marked[2:]
    plain = np.full((60, 80), 200, np.uint8)
    gain = encode(plain, xmp=GAIN_XMP) if kind != "iso" else encode(plain)
    photo = read_photo(marked + gain)
    assert (photo.width, photo.height, photo.warnings) == (320, 240, ())
    np.testing.assert_array_equal(photo.pixels, read_photo(base).pixels)

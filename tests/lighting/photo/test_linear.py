"""Linear values of 16-bit and 8-bit pictures, against the arrays that OpenCV and Pillow wrote into them."""

import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps

from lighting.color import srgb_decode
from lighting.errors import PhotoError
from lighting.photo import linear
from lighting.photo.linear import linear_from_array, read_linear, read_metadata_and_exposure
from lighting.photo.reader import read_photo
from lighting.photo.tiff import open_raw_header
from lighting.stereo.capture import _check_same_exposure, _read_day_photo
from tests.conftest import encode, exif, munich, scene
from tests.helpers.photos import grey_tiff, plain_dng, png, taken, tiff, tiff_with_exif_behind_thumbnail

RANDOM = np.random.default_rng(3)
NOISE = RANDOM.integers(0, 65536, (37, 53, 3)).astype(np.uint16)
SMOOTH = np.cumsum(RANDOM.integers(0, 300, (37, 53, 3)), axis=1).astype(np.uint16)


def write_16(path: Path, pixels: NDArray[np.uint16]) -> Path:
    import cv2

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


def test_sixteen_bit_grey_with_transparency_keeps_them_too(tmp_path: Path) -> None:
    grey = NOISE[..., 0]
    rows = np.stack([grey, NOISE[..., 1]], axis=-1).astype(">u2").view(np.uint8).reshape(len(grey), -1)
    plain = np.concatenate([np.zeros((len(grey), 1), np.uint8), rows], axis=1).tobytes()
    (tmp_path / "a.png").write_bytes(png(grey.shape[1], grey.shape[0], plain, depth=16, colour=4))
    photo = read_linear(tmp_path / "a.png")
    np.testing.assert_array_equal(np.rint(photo.pixels[..., 1] * 65535), grey)
    assert photo.gray


@pytest.mark.parametrize("name", ["a.png", "a.tif", "a.jpg"])
@pytest.mark.parametrize("orientation", [2, 3, 5, 6, 7, 8])
def test_pixels_stay_as_stored_unless_they_are_to_be_turned(tmp_path: Path, name: str, orientation: int) -> None:
    """Pillow turns TIFF files alone, and those unasked."""
    block = Image.Exif()
    block[ExifTags.Base.Orientation] = orientation
    pixels = np.repeat(SMOOTH[..., :1] >> 8, 3, axis=-1).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / name, exif=block.tobytes(), quality=100)
    stored, turned = (read_linear(tmp_path / name, "linear", upright=turned).pixels for turned in (False, True))
    assert stored == pytest.approx(pixels / 255.0, abs=0.01)
    expected = ImageOps.exif_transpose(Image.open(tmp_path / name))
    assert turned == pytest.approx(np.asarray(expected) / 255.0, abs=0.01)


def test_the_picture_behind_a_tiff_s_thumbnail_is_read(tmp_path: Path) -> None:
    whole = scene(320, 240)
    (tmp_path / "a.tif").write_bytes(tiff((scene(80, 60), munich()), (whole, {})))
    photo = read_linear(tmp_path / "a.tif", "linear")
    np.testing.assert_allclose(photo.pixels, whole / 255.0, rtol=0, atol=1e-6)
    assert photo.metadata.latitude is not None


def test_its_own_exif_block_counts_before_the_thumbnail_s(tmp_path: Path) -> None:
    (tmp_path / "a.tif").write_bytes(tiff_with_exif_behind_thumbnail())
    photo = read_linear(tmp_path / "a.tif", "linear", upright=True)
    assert photo.metadata.latitude == pytest.approx(48.1375)
    np.testing.assert_allclose(photo.pixels, np.rot90(scene(320, 240), 3) / 255.0, rtol=0, atol=1e-6)


@pytest.mark.parametrize("packed", [False, True])
def test_wide_colours_in_planes_are_refused_where_pillow_takes_them_for_narrow_ones(
    tmp_path: Path, packed: bool
) -> None:
    data = in_planes(np.repeat(SMOOTH, 2, axis=0), packed)
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(PhotoError, match="one after another"):
        read_linear(tmp_path / "a.tif")
    if packed:
        assert np.array_equal(read_photo(data, target=None).pixels, np.repeat(SMOOTH >> 8, 2, axis=0))
    else:
        with pytest.raises(PhotoError, match="one after another"):
            read_photo(data)


def test_twelve_bits_fill_the_scale_and_white_may_be_zero(tmp_path: Path) -> None:
    """Pillow hands out such values as they stand: 16 times too dark, or as a negative."""
    grey = np.tile(np.linspace(0, 4095, 64).astype(np.uint16), (48, 1))
    left, right = grey[:, ::2], grey[:, 1::2]
    packed = np.stack([left >> 4, (left & 15) << 4 | right >> 8, right & 255], axis=-1).astype(np.uint8).tobytes()
    wide = (65535 - (grey << 4)).astype("<u2").tobytes()
    for data in (grey_tiff(64, 48, 12, packed), grey_tiff(64, 48, 16, wide, white_is_zero=True)):
        (tmp_path / "a.tif").write_bytes(data)
        assert read_linear(tmp_path / "a.tif").pixels[..., 1] == pytest.approx(grey / 4095, abs=1 / 4095)
        assert np.abs(read_photo(data).pixels[..., 1] - (grey >> 4).astype(int)).max() <= 1


def in_planes(pixels: NDArray[np.uint16], packed: bool) -> bytes:
    """A TIFF that stores red, green and blue one after another."""
    height, width, _ = pixels.shape
    planes = [pixels[..., channel].astype("<u2").tobytes() for channel in range(3)]
    planes = [zlib.compress(plane) for plane in planes] if packed else planes
    short, long, three = 3, 4, 8 + 2 + 12 * 10 + 4  # where what does not fit the directory begins
    entries = [
        *((256, long, 1, width), (257, long, 1, height), (258, short, 3, three), (259, short, 1, 8 if packed else 1)),
        *((262, short, 1, 2), (273, long, 3, three + 6), (277, short, 1, 3), (278, long, 1, height)),
        *((279, long, 3, three + 18), (284, short, 1, 2)),
    ]
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries)
    places = [three + 30 + sum(len(plane) for plane in planes[:k]) for k in range(3)]
    beside = struct.pack("<3H6I", 16, 16, 16, *places, *(len(plane) for plane in planes))
    return b"II*\0" + struct.pack("<I", 8) + directory + bytes(4) + beside + b"".join(planes)


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


@pytest.mark.parametrize("mode", ["F", "I"])
def test_thirty_two_bits_are_refused_and_not_cut_to_eight_or_sixteen(tmp_path: Path, mode: str) -> None:
    Image.fromarray(NOISE[..., 0]).convert(mode).save(tmp_path / "a.tif")
    with pytest.raises(PhotoError, match=r"a\.tif: The TIFF holds 32 bits per color"):
        read_linear(tmp_path / "a.tif")


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


def test_so_does_a_jpeg_with_more_pictures_behind_it(tmp_path: Path) -> None:
    first, second = (Image.new("RGB", (40, 40), (level,) * 3) for level in (128, 20))
    first.save(tmp_path / "a.jpg", "MPO", save_all=True, append_images=[second])
    photo = read_linear(tmp_path / "a.jpg")
    assert photo.warnings[0].startswith("A JPEG")
    assert photo.pixels == pytest.approx(float(srgb_decode(128 / 255)), abs=0.01)


def test_floats_are_clipped_where_many_share_the_largest_value() -> None:
    ramp = np.linspace(0, 7, 300, dtype=np.float32).reshape(10, 10, 3)
    assert linear_from_array(ramp).white == float("inf")
    assert linear_from_array(np.minimum(ramp, 5)).white == pytest.approx(4.9)
    with pytest.raises(PhotoError, match="finite"):
        linear_from_array(np.full((2, 2, 3), np.nan, np.float32))


def test_what_is_no_picture_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_bytes(b"nothing")
    with pytest.raises(PhotoError, match="cannot be read"):
        read_linear(tmp_path / "a.png")
    with pytest.raises(OSError, match="No such file"):
        read_linear(tmp_path / "none.png")


@pytest.mark.needs("rawpy")
def test_raw_photos_are_linear_whatever_their_brightest_pixel(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(100, 16000, 200), (80, 1))
    for name, part in (("bright", 1.0), ("dark", 0.8)):
        (tmp_path / f"{name}.dng").write_bytes(plain_dng(ramp * part, white=16383))
        photo = read_linear(tmp_path / f"{name}.dng")
        inside = (slice(8, -8), slice(8, -8))
        expected = np.repeat((ramp * part / 16383)[..., None], 3, axis=-1)
        # The middle of two neighbors of a row counts half a step of the ramp.
        assert photo.pixels[inside] == pytest.approx(expected[inside], abs=0.003)
        assert photo.step == pytest.approx(1 / 16383)


def test_raw_photos_ask_for_their_library_or_say_what_is_wrong(tmp_path: Path) -> None:
    (tmp_path / "a.dng").write_bytes(b"nothing")
    with pytest.raises(PhotoError, match=r"rawpy|RAW"):
        read_linear(tmp_path / "a.dng")


def test_a_picture_with_too_many_pixels_is_called_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    Image.fromarray(np.zeros((40, 40), np.uint8)).save(tmp_path / "large.png")
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 100)
    with pytest.raises(PhotoError, match=r"large\.png has too many pixels"):
        read_linear(tmp_path / "large.png")


BASE = ExifTags.Base
SCENE = scene(96, 64)


def camera(seconds: float, orientation: int = 1) -> Image.Exif:
    block = exif(
        {BASE.ExposureTime: seconds, BASE.FNumber: 8.0, BASE.ISOSpeedRatings: 200, BASE.FocalLength: 35.0,
         BASE.DateTimeOriginal: "2024:06:01 11:00:00", BASE.OffsetTimeOriginal: "+02:00"}
    )  # fmt: skip
    block[BASE.Orientation] = orientation
    return block


def directory(tags: Image.Exif) -> bytes:
    return tags.tobytes().removeprefix(b"Exif\0\0")


def tiff_like(start: bytes, block: Image.Exif) -> bytes:
    """A directory, and a preview without a block of its own."""
    return start + directory(block)[4:] + encode(SCENE)


def raf(block: Image.Exif) -> bytes:
    photo = encode(SCENE, exif=block.tobytes())
    return b"FUJIFILMCCD-RAW ".ljust(84, b"\0") + struct.pack(">II", 160, len(photo)) + bytes(68) + photo


def box(kind: bytes, content: bytes) -> bytes:
    return struct.pack(">I4s", 8 + len(content), kind) + content


def cr3(block: Image.Exif) -> bytes:
    first, second = Image.Exif(), Image.Exif()
    first.update({tag: value for tag, value in block.items() if tag not in (0x8769, 0x8825)})
    second.update(block.get_ifd(ExifTags.IFD.Exif))
    inside = box(b"CMT1", directory(first)) + box(b"CMT2", directory(second))
    return box(b"ftyp", b"crx \0\0\0\1") + box(b"moov", box(b"uuid", bytes(16) + inside)) + box(b"mdat", encode(SCENE))


KINDS: dict[str, Any] = {
    "orf": lambda block: tiff_like(b"MMOR", block),
    "rw2": lambda block: tiff_like(b"IIU\0", little_endian(block)),
    "raf": raf,
    "cr3": cr3,
}


def little_endian(block: Image.Exif) -> Image.Exif:
    block.endian = "<"
    return block


@pytest.mark.parametrize("suffix", KINDS)
def test_time_and_exposure_are_read(suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a.{suffix}").write_bytes(KINDS[suffix](camera(1 / 125)))
    metadata, exposure = read_metadata_and_exposure(tmp_path / f"a.{suffix}")
    assert exposure == pytest.approx(200 / 100 / 125 / 64)
    assert (metadata.utc_offset, str(metadata.local_time)) == (2.0, "2024-06-01 11:00:00")


def test_a_dng_without_a_preview_tells_time_and_exposure(tmp_path: Path) -> None:
    """Its first picture is the mosaic, which Pillow does not open."""
    (tmp_path / "a.dng").write_bytes(plain_dng(np.full((8, 12), 9000.0), 16383, taken(1 / 125)))
    metadata, exposure = read_metadata_and_exposure(tmp_path / "a.dng")
    assert exposure == pytest.approx(1 / 125)
    assert (metadata.utc_offset, str(metadata.local_time)) == (2.0, "2024-06-01 11:00:00")


@pytest.mark.parametrize("suffix", KINDS)
def test_the_preview_has_the_metadata_of_its_file(suffix: str) -> None:
    photo = read_photo(KINDS[suffix](camera(1 / 125, orientation=6)))
    assert photo.format == "RAW"
    assert photo.metadata.utc_offset == 2.0
    assert (photo.width, photo.height) == (64, 96)


@pytest.mark.parametrize("suffix", KINDS)
def test_a_changed_exposure_is_seen_by_stereo(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without these cameras' pixels, which no program here writes: the developed ones are the same in all."""
    monkeypatch.setattr(linear, "_develop_raw", lambda *_: (np.full((8, 12, 3), 20_000, np.uint16), 16_383))
    for name, seconds in (("a", 1 / 125), ("b", 1 / 125), ("c", 1 / 60)):
        (tmp_path / f"{name}.{suffix}").write_bytes(KINDS[suffix](camera(seconds)))
    day = [_read_day_photo(tmp_path / f"{name}.{suffix}") for name in "abc"]
    assert day[0].exposure.seconds == pytest.approx(1 / 125)
    _check_same_exposure(day[:2])
    with pytest.raises(PhotoError, match=rf"c\.{suffix} and a\.{suffix} differ in exposure"):
        _check_same_exposure(day)


@pytest.mark.parametrize("suffix", KINDS)
@pytest.mark.parametrize("share", [0.02, 0.1, 0.3, 0.6])
def test_damage_hides_metadata_and_raises_nothing(suffix: str, share: float, tmp_path: Path) -> None:
    data = KINDS[suffix](camera(1 / 125))
    (tmp_path / "a").write_bytes(data[: max(16, int(share * len(data)))])
    read_metadata_and_exposure(tmp_path / "a")
    open_raw_header(data[: max(16, int(share * len(data)))])

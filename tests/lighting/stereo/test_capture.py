"""A day of photos: times, masks, exposure and motion checks."""

import math
from collections.abc import Callable
from datetime import date, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import pytest
from numpy.typing import NDArray
from PIL import Image

from lighting.color import srgb_decode
from lighting.errors import EnvironmentMapError, ParameterError, PhotoError
from lighting.files.exr import write_exr
from lighting.fusion.user_input import UserInput
from lighting.photo.linear import read_linear
from lighting.stereo.camera_motion import check_static_camera, moved_names
from lighting.stereo.capture import _light_varies, _read_day_photo, read_day_photos, read_nearest_skies
from lighting.stereo.light_vectors import (
    CLEAR_TURBIDITY,
    ClockLocation,
    Skies,
    clear_skies,
    modelled_day,
    sun_directions,
)
from lighting.stereo.normal_search import Pose
from tests.helpers.photos import WIDE_PRIMARIES, chunk, display_profile, plain_dng, write_png16
from tests.helpers.skies import JUNE, LATITUDE, ball, gray_blocks, june_suns, photos, write_photo

NOON = datetime(2024, 6, 21, 10)


def fill(folder: Path, count: int = 4, gap: float = 60.0, **tags: Any) -> None:
    for index in range(count):
        write_photo(folder / f"{index}.jpg", gray_blocks(), NOON + timedelta(minutes=gap * index), **tags)


def write_gray(path: Path, values: NDArray[Any]) -> None:
    """Write numbers (H, W) up to 65535 as a PNG of 16 bits."""
    write_png16(path, np.rint(values)[..., None].astype(np.uint16))


def test_a_day_of_jpegs(tmp_path: Path) -> None:
    fill(tmp_path, OffsetTimeOriginal="+02:00")
    shots = read_day_photos(tmp_path, size=32)
    assert shots.images.shape == (4, 32, 32, 3)
    assert shots.times[0] == np.datetime64("2024-06-21T08:00:00")
    assert shots.focal_length == pytest.approx(50.0)
    assert shots.mask.all()
    assert "JPEG" in shots.warnings[0]


def test_cropped_photos_tell_the_lens_of_what_is_left(tmp_path: Path) -> None:
    """The camera noted 96 x 64 pixels, of which 64 x 64 are left: the same lens covers a shorter diagonal."""
    fill(tmp_path, OffsetTimeOriginal="+02:00", ExifImageWidth=96, ExifImageHeight=64)
    full, left = math.hypot(96.0, 64.0), math.hypot(64.0, 64.0)
    assert read_day_photos(tmp_path).focal_length == pytest.approx(50.0 * full / left)


def test_times_and_masks_beside_photos_without_exif(tmp_path: Path) -> None:
    for index in range(3):
        write_gray(tmp_path / f"{index}.png", 60000 * gray_blocks())
    (tmp_path / "times.csv").write_text(
        "file,time\n" + "".join(f"{i}.png,2024-06-21T1{3 - i}:00+00:00\n" for i in range(3))
    )
    inside = np.zeros((64, 64), dtype=np.uint8)
    inside[10:30, 10:30] = 255
    Image.fromarray(inside).save(tmp_path / "mask.png")
    shots = read_day_photos(tmp_path)
    assert shots.names == ("2.png", "1.png", "0.png")  # in the order of their times
    assert shots.mask.sum() == 400
    assert shots.images.shape[-1] == 1


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (None, "is not a mask that can be read."),
        (np.full((64, 32), 255, dtype=np.uint8), "is 32 x 64 pixels; it does not have the photos' shape."),
        (np.zeros((64, 64), dtype=np.uint8), "is black all over; white marks the thing."),
    ],
)
def test_a_mask_that_marks_nothing_is_refused(content: NDArray[np.uint8] | None, sentence: str, tmp_path: Path) -> None:
    for index in range(3):
        write_gray(tmp_path / f"{index}.png", 60000 * gray_blocks())
    (tmp_path / "times.csv").write_text(
        "file,time\n" + "".join(f"{i}.png,2024-06-21T1{3 - i}:00+00:00\n" for i in range(3))
    )
    if content is None:
        (tmp_path / "mask.png").write_text("no picture")
    else:
        Image.fromarray(content).save(tmp_path / "mask.png")
    with pytest.raises(PhotoError, match=sentence):
        read_day_photos(tmp_path)


def test_a_day_of_one_light_and_photos_that_are_only_listed_are_told(tmp_path: Path) -> None:
    for index, strength in enumerate((0.5, 1.0, 0.7)):
        write_gray(tmp_path / f"{index}.png", strength * 60000 * gray_blocks())
    rows = "".join(f"{i}.png,2024-06-21T1{i}:00+00:00\n" for i in range(4))
    (tmp_path / "times.csv").write_text("file,time\n" + rows)
    warnings = read_day_photos(tmp_path).warnings
    assert "times.csv lists 3.png, which is not there." in warnings
    assert any("brightens and darkens alike" in warning for warning in warnings)
    write_gray(tmp_path / "3.png", 60000 * gray_blocks(1))
    assert len(read_day_photos(tmp_path).warnings) == 1


def test_one_photo_is_no_day(tmp_path: Path) -> None:
    fill(tmp_path, 1)
    with pytest.raises(PhotoError, match="holds 1 photo; normals need at least 3"):
        read_day_photos(tmp_path)


def _one_brighter(folder: Path) -> None:
    write_photo(folder / "3.jpg", gray_blocks(), NOON + timedelta(hours=3), seconds=0.02)


def _one_larger(folder: Path) -> None:
    write_photo(folder / "3.jpg", gray_blocks(side=128), NOON + timedelta(hours=3))


def _one_moved(folder: Path) -> None:
    write_photo(folder / "3.jpg", np.roll(gray_blocks(), 5, axis=1), NOON + timedelta(hours=3))


def _one_clipped(folder: Path) -> None:
    write_photo(folder / "3.jpg", np.minimum(2 * gray_blocks(), 1), NOON + timedelta(hours=3))


def _one_undated(folder: Path) -> None:
    write_photo(folder / "3.jpg", gray_blocks(), None)


def _one_same(folder: Path) -> None:
    write_photo(folder / "3.jpg", gray_blocks(), NOON)


def _one_grey(folder: Path) -> None:
    write_photo(folder / "3.jpg", gray_blocks(), NOON + timedelta(hours=3))
    with Image.open(folder / "3.jpg") as photo:
        photo.convert("L").save(folder / "3.jpg", exif=photo.getexif())


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (_one_grey, "one is gray and one in color"),
        (_one_brighter, "differ in exposure"),
        (_one_larger, "differ in size"),
        (_one_moved, "must not move"),
        (_one_clipped, "clipped"),
        (_one_undated, "when it was taken"),
        (_one_same, "times do not differ"),
    ],
)
def test_one_bad_photo_is_named(tmp_path: Path, spoil: Callable[[Path], None], sentence: str) -> None:
    fill(tmp_path, 3)
    spoil(tmp_path)
    with pytest.raises(PhotoError, match=sentence):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0))


def test_other_days_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(PhotoError, match="no folder"):
        read_day_photos(tmp_path / "none")
    fill(tmp_path, 2)
    with pytest.raises(PhotoError, match="at least 3"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0))
    fill(tmp_path, 3, gap=1)
    with pytest.raises(PhotoError, match="over hours"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0))
    fill(tmp_path, 3)
    with pytest.raises(PhotoError, match="--utc-offset"):
        read_day_photos(tmp_path)
    (tmp_path / "times.csv").write_text("file,time\n0.jpg,soon\n")
    with pytest.raises(ParameterError, match="soon"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0))


def test_a_folder_named_like_a_photo_is_none(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    (tmp_path / "out.png").mkdir()
    assert read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0)).names == ("0.jpg", "1.jpg", "2.jpg")


@pytest.mark.parametrize("content", [b"file,time\n\xff,\n", b"file,time\n" + b"a" * 200_000 + b",\n"])
def test_times_that_are_no_table_are_refused(tmp_path: Path, content: bytes) -> None:
    fill(tmp_path, 3)
    (tmp_path / "times.csv").write_bytes(content)
    with pytest.raises(PhotoError, match=r"times\.csv is not a CSV file in UTF-8\.$"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0))


def test_photos_may_be_small_but_not_a_point(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    assert read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0), size=2).images.shape[1:3] == (2, 2)
    with pytest.raises(PhotoError, match="1 x 1 pixels"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0), size=1)


def test_photos_of_two_sizes_are_refused_also_where_they_are_reduced_to_one(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    _one_larger(tmp_path)
    with pytest.raises(PhotoError, match="differ in size"):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0), size=32)


def test_a_photo_that_nothing_is_left_of_is_refused(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    write_photo(tmp_path / "thin.jpg", np.full((300, 1), 0.5), NOON)
    with pytest.raises(
        PhotoError, match=r"^thin\.jpg is reduced to 0 x 100 pixels; normals need 2 or more each way\.$"
    ):
        read_day_photos(tmp_path, user_input=UserInput(utc_offset=0.0), size=100)


def test_16_bit_png_and_exr_come_back_as_they_are(tmp_path: Path) -> None:
    values = np.random.default_rng(0).integers(0, 60000, (20, 40, 3)).astype(np.uint16)
    write_png16(tmp_path / "a.png", values)
    write_exr(tmp_path / "a.exr", (values / 65535).astype(np.float32), compression="none")
    for name in ("a.png", "a.exr"):
        shot = _read_day_photo(tmp_path / name)
        np.testing.assert_allclose(shot.pixels, values / 65535, rtol=1e-6)
        assert not shot.coded
        assert not shot.clipped.any()


def test_16_bit_tiff_of_one_channel(tmp_path: Path) -> None:
    values = np.arange(600, dtype=np.uint16).reshape(20, 30) * 100
    Image.fromarray(values).save(tmp_path / "a.tif")
    np.testing.assert_allclose(_read_day_photo(tmp_path / "a.tif").pixels[..., 0], values / 65535, rtol=1e-6)


def test_a_jpeg_is_decoded_from_srgb_turned_upright_and_its_white_is_clipped(tmp_path: Path) -> None:
    pixels = np.full((32, 64, 3), 188, dtype=np.uint8)
    pixels[:, :32] = 255
    exif = Image.Exif()
    exif[0x0112] = 6  # to be turned clockwise
    Image.fromarray(pixels).save(tmp_path / "a.jpg", quality=95, exif=exif)
    shot = _read_day_photo(tmp_path / "a.jpg")
    assert shot.coded
    assert shot.pixels.shape == (64, 32, 3)
    assert abs(float(shot.pixels[50, 16, 1]) - 0.5029) < 0.02  # sRGB's 188 is half of white, IEC 61966-2-1
    assert shot.clipped[:24].all()
    assert not shot.clipped[40:].any()


def test_16_bits_that_say_they_are_coded_are_refused_unless_told(tmp_path: Path) -> None:
    write_png16(tmp_path / "a.png", np.full((8, 8, 3), 30000, np.uint16))
    data = (tmp_path / "a.png").read_bytes()
    (tmp_path / "a.png").write_bytes(data[:33] + chunk(b"sRGB", b"\0") + data[33:])
    with pytest.raises(PhotoError, match="gamma-coded"):
        _read_day_photo(tmp_path / "a.png")
    assert abs(float(_read_day_photo(tmp_path / "a.png", "linear").pixels[0, 0, 0]) - 30000 / 65535) < 1e-6
    assert _read_day_photo(tmp_path / "a.png", "srgb").pixels[0, 0, 0] < 0.2


def test_a_photo_has_the_values_that_a_sky_probe_has(tmp_path: Path) -> None:
    """Wide primaries and what counts as clipped were passed over, for photos of a day had a reader of their own."""
    colours = np.full((8, 8, 3), (60, 90, 140), dtype=np.uint8)
    colours[0] = 252
    Image.fromarray(colours).save(tmp_path / "a.png", icc_profile=display_profile("Wide", WIDE_PRIMARIES))
    shot, photo = _read_day_photo(tmp_path / "a.png"), read_linear(tmp_path / "a.png")
    assert np.array_equal(shot.pixels, photo.pixels)
    assert np.abs(shot.pixels[4, 4] - srgb_decode(colours[4, 4] / 255.0)).max() > 0.02
    assert shot.clipped[0].all()
    assert not shot.clipped[1:].any()


def test_grey_stays_one_channel(tmp_path: Path) -> None:
    Image.fromarray(np.full((8, 8), 90, dtype=np.uint8)).save(tmp_path / "a.png")
    assert _read_day_photo(tmp_path / "a.png").pixels.shape == (8, 8, 1)


@pytest.mark.needs("rawpy")
def test_raw_photos_keep_one_unit_whatever_their_brightest_pixel(tmp_path: Path) -> None:
    ramp = np.tile(np.linspace(100, 16000, 200), (80, 1))
    for name, part in (("noon", 1.0), ("evening", 0.8)):
        (tmp_path / f"{name}.dng").write_bytes(plain_dng(ramp * part, white=16383))
        pixels = _read_day_photo(tmp_path / f"{name}.dng").pixels[8:-8, 8:-8]
        expected = np.repeat((ramp * part / 16383)[8:-8, 8:-8, None], 3, axis=-1)
        assert pixels == pytest.approx(expected, abs=0.003)  # half a step of the ramp, as in test_linear


@pytest.mark.parametrize("name", ["a.png", "a.jpg", "a.tif", "a.dng"])
def test_what_is_no_photo_ends_in_a_sentence(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"nothing of the kind")
    with pytest.raises(PhotoError, match=name):
        _read_day_photo(tmp_path / name)


def test_a_bad_exr_is_named(tmp_path: Path) -> None:
    OpenEXR.File({}, {"Y": np.ones((8, 8), np.float32)}).write(str(tmp_path / "depth.exr"))
    with pytest.raises(PhotoError, match=r"^depth\.exr: The EXR file has no channel R, G, B"):
        _read_day_photo(tmp_path / "depth.exr")


def test_an_exr_with_values_that_are_not_finite_is_refused(tmp_path: Path) -> None:
    pixels = np.ones((4, 8, 3), np.float32)
    pixels[1, 2] = np.nan
    write_exr(tmp_path / "spoiled.exr", pixels)
    with pytest.raises(PhotoError, match=r"^spoiled\.exr: .* not finite"):
        _read_day_photo(tmp_path / "spoiled.exr")


def fill_probes(folder: Path) -> None:
    """Probes at 10, 10:30 and 11 h, each brighter than the one before."""
    for level, name in enumerate(("100000", "103000", "110000"), 1):
        (folder / "20260621" / name).mkdir(parents=True)
        image = np.full((8, 16, 3), level, dtype=np.float32)
        image[2, 8] = 1000
        write_exr(folder / "20260621" / name / "envmap.exr", image)


def test_each_photo_gets_the_nearest_probe(tmp_path: Path) -> None:
    fill_probes(tmp_path)
    times = np.array(["2026-06-21T10:56", "2026-06-21T10:03", "2026-06-21T10:28"], dtype="datetime64[us]")
    skies = read_nearest_skies(tmp_path, times, 0.0)
    np.testing.assert_allclose(skies.radiance[:, -1].mean(axis=(1, 2)), [3, 1, 2], rtol=1e-3)
    earlier = np.asarray(times - np.timedelta64(2, "h"), dtype="datetime64[us]")
    shifted = read_nearest_skies(tmp_path, earlier, 2.0)  # the folders tell a clock at UTC+2
    np.testing.assert_allclose(shifted.radiance, skies.radiance)


def test_a_photo_without_a_probe_near_is_named(tmp_path: Path) -> None:
    fill_probes(tmp_path)
    with pytest.raises(EnvironmentMapError, match="within 10 minutes of 2026-06-21 10:15"):
        read_nearest_skies(tmp_path, np.array(["2026-06-21T10:15"], dtype="datetime64[us]"), 0.0)


NAMES = ["a", "b"]


def shaded_blocks() -> NDArray[np.float32]:
    return np.asarray(np.kron(np.random.default_rng(0).uniform(0.1, 0.7, (12, 16)), np.ones((8, 8))), dtype=np.float32)


def test_other_light_from_the_same_place_passes() -> None:
    ramp = np.linspace(0.3, 1.0, 128, dtype=np.float32)
    check_static_camera(np.stack([shaded_blocks() * ramp, shaded_blocks() * ramp[::-1]]), NAMES)


@pytest.mark.parametrize("shift", [(0, 4), (3, 0), (-4, 5)])
def test_a_camera_that_moved_is_named(shift: tuple[int, int]) -> None:
    with pytest.raises(PhotoError, match="b is shifted by"):
        check_static_camera(np.stack([shaded_blocks(), np.roll(shaded_blocks(), shift, axis=(0, 1))]), NAMES)


def test_pictures_without_edges_say_nothing() -> None:
    check_static_camera(np.ones((2, 64, 64), np.float32), NAMES)


def clear(times: np.ndarray = JUNE) -> Skies:
    return clear_skies(sun_directions(times, LATITUDE, 0.0), CLEAR_TURBIDITY, 0.3, 32)


def overcast() -> Skies:
    """Eight skies of an overcast day in June."""
    skies = modelled_day(ClockLocation(LATITUDE, 0.0, 0.0), date(2024, 6, 21), "overcast", coarse=True).skies
    return skies.at(np.linspace(0, len(skies) - 1, 8).astype(np.intp))


@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_a_clear_day_is_varied_and_an_overcast_one_is_not(noise: float) -> None:
    normals, mask, _ = ball()
    assert _light_varies(photos(normals, mask, clear(), Pose(), noise), mask)
    assert not _light_varies(photos(normals, mask, overcast(), Pose(), noise), mask)


def test_two_hours_of_a_clear_day_are_varied() -> None:
    normals, mask, _ = ball()
    times = JUNE[1] + np.arange(8) * np.timedelta64(17, "m")
    assert _light_varies(photos(normals, mask, clear(times), Pose()), mask)


def test_what_is_flat_is_not_varied_under_any_light() -> None:
    normals = np.broadcast_to(np.array([0.0, 0.6, 0.8], dtype=np.float32), (20, 20, 3))
    mask = np.ones((20, 20), dtype=bool)
    assert not _light_varies(photos(normals, mask, clear(), Pose()), mask)
    assert not _light_varies(np.zeros((3, 20, 20, 1), dtype=np.float32), mask)
    assert not _light_varies(np.ones((3, 20, 20, 1), dtype=np.float32), ~mask)


@pytest.mark.parametrize(("down", "right", "seen"), [(0, 0, False), (0, 1, True), (-1, 0, True), (3, -2, True)])
def test_a_camera_that_moved_by_a_pixel_is_seen(down: int, right: int, seen: bool) -> None:
    normals, mask, _ = ball(160)
    light = photos(normals, mask, clear_skies(june_suns()[[0, 3, 6]]), Pose())[..., 0]
    images = light + 0.3 * gray_blocks(side=160) * ~mask
    images[2] = np.roll(images[2], (down, right), axis=(0, 1))
    assert moved_names(images.astype(np.float32), ("a", "b", "c")) == (["c"] if seen else [])


def test_a_stated_offset_wins_over_the_files_and_says_so(tmp_path: Path) -> None:
    fill(tmp_path, 3, OffsetTimeOriginal="+02:00")
    shots = read_day_photos(tmp_path, user_input=UserInput(utc_offset=1.0))
    assert shots.times[0] == np.datetime64("2024-06-21T09:00:00")
    assert "+01:00, replaced the file's, +02:00" in shots.warnings[0]


def test_a_clock_without_an_offset_is_of_the_zone_of_the_place(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    shots = read_day_photos(tmp_path, user_input=UserInput(latitude=48.14, longitude=11.58))
    assert shots.times[0] == np.datetime64("2024-06-21T08:00:00")


def test_one_photo_tells_the_offset_of_all(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    write_photo(tmp_path / "1.jpg", gray_blocks(), NOON + timedelta(hours=1), OffsetTimeOriginal="+05:00")
    assert read_day_photos(tmp_path).times[0] == np.datetime64("2024-06-21T05:00:00")

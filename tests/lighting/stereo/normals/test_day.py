"""Folders of a day: what is read, and one sentence for each way in which photos cannot be used."""

from collections.abc import Callable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import ParameterError, PhotoError
from lighting.stereo.normals.day import read_shots
from lighting.stereo.normals.files import write_png16

NOON = datetime(2024, 6, 21, 10)


def scene(seed: int = 0, side: int = 64) -> NDArray[Any]:
    """Blocks of several greys, which have edges whatever the light."""
    return np.asarray(np.kron(np.random.default_rng(seed).uniform(0.1, 0.7, (side // 8, side // 8)), np.ones((8, 8))))


def jpeg(path: Path, picture: NDArray[Any], time: datetime | None, seconds: float = 0.01, **tags: Any) -> None:
    exif = Image.Exif()
    camera = exif.get_ifd(ExifTags.IFD.Exif)
    if time is not None:
        camera[ExifTags.Base.DateTimeOriginal] = f"{time:%Y:%m:%d %H:%M:%S}"
    camera[ExifTags.Base.ExposureTime] = seconds
    camera[ExifTags.Base.FocalLengthIn35mmFilm] = 50
    for name, value in tags.items():
        camera[ExifTags.Base[name]] = value
    pixels = np.repeat((picture * 255).astype(np.uint8)[..., None], 3, axis=-1)
    Image.fromarray(pixels).save(path, exif=exif, quality=95)


def fill(folder: Path, count: int = 4, gap: float = 60.0, **tags: Any) -> None:
    for index in range(count):
        jpeg(folder / f"{index}.jpg", scene(), NOON + timedelta(minutes=gap * index), **tags)


def test_a_day_of_jpegs(tmp_path: Path) -> None:
    fill(tmp_path, OffsetTimeOriginal="+02:00")
    shots = read_shots(tmp_path, size=32)
    assert shots.images.shape == (4, 32, 32, 3)
    assert shots.times[0] == np.datetime64("2024-06-21T08:00:00")
    assert shots.focal_length == 50
    assert shots.mask.all()
    assert "JPEG" in shots.warnings[0]


def test_cropped_photos_tell_no_lens(tmp_path: Path) -> None:
    """The camera noted 96 x 64 pixels, of which 64 x 64 are left: the diagonal is no longer the lens's."""
    fill(tmp_path, OffsetTimeOriginal="+02:00", ExifImageWidth=96, ExifImageHeight=64)
    assert read_shots(tmp_path).focal_length is None


def test_times_and_masks_beside_photos_without_exif(tmp_path: Path) -> None:
    for index in range(3):
        write_png16(tmp_path / f"{index}.png", 60000 * scene()[..., None])
    (tmp_path / "times.csv").write_text(
        "file,time\n" + "".join(f"{i}.png,2024-06-21T1{3 - i}:00+00:00\n" for i in range(3))
    )
    inside = np.zeros((64, 64), dtype=np.uint8)
    inside[10:30, 10:30] = 255
    Image.fromarray(inside).save(tmp_path / "mask.png")
    shots = read_shots(tmp_path)
    assert shots.names == ("2.png", "1.png", "0.png")  # in the order of their times
    assert shots.mask.sum() == 400
    assert shots.images.shape[-1] == 1


def test_a_day_of_one_light_and_photos_that_are_only_listed_are_told(tmp_path: Path) -> None:
    for index, strength in enumerate((0.5, 1.0, 0.7)):
        write_png16(tmp_path / f"{index}.png", strength * 60000 * scene()[..., None])
    rows = "".join(f"{i}.png,2024-06-21T1{i}:00+00:00\n" for i in range(4))
    (tmp_path / "times.csv").write_text("file,time\n" + rows)
    warnings = read_shots(tmp_path).warnings
    assert "times.csv lists 3.png, which is not there." in warnings
    assert any("brightens and darkens alike" in warning for warning in warnings)
    write_png16(tmp_path / "3.png", 60000 * scene(1)[..., None])
    assert len(read_shots(tmp_path).warnings) == 1


def test_one_photo_is_no_day(tmp_path: Path) -> None:
    fill(tmp_path, 1)
    with pytest.raises(PhotoError, match="holds 1 photo; normals need at least 3"):
        read_shots(tmp_path)


def _one_brighter(folder: Path) -> None:
    jpeg(folder / "3.jpg", scene(), NOON + timedelta(hours=3), seconds=0.02)


def _one_larger(folder: Path) -> None:
    jpeg(folder / "3.jpg", scene(side=128), NOON + timedelta(hours=3))


def _one_moved(folder: Path) -> None:
    jpeg(folder / "3.jpg", np.roll(scene(), 5, axis=1), NOON + timedelta(hours=3))


def _one_clipped(folder: Path) -> None:
    jpeg(folder / "3.jpg", np.minimum(2 * scene(), 1), NOON + timedelta(hours=3))


def _one_undated(folder: Path) -> None:
    jpeg(folder / "3.jpg", scene(), None)


def _one_same(folder: Path) -> None:
    jpeg(folder / "3.jpg", scene(), NOON)


def _one_grey(folder: Path) -> None:
    jpeg(folder / "3.jpg", scene(), NOON + timedelta(hours=3))
    with Image.open(folder / "3.jpg") as photo:
        photo.convert("L").save(folder / "3.jpg", exif=photo.getexif())


@pytest.mark.parametrize(
    ("spoil", "sentence"),
    [
        (_one_grey, "one is grey and one in colour"),
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
        read_shots(tmp_path, utc_offset=0.0)


def test_other_days_that_cannot_be_used(tmp_path: Path) -> None:
    with pytest.raises(PhotoError, match="no folder"):
        read_shots(tmp_path / "none")
    fill(tmp_path, 2)
    with pytest.raises(PhotoError, match="at least 3"):
        read_shots(tmp_path, utc_offset=0.0)
    fill(tmp_path, 3, gap=1)
    with pytest.raises(PhotoError, match="over hours"):
        read_shots(tmp_path, utc_offset=0.0)
    fill(tmp_path, 3)
    with pytest.raises(PhotoError, match="--utc-offset"):
        read_shots(tmp_path)
    (tmp_path / "times.csv").write_text("file,time\n0.jpg,soon\n")
    with pytest.raises(ParameterError, match="soon"):
        read_shots(tmp_path, utc_offset=0.0)


def test_a_folder_named_like_a_photo_is_none(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    (tmp_path / "out.png").mkdir()
    assert read_shots(tmp_path, utc_offset=0.0).names == ("0.jpg", "1.jpg", "2.jpg")


@pytest.mark.parametrize("content", [b"file,time\n\xff,\n", b"file,time\n" + b"a" * 200_000 + b",\n"])
def test_times_that_are_no_table_are_refused(tmp_path: Path, content: bytes) -> None:
    fill(tmp_path, 3)
    (tmp_path / "times.csv").write_bytes(content)
    with pytest.raises(PhotoError, match=r"times\.csv is not a CSV file in UTF-8\.$"):
        read_shots(tmp_path, utc_offset=0.0)


def test_photos_may_be_small_but_not_a_point(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    assert read_shots(tmp_path, utc_offset=0.0, size=2).images.shape[1:3] == (2, 2)
    with pytest.raises(PhotoError, match="1 x 1 pixels"):
        read_shots(tmp_path, utc_offset=0.0, size=1)


def test_photos_of_two_sizes_are_refused_also_where_they_are_reduced_to_one(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    _one_larger(tmp_path)
    with pytest.raises(PhotoError, match="differ in size"):
        read_shots(tmp_path, utc_offset=0.0, size=32)


def test_a_photo_that_nothing_is_left_of_is_refused(tmp_path: Path) -> None:
    fill(tmp_path, 3)
    jpeg(tmp_path / "thin.jpg", np.full((300, 1), 0.5), NOON)
    with pytest.raises(
        PhotoError, match=r"^thin\.jpg is reduced to 0 x 100 pixels; normals need 2 or more each way\.$"
    ):
        read_shots(tmp_path, utc_offset=0.0, size=100)

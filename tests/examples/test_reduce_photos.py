"""The photographs among the examples: their EXIF is kept, and each has a small copy for the page."""

from pathlib import Path

from PIL import ExifTags, Image

from examples.reduce_photos import HERE, PHOTOS, SHOWN, THUMB, reduce_photo, thumbnail
from tests.conftest import encode, exif, scene

LARGEST = 250_000  # bytes of one example that the page offers


def test_the_photographs_say_when_they_were_taken() -> None:
    for name in PHOTOS:
        with Image.open(HERE / "rome" / name) as photo:
            camera = photo.getexif().get_ifd(ExifTags.IFD.Exif)
        assert camera[ExifTags.Base.DateTimeOriginal].startswith("2024:08:10")


def test_every_example_of_the_page_has_a_small_copy() -> None:
    for shown in SHOWN:
        with Image.open(HERE / "thumbs" / Path(shown).name) as picture:
            assert picture.size == THUMB
            assert not picture.getexif()


def test_an_example_of_the_page_is_small() -> None:
    for shown in SHOWN:
        assert (HERE / shown).stat().st_size < LARGEST


def test_reducing_keeps_size_and_exif(tmp_path: Path) -> None:
    taken = exif(camera={ExifTags.Base.DateTimeOriginal: "2024:08:10 12:00:00"})
    (tmp_path / "a.jpg").write_bytes(encode(scene(320, 240), exif=taken, quality=95))
    reduce_photo(tmp_path / "a.jpg", tmp_path / "b.jpg")
    thumbnail(tmp_path / "a.jpg", tmp_path / "c.jpg")
    with Image.open(tmp_path / "b.jpg") as photo, Image.open(tmp_path / "c.jpg") as small:
        assert photo.size == (320, 240)
        assert photo.getexif().get_ifd(ExifTags.IFD.Exif)[ExifTags.Base.DateTimeOriginal] == "2024:08:10 12:00:00"
        assert small.size == THUMB

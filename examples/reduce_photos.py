"""Reduce photographs that were given for the project, and make the small pictures that the page shows of examples.

    python examples/reduce_photos.py FOLDER

FOLDER holds the photographs of `PHOTOS` and `LARGE` under their own names. Writes them and `thumbs/` here.
Those of `PHOTOS` keep their size and their EXIF; those of `LARGE` are made smaller.
"""

import argparse
from pathlib import Path

from PIL import Image, ImageOps

HERE = Path(__file__).parent
PHOTOS = {  # name here: name there
    "noon_steps.jpg": "rome_0174.jpg",
    "golden_hour.jpg": "rome_0617.jpg",
    "street_in_shade.jpg": "rome_0511.jpg",
    "afternoon_square.jpg": "rome_0477.jpg",
}
PAGE = ("brick_street.jpg", "garden_windows.jpg", "lake_clouds.jpg", "shore_dusk.jpg")
LARGE = (*PAGE, "beach_storm.jpg", "meadow_edge.jpg", "beach_evening.jpg")
LARGE_SIZE = (1600, 1200)
LARGE_QUALITY = 75
QUALITY = 82
THUMB = (240, 180)
THUMB_QUALITY = 72
SHOWN = (*PAGE, "rome/golden_hour.jpg", "rome/afternoon_square.jpg")


def reduce_photo(source: Path, target: Path) -> None:
    """The same pixels at a lower quality, with the EXIF as it was."""
    with Image.open(source) as photo:
        photo.save(target, "JPEG", quality=QUALITY, optimize=True, exif=photo.getexif())


def shrink_photo(source: Path, target: Path) -> None:
    """The photo within LARGE_SIZE, without metadata."""
    with Image.open(source) as photo:
        small = ImageOps.contain(ImageOps.exif_transpose(photo).convert("RGB"), LARGE_SIZE, Image.Resampling.LANCZOS)
    small.save(target, "JPEG", quality=LARGE_QUALITY, optimize=True, progressive=True)


def thumbnail(source: Path, target: Path) -> None:
    """A cut of 240 x 180 pixels from the photo's middle, without metadata."""
    with Image.open(source) as photo:
        small = ImageOps.fit(ImageOps.exif_transpose(photo).convert("RGB"), THUMB, Image.Resampling.LANCZOS)
    small.save(target, "JPEG", quality=THUMB_QUALITY, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    for name, original in PHOTOS.items():
        reduce_photo(folder / original, HERE / "rome" / name)
    for name in LARGE:
        shrink_photo(folder / name, HERE / name)
    for shown in SHOWN:
        thumbnail(HERE / shown, HERE / "thumbs" / Path(shown).name)


if __name__ == "__main__":
    main()

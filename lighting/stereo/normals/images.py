"""One photo as linear values, with what its EXIF block says of the moment and the exposure.

RAW (rawpy), 16-bit PNG and TIFF and EXR hold linear values; JPEG and 8-bit PNG are taken to be coded in sRGB, which a
camera's own curve only resembles.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.errors import EnvironmentMapError, PhotoError
from lighting.files import read_exr
from lighting.photo import RAW_SUFFIXES, Curve, PhotoFacts, read_linear

Pixels = NDArray[np.float32]

FORMATS = (*RAW_SUFFIXES, ".exr", ".jpeg", ".jpg", ".png", ".tif", ".tiff")


@dataclass(frozen=True)
class Exposure:
    """What a camera noted of how it took a photo; None is unknown."""

    seconds: float | None = None
    aperture: float | None = None  # f-number
    sensitivity: float | None = None  # ISO
    focal_length: float | None = None  # mm, of the lens itself


@dataclass(frozen=True, eq=False)
class Shot:
    """A photo of a day."""

    name: str
    pixels: Pixels  # (H, W, C), linear, white is 1; C is 1 or 3
    clipped: NDArray[np.bool_]  # (H, W), whether a channel is at white
    coded: bool  # whether a curve was taken off
    shape: tuple[int, int]  # rows and columns of the file, however far the pixels are reduced
    facts: PhotoFacts = field(default_factory=PhotoFacts)
    exposure: Exposure = Exposure()


def read_shot(path: Path, curve: Curve | None = None) -> Shot:
    """The photo in a file; `curve` says how its values are coded where the file is not to be believed.

    Raises PhotoError for a file that cannot be read, that needs a package that is missing, or whose 16-bit values say
    that they are gamma-coded while no curve is given.
    """
    if path.suffix.lower() != ".exr":
        return _read_photo(path, curve)
    try:
        return _read_exr(path)
    except (EnvironmentMapError, PhotoError) as error:
        raise PhotoError(f"{path.name}: {error}") from error


def read_mask(file: Path) -> Image.Image:
    """A mask as a picture of grey values; PhotoError where it cannot be read."""
    try:
        return Image.open(file).convert("L")
    except Exception as error:  # Pillow raises nearly anything on hostile bytes
        raise PhotoError(f"{file} is not a mask that can be read.") from error


def _read_exr(path: Path) -> Shot:
    pixels = read_exr(path)[0]
    if not np.isfinite(pixels).all():
        raise PhotoError("The picture holds values that are not finite numbers.")
    shape = pixels.shape[0], pixels.shape[1]
    return Shot(path.name, pixels, np.zeros(shape, dtype=bool), coded=False, shape=shape)


def _read_photo(path: Path, curve: Curve | None) -> Shot:
    photo = read_linear(path, curve, turned=True)
    if photo.doubtful:
        raise PhotoError(
            f"{path}: The file says that its values are gamma-coded; export linear values, or say --curve linear or "
            "srgb."
        )
    pixels = np.ascontiguousarray(photo.pixels[..., :1] if photo.grey else photo.pixels)
    clipped = np.asarray((pixels >= photo.white).any(axis=-1))
    shape = pixels.shape[0], pixels.shape[1]
    return Shot(path.name, pixels, clipped, photo.coded, shape, photo.facts, _exposure(path))


def _exposure(path: Path) -> Exposure:
    try:
        with Image.open(path, formats=["JPEG", "PNG", "TIFF"]) as header:
            tags = dict(header.getexif().get_ifd(ExifTags.IFD.Exif))
    except Exception:  # EXIF is hostile input
        return Exposure()
    base = ExifTags.Base
    names = (base.ExposureTime, base.FNumber, base.ISOSpeedRatings, base.FocalLength)
    return Exposure(*(_number(tags.get, name) for name in names))


def _number(get: Callable[[int], Any], tag: int) -> float | None:
    try:
        value = float(get(tag))
    except (ArithmeticError, TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value > 0 else None

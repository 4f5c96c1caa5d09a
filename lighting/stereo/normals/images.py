"""One photo as linear values, with what its EXIF block says of the moment and the exposure.

RAW (rawpy), 16-bit PNG and TIFF (OpenCV) and EXR hold linear values; JPEG and 8-bit PNG are taken to be coded in sRGB,
which a camera's own curve only resembles.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image

from lighting.colour import srgb_decode
from lighting.errors import EnvironmentMapError, PhotoError, PhotoExtraError
from lighting.files import read_exr
from lighting.photo import RAW_SUFFIXES, Curve, PhotoFacts, develop_raw, read_facts, read_orientation, says_gamma

Pixels = NDArray[np.float32]

FORMATS = (*RAW_SUFFIXES, ".exr", ".jpeg", ".jpg", ".png", ".tif", ".tiff")

_CLIPPED = 0.995  # of white, from where on a value counts as clipped
_TURNS = {3: 2, 6: 3, 8: 1}  # EXIF orientation: quarters of a turn counter-clockwise that make a picture upright


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
    try:
        return _read(path, curve)
    except (EnvironmentMapError, PhotoError) as error:
        raise PhotoError(f"{path.name}: {error}") from error


def read_mask(file: Path) -> Image.Image:
    """A mask as a picture of grey values; PhotoError where it cannot be read."""
    try:
        return Image.open(file).convert("L")
    except Exception as error:  # Pillow raises nearly anything on hostile bytes
        raise PhotoError(f"{file} is not a mask that can be read.") from error


def _read(path: Path, curve: Curve | None) -> Shot:
    suffix, data = path.suffix.lower(), path.read_bytes()
    if suffix == ".exr":
        pixels = read_exr(BytesIO(data))[0]
        if not np.isfinite(pixels).all():
            raise PhotoError("The picture holds values that are not finite numbers.")
        shape = pixels.shape[0], pixels.shape[1]
        return Shot(path.name, pixels, np.zeros(shape, dtype=bool), coded=False, shape=shape)
    header = _header(data)
    if suffix in RAW_SUFFIXES:
        return _shot(path.name, develop_raw(data, "The file", upright=True)[0], header, coded=False)
    values = _decoded(data)
    coded = _is_coded(values, header, curve)
    orientation = None if header is None else read_orientation(header)
    values = np.rot90(values, _TURNS.get(orientation or 1, 0))
    return _shot(path.name, values, header, coded=coded)


def _shot(name: str, values: NDArray[Any], header: Image.Image | None, *, coded: bool) -> Shot:
    share = values.astype(np.float32) / np.float32(np.iinfo(values.dtype).max)
    pixels = share if share.ndim == 3 else share[..., None]
    clipped = np.asarray((pixels >= _CLIPPED).any(axis=-1))
    linear = np.ascontiguousarray(srgb_decode(pixels) if coded else pixels, dtype=np.float32)
    height, width = linear.shape[:2]
    if header is None:
        return Shot(name, linear, clipped, coded, (height, width))
    facts = read_facts(header, width, height)
    return Shot(name, linear, clipped, coded, (height, width), facts, _exposure(header))


def _header(data: bytes) -> Image.Image | None:
    """The file as Pillow opens it, for its EXIF block; None where it cannot."""
    try:
        return Image.open(BytesIO(data), formats=["JPEG", "PNG", "TIFF"])
    except Exception:  # Pillow raises nearly anything on hostile bytes
        return None


def _decoded(data: bytes) -> NDArray[Any]:
    """Values as stored, 8 or 16 bits, (H, W) or (H, W, 3) as red, green, blue."""
    try:
        import cv2
    except ImportError as error:
        raise PhotoExtraError("Photos of 16 bits need OpenCV: pip install 'outdoor-lighting[stereo]'.") from error
    values = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED) if data else None
    if values is None or values.dtype not in (np.uint8, np.uint16):
        raise PhotoError("The file is not a photo of 8 or 16 bits that can be read.")
    return np.asarray(values if values.ndim == 2 else values[..., [2, 1, 0]])


def _is_coded(values: NDArray[Any], header: Image.Image | None, curve: Curve | None) -> bool:
    """Whether a curve is to be taken off."""
    if curve is not None:
        return curve == "srgb"
    if values.dtype == np.uint8:
        return True
    if header is not None and says_gamma(header):
        raise PhotoError(
            "The file says that its values are gamma-coded; export linear values, or say --curve linear or srgb."
        )
    return False


def _exposure(header: Image.Image) -> Exposure:
    try:
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

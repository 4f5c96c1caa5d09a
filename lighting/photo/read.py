"""Bytes to upright sRGB pixels.

What is read: JPEG, PNG, WebP, and HEIC where pillow-heif is installed (extra `heif`). Everything ends as 8-bit sRGB:
16-bit samples are scaled, embedded colour profiles are converted, transparent parts become mid-grey, and of an
animation or a series the first picture counts. A damaged EXIF block or colour profile never rejects a photo.
"""

import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import lru_cache
from io import BytesIO
from math import ceil
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageCms, UnidentifiedImageError

from lighting.errors import PhotoError, PhotoTooLargeError
from lighting.photo.exif import PhotoFacts, read_facts
from lighting.photo.jpeg import check_scans
from lighting.photo.memory import admitted

Source = str | os.PathLike[str] | bytes | BinaryIO

MAX_BYTES = 64_000_000
MAX_PIXELS = 128_000_000  # lets the 108-megapixel photos of phones pass
MOST_PIXELS = 178_000_000  # that Pillow opens at all
TARGET = 448  # pixels along the longer side, twice what the network sees
MIN_SIDE = 32  # pixels
MAX_ASPECT = 8  # longer side / shorter side

_HEIC_BRANDS = (b"heic", b"heix", b"heim", b"heis", b"hevc", b"hevx", b"hevm", b"hevs", b"mif1", b"msf1")
_CHUNK = 1 << 22  # bytes read at once, so that small files need no buffer of the limit's size
_STRIP = 1 << 22  # pixels converted at once
_MID_GREY = (128, 128, 128, 255)
_UPRIGHT = {  # EXIF orientation: what makes the picture upright
    2: Image.Transpose.FLIP_LEFT_RIGHT,
    3: Image.Transpose.ROTATE_180,
    4: Image.Transpose.FLIP_TOP_BOTTOM,
    5: Image.Transpose.TRANSPOSE,
    6: Image.Transpose.ROTATE_270,
    7: Image.Transpose.TRANSVERSE,
    8: Image.Transpose.ROTATE_90,
}


@dataclass(frozen=True, eq=False)
class Photo:
    """An upright photo."""

    pixels: NDArray[np.uint8]  # (h, w, 3) sRGB, perhaps smaller than the photo in the file
    width: int  # of the upright photo in the file, pixels
    height: int
    format: str  # "JPEG", "MPO" (a JPEG with further pictures behind it), "PNG", "WEBP" or "HEIF"
    facts: PhotoFacts = field(default_factory=PhotoFacts)  # what its EXIF block says


def read_photo(
    source: Source, *, max_bytes: int = MAX_BYTES, max_pixels: int = MAX_PIXELS, target: int | None = TARGET
) -> Photo:
    """The photo in a file, in bytes or in a binary stream.

    Its longer side keeps at least `target` pixels if it has them, and rarely twice as many; None keeps them all.
    Raises PhotoTooLargeError over `max_bytes` or `max_pixels` (at most MOST_PIXELS; fewer for kinds of picture whose
    decoder needs more memory, see `memory.py`), PhotoError for what is not a photo of at least 32 pixels each way and
    of an aspect ratio up to 8:1, OSError for a file that cannot be opened.
    """
    data = photo_data(source, max_bytes)
    try:
        image = _open(data, max_pixels)
        width, height = image.size
        pixels, turned = _decode(image, target or max(image.size))
    except PhotoError:
        raise
    except Exception as error:  # decoders raise nearly anything on hostile bytes
        raise PhotoError(f"The photo is damaged or cut short ({_reason(error)}).") from error
    width, height = (height, width) if turned else (width, height)
    with _no_warnings():
        facts = read_facts(image, width, height)
    return Photo(pixels, width, height, str(image.format), facts)


def photo_data(source: Source, max_bytes: int = MAX_BYTES) -> bytes:
    """What a file or a binary stream holds; PhotoError where that is nothing, PhotoTooLargeError over `max_bytes`."""
    if isinstance(source, str | os.PathLike):
        with Path(source).open("rb") as stream:
            return photo_data(stream, max_bytes)
    data = source if isinstance(source, bytes) else _drain(source, max_bytes + 1)
    if len(data) > max_bytes:
        raise PhotoTooLargeError(f"The photo is larger than the limit of {max_bytes / 1e6:g} MB.")
    if not data:
        raise PhotoError("The photo is empty.")
    return data


def _drain(stream: BinaryIO, limit: int) -> bytes:
    chunks: list[bytes] = []
    while limit > 0 and (chunk := stream.read(min(limit, _CHUNK))):
        chunks.append(chunk)
        limit -= len(chunk)
    return b"".join(chunks)


def _open(data: bytes, max_pixels: int) -> Image.Image:
    """The image with its header read and its size found acceptable, before anything is decoded."""
    formats = ["JPEG", "PNG", "WEBP"]
    if data[4:8] == b"ftyp" and data[8:12] in _HEIC_BRANDS:
        formats = [_heif_format()]
    check_scans(data)
    try:
        with _no_warnings():
            image = Image.open(BytesIO(data), formats=formats)
    except UnidentifiedImageError as error:
        raise PhotoError("The file is not a JPEG, PNG, WebP or HEIC photo that can be read.") from error
    except Image.DecompressionBombError as error:
        raise PhotoTooLargeError(_too_many("The photo", min(max_pixels, MOST_PIXELS))) from error
    _check_size(*image.size, *admitted(image, data, max_pixels))
    return image


@lru_cache(maxsize=1)
def _heif_format() -> str:
    try:
        import pillow_heif
    except ImportError as error:
        raise PhotoError("HEIC photos need pillow-heif: pip install 'outdoor-lighting[heif]'.") from error
    pillow_heif.register_heif_opener()
    return "HEIF"


def _too_many(photo: str, limit: int) -> str:
    return f"{photo} has more than its limit of {limit / 1e6:g} million pixels."


def _check_size(width: int, height: int, limit: int, kind: str) -> None:
    if width * height > limit:
        raise PhotoTooLargeError(_too_many(f"The {kind} of {width} x {height} pixels", limit))
    if min(width, height) < MIN_SIDE:
        raise PhotoError(f"The photo is {width} x {height} pixels; each side must have at least {MIN_SIDE}.")
    if max(width, height) > MAX_ASPECT * min(width, height):
        raise PhotoError(f"The photo is {width} x {height} pixels; one side may be {MAX_ASPECT} times the other.")


def _decode(image: Image.Image, target: int) -> tuple[NDArray[np.uint8], bool]:
    """Upright pixels (h, w, 3), and whether width and height changed places."""
    scale = min(1.0, target / max(image.size))
    image.draft(None, (ceil(image.width * scale), ceil(image.height * scale)))
    image.load()
    orientation = _orientation(image)
    small = _reduced(image, max(image.size) // target)
    opaque = _over_grey(small) if small.mode == "RGBA" else small
    rgb = _srgb(opaque, image.info.get("icc_profile"))
    upright = rgb.transpose(_UPRIGHT[orientation]) if orientation in _UPRIGHT else rgb
    return np.asarray(upright), orientation in (5, 6, 7, 8)


def _orientation(image: Image.Image) -> object:
    try:
        with _no_warnings():
            value = image.getexif().get(ExifTags.Base.Orientation)
            return value if isinstance(value, int) else None
    except Exception:  # EXIF is hostile input
        return None


def _reduced(image: Image.Image, factor: int) -> Image.Image:
    """The picture in `_eight_bits`, each side divided by the factor and rounded up.

    Strip by strip: conversions of a whole large picture would take several times its memory.
    """
    if factor <= 1:
        return _eight_bits(image)
    rows = factor * max(1, _STRIP // (factor * image.width))
    if rows >= image.height:
        return _eight_bits(image).reduce(factor)
    edges = range(0, image.height, rows)
    strips = [
        _eight_bits(image.crop((0, top, image.width, min(top + rows, image.height)))).reduce(factor) for top in edges
    ]
    whole = Image.new(strips[0].mode, (strips[0].width, ceil(image.height / factor)))
    for top, strip in zip(edges, strips, strict=True):
        whole.paste(strip, (0, top // factor))
    return whole


def _eight_bits(image: Image.Image) -> Image.Image:
    """The same picture in mode L, RGB, CMYK or RGBA."""
    if image.mode.startswith("I"):  # 16-bit grey, which Pillow would clip
        return Image.fromarray((np.asarray(image) >> 8).astype(np.uint8))
    if image.has_transparency_data:
        return image if image.mode == "RGBA" else image.convert("RGBA")
    return image if image.mode in ("L", "RGB", "CMYK") else image.convert("RGB")


def _over_grey(image: Image.Image) -> Image.Image:
    if image.getchannel("A").getextrema() == (0, 0):
        raise PhotoError("The photo is fully transparent.")
    return Image.alpha_composite(Image.new("RGBA", image.size, _MID_GREY), image).convert("RGB")


def _srgb(image: Image.Image, profile: bytes | None) -> Image.Image:
    """The picture as sRGB by its ICC profile, or as it stands where that is absent, unfit or damaged."""
    try:
        if profile and "sRGB" not in ImageCms.getProfileDescription(icc := ImageCms.ImageCmsProfile(BytesIO(profile))):
            converted = ImageCms.profileToProfile(image, icc, ImageCms.createProfile("sRGB"), outputMode="RGB")
            return converted or image.convert("RGB")
    except Exception:  # a bad profile must not reject a photo either
        pass
    return image if image.mode == "RGB" else image.convert("RGB")


def _reason(error: Exception) -> str:
    return str(error).strip().rstrip(".").splitlines()[0] if str(error).strip() else type(error).__name__


_WARNING_FILTERS = threading.Lock()


@contextmanager
def _no_warnings() -> Iterator[None]:
    """Silence about oddities of a file; the filters belong to the whole process, so one thread at a time."""
    with _WARNING_FILTERS, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield

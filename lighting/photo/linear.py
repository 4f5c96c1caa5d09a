"""Photos that measure light: linear values, with all the bits that the file has.

What is read: 16-bit PNG and TIFF, RAW where rawpy is installed (extra `all`), and with less precision 8-bit PNG, TIFF
and JPEG. A tag for gamma is not believed, since it often lies: 16 bits count as linear, 8 bits as sRGB, unless the
caller knows better. The primaries of an ICC profile are believed: values become Rec.709's.
"""

import io
import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from lighting.color import SRGB_LINEAR, srgb_decode
from lighting.errors import PhotoError, PhotoExtraError, require_extra
from lighting.photo.color_encoding import is_gamma_encoded, read_color_encoding
from lighting.photo.formats import kind_name
from lighting.photo.metadata import PhotoMetadata, read_exposure, read_metadata
from lighting.photo.pixels import check_bit_depth, decoder_calls, gray_16_bit, make_upright
from lighting.photo.sidecars import read_sidecar
from lighting.photo.tags import read_tags
from lighting.photo.tiff import open_raw_header, photo_page

Pixels = NDArray[np.float32]
Curve = Literal["linear", "srgb"]

RAW_SUFFIXES = (".arw", ".cr2", ".cr3", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".rw2", ".rwl")
_CLIPPED_FROM = 0.98  # of full scale: from here on a value counts as clipped, for noise and demosaicing spread the end
_GRAY_ALPHA = "LA;16B"  # Pillow's name for gray of 16 bits with transparency in a PNG, of which it keeps half the bits
_GRAY_MODES = ("1", "L", "LA")
_KIND_HEAD = 1 << 16  # bytes that tell what a file is
_OPPOSITE = {6: 8, 8: 6}  # of orientations that are not their own: Pillow has rotated a TIFF
_MIN_PLATEAU = 3  # pixels of exactly the largest value that say a float picture was clipped there


@dataclass(frozen=True, eq=False)
class LinearPhoto:
    """Linear values of a photo, in units of the sensor's full scale."""

    pixels: Pixels
    """(H, W, 3), 0 or more."""
    white: float
    """From which on a channel counts as clipped; infinite where nothing is."""
    step: float
    """The least difference that the file can hold, near black."""
    exposure: float | None = None
    """S x ISO / 100 / f-number^2, from EXIF."""
    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    """What the file says."""
    warnings: tuple[str, ...] = ()
    """Sentences for people."""
    gray: bool = False
    """Whether the file holds one channel, which the pixels repeat."""
    srgb_decoded: bool = False
    """Whether a curve was taken off."""
    gamma_doubtful: bool = False
    """Whether the file says that a curve coded the values which were taken for linear."""


def read_linear(path: str | Path, curve: Curve | None = None, *, upright: bool = False) -> LinearPhoto:
    """The photo in a file. PhotoError where it cannot be read, OSError where it cannot be opened.

    Args:
        path: of a PNG, TIFF, JPEG or RAW file.
        curve: how its values are coded; None: linear for 16 bits, sRGB for 8.
        upright: rotates it by EXIF. Else it stays as the sensor had it: a camera that looks straight up notes an
            orientation at random.
    """
    file = Path(path)
    if file.suffix.lower() in RAW_SUFFIXES:
        return _read_raw(file, upright)
    try:
        return _read_picture(file, curve, upright)
    except PhotoError as error:
        if isinstance(error.__cause__, Image.DecompressionBombError):
            raise PhotoError(f"{file} has too many pixels to be read.") from error
        if error.__cause__:  # what a decoder raised
            raise PhotoError(f"{file} cannot be read as a PNG, TIFF or JPEG picture{_kind_of(file)}.") from error
        raise PhotoError(f"{file}: {error}") from error


def _kind_of(file: Path) -> str:
    """What a file is instead, as the rest of a sentence; nothing for a damaged picture or without a name."""
    with file.open("rb") as stream:
        name = kind_name(stream.read(_KIND_HEAD))
    return f"; it is {name}" if name else ""


def linear_from_array(pixels: Pixels) -> LinearPhoto:
    """A photo of linear values, which count as clipped at their largest where several are just that.

    Args:
        pixels: (H, W, 3) linear Rec.709, finite, else PhotoError.
    """
    if not np.isfinite(pixels).all():
        raise PhotoError("The picture holds values that are not finite numbers.")
    largest = float(pixels.max())
    clipped = int((pixels == largest).sum()) >= _MIN_PLATEAU and largest > 0
    return LinearPhoto(pixels, _CLIPPED_FROM * largest if clipped else float("inf"), 2.0**-14)


def _read_picture(file: Path, curve: Curve | None, upright: bool) -> LinearPhoto:
    data = file.read_bytes()
    page = photo_page(data)
    first_page = page.as_first(data) if page else data
    image = _open(first_page)
    if image.format == "TIFF":
        check_bit_depth(image, all_bits=True)
        own, tags = read_tags(image), read_tags(_open(first_page if page and page.has_exif else data))
        samples = make_upright(_read_samples(image, first_page), _OPPOSITE.get(own.orientation or 1, own.orientation))
    else:
        samples = _read_samples(image, first_page)
        own = tags = read_tags(image)  # after the samples, for Pillow decodes a PNG to find EXIF
    if upright:
        samples = make_upright(samples, (tags if page and not page.has_orientation else own).orientation)
    full = int(np.iinfo(samples.dtype).max)
    coded = (curve or ("linear" if full > 255 else "srgb")) == "srgb"
    linear = _linearize(samples, coded)
    if (matrix := read_color_encoding(image, first_page, own, tags).to_rec709) is not None:
        linear = np.maximum(linear @ matrix.T, 0.0)  # wide primaries: what was clipped stays over white
    doubtful = full > 255 and curve is None and is_gamma_encoded(image)
    white, step = (float(srgb_decode(_CLIPPED_FROM)), 1 / full / 12.92) if coded else (_CLIPPED_FROM, 1 / full)
    exposure = read_exposure(tags.camera)
    metadata = read_metadata(tags, linear.shape[1], linear.shape[0], read_sidecar(file))
    warnings, gray = _curve_warnings(image, full == 255 and curve is None, doubtful), samples.shape[2] == 1
    return LinearPhoto(linear, white, step, exposure, metadata, warnings, gray, coded, doubtful)


def _open(data: bytes) -> Image.Image:
    with decoder_calls():
        return Image.open(io.BytesIO(data), formats=["PNG", "TIFF", "JPEG"])


def _linearize(samples: NDArray[np.integer], coded: bool) -> Pixels:
    """Linear values (H, W, 3), 1 at full scale, of whole numbers (H, W, 1 or 3)."""
    if coded and samples.dtype == np.uint8:
        linear = SRGB_LINEAR[samples]
    else:
        share = np.asarray(samples / np.float32(np.iinfo(samples.dtype).max), dtype=np.float32)
        linear = np.asarray(srgb_decode(share), dtype=np.float32) if coded else share
    return np.repeat(linear, 3, axis=-1) if linear.shape[2] == 1 else linear


def _curve_warnings(header: Image.Image, assumed: bool, doubtful: bool) -> tuple[str, ...]:
    if header.format in ("JPEG", "MPO"):  # the latter has more pictures behind it
        return ("A JPEG's curve is unknown: its values are rough.",)
    if assumed:
        return ("8-bit pixels are taken for sRGB; say the curve if they are linear.",)
    if doubtful:
        return ("16-bit pixels are taken for linear, against what the file says: say the curve.",)
    return ()


def _read_samples(image: Any, data: bytes) -> NDArray[np.integer]:
    """Samples (H, W, C) of 8 or 16 bits as Pillow decodes them; C is 1 for gray, else 3."""
    modes = {_raw_mode(tile) for tile in image.tile}
    if modes == {_GRAY_ALPHA} and not image.mode.startswith("I"):
        image.tile = [tile._replace(args="RGBA") for tile in image.tile]  # as many bytes of a pixel, untouched
    with decoder_calls():
        image.load()
    if image.mode.startswith("I"):
        return gray_16_bit(image)[..., None]
    if modes == {_GRAY_ALPHA}:
        high, low = np.moveaxis(np.asarray(image), -1, 0)[:2]
        return np.asarray((high.astype(np.uint16) << 8 | low)[..., None])
    if image.mode in ("RGB", "RGBA") and any(";16" in mode for mode in modes):
        return np.asarray(image)[..., :3].astype(np.uint16) << 8 | _low_bytes(data)
    if image.mode in _GRAY_MODES:
        return np.asarray(image.convert("L"))[..., None]
    return np.asarray(image.convert("RGB"))


def _low_bytes(data: bytes) -> NDArray[np.uint8]:
    """The low bytes (H, W, 3) of a picture of 16-bit colors, of which Pillow keeps the high ones.

    It keeps the byte that comes last in little-endian order and first in big-endian. With the other byte order than the
    file's, it keeps the low byte.
    """
    image: Any = _open(data)
    image.tile = [_with_other_byte_order(tile) for tile in image.tile]
    with decoder_calls():
        image.load()
    return np.asarray(image)[..., :3]


def _with_other_byte_order(tile: Any) -> Any:
    mode = _raw_mode(tile)
    order = mode[-1] if mode[-1] != "N" else "L" if sys.byteorder == "little" else "B"
    other = mode[:-1] + {"L": "B", "B": "L"}[order]
    return tile._replace(args=other if isinstance(tile.args, str) else (other, *tile.args[1:]))


def _raw_mode(tile: Any) -> str:
    return str(tile.args if isinstance(tile.args, str) else tile.args[0])


def _read_raw(file: Path, upright: bool) -> LinearPhoto:
    pixels, levels = _develop_raw(file.read_bytes(), str(file), upright)
    metadata, exposure = read_metadata_and_exposure(file)
    return LinearPhoto(np.asarray(pixels / np.float32(65535)), _CLIPPED_FROM, 1 / levels, exposure, metadata)


def _develop_raw(data: bytes, name: str, upright: bool) -> tuple[NDArray[np.uint16], int]:
    """Camera RGB (H, W, 3), 65535 at full scale, and the sensor's number of levels.

    Demosaiced and balanced for daylight, to Rec.709, without any curve or brightening. Raises PhotoError for what
    cannot be read, under `name`, and without rawpy.
    """
    rawpy = require_extra("rawpy", "RAW photos need rawpy", "all", PhotoExtraError)
    try:
        with rawpy.imread(io.BytesIO(data)) as raw:
            levels = int(raw.white_level)
            pixels = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,  # else each exposure is scaled by its own brightest pixel
                output_bps=16,
                use_camera_wb=False,
                user_wb=list(raw.daylight_whitebalance),
                output_color=rawpy.ColorSpace.sRGB,
                highlight_mode=rawpy.HighlightMode.Clip,
                user_flip=None if upright else 0,
            )
    except rawpy.LibRawError as error:
        raise PhotoError(f"{name} cannot be read as a RAW photo ({error}).") from error
    return np.asarray(pixels), levels


def open_header(file: str | Path) -> Image.Image | None:
    """A picture with its EXIF block and nothing decoded, of RAW files their preview; None where it cannot be opened.

    Most RAW files are TIFF files inside, of which Pillow reads the tags.

    Args:
        file: path of a photo.
    """
    try:
        return Image.open(file)
    except UnidentifiedImageError:
        return open_raw_header(Path(file).read_bytes())
    except Exception:  # Pillow raises nearly anything on hostile bytes
        return None


def read_metadata_and_exposure(file: str | Path) -> tuple[PhotoMetadata, float | None]:
    """Metadata and exposure of a photo without its pixels; empty and None where no EXIF block can be read.

    Args:
        file: path of a photo.
    """
    header = open_header(file)
    if header is None:
        return PhotoMetadata(), None
    with header as image:
        tags, beside = read_tags(image), read_sidecar(file)
    return read_metadata(tags, image.width, image.height, beside), read_exposure(tags.camera)

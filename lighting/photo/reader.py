"""Photo, read_photo, photo_from_array, size and memory limits.

What is read: JPEG, PNG, WebP, TIFF, AVIF where Pillow has it, HEIC, and the preview in a RAW file. Everything ends as
8-bit sRGB. Samples of 16 bits are scaled, and colors are converted from the encoding that the file states. Transparent
parts become mid-gray. Of an animation or a series the first picture counts; of a TIFF that begins with a thumbnail, the
picture behind it. A damaged EXIF block or color profile never rejects a photo.
"""

import os
import struct
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from io import BytesIO, TextIOBase
from numbers import Integral
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, UnidentifiedImageError

import lighting.photo.containers as containers
import lighting.photo.tiff as tiff
from lighting.color import check_pixels
from lighting.errors import (
    CodedWarning,
    ErrorCode,
    ParameterError,
    PhotoError,
    PhotoTooLargeError,
    WarningCode,
    warn_of_old_name,
)
from lighting.fields import describe_fields
from lighting.geometry import zoomed_fov
from lighting.photo.borders import Layout, find_layout
from lighting.photo.color_encoding import read_color_encoding
from lighting.photo.metadata import PhotoMetadata, read_metadata
from lighting.photo.pixels import MAX_KEPT_PIXELS, check_bit_depth, decode_image, decoder_calls, upright_pixels
from lighting.photo.sidecars import read_sidecar
from lighting.photo.tags import read_tags

Source = str | os.PathLike[str] | bytes | bytearray | memoryview | BinaryIO

MAX_BYTES = 64_000_000
MAX_PIXELS = 128_000_000  # lets the 108-megapixel photos of phones pass
PILLOW_MAX_PIXELS = 178_000_000  # that Pillow opens at all, and this package of kinds that it opens without Pillow
TARGET = 448  # pixels along the longer side, twice what the network sees
MIN_SIDE = 32  # pixels
MAX_ASPECT = 8  # longer side / shorter side

_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")  # how files begin, those of more than 4 GB too
_UNREADABLE_TIFF = "The TIFF is damaged or not supported, such as 32 bits per color; convert it to 8 or 16 bits."
_BORDER = "Only the {subject} inside a border was used: {width} x {height} pixels."
_STEREO_PAIR = "Only one half of a stereo pair was used: {width} x {height} pixels."
_COLLAGE = "Probably a collage of several photos: do not trust this result."
_WARNING_FILTERS = threading.Lock()  # they belong to the whole process, so one thread at a time is silent
_CHUNK_BYTES = 1 << 22  # read at once, so that small files need no buffer of the limit's size
_FORMATS = ("JPEG", "PNG", "WEBP", "TIFF")  # that Pillow opens, beside ISO media files
_ARRAY_FORMAT = "PIXELS"  # the Photo's `format`

# Memory of decoders, so that one photo takes a stated amount at most.
_BYTES_PER_PIXEL = 4  # of the `max_pixels`; a kind that needs more per pixel may have fewer pixels
_FIXED_BYTES = 64_000_000  # bytes beside, of conversions in strips

_BYTES_PER_COEFFICIENT = 2.1  # bytes for each that a JPEG's decoder holds, with its tables
# Name of a kind, and bytes per pixel by `python -m benchmarks.decoding` (Pillow 13.0.0, pillow-heif 1.8.1), rounded up.
_DECODERS = {
    "JPEG": ("JPEG", 1.0),  # decoded row by row, and reduced on the way
    "PNG": ("PNG", 4.0),  # Pillow's own picture
    "WEBP": ("WebP", 18.0),  # lossy and lossless alike: Pillow reads both as animations
    "HEIF": ("HEIC", 10.0),
    "TIFF": ("TIFF", 16.0),  # a strip as large as the picture, of up to twice the bytes per color, beside Pillow's own
    "AVIF": ("AVIF", 14.0),
}


@dataclass(frozen=True)
class PhotoCrop:
    """The part of an upright picture that is its photo, in pixels of the file."""

    left: int
    """Column, pixels of the file from 0, of the photo's left edge."""
    top: int
    """Row, pixels of the file from 0, of the photo's upper edge."""
    width: int
    """Columns of the photo, pixels."""
    height: int
    """Rows of the photo, pixels."""
    picture_width: int
    """Columns of the whole picture, pixels, its border included."""
    picture_height: int
    """Rows of the whole picture, pixels, its border included."""


@dataclass(frozen=True, eq=False)
class PhotoOrigin:
    """Where a photo was read from, and the limits of that, so that it can be read again."""

    data: bytes | Path
    """The file's bytes, or its absolute path."""
    modified: tuple[int, int] | None
    """Of a file, its size in bytes and the time of its last change in ns. None: of bytes."""
    max_bytes: int
    """Most bytes that the file may have."""
    max_pixels: int
    """Most pixels that the picture may have."""
    reader: Callable[..., "Photo"] = field(repr=False)
    """What reads it: `read_photo`, or the same in another process."""

    @property
    def name(self) -> str | None:
        """Of the file; None where the photo came as bytes."""
        return self.data.name if isinstance(self.data, Path) else None

    def read(self, target: int) -> "Photo":
        """Read the photo again.

        Args:
            target: pixels that the longer side keeps at least if it has them.

        Raises:
            PhotoError: its file has changed since.
            OSError: its file cannot be opened any more.
        """
        if isinstance(self.data, Path) and modified(self.data) != self.modified:
            raise PhotoError(f"{self.data} has changed since it was read.")
        return self.reader(self.data, max_bytes=self.max_bytes, max_pixels=self.max_pixels, target=target, sidecar={})


@dataclass(frozen=True, eq=False)
class Photo:
    """An upright photo. Of a picture with a border, it is what lies inside."""

    pixels: NDArray[np.uint8] = field(repr=False)
    """(h, w, 3) 8-bit sRGB, 0 to 255, upright; perhaps fewer than in the file."""
    width: int
    """Columns of the upright photo in the file, pixels, without its border."""
    height: int
    """Rows of the upright photo in the file, pixels, without its border."""
    format: str
    """As Pillow names it: "JPEG", "MPO" (a JPEG with more pictures behind it), "PNG" and so on; "RAW", "PIXELS"."""
    metadata: PhotoMetadata = field(default_factory=PhotoMetadata)
    """What the file's EXIF block and XMP packet say."""
    crop: PhotoCrop | None = None
    """The photo's part of the upright picture. None: all of it."""
    is_collage: bool = False
    """Whether the picture shows several photos."""
    warnings: tuple[str, ...] = ()
    """Sentences about the picture's border."""
    source: PhotoOrigin | None = field(default=None, repr=False)
    """Where more pixels are. None: these are all."""

    def reread(self, side: int) -> "Photo":
        """Return the photo with more of its pixels, read again from where it came; itself where it came as pixels.

        Args:
            side: pixels that the longer side keeps at least if it has them.

        Raises:
            PhotoError: its file has changed since.
            OSError: its file cannot be opened any more.
        """
        return self if self.source is None else self.source.read(side)

    @property
    def facts(self) -> PhotoMetadata:
        """The old name of `metadata`; warns of it."""
        warn_of_old_name("lighting.photo.reader.Photo.facts")
        return self.metadata


describe_fields(PhotoCrop, PhotoOrigin, Photo)


def check_photo(thing: object) -> None:
    """Raise PhotoError for what is no Photo.

    Args:
        thing: to check.
    """
    if not isinstance(thing, Photo):
        kind = type(thing).__name__
        sentence = f"A Photo is needed, not {kind}; read_photo reads files, photo_from_array takes pixels."
        raise PhotoError(sentence, code=ErrorCode.WRONG_TYPE)


def read_photo(
    source: Source,
    *,
    max_bytes: int = MAX_BYTES,
    max_pixels: int = MAX_PIXELS,
    target: int | None = TARGET,
    path: str | os.PathLike[str] | None = None,
    sidecar: Mapping[str, str] | None = None,
) -> Photo:
    """The photo in a file, in bytes or in a binary stream.

    Args:
        source: path, bytes or binary stream.
        max_bytes: of the file.
        max_pixels: of the picture, at most 178 million; kinds whose decoder needs more memory may have fewer.
        target: pixels that the longer side keeps at least if it has them, rarely twice as many, and 32 million in all;
            None: all up to that.
        path: where bytes or a stream come from, beside which sidecars may lie; None: `source`, if it is a path.
        sidecar: what `read_sidecar` returned, in place of looking beside `path`; None: look there.

    Raises:
        PhotoTooLargeError: over `max_bytes` or `max_pixels`.
        PhotoError: for what is no photo of at least 32 pixels each way and of an aspect ratio up to 8:1.
        ParameterError: for a `target` that is no number of pixels.
        OSError: for a file that cannot be opened.
    """
    if target is not None and not (isinstance(target, Integral) and target > 0):
        predicate = f"must be a whole number of pixels over 0, or None, not {target!r}."
        code = ErrorCode.OUT_OF_RANGE if isinstance(target, Integral) else ErrorCode.WRONG_TYPE
        raise ParameterError.about("target", predicate, code)
    file = Path(source).absolute() if isinstance(source, str | os.PathLike) and Path(source).is_file() else None
    changed = modified(file) if file else None
    data = read_bytes(source, max_bytes)
    try:
        with _WARNING_FILTERS, warnings.catch_warnings(action="ignore"):
            raw = tiff.is_raw(data)
            page = tiff.preview_page(data) if raw else tiff.photo_page(data)
            picture = page.as_first(data) if page else tiff.embedded_preview(data) if raw else data
            image = _open_photo(picture, max_pixels)
            embedded = raw or (page is not None and not page.has_exif)
            exif_source = tiff.open_exif_source(data, image) if embedded else image
        width, height = image.size
        side = target or max(image.size)
        decode_image(image, side)
        beside = source if isinstance(source, str | os.PathLike) else path
        with _WARNING_FILTERS, warnings.catch_warnings(action="ignore"):
            own = tags = read_tags(image)
            if exif_source is not image:
                tags = read_tags(exif_source)
            if sidecar is None and beside is not None:
                sidecar = read_sidecar(beside)
            encoding = read_color_encoding(image, picture, own, tags)
        orientation = (own if page and page.has_orientation else tags).orientation
        pixels = upright_pixels(image, side, orientation, encoding)
    except MemoryError as error:
        raise PhotoTooLargeError("The photo needs more memory than its limit.") from error
    width, height = (height, width) if orientation in (5, 6, 7, 8) else (width, height)
    photo = _without_border(Photo(pixels, width, height, tiff.RAW_FORMAT if raw else str(image.format)))
    metadata = read_metadata(tags, photo.width, photo.height, sidecar, is_inside=photo.crop is not None)
    origin = PhotoOrigin(file or data, changed, max_bytes, max_pixels, read_photo)
    return replace(photo, metadata=metadata, source=origin)


def modified(file: Path) -> tuple[int, int]:
    """Return a file's size in bytes and the time of its last change in ns.

    Args:
        file: of a photo.
    """
    status = file.stat()
    return status.st_size, status.st_mtime_ns


def photo_from_array(pixels: ArrayLike, metadata: PhotoMetadata | None = None) -> Photo:
    """The Photo of pixels that a program has already, such as a camera's frame; without a border, as `read_photo`'s.

    They are copied only where their rows are not contiguous. PhotoError for another type or shape; for a size also
    PhotoTooLargeError, as in `read_photo`.

    Args:
        pixels: (h, w, 3) 8-bit sRGB, upright: an array, a PIL image in RGB or a tensor in the CPU's memory.
        metadata: as its EXIF block would have it; None: unknown.
    """
    array = check_pixels(pixels)
    height, width = array.shape[:2]
    _check_size(width, height, MAX_PIXELS, "photo")
    whole = Photo(np.ascontiguousarray(array), width, height, _ARRAY_FORMAT, metadata or PhotoMetadata())
    photo = _without_border(whole)
    fov = whole.metadata.vertical_fov
    if photo.crop is None or fov is None:
        return photo
    return replace(photo, metadata=replace(whole.metadata, vertical_fov=zoomed_fov(fov, height / photo.height)))


def _without_border(photo: Photo) -> Photo:
    """What lies inside a picture's border, with a warning; of a stereo pair one half."""
    layout = find_layout(photo.pixels)
    if layout.is_collage:
        return replace(photo, is_collage=True, warnings=tuple(describe_layout(layout, photo.width, photo.height)))
    if layout.photo is None:
        return photo
    left, top, right, bottom = layout.photo.pixels(photo.width, photo.height)
    width, height = right - left, bottom - top
    if min(width, height) < MIN_SIDE or max(width, height) > MAX_ASPECT * min(width, height):
        return photo
    x, y, x_end, y_end = layout.photo.pixels(photo.pixels.shape[1], photo.pixels.shape[0])
    pixels = np.ascontiguousarray(photo.pixels[y:y_end, x:x_end])
    crop = PhotoCrop(left, top, width, height, photo.width, photo.height)
    told = tuple(describe_layout(layout, width, height))
    return replace(photo, pixels=pixels, width=width, height=height, crop=crop, warnings=told)


def describe_layout(layout: Layout, width: int, height: int, subject: str = "photo") -> Iterator[CodedWarning]:
    """What is to be said of how a picture is made up: a sentence, or nothing.

    Args:
        layout: of the picture.
        width: of the photo in it, pixels.
        height: of the photo in it, pixels.
        subject: what the sentence calls that photo.
    """
    if layout.is_collage:
        yield CodedWarning(_COLLAGE, WarningCode.COLLAGE)
    elif layout.photo is not None:
        sentence = _STEREO_PAIR if layout.is_stereo_pair else _BORDER
        yield CodedWarning(sentence.format(subject=subject, width=width, height=height), WarningCode.BORDER)


def _pixel_limit(image: Image.Image, data: bytes, max_pixels: int) -> tuple[int, str]:
    """How many pixels a picture that is not yet decoded may have by its kind, and the kind's name for people."""
    max_pixels = min(max_pixels, PILLOW_MAX_PIXELS)
    kind = "JPEG" if image.format == "MPO" else str(image.format)
    coefficients = containers.dct_coefficients_per_pixel(data) if kind == "JPEG" else 0.0
    if not coefficients:
        return _limit_of_kind(kind, max_pixels)
    fitting = int(max_pixels * _BYTES_PER_PIXEL / (coefficients * _BYTES_PER_COEFFICIENT))
    return min(max_pixels, fitting), "progressive JPEG"


def _limit_of_kind(kind: str, max_pixels: int) -> tuple[int, str]:
    """How many pixels a picture of a kind of _DECODERS may have, and the kind's name for people."""
    name, bytes_per_pixel = _DECODERS[kind]
    return min(max_pixels, int(max_pixels * _BYTES_PER_PIXEL / bytes_per_pixel)), name


def memory_budget(size: int, max_pixels: int, target: int | None) -> int:
    """Bytes of memory that reading a photo may take, with the pixels that are kept and a rotated copy.

    Args:
        size: bytes of the photo.
        max_pixels: as in `read_photo`.
        target: as in `read_photo`.
    """
    kept = MAX_KEPT_PIXELS if target is None else min(4 * target * target, MAX_KEPT_PIXELS)
    return _BYTES_PER_PIXEL * max_pixels + _FIXED_BYTES + 2 * size + 6 * kept


def read_bytes(source: Source, max_bytes: int = MAX_BYTES) -> bytes:
    """What a file or a binary stream holds; PhotoError where that is nothing.

    Args:
        source: path, bytes or binary stream.
        max_bytes: beyond which it raises PhotoTooLargeError.
    """
    if isinstance(source, str | os.PathLike):
        with Path(source).open("rb") as stream:
            return read_bytes(stream, max_bytes)
    data = bytes(source) if isinstance(source, bytes | bytearray | memoryview) else _read_stream(source, max_bytes + 1)
    if len(data) > max_bytes:
        raise PhotoTooLargeError(f"The photo is larger than the limit of {max_bytes / 1e6:g} MB.")
    if not data:
        raise PhotoError("The photo is empty.")
    return data


def _read_stream(stream: BinaryIO, limit: int) -> bytes:
    problem = None
    if isinstance(stream, TextIOBase):
        problem = "The file is open as text; open it in binary mode: open(path, 'rb')."
    elif isinstance(stream, Photo):
        problem = "That is a Photo already, which needs no reading; an Estimator takes it."
    elif not hasattr(stream, "read"):
        kind = type(stream).__name__
        problem = f"A photo is read from a path, bytes or a binary stream, not {kind}; photo_from_array takes pixels."
    if problem:
        raise PhotoError(problem, code=ErrorCode.WRONG_TYPE)
    chunks: list[bytes] = []
    while limit > 0 and (chunk := stream.read(min(limit, _CHUNK_BYTES))):
        chunks.append(chunk)
        limit -= len(chunk)
    return b"".join(chunks)


def _open_photo(data: bytes, max_pixels: int = MAX_PIXELS) -> Image.Image:
    """The image with its header read and its size checked, before anything is decoded; raises as `read_photo`.

    Args:
        data: of a photo, no RAW file.
        max_pixels: as in `read_photo`.
    """
    containers.check_structure(data)
    data = tiff.without_costly_exif(data)
    if size := containers.webp_size(data):
        _check_size(*size, *_limit_of_kind("WEBP", max_pixels))
    with decoder_calls():
        try:
            image = _open_image(data)
        except (UnidentifiedImageError, SyntaxError) as error:
            from lighting.photo.formats import unreadable_sentence

            raise PhotoError(_UNREADABLE_TIFF if data.startswith(_TIFF) else unreadable_sentence(data)) from error
        except Image.DecompressionBombError as error:
            raise PhotoTooLargeError(_size_sentence("The photo", min(max_pixels, PILLOW_MAX_PIXELS))) from error
    if image.format == "HEIF":
        from lighting.photo.formats import restore_orientation

        restore_orientation(image, data, image.info.get("original_orientation"))
    if image.format == "TIFF":
        check_bit_depth(image)
    _check_size(*image.size, *_pixel_limit(image, data, max_pixels))
    if image.format == "AVIF":
        from lighting.photo.formats import complete_avif

        complete_avif(image, data)
    return image


def _open_image(data: bytes) -> Image.Image:
    """The picture of a file, not decoded; HEIC and AVIF are ISO media files, whose boxes are another module's."""
    if data.startswith(b"\xff\xd8\xff"):
        from PIL.JpegImagePlugin import jpeg_factory  # Image.open would import the plugins of four other formats

        try:
            return jpeg_factory(BytesIO(data))
        except (SyntaxError, IndexError, TypeError, struct.error) as error:  # as Image.open does
            raise UnidentifiedImageError(str(error)) from error
    if data[4:8] != b"ftyp":
        return Image.open(BytesIO(data), formats=_FORMATS)
    from lighting.photo.formats import open_heif

    return open_heif(data)


def _size_sentence(photo: str, limit: int) -> str:
    return f"{photo} has more than its limit of {limit / 1e6:g} million pixels."


def _check_size(width: int, height: int, limit: int, kind: str) -> None:
    """Raise PhotoTooLargeError over `limit` pixels, PhotoError for a photo too small or too long; `kind` names it."""
    if width * height > limit:
        raise PhotoTooLargeError(_size_sentence(f"The {kind} of {width} x {height} pixels", limit))
    if min(width, height) < MIN_SIDE:
        raise PhotoError(f"The photo is {width} x {height} pixels; each side must have at least {MIN_SIDE}.")
    if max(width, height) > MAX_ASPECT * min(width, height):
        sentence = f"The photo is {width} x {height} pixels; one side may be at most {MAX_ASPECT} times the other."
        raise PhotoError(sentence)

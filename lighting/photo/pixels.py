"""A decoded image's pixels: bit depth and orientation, and how they become upright 8-bit sRGB."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import ceil
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lighting.errors import PhotoError
from lighting.photo.color_encoding import ColorEncoding
from lighting.photo.tags import Tags

Pixels = NDArray[np.uint8]

_Kind = TypeVar("_Kind", bound=np.generic)
MAX_KEPT_PIXELS = 32_000_000  # of what is returned, so that photos kept large, as a scene's plate, are bounded too

_32_BIT_MODES = ("F", "I")  # Pillow's, whose range no rule tells
_STRIP_PIXELS = 1 << 22  # converted at once
_BITS, _PHOTOMETRIC, _PLANAR = 0x102, 0x106, 0x11C  # tags of a TIFF
_WHITE_IS_ZERO, _PLANES = 0, 2  # what the latter two may say: the order of grays, colors one after another
_MID_GRAY = (128, 128, 128)  # sRGB, behind what is transparent
_FLIPS = {2: (1, -1), 3: (-1, -1), 4: (-1, 1), 6: (-1, 1), 7: (-1, -1), 8: (1, -1)}  # steps of rows and of columns
_TRANSPOSED = (5, 6, 7, 8)  # EXIF orientations that then change rows and columns


@contextmanager
def decoder_calls() -> Iterator[None]:
    """Calls of decoders alone, which raise nearly anything on hostile bytes: it becomes PhotoError."""
    try:
        yield
    except (PhotoError, MemoryError):
        raise
    except Exception as error:
        reason = (str(error).strip().rstrip(".").splitlines() or [type(error).__name__])[0]
        raise PhotoError(f"The photo is damaged or cut short ({reason}).") from error


def check_bit_depth(image: Any, *, all_bits: bool = False) -> None:
    """Raise PhotoError for a TIFF whose colors Pillow does not read.

    Args:
        image: a TIFF, opened by Pillow.
        all_bits: whether all bits of its colors are needed, not the high ones alone.
    """
    if image.mode in _32_BIT_MODES:
        raise PhotoError(
            "The TIFF holds 32 bits per color, or signed ones, whose white is unknown; convert it to 8 or 16 bits."
        )
    tags = _tiff_tags(image)
    in_planes = tags.get(_PLANAR) == _PLANES and max(tags.get(_BITS, (8,))) > 8  # of which packed ones lose low bits
    if in_planes and (all_bits or image.tile[0].codec_name == "raw"):
        raise PhotoError("The TIFF stores red, green and blue of 16 bits one after another; store them pixel by pixel.")


def upright_pixels(
    image: Image.Image, target: int, orientation: int | None, encoding: ColorEncoding | None = None
) -> Pixels:
    """Pixels (h, w, 3) of the upright picture, up to MAX_KEPT_PIXELS; PhotoError where it is fully transparent.

    Args:
        image: decoded; its pixels are freed, for both would take more memory.
        target: pixels that the longer side keeps at least if it has them.
        orientation: 1 to 8 by EXIF; None: upright.
        encoding: of its colors; None: sRGB.
    """
    pixels = _convert_to_srgb(image, _reduction_factor(*image.size, target), (encoding or ColorEncoding()).to_srgb())
    image.im = None  # type: ignore[assignment]
    return np.ascontiguousarray(make_upright(pixels, orientation))


def make_upright(pixels: NDArray[_Kind], orientation: int | None) -> NDArray[_Kind]:
    """A view of pixels that is rotated as their EXIF orientation says.

    Args:
        pixels: (h, w, C).
        orientation: 1 to 8; None: upright.
    """
    rows, columns = _FLIPS.get(orientation or 1, (1, 1))
    view = pixels[::rows, ::columns]
    return view.swapaxes(0, 1) if orientation in _TRANSPOSED else view


def _reduction_factor(width: int, height: int, target: int) -> int:
    """By how much each side is divided."""
    factor = max(1, max(width, height) // target)
    while ceil(width / factor) * ceil(height / factor) > MAX_KEPT_PIXELS:
        factor += 1
    return factor


def _convert_to_srgb(image: Image.Image, factor: int, to_srgb: Callable[[Image.Image], Pixels]) -> Pixels:
    """The picture as sRGB (h, w, 3), each side divided by the factor and rounded up."""
    rows = factor * max(1, _STRIP_PIXELS // (factor * image.width))
    edges = range(0, image.height, rows)
    opaque = False  # whether a pixel is not fully transparent
    out = np.empty((ceil(image.height / factor), ceil(image.width / factor), 3), dtype=np.uint8)
    tags = _tiff_tags(image)
    for top in edges:
        part = image if len(edges) == 1 else image.crop((0, top, image.width, min(top + rows, image.height)))
        small = _to_8_bits(part, tags)
        small = small.reduce(factor) if factor > 1 else small
        opaque = opaque or small.mode != "RGBA" or small.getchannel("A").getextrema() != (0, 0)
        colors = to_srgb(small.convert("RGB") if small.mode == "RGBA" else small)
        if small.mode == "RGBA":
            behind = Image.new("RGB", small.size, _MID_GRAY)
            colors = np.asarray(Image.composite(Image.fromarray(colors), behind, small.getchannel("A")))
        out[top // factor : top // factor + small.height] = colors
    if not opaque:
        raise PhotoError("The photo is fully transparent.")
    return out


def _to_8_bits(image: Image.Image, tags: Tags) -> Image.Image:
    """The same picture in mode L, RGB, CMYK or RGBA; `tags` are those of `_tiff_tags`."""
    if image.mode.startswith("I"):
        return Image.fromarray((gray_16_bit(image, tags) >> 8).astype(np.uint8))
    with decoder_calls():
        if image.has_transparency_data:
            return image if image.mode == "RGBA" else image.convert("RGBA")
        return image if image.mode in ("L", "RGB", "CMYK") else image.convert("RGB")


def _tiff_tags(image: Image.Image) -> Tags:
    """A TIFF's tags; none of other pictures."""
    return getattr(image, "tag_v2", {})


def gray_16_bit(image: Image.Image, tags: Tags | None = None) -> NDArray[np.uint16]:
    """Gray values (h, w) of over 8 bits, black at 0 and white at 65535.

    Pillow would clip them to 8 bits, and passes over a TIFF's 12 bits and over white at 0.

    Args:
        image: of one channel.
        tags: of a TIFF, whose part it may be; None: its own.
    """
    tags = _tiff_tags(image) if tags is None else tags
    values: NDArray[Any] = np.asarray(image).astype(np.uint16)
    if tags.get(_BITS) == (12,):
        values = values << 4 | values >> 8
    return 65535 - values if tags.get(_PHOTOMETRIC) == _WHITE_IS_ZERO else values


def decode_image(image: Image.Image, target: int) -> None:
    """Decode an opened picture, as small as its decoder makes it with the longer side no shorter than the target.

    Args:
        image: changed in place.
        target: pixels, over 0.
    """
    scale = min(1.0, target / max(image.size))
    with decoder_calls():
        image.draft(None, (ceil(image.width * scale), ceil(image.height * scale)))
        image.load()

"""The pixels of panoramas: as published, as linear values, and reduced."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from export.data.panoramas import Panorama
from export.data.tables import DataError
from lighting.colour import SRGB_LINEAR
from lighting.prefilter import shrink

_LARGEST_HALF = 65504.0  # half floats end here


def read_picture(panorama: Panorama) -> NDArray[Any]:
    """Pixels (H, 2H, 3) as published: uint8 sRGB of an LDR picture, float32 linear Rec.709 of an HDR one.

    Raises DataError if the picture cannot be read or is not twice as wide as high.
    """
    try:
        pixels = _read_ldr(panorama.path) if panorama.kind == "ldr" else _read_hdr(panorama.path)
    except DataError:
        raise
    except UnidentifiedImageError as error:  # its text names the file once more
        raise DataError(f"The panorama {panorama.path} cannot be read: it is no JPEG, PNG or WebP.") from error
    except OSError as error:
        raise DataError(f"The panorama {panorama.path} cannot be read: {error.strerror or error}.") from error
    except Exception as error:  # the EXR reader raises bare RuntimeErrors, Pillow half a dozen kinds
        raise DataError(f"The panorama {panorama.path} cannot be read: {error}.") from error
    height, width = pixels.shape[:2]
    if width != 2 * height:
        raise DataError(f"The panorama {panorama.path} is {width} x {height} pixels, not twice as wide as high.")
    return pixels


def read_linear(panorama: Panorama, height: int) -> NDArray[np.float32]:
    """Linear Rec.709 float32 (H, 2H, 3), reduced to `height` rows if the picture has more."""
    return shrink(linear_of(panorama, read_picture(panorama)), height)


def linear_of(panorama: Panorama, pixels: NDArray[Any]) -> NDArray[np.float32]:
    """Linear values of pixels of any shape, which are as `read_picture` returns them."""
    return decode(pixels) if panorama.kind == "ldr" else pixels


def decode(picture: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Linear values in [0, 1] of an 8-bit sRGB picture of any shape."""
    return SRGB_LINEAR[picture]


def _read_ldr(path: Path) -> NDArray[np.uint8]:
    with Image.open(path, formats=["JPEG", "PNG", "WEBP"]) as image:
        return np.asarray(image.convert("RGB"), dtype=np.uint8)


def _read_hdr(path: Path) -> NDArray[np.float32]:
    import OpenEXR

    with OpenEXR.File(str(path)) as file:
        channels = file.channels()
        name = next((key for key in ("RGB", "RGBA") if key in channels), None)
        if name is None:
            raise DataError(f"The panorama {path} has no channels R, G and B.")
        pixels = np.array(channels[name].pixels[..., :3], dtype=np.float32)
    return np.maximum(np.nan_to_num(pixels, nan=0.0, posinf=_LARGEST_HALF, neginf=0.0), 0.0)

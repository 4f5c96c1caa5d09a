"""How many pixels of each kind of picture may be decoded, so that one photo takes a stated amount of memory."""

from PIL import Image

from lighting.photo.jpeg import coefficients
from lighting.photo.pixels import MOST_KEPT

BYTES = 4  # that a photo may take for each of the `max_pixels`; a kind that needs more per pixel is given fewer pixels
FIXED = 64_000_000  # bytes beside, of conversions in strips

COEFFICIENT = 2.1  # bytes for each that a JPEG's decoder holds, with its tables
PER_PIXEL = {  # bytes. `python -m benchmarks.decoding`, 2026-11-23, Pillow 13.0.0, pillow-heif 1.8.1; rounded up
    "JPEG": 1.0,  # decoded row by row, and reduced on the way
    "PNG": 4.0,  # Pillow's own picture
    "WEBP": 18.0,  # lossy and lossless alike: Pillow reads both as animations
    "HEIF": 10.0,
    "TIFF": 16.0,  # a strip as large as the picture, of up to twice the bytes per colour, beside Pillow's own
    "AVIF": 14.0,
}
NAMES = {"JPEG": "JPEG", "PNG": "PNG", "WEBP": "WebP", "HEIF": "HEIC", "TIFF": "TIFF", "AVIF": "AVIF"}


def admitted(image: Image.Image, data: bytes, max_pixels: int) -> tuple[int, str]:
    """How many pixels a picture of this kind may have, and the kind's name for people."""
    kind = "JPEG" if image.format == "MPO" else str(image.format)
    held = coefficients(data) if kind == "JPEG" else 0.0
    if not held:
        return most(kind, max_pixels), NAMES[kind]
    return min(max_pixels, int(max_pixels * BYTES / (held * COEFFICIENT))), f"progressive {NAMES[kind]}"


def most(kind: str, max_pixels: int) -> int:
    """How many pixels a picture of a kind of PER_PIXEL may have."""
    return min(max_pixels, int(max_pixels * BYTES / PER_PIXEL[kind]))


def allowance(size: int, max_pixels: int, target: int | None) -> int:
    """Bytes of memory that reading a photo of `size` bytes may take, with its pixels that are kept and a turned copy.

    `max_pixels` and `target` are those of `read_photo`.
    """
    kept = MOST_KEPT if target is None else min(4 * target * target, MOST_KEPT)
    return BYTES * max_pixels + FIXED + 2 * size + 6 * kept

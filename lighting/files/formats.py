"""Environment maps as files: .exr with everything, .hdr for older tools, tone-mapped .png for looking at."""

import io
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lighting.colour import tone_map
from lighting.errors import EnvironmentMapError
from lighting.files.compression import Compression
from lighting.files.exr import SOFTWARE, Target, checked_map, opened, write_exr
from lighting.geometry import Floats
from lighting.records import Lighting

Writer = Callable[[Target, Floats, Lighting | None], None]

_DARKEST = 1e-38  # what RGBE cannot hold becomes black
_RUN = 127  # the longest run of the Radiance run-length code


def write_envmap(
    target: str | os.PathLike[str],
    image: Floats,
    lighting: Lighting | None = None,
    *,
    compression: Compression = "zip",
) -> None:
    """Write a map (H, 2H, 3) to a path in the format of its suffix: .exr, .hdr or .png.

    `compression` is how `write_exr` packs it; the others know none. The path appears only when the file is whole.
    Raises EnvironmentMapError for another suffix or shape and for a path that cannot be written.
    """
    _writer(format_of(target), compression)(target, image, lighting)


def encode_envmap(
    image: Floats, lighting: Lighting | None = None, format: str = "exr", *, compression: Compression = "zip"
) -> bytes:
    """The bytes of such a file; `format` is exr, hdr or png."""
    buffer = io.BytesIO()
    _writer(format, compression)(buffer, image, lighting)
    return buffer.getvalue()


def encode_png(pixels: NDArray[np.uint8], compress_level: int = 6) -> bytes:
    """The bytes of a PNG of pixels (H, W, 3 or 4), or of one channel (H, W)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=compress_level)
    return buffer.getvalue()


def encode_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """The bytes of a JPEG of pixels (H, W, 3), without metadata."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def format_of(path: str | os.PathLike[str]) -> str:
    """The format that a path's suffix names; EnvironmentMapError for one that is not an environment map's."""
    if not isinstance(path, str | os.PathLike):
        raise EnvironmentMapError(f"A map is written to a path, not {type(path).__name__}; encode_envmap makes bytes.")
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in _WRITERS:
        raise EnvironmentMapError(f"The name {os.fspath(path)!r} must end in .exr, .hdr or .png.")
    return suffix


def _writer(format: str, compression: Compression) -> Writer:
    if format not in _WRITERS:
        raise EnvironmentMapError(f"The format {format!r} is not known; an environment map is exr, hdr or png.")
    return partial(write_exr, compression=compression) if format == "exr" else _WRITERS[format]


def _write_hdr(target: Target, image: Floats, _: Lighting | None) -> None:
    """Radiance RGBE with run-length coded scanlines, top row first, left to right."""
    pixels = _rgbe(checked_map(image))
    height, width = pixels.shape[:2]
    start = bytes((2, 2, width >> 8, width & 255))
    with opened(target) as stream:
        stream.write(f"#?RADIANCE\nSOFTWARE={SOFTWARE}\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode())
        for row in pixels:
            stream.write(start + b"".join(_packed(row[:, channel].tobytes()) for channel in range(4)))


def _rgbe(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Three mantissas and the exponent they share (H, W, 4); a value is mantissa x 2^(exponent - 136)."""
    brightest = image.max(axis=-1)
    exponent = np.maximum(np.frexp(brightest)[1], -127)
    pixels = np.empty((*image.shape[:2], 4), dtype=np.uint8)
    pixels[..., :3] = np.clip(np.rint(np.ldexp(np.maximum(image, 0), 8 - exponent[..., None])), 0, 255)
    pixels[..., 3] = np.clip(exponent + 128, 0, 255)
    pixels[brightest < _DARKEST] = 0
    return pixels


def _packed(line: bytes) -> bytes:
    """Run-length code of one channel of a scanline: a block of equal values as a run, any other as it is."""
    parts = []
    for start in range(0, len(line), _RUN):
        block = line[start : start + _RUN]
        equal = block.count(block[0]) == len(block)
        parts.append(bytes((128 + len(block), block[0])) if equal else bytes((len(block),)) + block)
    return b"".join(parts)


def _write_png(target: Target, image: Floats, _: Lighting | None) -> None:
    """The map as the photo's exposure shows it, clipped at white."""
    from PIL import Image

    picture = Image.fromarray(tone_map(checked_map(image)))
    with opened(target) as stream:
        picture.save(stream, format="png")


_WRITERS: dict[str, Writer] = {"exr": write_exr, "hdr": _write_hdr, "png": _write_png}

"""Radiance HDR pictures, written and read.

A header may say by what all values were multiplied, EXPOSURE, more than once, and that the pixels hold X, Y and Z in
place of red, green and blue.

References:
    [1] Ward, Radiance File Formats.
"""

import math
import re
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lighting.color import check_envmap
from lighting.errors import EnvironmentMapError
from lighting.files.exr import SOFTWARE, WriteTarget, check_read_size, open_target, row_bands
from lighting.geometry import Floats
from lighting.records import Lighting

HDR_MAGIC = b"#?"
_MIN_VALUE = 1e-38  # what RGBE cannot hold becomes black
_MAX_RUN = 127  # of the run-length code
_SIZE = re.compile(rb"-Y (\d{1,9}) \+X (\d{1,9})\n")
_XYZ = re.compile(rb"^FORMAT=\s*32-bit_rle_xyze\s*$", re.MULTILINE)
_EXPOSURE = re.compile(rb"^EXPOSURE=\s*([0-9.eE+-]+)\s*$", re.MULTILINE)


def write_hdr(target: WriteTarget, image: Floats, _: Lighting | None = None) -> None:
    """Write a map as Radiance RGBE with run-length coded rows, top row first, left to right [1].

    Args:
        target: path or binary stream.
        image: (H, 2H, 3) linear Rec.709, else EnvironmentMapError.
        _: a lighting, which the format does not hold.
    """
    with open_target(target) as stream:
        stream.writelines(_encode_rows(check_envmap(image)))


def encode_hdr_face(face: NDArray[np.float32]) -> bytes:
    """The bytes of a file that holds a face of a cubemap, as `write_hdr` writes maps.

    Args:
        face: (size, size, 3) linear Rec.709, of 8 pixels or more.
    """
    return b"".join(_encode_rows(face))


def _encode_rows(image: NDArray[np.float32]) -> Iterator[bytes]:
    """The header, and one row after the other."""
    height, width = image.shape[:2]
    yield f"#?RADIANCE\nSOFTWARE={SOFTWARE}\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    start = _row_start(width)
    for band in row_bands(image):
        for row in _encode_rgbe(band):
            yield start + b"".join(_encode_runs(row[:, channel].tobytes()) for channel in range(4))


def _encode_rgbe(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Three mantissas and the exponent they share (H, W, 4); a value is mantissa x 2^(exponent - 136)."""
    brightest = image.max(axis=-1)
    exponent = np.maximum(np.frexp(brightest)[1], -127)
    pixels = np.empty((*image.shape[:2], 4), dtype=np.uint8)
    pixels[..., :3] = np.clip(np.rint(np.ldexp(np.maximum(image, 0), 8 - exponent[..., None])), 0, 255)
    pixels[..., 3] = np.clip(exponent + 128, 0, 255)
    pixels[brightest < _MIN_VALUE] = 0
    return pixels


def _encode_runs(line: bytes) -> bytes:
    """Run-length code of one channel of a scanline: a block of equal values as a run, any other as it is."""
    parts = []
    for start in range(0, len(line), _MAX_RUN):
        block = line[start : start + _MAX_RUN]
        equal = block.count(block[0]) == len(block)
        parts.append(bytes((128 + len(block), block[0])) if equal else bytes((len(block),)) + block)
    return b"".join(parts)


def _row_start(width: int) -> bytes:
    """What begins a row whose four channels are run-length coded."""
    return bytes((2, 2, width >> 8, width & 255))


def decode_hdr(data: bytes) -> NDArray[np.float32]:
    """The pixels (H, W, 3) of a Radiance RGBE picture, run-length coded or plain, without its EXPOSURE [1].

    Raises EnvironmentMapError for another kind of file, a damaged one and one whose rows run another way.

    Args:
        data: of the file, top row first.
    """
    size = _SIZE.search(data)
    if not data.startswith(HDR_MAGIC) or size is None:
        raise EnvironmentMapError("The file is not a Radiance HDR picture with its top row first.")
    if _XYZ.search(data, 0, size.start()):
        raise EnvironmentMapError("The HDR picture holds X, Y and Z in place of red, green and blue.")
    height, width = int(size[1]), int(size[2])
    check_read_size(width, height, "HDR picture")
    try:
        exposure = math.prod(float(factor) for factor in _EXPOSURE.findall(data[: size.start()]))
        if not 1e-30 < exposure < 1e30:
            raise ValueError("no exposure")
        pixels = _decode_rgbe(data, size.end(), height, width)
    except (IndexError, ValueError) as error:
        raise EnvironmentMapError("The HDR picture is cut short or damaged.") from error
    scale = np.ldexp(np.float32(1), pixels[..., 3:].astype(np.int32) - 136)
    return np.asarray(pixels[..., :3] * (scale / np.float32(exposure)), dtype=np.float32)


def _decode_rgbe(data: bytes, start: int, height: int, width: int) -> NDArray[np.uint8]:
    """Mantissas and exponent (H, W, 4)."""
    if not height * width:
        raise ValueError("no pixels")
    if data[start : start + 2] != b"\x02\x02":
        return np.frombuffer(data, np.uint8, height * width * 4, start).reshape(height, width, 4)
    rows, position = [], start
    for _ in range(height):
        if data[position : position + 4] != _row_start(width):
            raise ValueError("a row does not start as one")
        row, position = _decode_runs(data, position + 4, 4 * width)
        rows.append(np.frombuffer(row, np.uint8).reshape(4, width).T)
    return np.stack(rows)


def _decode_runs(data: bytes, position: int, length: int) -> tuple[bytes, int]:
    """The four channels of a row, one behind the other, and where the next one starts."""
    row = bytearray()
    while len(row) < length:
        count = data[position]
        if count > 128:  # a run
            row += data[position + 1 : position + 2] * (count - 128)
            position += 2
        else:
            row += data[position + 1 : position + 1 + count]
            position += 1 + count
    if len(row) != length:
        raise ValueError("a run crosses the end of its row")
    return bytes(row), position

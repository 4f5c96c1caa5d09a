"""Deflate by ISA-L's igzip, in threads, and what is packed so: PNGs, and chunks of an EXR.

igzip takes a fourth of zlib's time [1]. Where it has no wheel, zlib does the same work. Bytes are the same on any
number of threads.

References:
    [1] https://python-isal.readthedocs.io
    [2] ISO/IEC 15948, Portable Network Graphics: chunks, and filter 2, the difference to the row above.
    [3] RFC 1950: the header of a stream, and Adler-32 at its end.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lighting.runtime import available_cpus

try:
    from isal import isal_zlib as packer
except ImportError:
    packer = zlib  # type: ignore[misc,unused-ignore]  # has the same functions

_MAX_HALF = 65504.0  # the largest half float
_MIN_NORMAL_HALF = 2.0**-14  # the least half float that has all its digits
_MIN_ROW_MEAN = 2.0**-12  # of a row of half floats, beside which their steps of 2^-24 do not count
CHUNK_ROWS = 16  # that ZIP packs together, and that are worked on at once
_EFFORT = 1  # 0 to 3; more takes longer and saves less than 1 %
_THREADS = 4  # beyond which packing gets no faster
_AHEAD = 16  # parts a thread that are packed before the first of them is taken
_BAND_BYTES = 1 << 21  # of rows of a PNG that are packed at once
_ADLER_BASE = 65521
_COLOR_TYPES = {1: 0, 3: 2, 4: 6}  # of a PNG, by its channels
_limit = _THREADS
_Part = TypeVar("_Part")
_Packed = TypeVar("_Packed")


def limit_packing_threads(count: int) -> None:
    """Pack in at most so many threads from now on.

    Args:
        count: of threads, 1 or more.
    """
    global _limit
    _limit = count


def pack_in_threads(pack: Callable[[_Part], _Packed], parts: Sequence[_Part]) -> Iterator[_Packed]:
    """Yield what a function makes of each part, in order; threads are some parts ahead.

    Args:
        pack: the function.
        parts: its arguments.
    """
    threads = min(_limit, _THREADS, available_cpus(), len(parts))
    if threads <= 1:
        yield from map(pack, parts)
        return
    with ThreadPoolExecutor(threads) as pool:  # of its own: a process that is forked has none of another's threads
        for start in range(0, len(parts), threads * _AHEAD):
            yield from pool.map(pack, parts[start : start + threads * _AHEAD])


def deflate(data: NDArray[np.uint8]) -> bytes:
    """Return the zlib stream of bytes (N,).

    Args:
        data: contiguous in memory.
    """
    return packer.compress(data, _EFFORT)


def encode_png(pixels: NDArray[np.uint8] | NDArray[np.uint16], texts: Mapping[str, str] | None = None) -> bytes:
    """Return the bytes of a PNG of 8 or 16 bits.

    Args:
        pixels: (H, W, 3 or 4) sRGB, or (H, W) of one channel.
        texts: keywords and their texts, Latin-1; None: none.
    """
    height, width, channels = (*pixels.shape, 1)[:3]
    rows = np.ascontiguousarray(pixels, pixels.dtype.newbyteorder(">")).view(np.uint8).reshape(height, -1)
    band = max(1, _BAND_BYTES // rows.shape[1])
    adler, stream = 1, [b"\x78\x01"]
    starts = range(0, height, band)
    for data, checksum, size in pack_in_threads(lambda start: _pack_band(rows, start, start + band), starts):
        adler = _join_adler(adler, checksum, size)
        stream.append(data)
    head = struct.pack(">IIBBBBB", width, height, 8 * pixels.dtype.itemsize, _COLOR_TYPES[channels], 0, 0, 0)
    chunks = [
        (b"IHDR", head),
        *((b"tEXt", f"{name}\0{text}".encode("latin-1")) for name, text in (texts or {}).items()),
        (b"IDAT", b"".join(stream) + adler.to_bytes(4, "big")),
        (b"IEND", b""),
    ]
    framed = (
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", packer.crc32(kind + data))
        for kind, data in chunks
    )
    return b"\x89PNG\r\n\x1a\n" + b"".join(framed)


def _pack_band(rows: NDArray[np.uint8], start: int, stop: int) -> tuple[bytes, int, int]:
    """A part of a stream that holds some rows (H, B) as differences; Adler-32 and number of the bytes in it."""
    band = rows[start:stop]
    filtered = np.empty((len(band), 1 + band.shape[1]), np.uint8)
    filtered[:, 0] = 2
    np.subtract(band[0], rows[start - 1] if start else 0, out=filtered[0, 1:])
    np.subtract(band[1:], band[:-1], out=filtered[1:, 1:])
    stream = packer.compressobj(_EFFORT, packer.DEFLATED, -packer.MAX_WBITS)
    ends = packer.Z_FINISH if stop >= len(rows) else packer.Z_FULL_FLUSH
    data = stream.compress(filtered) + stream.flush(ends)
    return data, packer.adler32(filtered), filtered.size


def _join_adler(first: int, second: int, size: int) -> int:
    """Adler-32 of bytes by those of their two parts, and the size of the second part."""
    low, high = first & 0xFFFF, first >> 16
    joined = high + (second >> 16) + size * (low - 1)
    return joined % _ADLER_BASE << 16 | (low + (second & 0xFFFF) - 1) % _ADLER_BASE


def fits_half(image: NDArray[np.float32]) -> bool:
    """Whether half floats hold the light of an image: none of it is too bright, and no row too dark.

    Args:
        image: (H, W, 3) linear.
    """
    if not (image.size and image.min() >= 0 and image.max() <= _MAX_HALF):  # false for NaN
        return False
    means = image.reshape(len(image), -1) @ np.tile(np.eye(3, dtype=np.float32) / image.shape[1], (image.shape[1], 1))
    return bool(((means == 0) | (means >= _MIN_ROW_MEAN)).all())


def deflate_chunk(pixels: NDArray[np.float32], is_half: bool, start: int) -> bytes:
    """Return CHUNK_ROWS rows as a chunk of an EXR in ZIP.

    That is B, G and R of each row; every other byte, then the rest; as differences; deflated.

    Args:
        pixels: (H, W, 3).
        is_half: whether they become half floats, which hold them.
        start: the first row.
    """
    planes = np.ascontiguousarray(pixels[start : start + CHUNK_ROWS, :, ::-1].transpose(0, 2, 1))
    raw = (_round_to_half(planes) if is_half else planes).view(np.uint8).reshape(-1)
    halves = raw.reshape(-1, 2).T.reshape(-1)
    differences = np.empty_like(halves)
    differences[0] = halves[0]
    np.subtract(halves[1:], halves[:-1], out=differences[1:])
    differences[1:] += np.uint8(128)
    data = deflate(differences)
    return data if len(data) < raw.size else raw.tobytes()  # as readers tell by its length


def _round_to_half(values: NDArray[np.float32]) -> NDArray[np.float16]:
    """The nearest half floats, to even, of values (...) from 0 to 65504: of their bits, where none of them is tiny."""
    if values.min() < _MIN_NORMAL_HALF:
        return values.astype(np.float16)
    bits = values.view(np.uint32)
    rounded = bits >> np.uint32(13)
    rounded &= np.uint32(1)
    rounded += bits
    rounded += np.uint32(0xFFF)  # just under half of a step; the bit before makes it half where that is even
    rounded -= np.uint32(112 << 23)  # exponents of half floats count from 15, not from 127
    rounded >>= np.uint32(13)
    return rounded.astype(np.uint16).view(np.float16)

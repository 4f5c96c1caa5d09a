"""How the pixels of an EXR are packed: which ways there are, and what each costs.

docs/performance.md says which programs opened which of them, how long they take and how large the files are.
"""

import ctypes
import os
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.cpus import available_cpus
from lighting.errors import EnvironmentMapError

COMPRESSIONS = {"zip": "ZIP_COMPRESSION", "pxr24": "PXR24_COMPRESSION", "none": "NO_COMPRESSION"}  # OpenEXR's names
_REMOVED = ("zip-exact", "piz", "htj2k")  # they changed no value

MANTISSA = 13  # bits that `zip` keeps, so that a value changes by no more than 1 part in 2^14
_DROPPED = 23 - MANTISSA
_HALF, _MASK = np.uint32(1 << (_DROPPED - 1)), np.uint32(0xFFFFFFFF << _DROPPED & 0xFFFFFFFF)
_ROWS = 32  # that are rounded at once
_THREADS = 4  # beyond which packing gets no faster
_EFFORT = 1  # of ZIP, 1 to 9: a third less work than OpenEXR's own 4, for a seventh more bytes
_SET_EFFORT = "_ZN7Imf_3_529setDefaultZipCompressionLevelEi"  # Imf::setDefaultZipCompressionLevel(int) of OpenEXR 3.5


def check_packing(compression: str) -> None:
    """Raise EnvironmentMapError for what is not among COMPRESSIONS; of one that was, it says what to use instead."""
    if compression in _REMOVED:
        raise EnvironmentMapError(f"The compression {compression!r} was removed; none changes no value either.")
    if compression not in COMPRESSIONS:
        raise EnvironmentMapError(
            f"The compression {compression!r} is not known; it must be one of {', '.join(COMPRESSIONS)}."
        )


def packed_with(image: NDArray[np.float32], compression: str) -> tuple[Any, NDArray[np.float32]]:
    """OpenEXR's name of the compression, and the pixels as it is to pack them.

    Raises EnvironmentMapError for one that is not among COMPRESSIONS.
    """
    check_packing(compression)
    library = _library()
    return getattr(library, COMPRESSIONS[compression]), rounded(image) if compression == "zip" else image


def rounded(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """The values as `round_in_place` leaves them, in an array of their own unless they are so already."""
    if is_rounded(image):
        return image
    values = np.empty_like(image)
    _round(image, values)
    return values


def round_in_place(image: NDArray[np.float32]) -> None:
    """Round the values to MANTISSA bits, half away from zero; what would become infinite stays as it is.

    The zeros that this leaves at the end of every number are what ZIP packs fast and small.
    """
    _round(image, image)


def _round(image: NDArray[np.float32], target: NDArray[np.float32]) -> None:
    """Fill `target`, which may be the image itself, with its values rounded."""
    for rows, there in zip(_bands(image), _bands(target), strict=True):
        bits = rows.view(np.uint32) + _HALF
        bits &= _MASK
        values = bits.view(np.float32)
        kept = np.isfinite(values)
        there[:] = values if kept.all() else np.where(kept, values, rows)


def is_rounded(image: NDArray[np.float32]) -> bool:
    """Whether rounding changes nothing."""
    return not any((rows.view(np.uint32) & ~_MASK).any() for rows in _bands(image))


def _bands(image: NDArray[np.float32]) -> Iterator[NDArray[np.float32]]:
    """Views of a few rows each, so that what is computed of one stays in the processor's cache."""
    for start in range(0, len(image), _ROWS):
        yield image[start : start + _ROWS]


def pack_in_threads(count: int) -> None:
    """Pack in this many threads from now on; one packs in the thread that asks, since a pool of one is slower."""
    _library().set_global_thread_count(count if count > 1 else 0)


@cache
def _library() -> Any:
    """OpenEXR with little effort in ZIP, and a thread for each CPU unless the program has set their number itself."""
    import OpenEXR

    with suppress(OSError, AttributeError):  # Python's module has no name for it; without it ZIP is as good, but slower
        getattr(ctypes.CDLL(OpenEXR.__file__), _SET_EFFORT)(ctypes.c_int(_EFFORT))
    if OpenEXR.global_thread_count() == 0:
        OpenEXR.set_global_thread_count(min(_THREADS, available_cpus()))
        if hasattr(os, "register_at_fork"):
            _rest_over_forks(OpenEXR)
    return OpenEXR


def _rest_over_forks(library: Any) -> None:
    """End the threads before a fork and start them again in the parent; the child packs in its own thread.

    A forked process has none of them, and would wait for them for ever.
    """
    counts: list[int] = []

    def rest() -> None:
        counts.append(library.global_thread_count())
        library.set_global_thread_count(0)

    os.register_at_fork(before=rest, after_in_parent=lambda: library.set_global_thread_count(counts.pop()))

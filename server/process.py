"""How this process works with threads and memory."""

import ctypes
import os
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_KEPT = 1 << 28  # bytes of free memory that stay with the process
_BUFFER = 1 << 25  # bytes; what is larger is asked of the system each time, and no more is allowed here


def prepare() -> None:
    """One thread for each photo, and memory that is used again: to be called before numpy is imported.

    OpenBLAS's own threads would spin beside those that work on other photos. And glibc would return the buffers of a
    photo to the system and fault them in again for the next, in as many heaps as there are threads.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep:  # musl has none
        for option, value in ((_M_ARENA_MAX, 1), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)


def share_compression(threads: int) -> None:
    """Let so many threads compress the blocks of an EXR; a pool of one would be slower than none."""
    import OpenEXR

    OpenEXR.set_global_thread_count(threads if threads > 1 else 0)

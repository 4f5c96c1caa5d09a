"""Threads and memory of the server's process."""

import ctypes
import os
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_KEPT = 1 << 28  # bytes of free memory that the process keeps
_BUFFER = 1 << 25  # bytes; larger blocks are requested from the system each time; glibc allows no larger limit


def prepare() -> None:
    """Use one thread per photo and reuse memory; call this before numpy is imported.

    OpenBLAS's own threads would compete with those that process other photos. And glibc would return each photo's
    buffers to the system and request them again for the next photo, in one heap per thread.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep:  # musl has none
        for option, value in ((_M_ARENA_MAX, 1), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)


def share_compression(threads: int) -> None:
    """Compress the blocks of an EXR in this many threads. For one, no pool is made: it would be slower than none."""
    import OpenEXR

    OpenEXR.set_global_thread_count(threads if threads > 1 else 0)

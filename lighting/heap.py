"""glibc's heap, told to keep what it has; on other systems nothing happens."""

import ctypes
import sys

_M_TRIM_THRESHOLD, _M_MMAP_THRESHOLD, _M_ARENA_MAX = -1, -3, -8  # glibc's malloc.h
_KEPT = 1 << 28  # bytes of free memory that the process keeps
_BUFFER = 1 << 25  # bytes; larger blocks are requested from the system each time; glibc allows no larger limit


def keep_memory() -> None:
    """Reuse freed memory, in one heap for all threads.

    By itself glibc takes each large buffer from the system and gives it back, in one heap per thread; taking fresh
    pages costs as much as filling them.
    """
    keep = getattr(ctypes.CDLL(None), "mallopt", None) if sys.platform == "linux" else None
    if keep:  # musl has none
        for option, value in ((_M_ARENA_MAX, 1), (_M_TRIM_THRESHOLD, _KEPT), (_M_MMAP_THRESHOLD, _BUFFER)):
            keep(option, value)

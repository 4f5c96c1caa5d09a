"""Threads and memory of the server's process."""

import os

from lighting.heap import keep_memory


def prepare() -> None:
    """Use one thread per photo and reuse memory; call this before numpy is imported.

    OpenBLAS's own threads would compete with those that process other photos. And glibc would return each photo's
    buffers to the system and request them again for the next photo, in one heap per thread.
    """
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    keep_memory()

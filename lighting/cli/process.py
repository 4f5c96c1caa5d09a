"""The process of a command: made ready for a short life, and ended at once."""

import atexit
import errno
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress

from lighting.heap import keep_memory

_BRIEF = frozenset({"estimate", "envmap", "preview", "render"})  # commands that mostly end in less than a second
_GARBAGE = 100_000  # objects after which cycles among them are sought; the imports alone make tens of thousands


def prepare(arguments: Sequence[str]) -> None:
    """Save a brief command what pays in long ones alone; call this before numpy is imported.

    OpenBLAS's threads would spin while they wait for products of matrices that are too small to share.
    """
    if _BRIEF.isdisjoint(arguments):
        return
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    gc.set_threshold(_GARBAGE)
    keep_memory()


class _ClosedStdout(io.TextIOBase):
    """What takes the place of a stdout that is closed: an answer is not lost without a word."""

    def write(self, text: str) -> int:
        if not text:
            return 0
        raise OSError(errno.EBADF, "There is no stdout to write to, it is closed")


def hold_closed_streams() -> None:
    """Put something in the place of streams that the caller closed: what is said on stderr is lost, on stdout it fails.

    Their numbers are held, too: otherwise the next file that is opened gets one, and what a library prints goes there.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # the lowest number that is free
    if sys.stdout is None:
        sys.stdout = _ClosedStdout()
    if sys.stderr is None:
        sys.stderr = os.fdopen(2, "w", encoding="utf-8")


@contextmanager
def ending_at_once() -> Iterator[None]:
    """Ctrl-C ends the process within the block, which has nothing to put in order and waits for a thread.

    Python would raise an exception. Where both threads import, that may come while an object is taken apart, which
    loses it, and leave the lock of imports held, for which the other thread then waits for ever.
    """
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _abort)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _abort(*_: object) -> None:
    """End the process with what click says and returns on Ctrl-C."""
    with suppress(OSError):
        os.write(2, b"\nAborted!\n")
    os._exit(1)


def leave(status: int) -> None:
    """End the process without taking its objects apart; what waits for its end is called, and what is said is written.

    It returns where somebody watches the program (a profiler or a debugger), or where a stream cannot be written, and
    leaves the end to Python.
    """
    if sys.gettrace() or sys.getprofile():
        return
    atexit._run_exitfuncs()
    try:
        for stream in filter(None, (sys.stdout, sys.stderr)):
            stream.flush()
    except (OSError, ValueError):
        return
    os._exit(status)

"""The process of a command: made ready for a short life, its signals, silence and end.

Its network is loaded while the rest is imported.
"""

import atexit
import errno
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TextIO

from lighting.errors import ModelError
from lighting.runtime import ONE_BLAS_THREAD, keep_memory, reserve_heap

if TYPE_CHECKING:
    from concurrent.futures import Future, ThreadPoolExecutor

    from lighting.onnx_session import OnnxSession

_BRIEF_COMMANDS = frozenset({"estimate", "envmap", "preview", "render"})  # that mostly end in less than a second
_ONE_PHOTO_COMMANDS = frozenset({"envmap", "estimate", "preview", "scene"})  # that mostly run the network once
_GC_THRESHOLD = 100_000  # objects after which cycles among them are sought; the imports alone make tens of thousands


def prepare_process(command: str) -> None:
    """Give sums one order, and save a brief command what pays in long ones alone; call this before numpy is imported.

    OpenBLAS's threads would add in another order, and spin while they wait for products that are too small to share.

    Args:
        command: its name.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    ONE_BLAS_THREAD.is_given = os.environ["OPENBLAS_NUM_THREADS"] == "1"
    if command in _BRIEF_COMMANDS:
        gc.set_threshold(_GC_THRESHOLD)
        keep_memory()
    elif command == "video":
        keep_memory()


@dataclass
class StartedNetwork:
    """The packaged network, which a thread loads for one photo."""

    thread: "ThreadPoolExecutor"
    """That loads it, and runs it."""
    session: "Future[OnnxSession] | None"
    """Of onnxruntime. None: it was taken."""

    def take(self) -> "OnnxSession | None":
        """Return the session, for one use, after which it is gone; None where it was taken."""
        session, self.session = self.session, None
        return session.result() if session else None


def start_network(command: str) -> StartedNetwork | None:
    """Begin to load the packaged network, in a thread, if a command mostly runs it on one photo.

    Args:
        command: its name.
    """
    if command not in _ONE_PHOTO_COMMANDS:
        return None
    from concurrent.futures import ThreadPoolExecutor

    from lighting.checksum import DATA_FOLDER
    from lighting.onnx_session import create_session, import_onnxruntime, packaged_network

    import_onnxruntime()  # here, for two threads that import wait for each other
    with suppress(ModelError):  # which is raised where the network is needed
        file = packaged_network(DATA_FOLDER, "outdoor")
        thread = ThreadPoolExecutor(1)
        if command in _BRIEF_COMMANDS:
            reserve_heap(2)
        return StartedNetwork(thread, thread.submit(create_session, file, 0, for_one_run=True))
    return None


class _ClosedStdout(io.TextIOBase):
    """A stdout that is closed: an answer is not lost without a word."""

    def write(self, text: str) -> int:
        if not text:
            return 0
        raise OSError(errno.EBADF, "There is no stdout to write to, it is closed")


def replace_closed_streams() -> None:
    """Replace streams that the caller closed: what is written to stderr is lost, to stdout it fails.

    Their numbers are taken, too: otherwise the next file that is opened gets one, and what a library prints goes there.
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
def exit_on_interrupt() -> Iterator[None]:
    """Ctrl-C ends the process within the block, which has nothing to put in order and waits for a thread.

    Python would raise an exception. Where both threads import, that may come while an object is taken apart, which
    loses it. It may also leave the lock of imports held; the other thread then waits for ever.
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


def exit_now(status: int) -> None:
    """End the process without taking its objects apart; what waits for its end is called, and streams are flushed.

    It returns where somebody watches the program (a profiler or a debugger), or where a stream cannot be written and
    nothing has failed before, and leaves the end to Python.

    Args:
        status: exit status.
    """
    if sys.gettrace() or sys.getprofile():
        return
    atexit._run_exitfuncs()
    for stream in filter(None, (sys.stdout, sys.stderr)):
        try:
            stream.flush()
        except (OSError, ValueError):
            if status == 0:
                return
    os._exit(status)


@contextmanager
def silence_libraries() -> Iterator[TextIO]:
    """Nothing reaches stdout, nor stderr, of which OpenEXR writes in C; for a process of one thread.

    What is written to the stream that it yields reaches stderr all the same: a progress bar.
    """
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
        if sys.stderr is None:  # closed, so that its number may be another file's
            yield nowhere
            return
        with os.fdopen(os.dup(2), "w", encoding="utf-8") as stderr:
            try:
                os.dup2(nowhere.fileno(), 2)
                yield stderr
            finally:
                os.dup2(stderr.fileno(), 2)

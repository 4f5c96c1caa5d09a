"""The process of a command: signals, silence, its end."""

import atexit
import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout, suppress
from pathlib import Path
from typing import TextIO


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

    It returns where somebody watches the program (a profiler or a debugger), or where a stream cannot be written, and
    leaves the end to Python.

    Args:
        status: exit status.
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

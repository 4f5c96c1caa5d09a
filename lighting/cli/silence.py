"""Keeping what a library prints on its own from the terminal."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import TextIO


@contextmanager
def silence() -> Iterator[TextIO]:
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

"""Keeping what a library prints on its own from the terminal."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path


@contextmanager
def silence() -> Iterator[None]:
    """Nothing reaches stdout, nor stderr, of which OpenEXR writes in C; for a process of one thread."""
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere):
        if sys.stderr is None:  # closed, so that its number may be another file's
            yield
            return
        stderr = os.dup(2)
        try:
            os.dup2(nowhere.fileno(), 2)
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)

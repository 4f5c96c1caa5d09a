"""Files that appear under their final name only when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(target: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `target` that takes its place if the block ends well and vanishes if it does not.

    The suffix is kept, since writers read the format from it. Raises OSError where the folder cannot be written.
    """
    final = Path(target)
    temporary = _empty(final)
    try:
        yield temporary
        temporary.replace(final)
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(temporary), temporary):
            raise OSError(error.errno, error.strerror, str(final)) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def _empty(final: Path) -> Path:
    """A new file beside another, with the permissions of any file that the process makes."""
    path = final.parent / f".{os.urandom(8).hex()}{final.suffix}"
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(final)) from error
    return path

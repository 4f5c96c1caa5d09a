"""Files that appear under their final name only when they are whole."""

import errno
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_RANDOM = 8  # bytes in a temporary name


@contextmanager
def replacing(target: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path beside `target` that takes its place if the block ends well and vanishes if it does not.

    The suffix is kept, since writers read the format from it. A link stays, and what it leads to is replaced; a file
    that is replaced passes its permissions on. Raises OSError where the folder cannot be written, and for a pipe or a
    device, which a file would take away from others: /dev/null from the whole system.
    """
    final = Path(os.path.realpath(target))
    if final.exists() and not final.is_file() and not final.is_dir():
        raise OSError(errno.EEXIST, "it is a pipe or a device, not a file", str(target))
    temporary = _empty(final, Path(target).suffix)
    try:
        yield temporary
        if final.is_file():
            temporary.chmod(stat.S_IMODE(final.stat().st_mode))
        temporary.replace(final)
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(temporary), temporary):
            raise OSError(error.errno, error.strerror, str(target)) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def leftovers(target: str | os.PathLike[str]) -> list[Path]:
    """Temporary files of `replacing` with the suffix of `target` in its folder.

    While nobody writes there, they are what killed processes left.
    """
    final = Path(os.path.realpath(target))
    name = re.compile(rf"\.[0-9a-f]{{{2 * _RANDOM}}}{re.escape(Path(target).suffix)}")
    return [path for path in final.parent.iterdir() if name.fullmatch(path.name)] if final.parent.is_dir() else []


def _empty(final: Path, suffix: str) -> Path:
    """A new file beside another, with the permissions of any file that the process makes."""
    path = final.parent / f".{os.urandom(_RANDOM).hex()}{suffix}"
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(final)) from error
    return path

"""Atomic replacement, output folders, PNG and JPEG bytes."""

import errno
import io
import os
import re
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Files that appear under their final name only when they are whole.

_RANDOM = 8  # bytes in a temporary name


@contextmanager
def atomic_write(target: str | os.PathLike[str]) -> Iterator[Path]:
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


def stale_temporaries(target: str | os.PathLike[str]) -> list[Path]:
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


# Pixels as the bytes of pictures that everybody opens.


def encode_png(pixels: NDArray[np.uint8], compress_level: int = 6) -> bytes:
    """The bytes of a PNG of pixels (H, W, 3 or 4), or of one channel (H, W)."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=compress_level)
    return buffer.getvalue()


def encode_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """The bytes of a JPEG of pixels (H, W, 3), without metadata."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


# Folders that results go to.

_NEEDS_FOLDER = "the results need a folder"


def output_folder_error(
    folder: Path, *, overwrite: bool, what: str = "the results", need: str = _NEEDS_FOLDER
) -> str | None:
    """Why something cannot or must not be written to a folder, in a sentence; None where nothing is in the way.

    `what` is its name in the sentence, `need` says that it takes a folder.
    """
    parent = folder.absolute().parent
    if folder.exists() and not folder.is_dir():
        return f"{folder} is a file; {need}."
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        return f"{folder} is not empty; --overwrite replaces {what} in it."
    if not parent.is_dir():
        return f"There is no folder {parent}."
    closed = (place for place in (parent, folder) if place.exists() and not os.access(place, os.W_OK | os.X_OK))
    return next((f"The folder {place} cannot be written to." for place in closed), None)

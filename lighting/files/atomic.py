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

_RANDOM_BYTES = 8  # in a temporary name


@contextmanager
def atomic_write(target: str | os.PathLike[str]) -> Iterator[Path]:
    """A temporary path that replaces the target if the block ends well, and vanishes if it does not.

    The suffix is kept, since writers read the format from it. A link stays, and what it leads to is replaced. A file
    that is replaced passes its permissions on. Raises OSError where the folder cannot be written, and for a pipe or a
    device, which a file would take away from others: /dev/null from the whole system.

    Args:
        target: path under which the file appears when it is whole.
    """
    final = Path(os.path.realpath(target))
    if final.exists() and not final.is_file() and not final.is_dir():
        raise OSError(errno.EEXIST, "it is a pipe or a device, not a file", str(target))
    temporary = _create_beside(final, Path(target).suffix)
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
    """Temporary files of `atomic_write` in a folder: while nobody writes in it, what killed processes left.

    Args:
        target: path whose folder and suffix count.
    """
    final = Path(os.path.realpath(target))
    name = re.compile(rf"\.[0-9a-f]{{{2 * _RANDOM_BYTES}}}{re.escape(Path(target).suffix)}")
    return [path for path in final.parent.iterdir() if name.fullmatch(path.name)] if final.parent.is_dir() else []


def _create_beside(final: Path, suffix: str) -> Path:
    """A new file beside another, with the permissions of any file that the process makes."""
    path = final.parent / f".{os.urandom(_RANDOM_BYTES).hex()}{suffix}"
    try:
        os.close(os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(final)) from error
    return path


def encode_png(pixels: NDArray[np.uint8], compress_level: int = 6) -> bytes:
    """The bytes of a PNG.

    Args:
        pixels: (H, W, 3 or 4) sRGB, or (H, W) of one channel.
        compress_level: 0 fast to 9 small.
    """
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=compress_level)
    return buffer.getvalue()


def encode_jpeg(pixels: NDArray[np.uint8], quality: int) -> bytes:
    """The bytes of a JPEG without metadata.

    Args:
        pixels: (H, W, 3) sRGB.
        quality: 1 to 95.
    """
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def output_folder_error(
    folder: Path, *, overwrite: bool, what: str = "the results", need: str = "the results need a folder"
) -> str | None:
    """Why results cannot or must not be written to a folder, in a sentence; None where nothing is in the way.

    Args:
        folder: that may exist or not.
        overwrite: whether files in it may be replaced.
        what: name of the results in the sentence.
        need: says that they take a folder.
    """
    parent = folder.absolute().parent
    if folder.exists() and not folder.is_dir():
        return f"{folder} is a file; {need}."
    if not overwrite and folder.is_dir() and any(folder.iterdir()):
        return f"{folder} is not empty; --overwrite replaces {what} in it."
    if not parent.is_dir():
        return f"There is no folder {parent}."
    closed = (path for path in (parent, folder) if path.exists() and not os.access(path, os.W_OK | os.X_OK))
    return next((f"The folder {path} cannot be written to." for path in closed), None)

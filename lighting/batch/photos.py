"""The photos of a batch: those in a folder, or those that a glob matches."""

import glob
import os
from collections.abc import Iterator
from pathlib import Path

from lighting.errors import BatchError

SUFFIXES = (".jpg", ".jpeg", ".png", ".webp", ".heic", ".heif")  # of photos in a folder; a glob may match any file


def find_photos(pattern: str) -> tuple[str, list[str]]:
    """A folder, and the sorted names of photos relative to it.

    `pattern` is a folder, whose photos count at any depth, or a glob, whose folder is the part before its first
    wildcard. Raises BatchError if there is no photo.
    """
    if Path(pattern).is_dir():
        source, names = pattern, list(_photos_below(Path(pattern)))
    else:
        source = _fixed_part(pattern)
        names = list(_matches(pattern, Path(source)))
    if not names:
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any.")
    return source, sorted(names)


def _photos_below(source: Path) -> Iterator[str]:
    """Names of the photos at any depth, without hidden files and folders."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        yield from ((below / name).as_posix() for name in files if name.lower().endswith(SUFFIXES) and name[0] != ".")


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once."""
    matches = glob.iglob(pattern, recursive=True)  # noqa: PTH207, a pattern may be absolute
    yield from (Path(path).relative_to(source).as_posix() for path in set(matches) if Path(path).is_file())


def _fixed_part(pattern: str) -> str:
    parts = Path(pattern).parts[:-1]
    plain = next((index for index, part in enumerate(parts) if glob.has_magic(part)), len(parts))
    return str(Path(*parts[:plain]))

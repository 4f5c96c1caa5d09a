"""The photos of a batch: those in a folder, or those that a glob matches."""

import glob
import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from lighting.batch.summary import in_words
from lighting.errors import BatchError
from lighting.photo import RAW_SUFFIXES

SUFFIXES = (  # of photos in a folder; a glob may match any file
    ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".heic", ".heif", ".hif", ".tif", ".tiff", ".avif",
    *RAW_SUFFIXES, ".x3f",
)  # fmt: skip
OTHERS = (  # of pictures that are no photos, or that nothing here is known to read
    ".heics", ".heifs", ".avifs",
    ".srw", ".3fr", ".fff", ".iiq", ".erf", ".kdc", ".dcr", ".mrw", ".mef", ".mos",
    ".gif", ".bmp", ".jxl", ".jp2", ".j2k", ".jxr", ".psd", ".svg", ".exr", ".hdr", ".tga", ".ppm", ".xcf", ".ico",
)  # fmt: skip


def find_photos(pattern: str) -> tuple[str, list[str]]:
    """A folder, and the sorted names of photos relative to it.

    `pattern` is a folder, whose photos count at any depth, or a glob, whose folder is the part before its first
    wildcard. Raises BatchError if there is no photo, and for an empty pattern, as an unset variable of a shell is.
    """
    if not pattern:
        raise BatchError("The input is empty; it must be a folder or a pattern.")
    if Path(pattern).is_dir():
        source, names = pattern, list(_files_below(Path(pattern), SUFFIXES))
    else:
        source = _fixed_part(pattern)
        names = list(_matches(pattern, Path(source)))
    if not names:
        others = in_words(other_pictures(pattern))
        but = f"; its pictures are of kinds that are not read{others}" if others else ""
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any{but}.")
    return source, sorted(names)


def other_pictures(pattern: str) -> Counter[str]:
    """How many pictures of each kind that is not read lie in a folder, by suffix; none for a glob.

    Maps that a batch wrote beside their photos are no such pictures.
    """
    folder = Path(pattern)
    names = _files_below(folder, OTHERS) if folder.is_dir() else ()
    return Counter(Path(name).suffix.lower() for name in names if not _is_map(name))


def _is_map(name: str) -> bool:
    """Whether a file is named as a batch names a photo's map."""
    return name.endswith(".exr") and name.removesuffix(".exr").lower().endswith(SUFFIXES)


def _files_below(source: Path, suffixes: tuple[str, ...]) -> Iterator[str]:
    """Names of the files at any depth that end so, without hidden files and folders."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        for name in files:
            if name.lower().endswith(suffixes) and name[0] != "." and not _would_wait(Path(parent, name)):
                yield (below / name).as_posix()


def _would_wait(path: Path) -> bool:
    """Whether a file is a pipe, a socket or a device, from which reading may not end; a broken link is none."""
    return path.exists() and not path.is_file()


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once; hidden ones only where the glob names a dot.

    No link to a folder is followed by `**`, for it may lead back to where it stands. Raises BatchError for a name that
    holds `**` beside other letters.
    """
    parts = Path(pattern).parts[len(source.parts) :]
    if any("**" in part and part != "**" for part in parts):
        raise BatchError(f"{pattern} is no pattern: ** stands for folders, between slashes alone.")
    if parts[-1] == "**":
        parts = (*parts, "*")
    dotted = any(part.startswith(".") for part in parts)
    names = {path.relative_to(source) for path in source.glob(str(Path(*parts))) if path.is_file()}
    yield from (name.as_posix() for name in names if dotted or not any(part.startswith(".") for part in name.parts))


def _fixed_part(pattern: str) -> str:
    parts = Path(pattern).parts[:-1]
    plain = next((index for index, part in enumerate(parts) if glob.has_magic(part)), len(parts))
    return str(Path(*parts[:plain]))

"""The photos of a batch: those of a folder or a pattern, and what a person knows of single ones.

The latter stands in a table in CSV: a row a photo, columns by the options' names.
"""

import csv
import glob
import hashlib
import os
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path, PurePath
from typing import Any

from lighting.batch.results import JOURNAL, SETTINGS, TABLE
from lighting.errors import SHORT_FORMS, BatchError, LightingError
from lighting.fields import option_name
from lighting.files import MAP_FORMATS, PREVIEW_ENDING
from lighting.fusion.fspy import read_fspy
from lighting.fusion.user_input import NO_USER_INPUT, UserInput
from lighting.map_options import Adjustments
from lighting.photo.linear import RAW_SUFFIXES

PHOTO_SUFFIXES = (  # of photos in a folder; a glob may match any file
    ".jpg", ".jpeg", ".jpe", ".jfif", ".mpo", ".png", ".webp", ".heic", ".heif", ".hif", ".tif", ".tiff", ".avif",
    *RAW_SUFFIXES, ".x3f",
)  # fmt: skip
_OTHER_SUFFIXES = (  # of pictures that are no photos or that nothing here is known to read, and of clips
    ".heics", ".heifs", ".avifs", ".insp", ".jps", ".pns", ".thm", ".lri",
    ".gpr", ".srw", ".sr2", ".srf", ".3fr", ".fff", ".iiq", ".eip", ".erf", ".kdc", ".dcr", ".dcs", ".k25",
    ".mrw", ".mef", ".mos", ".mdc", ".crw", ".bay", ".pxn", ".ptx", ".r3d", ".ari", ".braw", ".rwz", ".raw", ".cin",
    ".gif", ".bmp", ".dib", ".jxl", ".jp2", ".j2k", ".j2c", ".jpf", ".jpx", ".jpm", ".jxr", ".wdp", ".hdp", ".jls",
    ".psd", ".psb", ".svg", ".svgz", ".pdf", ".eps", ".ai", ".exr", ".hdr", ".dpx", ".tga", ".dds", ".ktx",
    ".ppm", ".pgm", ".pbm", ".pnm", ".pam", ".pfm", ".xcf", ".kra", ".ora", ".ico", ".icns", ".pcx", ".sgi", ".qoi",
    ".flif", ".bpg", ".fits", ".djvu", ".wmf", ".emf", ".apng",
    ".mp4", ".mov", ".m4v", ".avi", ".mkv", ".webm", ".wmv", ".3gp", ".3g2", ".mts", ".m2ts", ".mpg", ".mpeg", ".flv",
    ".insv", ".360", ".lrv", ".lrf", ".livp",
)  # fmt: skip
IN_CACHES = "in caches"  # the reason of pictures that programs made of others, or that a user threw away
_CACHE_NAMES = {  # of folders, in small letters
    "@eadir", "@tmp", "#recycle", "#snapshot", "@recycle", "@recently-snapshot", "@transcode",  # of Synology and QNAP
    "@synoresource", "~snapshot", "files_trashbin", "files_versions",  # of Synology, NetApp and Nextcloud
    "system volume information", "network trash folder", "temporary items",
    "papierkorb", "corbeille", "papelera", "cestino", "prullenbak", "papperskorg", "lixeira", "kosz",
    "$recycle.bin", "recycle.bin", "recycler", "recycled", "recycle bin", "trash", "trash folder", "lost+found",
    "recently deleted", "deleted items", "__macosx", "thevolumesettingsfolder", "@sharesnap", "@recently",
    "корзина", "ごみ箱", "ゴミ箱", "回收站", "휴지통", "_vti_cnf", "node_modules",
}  # fmt: skip
_CACHE_NAME = re.compile(
    r"thumbnail|(?:^|[._@-])thumbs?$|(?:^|[ ._@-]|image|photo|preview)caches?$|^appdata_|\.lrdata$"
)
_LIBRARIES = (".photoslibrary", ".photolibrary", ".aplibrary", ".migratedphotolibrary")  # of Apple's programs
_ORIGINALS = ("originals", "masters")  # the folders of libraries that hold photos
_DERIVATIVES = ("derivatives", "renders")  # below a library's "resources"
_INDEX_FOLDERS = ("thm", "idx")  # below a camera's "misc"


def find_photos(pattern: str) -> tuple[str, list[str]]:
    """Find a batch's photos: their folder, and their sorted names relative to it.

    Args:
        pattern: a folder, whose photos count at any depth, or a glob, whose folder is the part before its first
            wildcard.

    Raises:
        BatchError: there is no photo, or the pattern is empty, as an unset variable of a shell is.
    """
    if not pattern:
        raise BatchError("The input is empty; it must be a folder or a pattern.")
    source, candidates = _candidates(pattern)
    suffixes = PHOTO_SUFFIXES if Path(pattern).is_dir() else ("",)
    names = sorted(name for name in candidates if name.lower().endswith(suffixes) and not is_set_aside(name, pattern))
    if not names:
        skipped = format_counts(count_skipped(pattern))
        hint = f"; what it holds is not taken{skipped}" if skipped else ""
        raise BatchError(f"{pattern} is neither a folder with photos nor a pattern that matches any{hint}.")
    return source, names


def count_skipped(pattern: str) -> Counter[str]:
    """Count the pictures and clips that are not taken: by suffix, previews, and those in caches.

    A batch's own maps are none of them. Of a glob, which says what is wanted, the last two count alone.

    Args:
        pattern: a folder or a glob.
    """
    folder, (_, candidates) = Path(pattern).is_dir(), _candidates(pattern)
    skipped = Counter[str]()
    for name in candidates:
        known = name.lower().endswith((*PHOTO_SUFFIXES, *_OTHER_SUFFIXES)) and not _is_own_output(name)
        if known and _is_in_cache(PurePath(name).parts[:-1], pattern):
            skipped[IN_CACHES] += 1
        elif known and _is_preview(name, pattern):
            skipped["named as previews"] += 1
        elif known and folder and not name.lower().endswith(PHOTO_SUFFIXES):
            skipped[PurePath(name).suffix.lower()] += 1
    return skipped


def is_set_aside(name: str, pattern: str) -> bool:
    """Tell whether a file is never a photo, by its name: a batch's own, a preview, or in a cache.

    A cache or previews that the pattern names are none.

    Args:
        name: of a file, relative to the batch's folder.
        pattern: a folder, its URI or a glob.
    """
    own = _is_own_output(name) or _is_preview(name, pattern)
    return own or _is_in_cache(PurePath(name).parts[:-1], pattern)


def format_counts(counts: Counter[str]) -> str:
    """Return the reasons in brackets after a space, such as "(2 .gif, 1 .jxl)", the most frequent first; "" for none.

    Args:
        counts: by the reason.
    """
    ordered = sorted(counts.items(), key=lambda kind: (-kind[1], kind[0]))
    listed = ", ".join(f"{count} {reason}" for reason, count in ordered)
    return f" ({listed})" if listed else ""


def _is_own_output(name: str) -> bool:
    """Whether a file is named as a batch names its results and a photo's map."""
    if PurePath(name).name in (SETTINGS, JOURNAL, TABLE):
        return True
    photo, _, suffix = name.rpartition(".")
    return suffix in MAP_FORMATS and MAP_FORMATS[suffix].read is not None and photo.lower().endswith(PHOTO_SUFFIXES)


def _is_preview(name: str, pattern: str) -> bool:
    """Whether a file is named as a photo's preview, unless the pattern names previews itself."""
    return name.lower().endswith(PREVIEW_ENDING) and not pattern.lower().endswith(PREVIEW_ENDING)


def _is_in_cache(folders: Sequence[str], pattern: str) -> bool:
    """Whether a folder on the way to a file holds what programs made of photos, or a user threw away.

    Folders that the pattern names itself are none.
    """
    lower = [folder.lower() for folder in folders]
    named = {part.lower() for part in PurePath(pattern).parts}
    for index, folder in enumerate(lower):
        parent = lower[index - 1] if index else ""
        cache = folder in _CACHE_NAMES or _CACHE_NAME.search(folder)
        derived = (parent == "resources" and folder in _DERIVATIVES) or (parent == "misc" and folder in _INDEX_FOLDERS)
        beside = parent.endswith(_LIBRARIES) and folder not in _ORIGINALS
        if (cache or derived or beside) and folder not in named:
            return True
    return False


def _candidates(pattern: str) -> tuple[str, Iterator[str]]:
    """A batch's folder, and names of all files in it at any depth, or of those that a glob matches."""
    if Path(pattern).is_dir():
        return pattern, _files_below(Path(pattern))
    source = _fixed_part(pattern)
    return source, _matches(pattern, Path(source))


def _files_below(source: Path) -> Iterator[str]:
    """Names of the files at any depth, without hidden files and folders."""
    for parent, folders, files in os.walk(source):
        folders[:] = [name for name in folders if not name.startswith(".")]
        below = Path(parent).relative_to(source)
        for name in files:
            relevant = name.lower().endswith((*PHOTO_SUFFIXES, *_OTHER_SUFFIXES)) and name[0] != "."
            if relevant and not _is_pipe_or_device(Path(parent, name)):
                yield (below / name).as_posix()


def _is_pipe_or_device(path: Path) -> bool:
    """Whether a file is a pipe, a socket or a device, from which reading may not end; a broken link is none."""
    return path.exists() and not path.is_file()


def _matches(pattern: str, source: Path) -> Iterator[str]:
    """Names of the files that a glob matches, each once; hidden ones only where the glob names a dot.

    A part that exists as it is written is no pattern, so that "[2024] trip" is that folder, never "2 trip". Nor are
    brackets: "a[1].*" is "a[1].jpg" where there is one, never "a1.jpg". No link to a folder is followed by `**`, for it
    may lead back to where it stands. Raises BatchError for a name that holds `**` beside other letters.
    """
    parts = Path(pattern).parts[len(source.parts) :]
    if any("**" in part and part != "**" for part in parts):
        raise BatchError(f"{pattern} is no pattern: ** means folders; write it between slashes, as in photos/**/*.jpg.")
    if parts[-1:] == ("**",):
        parts = (*parts, "*")
    hidden = any(part.startswith(".") for part in parts)
    found = {source}
    for part in parts:
        found = _match_part(found, part)
    names = {path.relative_to(source) for path in found if path.is_file()}
    yield from (name.as_posix() for name in names if hidden or not any(part.startswith(".") for part in name.parts))


def _match_part(folders: set[Path], part: str) -> set[Path]:
    """What a part of a glob matches in folders; if any of them holds it, or its brackets, as written, that alone."""
    if part == "**":
        return {Path(parent) for folder in folders for parent, _, _ in os.walk(folder)}
    written = {folder / part for folder in folders if _exists(folder / part)}
    return written or _glob_part(folders, part.replace("[", "[[]")) or _glob_part(folders, part)


def _glob_part(folders: set[Path], part: str) -> set[Path]:
    return {path for folder in folders if folder.is_dir() for path in folder.glob(part)}


def _exists(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that the system does not take, such as one that is too long
        return False


def _fixed_part(pattern: str) -> str:
    """The folder before a glob's first part that is a pattern."""
    folder = Path()
    for part in Path(pattern).parts[:-1]:
        if glob.has_magic(part) and not _exists(folder / part):
            break
        folder /= part
    return str(folder)


_FILE = "file"
_NUMBERS = ("latitude", "longitude", "heading", "vertical_fov", "camera_height")
_TEXTS = ("time", "utc_offset", "horizon", "reference")
_LISTS = {"shadow": "shadows", "vertical": "verticals"}  # separated by ;
_COLUMNS = (_FILE, *_TEXTS, *_NUMBERS, *_LISTS, "camera", "pick")


@dataclass(frozen=True)
class PhotoInput:
    """What is known of one photo."""

    user_input: UserInput = NO_USER_INPUT
    """Replaces what is stated of all photos, field by field."""
    pick: int | None = None
    """Number of the sun in `Lighting.sun_candidates` that shines. None: the answer's."""

    def over(self, common: UserInput) -> UserInput:
        """Return what is known of the photo, with what is stated of all.

        Args:
            common: of all photos.
        """
        stated: Any = {**common.explicit_fields(), **self.user_input.explicit_fields()}
        return UserInput(**stated)


@dataclass(frozen=True)
class PhotoTable:
    """The rows of a table, by the photo's name."""

    rows: Mapping[str, PhotoInput]
    """Names are relative to the batch's folder."""
    sha256: str
    """Of the file."""


def read_photo_table(path: str) -> PhotoTable:
    """Read a table.

    Args:
        path: of the CSV, in UTF-8; the first line names the columns, of _COLUMNS. Cameras of fSpy lie beside it.

    Raises:
        BatchError: it is no such table; the sentence names file and line.
        OSError: it cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        lines = list(csv.reader(StringIO(data.decode("utf-8-sig"))))
    except (ValueError, csv.Error) as error:
        raise BatchError(f"{path} is no table of text in UTF-8, with commas.") from error
    written = [cell.strip().lower().replace("-", "_") for cell in (lines[0] if lines else [])]
    header = [SHORT_FORMS.get(name, name) for name in written]
    if unknown := next((name for name in header if name not in _COLUMNS), None):
        raise BatchError(f"{path} has a column {unknown!r}; it may have {', '.join(_COLUMNS)}.")
    if header.count(_FILE) != 1 or len(set(header)) < len(header):
        raise BatchError(f"{path} needs one column {_FILE!r}, and each other one once at most.")
    rows: dict[str, PhotoInput] = {}
    for number, cells in enumerate(lines[1:], start=2):
        values = {name: cell.strip() for name, cell in zip(header, cells, strict=False) if cell.strip()}
        if not values:
            continue
        name = values.pop(_FILE, None)
        if name is None or len(cells) > len(header) or name in rows:
            sentence = "a row has a photo's name, which no other has, and no cell without a column."
            raise BatchError(f"{path}, line {number}: {sentence}")
        try:
            rows[name] = _read_row(values, Path(path).parent)
        except (LightingError, ValueError, OSError) as error:
            text = str(error.renamed(option_name)) if isinstance(error, LightingError) else str(error)
            raise BatchError(f"{path}, line {number}: {text}") from error
    return PhotoTable(rows, hashlib.sha256(data).hexdigest())


def check_photo_names(table: PhotoTable, names: Collection[str]) -> None:
    """Raise BatchError for a row about a photo that the batch does not have.

    Args:
        table: of the batch.
        names: of its photos.
    """
    known = frozenset(names)
    if (name := next((name for name in table.rows if name not in known), None)) is not None:
        raise BatchError(f"The table has a row about {name}, which is none of the photos.")


def _read_row(values: Mapping[str, str], folder: Path) -> PhotoInput:
    stated: dict[str, Any] = {name: values[name] for name in _TEXTS if name in values}
    stated |= {name: float(values[name]) for name in _NUMBERS if name in values}
    stated |= {field: values[name].split(";") for name, field in _LISTS.items() if name in values}
    if "camera" in values:
        stated["camera"] = read_fspy((folder / values["camera"]).read_bytes())
    pick: Any = values.get("pick")
    return PhotoInput(UserInput(**stated), Adjustments(pick=pick).pick)

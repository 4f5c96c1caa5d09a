"""Files that are whole or absent, and environment maps among them: .exr with everything, .hdr for older tools, .png.

The formats of maps are entries of MAP_FORMATS, which the command line and the service read. What needs numpy is
imported by the functions, so that the command line's help stays quick.
"""

import errno
import io
import os
import re
import stat
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self

from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError
from lighting.fields import describe_fields
from lighting.map_options import OptionText, check_option, option

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.files.exr import Image, Strips, WriteTarget
    from lighting.geometry import Floats
    from lighting.records import Lighting, LightProbe

CLIP_SUFFIXES = (".mp4", ".mov", ".m4v", ".mkv", ".avi", ".webm", ".mts", ".m2ts", ".3gp")
PREVIEW_ENDING = "-preview.png"  # of a preview's name, behind its photo's without the suffix
MAP_FILE_SUFFIXES = (".exr", ".hdr")  # of maps, and never of photos; systems have no program for them
_HEAD_BYTES = 1 << 16  # of a file
_EXR_MAGIC, _RECORD_MARK, _PROGRAM_MARK = b"\x76\x2f\x31\x01", b"lighting.json", b"outdoor-lighting"
_RANDOM_BYTES = 8  # in a temporary name
_HALF = re.compile("[\ud800-\udc7f\udd00-\udfff]")  # halves of surrogate pairs that stand for no byte of a name


@dataclass(frozen=True, eq=False, repr=False)
class _MapFormat:
    """How environment maps are written in one format."""

    write: Callable[..., None]
    """(target, image, lighting); `compression`, `colors` and `probe` where it takes them."""
    media_type: str
    """By which HTTP names it."""
    read: Callable[[bytes], "Image"] | None = None
    """The linear pixels (H, W, 3); None where a file holds none."""
    has_header: bool = False
    """Whether files hold lighting and probe, and say how they are packed and in which colors they are."""


def _write_exr(target: "WriteTarget", image: "Floats", lighting: "Lighting | None", **options: Any) -> None:
    from lighting.files.exr import write_exr

    write_exr(target, image, lighting, **options)


def _read_exr(data: bytes) -> "Image":
    from lighting.files.exr import read_exr

    return read_exr(io.BytesIO(data))[0]


def _write_hdr(target: "WriteTarget", image: "Floats", lighting: "Lighting | None") -> None:
    from lighting.files.radiance_hdr import write_hdr

    write_hdr(target, image, lighting)


def _read_hdr(data: bytes) -> "Image":
    from lighting.files.radiance_hdr import decode_hdr

    return decode_hdr(data)


def _write_png(target: "WriteTarget", image: "Floats", _lighting: "Lighting | None") -> None:
    """The map as the photo's exposure shows it, clipped at white."""
    import numpy as np

    from lighting.color import check_envmap, tone_map
    from lighting.files.deflate import encode_png
    from lighting.files.exr import SOFTWARE, open_target, row_bands

    rows = [tone_map(band) for band in row_bands(check_envmap(image))]
    with open_target(target) as stream:
        stream.write(encode_png(np.concatenate(rows), {"Software": SOFTWARE}))


MAP_FORMATS: dict[str, _MapFormat] = {  # by the suffix of a file, without its dot
    "exr": _MapFormat(_write_exr, "image/x-exr", _read_exr, has_header=True),
    "hdr": _MapFormat(_write_hdr, "image/vnd.radiance", _read_hdr),
    "png": _MapFormat(_write_png, "image/png"),
}


def _compressions() -> Sequence[str]:
    from lighting.files.exr import COMPRESSIONS

    return list(COMPRESSIONS)


def _color_spaces() -> Sequence[str]:
    from lighting.color import COLOR_SPACES

    return list(COLOR_SPACES)


@dataclass(frozen=True)
class FileOptions:
    """How an environment map is written. A value that the format does not take is a ParameterError."""

    format: str = option("exr", OptionText("OpenEXR, Radiance HDR, or PNG", "NAME", choices=MAP_FORMATS))
    """One of MAP_FORMATS; where a file has a name, its suffix says it."""
    compression: str = option(
        "zip", OptionText("how an EXR is packed: zip, pxr24 or none", "NAME", choices=_compressions)
    )
    """Of an EXR: zip writes half floats, pxr24 and none 32-bit floats."""
    colors: str = option(
        "rec709", OptionText("primaries of an EXR: rec709, acescg or linear-p3", "NAME", choices=_color_spaces)
    )
    """Of an EXR, one of `color.COLOR_SPACES`; the record in it stays in Rec.709."""

    def __post_init__(self) -> None:
        check_option(FileOptions, "format", self.format)
        for name in ("compression", "colors"):
            value = getattr(self, name)
            if isinstance(value, str) and value == getattr(FileOptions, name):
                continue
            if not MAP_FORMATS[self.format].has_header:
                formats = join_words([name for name, entry in MAP_FORMATS.items() if entry.has_header])
                raise ParameterError.about(name, f"goes with the format {formats}.", ErrorCode.CONTRADICTION)
            if name == "compression" and isinstance(value, str):  # whose error says more of one that was
                from lighting.files.exr import check_exr_compression

                check_exr_compression(value)
            check_option(FileOptions, name, value)

    def for_path(self, path: str | os.PathLike[str]) -> Self:
        """Return the options with the format that a path's suffix names.

        Args:
            path: of a map.

        Raises:
            EnvironmentMapError: the suffix is not an environment map's.
            ParameterError: the format does not take the options.
        """
        return replace(self, format=check_map_name(path))


describe_fields(FileOptions)
DEFAULT_FILE = FileOptions()


def join_strips(strips: "Strips") -> "Image":
    """Return a map (H, 2H, 3) in one array, which is filled strip by strip.

    Args:
        strips: yields the rows (R, 2H, 3), from the top down.
    """
    import numpy as np

    parts = strips()
    first = next(parts)
    height = first.shape[1] // 2
    if len(first) == height:
        return first
    image = np.empty((height, *first.shape[1:]), first.dtype)
    end = 0
    for part in chain((first,), parts):
        start, end = end, end + len(part)
        image[start:end] = part
    return image[:end]


def write_envmap(
    target: str | os.PathLike[str],
    image: "Floats | Strips",
    lighting: "Lighting | None" = None,
    options: FileOptions = DEFAULT_FILE,
    *,
    probe: "LightProbe | None" = None,
) -> None:
    """Write a map to a path in the format of its suffix. The path appears only when the file is whole.

    Args:
        target: path whose suffix is one of MAP_FORMATS.
        image: (H, 2H, 3) linear Rec.709; or what yields its rows, which an EXR of `zip` takes one after the other.
        lighting: for the header of an EXR; None: without.
        options: how the file is written.
        probe: the map's, for the header of an EXR; None: without.

    Raises:
        EnvironmentMapError: another suffix or shape, or a path that cannot be written.
        ParameterError: the format does not take the options.
    """
    _write_map(target, image, lighting, options.for_path(target), probe)


def encode_envmap(
    image: "Floats | Strips",
    lighting: "Lighting | None" = None,
    options: FileOptions = DEFAULT_FILE,
    *,
    probe: "LightProbe | None" = None,
) -> bytes:
    """The bytes of a file that holds a map; raises as `write_envmap`.

    Args:
        image: as in `write_envmap`.
        lighting: for the header of an EXR; None: without.
        options: how the file is written.
        probe: the map's, for the header of an EXR; None: without.
    """
    buffer = io.BytesIO()
    _write_map(buffer, image, lighting, options, probe)
    return buffer.getvalue()


def _write_map(
    target: "WriteTarget",
    image: "Floats | Strips",
    lighting: "Lighting | None",
    options: FileOptions,
    probe: "LightProbe | None",
) -> None:
    entry = MAP_FORMATS[options.format]
    if entry.has_header:
        entry.write(target, image, lighting, compression=options.compression, colors=options.colors, probe=probe)
    else:
        entry.write(target, join_strips(image) if callable(image) else image, lighting)


def read_envmap(file: str | os.PathLike[str]) -> "Image":
    """The map (H, 2H, 3) in an EXR or HDR file; EnvironmentMapError, which names it, for what is no finite map.

    Args:
        file: path of the map.
    """
    import numpy as np

    from lighting.color import check_envmap
    from lighting.files.exr import read_map_bytes
    from lighting.files.radiance_hdr import HDR_MAGIC

    data = read_map_bytes(file)
    try:
        is_hdr = data.startswith(HDR_MAGIC) or os.fspath(file).lower().endswith(".hdr")
        image = check_envmap(_read_hdr(data) if is_hdr else _read_exr(data))
        if not np.isfinite(image).all():
            raise EnvironmentMapError("The map holds values that are not finite numbers.")
    except EnvironmentMapError as error:
        raise EnvironmentMapError(f"{os.fspath(file)}: {error}") from error
    return image


def is_own_map(file: BinaryIO) -> bool:
    """Tell whether a map is of this program, by its header: no other is replaced or removed unasked.

    An EXR must hold a record of its light; other files hold none, and name the program.

    Args:
        file: open to read; it is closed.
    """
    with file:
        head = file.read(_HEAD_BYTES)
    return (_RECORD_MARK if head.startswith(_EXR_MAGIC) else _PROGRAM_MARK) in head


def check_map_name(path: str | os.PathLike[str]) -> str:
    """Return the format that a path's suffix names.

    Args:
        path: of a map.

    Raises:
        EnvironmentMapError: the suffix is not an environment map's.
    """
    if not isinstance(path, str | os.PathLike):
        raise EnvironmentMapError(
            f"A map is written to a path, not {type(path).__name__}; encode_envmap makes bytes.",
            code=ErrorCode.WRONG_TYPE,
        )
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in MAP_FORMATS:
        suffixes = join_words([f".{name}" for name in MAP_FORMATS])
        raise EnvironmentMapError(f"The name {os.fspath(path)!r} must end in {suffixes}.")
    return suffix


def join_words(words: Sequence[str], link: str = "or") -> str:
    """Return words as a choice or a list: a, b or c.

    Args:
        words: one or more.
        link: before the last one.
    """
    return f" {link} ".join(filter(None, (", ".join(words[:-1]), words[-1])))


def is_address(name: str) -> bool:
    """Tell whether a file's name is an address in the web.

    Args:
        name: as the user typed it.
    """
    return name.lower().startswith(("http://", "https://", "ftp://"))


# Files that appear whole, pictures in memory, and folders.


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
        modes = [stat.S_IMODE(path.stat().st_mode) for path in (temporary, final) if path.is_file()]
        if len(set(modes)) > 1:
            temporary.chmod(modes[1])
        temporary.replace(final)
    except OSError as error:
        if error.errno is not None and error.filename in (None, str(temporary), temporary):
            raise OSError(error.errno, error.strerror, str(target)) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


def write_file(target: str | os.PathLike[str], data: bytes) -> None:
    """Write a file that is whole or not at all, as `atomic_write` does.

    Args:
        target: path of the file.
        data: what it holds.
    """
    with atomic_write(target) as temporary:
        temporary.write_bytes(data)


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


def encode_jpeg(pixels: "NDArray[np.uint8]", quality: int) -> bytes:
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


def escape_undecodable(name: str) -> str:
    """Return the name of a file, or a text that holds one, for JSON: bytes that are not UTF-8 as escapes as \\xe9.

    JSON could hold such a byte only as half a surrogate pair, which many programs refuse.

    Args:
        name: as the user typed it.
    """
    halves = name.encode("utf-8", "backslashreplace") if _HALF.search(name) else os.fsencode(name)
    return halves.decode("utf-8", "backslashreplace")

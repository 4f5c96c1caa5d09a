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
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lighting.errors import EnvironmentMapError, ErrorCode

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from lighting.files.exr import Image, WriteTarget
    from lighting.geometry import Floats
    from lighting.light_probe import LightProbe
    from lighting.records import Lighting

_RANDOM_BYTES = 8  # in a temporary name


@dataclass(frozen=True, eq=False, repr=False)
class _MapFormat:
    """How environment maps are written in one format."""

    write: Callable[..., None]
    """(target, image, lighting); `compression`, `overwrite`, `probe` and `colours` where it takes them."""
    media_type: str
    """By which HTTP names it."""
    read: Callable[[bytes], "Image"] | None = None
    """The linear pixels (H, W, 3); None where a file holds none."""
    takes_compression: bool = False
    """Whether a file may be packed in several ways, and the packing may use the image's memory."""
    has_header: bool = False
    """Whether files hold lighting and probe, and say in which colours they are."""


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
    from PIL import Image

    from lighting.color import tone_map
    from lighting.files.exr import check_envmap, open_target, row_bands

    rows = [tone_map(band) for band in row_bands(check_envmap(image))]
    picture = Image.fromarray(np.concatenate(rows))
    with open_target(target) as stream:
        picture.save(stream, format="png")


MAP_FORMATS: dict[str, _MapFormat] = {  # by the suffix of a file, without its dot
    "exr": _MapFormat(_write_exr, "image/x-exr", _read_exr, takes_compression=True, has_header=True),
    "hdr": _MapFormat(_write_hdr, "image/vnd.radiance", _read_hdr),
    "png": _MapFormat(_write_png, "image/png"),
}


def write_envmap(
    target: str | os.PathLike[str],
    image: "Floats",
    lighting: "Lighting | None" = None,
    *,
    compression: str = "zip",
    probe: "LightProbe | None" = None,
    colours: str = "rec709",
    overwrite: bool = False,
) -> None:
    """Write a map to a path in the format of its suffix. The path appears only when the file is whole.

    Raises EnvironmentMapError for another suffix or shape and for a path that cannot be written.

    Args:
        target: path whose suffix is one of MAP_FORMATS.
        image: (H, 2H, 3) linear Rec.709.
        lighting: for the header of an EXR; None: without.
        compression: of an EXR, one of COMPRESSIONS; the others have none.
        probe: the map's, for the header of an EXR; None: without.
        colours: of an EXR, one of `color.COLOR_SPACES`; the others are Rec.709's.
        overwrite: whether an EXR may use the image's memory; the image is then worthless.
    """
    _writer_of(check_map_name(target), compression, probe, colours, overwrite)(target, image, lighting)


def encode_envmap(
    image: "Floats",
    lighting: "Lighting | None" = None,
    format: str = "exr",
    *,
    compression: str = "zip",
    probe: "LightProbe | None" = None,
    colours: str = "rec709",
    overwrite: bool = False,
) -> bytes:
    """The bytes of a file that holds a map; raises as `write_envmap`.

    Args:
        image: (H, 2H, 3) linear Rec.709.
        lighting: for the header of an EXR; None: without.
        format: one of MAP_FORMATS.
        compression: of an EXR, one of COMPRESSIONS; the others have none.
        probe: the map's, for the header of an EXR; None: without.
        colours: of an EXR, one of `color.COLOR_SPACES`; the others are Rec.709's.
        overwrite: whether an EXR may use the image's memory; the image is then worthless.
    """
    buffer = io.BytesIO()
    _writer_of(format, compression, probe, colours, overwrite)(buffer, image, lighting)
    return buffer.getvalue()


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


def _writer_of(
    name: str, compression: str, probe: "LightProbe | None", colours: str, overwrite: bool
) -> Callable[..., None]:
    if name not in MAP_FORMATS:
        raise EnvironmentMapError(
            f"The format {name!r} is not known; an environment map is {join_words(list(MAP_FORMATS))}."
        )
    entry = MAP_FORMATS[name]
    if colours != "rec709" and not entry.has_header:
        raise EnvironmentMapError(f"The colours {colours} need an .exr file.", "colours", ErrorCode.CONTRADICTION)
    options = {"compression": compression, "overwrite": overwrite} if entry.takes_compression else {}
    return partial(entry.write, **options, **({"probe": probe, "colours": colours} if entry.has_header else {}))


def join_words(words: Sequence[str], link: str = "or") -> str:
    """Return words as a choice or a list: a, b or c.

    Args:
        words: one or more.
        link: before the last one.
    """
    return f" {link} ".join(filter(None, (", ".join(words[:-1]), words[-1])))


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


def encode_png(pixels: "NDArray[np.uint8]", compress_level: int = 6) -> bytes:
    """The bytes of a PNG.

    Args:
        pixels: (H, W, 3 or 4) sRGB, or (H, W) of one channel.
        compress_level: 0 fast to 9 small.
    """
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG", compress_level=compress_level)
    return buffer.getvalue()


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
    return os.fsencode(name).decode("utf-8", "backslashreplace")

"""Environment maps as files: .exr with everything, .hdr for older tools, tone-mapped .png for looking at."""

import io
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from lighting.colour import tone_map
from lighting.errors import EnvironmentMapError
from lighting.files.compression import Compression
from lighting.files.exr import Target, checked_map, opened, write_exr
from lighting.files.rgbe import write_hdr
from lighting.geometry import Floats
from lighting.records import Lighting

Writer = Callable[[Target, Floats, Lighting | None], None]


def write_envmap(
    target: str | os.PathLike[str],
    image: Floats,
    lighting: Lighting | None = None,
    *,
    compression: Compression = "zip",
) -> None:
    """Write a map (H, 2H, 3) to a path in the format of its suffix: .exr, .hdr or .png.

    `compression` is how `write_exr` packs it; the others know none. The path appears only when the file is whole.
    Raises EnvironmentMapError for another suffix or shape and for a path that cannot be written.
    """
    _writer(format_of(target), compression)(target, image, lighting)


def encode_envmap(
    image: Floats, lighting: Lighting | None = None, format: str = "exr", *, compression: Compression = "zip"
) -> bytes:
    """The bytes of such a file; `format` is exr, hdr or png."""
    buffer = io.BytesIO()
    _writer(format, compression)(buffer, image, lighting)
    return buffer.getvalue()


def format_of(path: str | os.PathLike[str]) -> str:
    """The format that a path's suffix names; EnvironmentMapError for one that is not an environment map's."""
    if not isinstance(path, str | os.PathLike):
        raise EnvironmentMapError(f"A map is written to a path, not {type(path).__name__}; encode_envmap makes bytes.")
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in _WRITERS:
        raise EnvironmentMapError(f"The name {os.fspath(path)!r} must end in .exr, .hdr or .png.")
    return suffix


def _writer(format: str, compression: Compression) -> Writer:
    if format not in _WRITERS:
        raise EnvironmentMapError(f"The format {format!r} is not known; an environment map is exr, hdr or png.")
    return partial(write_exr, compression=compression) if format == "exr" else _WRITERS[format]


def _write_png(target: Target, image: Floats, _: Lighting | None) -> None:
    """The map as the photo's exposure shows it, clipped at white."""
    from PIL import Image

    picture = Image.fromarray(tone_map(checked_map(image)))
    with opened(target) as stream:
        picture.save(stream, format="png")


_WRITERS: dict[str, Writer] = {"exr": write_exr, "hdr": write_hdr, "png": _write_png}

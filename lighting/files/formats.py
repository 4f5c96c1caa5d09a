"""Environment maps as files: .exr with everything, .hdr for older tools, tone-mapped .png for looking at."""

import io
import os
from collections.abc import Callable
from functools import partial
from pathlib import Path

from lighting.colour import tone_map
from lighting.errors import EnvironmentMapError
from lighting.files import MAP_FORMATS
from lighting.files.exr import Target, checked_map, opened
from lighting.geometry import Floats
from lighting.records import Lighting

Writer = Callable[[Target, Floats, Lighting | None], None]


def write_envmap(
    target: str | os.PathLike[str],
    image: Floats,
    lighting: Lighting | None = None,
    *,
    compression: str = "zip",
) -> None:
    """Write a map (H, 2H, 3) to a path in the format of its suffix, one of MAP_FORMATS.

    `compression` is how an EXR is packed; the others know none. The path appears only when the file is whole.
    Raises EnvironmentMapError for another suffix or shape and for a path that cannot be written.
    """
    _writer(format_of(target), compression)(target, image, lighting)


def encode_envmap(
    image: Floats, lighting: Lighting | None = None, format: str = "exr", *, compression: str = "zip"
) -> bytes:
    """The bytes of such a file; `format` is one of MAP_FORMATS."""
    buffer = io.BytesIO()
    _writer(format, compression)(buffer, image, lighting)
    return buffer.getvalue()


def format_of(path: str | os.PathLike[str]) -> str:
    """The format that a path's suffix names; EnvironmentMapError for one that is not an environment map's."""
    if not isinstance(path, str | os.PathLike):
        raise EnvironmentMapError(f"A map is written to a path, not {type(path).__name__}; encode_envmap makes bytes.")
    suffix = Path(path).suffix.lower().removeprefix(".")
    if suffix not in MAP_FORMATS:
        known = _either([f".{name}" for name in MAP_FORMATS])
        raise EnvironmentMapError(f"The name {os.fspath(path)!r} must end in {known}.")
    return suffix


def _writer(name: str, compression: str) -> Writer:
    if name not in MAP_FORMATS:
        raise EnvironmentMapError(
            f"The format {name!r} is not known; an environment map is {_either(list(MAP_FORMATS))}."
        )
    entry = MAP_FORMATS[name]
    return partial(entry.write, compression=compression) if entry.takes_compression else entry.write


def _either(names: list[str]) -> str:
    return f"{', '.join(names[:-1])} or {names[-1]}"


def write_png_map(target: Target, image: Floats) -> None:
    """The map as the photo's exposure shows it, clipped at white."""
    from PIL import Image

    picture = Image.fromarray(tone_map(checked_map(image)))
    with opened(target) as stream:
        picture.save(stream, format="png")

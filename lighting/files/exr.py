"""Environment maps as OpenEXR: 32-bit float R, G, B with the lighting that made them in the header.

Attributes: `envmap`, `chromaticities`, `software`; `lighting.<name>` for each number of a Lighting that is known, with
the names and units of ranges.py; `lighting.sky_model`, `lighting.sun_direction`, `lighting.evidence`; `lighting.json`,
the whole record.
"""

import io
import json
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from lighting.errors import EnvironmentMapError, ParameterError
from lighting.files.atomic import replacing
from lighting.files.compression import packed_with
from lighting.files.primaries import CHROMATICITIES, chromaticities_to_rec709
from lighting.files.record import full_record
from lighting.ranges import COLOUR_RANGES, OPTIONAL_RANGES, RANGES
from lighting.records import Lighting, check_lighting
from lighting.version import __version__

Image = NDArray[np.float32]
Target = str | os.PathLike[str] | BinaryIO

SOFTWARE = f"outdoor-lighting {__version__}"

MAGIC = b"v/1\x01"
_BUFFER = 1 << 20  # bytes written at once; OpenEXR writes each 16 rows, with their place and size, by themselves
_NOT_PLAIN = 0x1A00  # version flags of tiled, deep and multi-part files
_MOST_CHUNKS = 1 << 16  # of a file, each of a row or more: a map of more rows would hold 100 GB


def write_exr(
    target: Target,
    image: NDArray[np.floating[Any]],
    lighting: Lighting | None = None,
    attributes: Mapping[str, Any] | None = None,
    *,
    compression: str = "zip",
) -> None:
    """Write a map (H, 2H, 3) to a path or a binary stream, as 32-bit float.

    `attributes` go into the header beside those of the lighting: texts, floats and what else OpenEXR knows. Every
    program opens `zip`, which changes values by up to 6e-5 of each; `pxr24` changes up to 1.6e-5, `none` nothing.
    A path appears only when the file is whole. Raises EnvironmentMapError for an array of another shape, another
    compression, attributes that no EXR can have, a path that cannot be written and what is neither a path nor a stream,
    ParameterError for what is no Lighting; what a stream raises is passed on.
    """
    import OpenEXR

    if not isinstance(attributes, Mapping | None):
        raise EnvironmentMapError(f"The attributes of an EXR have names, which {type(attributes).__name__} has not.")
    packing, pixels = packed_with(checked_map(image), compression)
    header = {
        "compression": packing,
        "type": OpenEXR.scanlineimage,
        "envmap": OpenEXR.ENVMAP_LATLONG,
        "chromaticities": CHROMATICITIES,
        "software": SOFTWARE,
        **_attributes(lighting),
        **(attributes or {}),
    }
    if attributes:
        _try_attributes(header)
    file = OpenEXR.File(header, {"RGB": pixels})
    if isinstance(target, str | os.PathLike):
        with opened(target) as stream:
            file.write(stream)
    elif not callable(getattr(target, "write", None)):
        raise EnvironmentMapError(f"An EXR is written to a path or a binary stream, not {type(target).__name__}.")
    else:  # OpenEXR seeks backwards, which pipes and files opened for appending cannot
        buffer = io.BytesIO()
        file.write(buffer)
        target.write(buffer.getbuffer())


def read_exr(source: Target) -> tuple[Image, Lighting | None]:
    """The pixels (H, W, 3) of an EXR file, half or float, in Rec.709, and the lighting in its header if there is one.

    `source` is a path or a binary stream. Raises EnvironmentMapError for what is not a whole EXR file with R, G and B.
    """
    data = _read(source)
    if not _is_whole(data):
        raise EnvironmentMapError("The EXR file is cut short or damaged.")
    header, channels = _decode(data)
    missing = [name for name in "RGB" if name not in channels]
    if missing:
        raise EnvironmentMapError(f"The EXR file has no channel {', '.join(missing)}; it needs R, G and B.")
    planes = [np.asarray(channels[name].pixels, dtype=np.float32) for name in "RGB"]
    if len({plane.shape for plane in planes}) > 1:
        raise EnvironmentMapError("The EXR file's channels R, G and B differ in size.")
    return _in_rec709(np.stack(planes, axis=-1), header), _lighting_in(header)


def _in_rec709(pixels: Image, header: Mapping[str, Any]) -> Image:
    """Pixels (H, W, 3) of the primaries that a header names, Rec.709's where it names none, in those of Rec.709."""
    try:
        matrix = chromaticities_to_rec709(header.get("chromaticities", CHROMATICITIES))
    except (ValueError, TypeError) as error:
        raise EnvironmentMapError("The EXR file's chromaticities are those of no colours.") from error
    return pixels if matrix is None else np.asarray(pixels @ matrix.T)


def read_map(file: str | os.PathLike[str]) -> Image:
    """The map (H, 2H, 3) in an EXR file.

    Raises EnvironmentMapError, which names the file, for what is no whole map, and for values that are not finite.
    """
    data = _read(file)
    try:
        image = checked_map(read_exr(io.BytesIO(data))[0])
        if not np.isfinite(image).all():
            raise EnvironmentMapError("The map holds values that are not finite numbers.")
    except EnvironmentMapError as error:
        raise EnvironmentMapError(f"{os.fspath(file)}: {error}") from error
    return image


def read_attributes(source: str | os.PathLike[str]) -> dict[str, Any]:
    """The header of an EXR file, without its pixels. Raises EnvironmentMapError for what is not one."""
    import OpenEXR

    try:
        with Path(source).open("rb") as stream:
            if stream.read(4) != MAGIC:
                raise EnvironmentMapError(f"{os.fspath(source)} is not an OpenEXR image.")
        return dict(OpenEXR.File(os.fspath(source), header_only=True).header())
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(source)} cannot be read: {error.strerror or error}.") from error
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(f"The header of {os.fspath(source)} cannot be read: {error}.") from error


def checked_map(image: NDArray[np.floating[Any]]) -> Image:
    """The map as contiguous float32; EnvironmentMapError unless it has the shape (H, 2H, 3)."""
    shape = np.shape(image)
    if len(shape) != 3 or shape != (shape[0], 2 * shape[0], 3) or shape[0] == 0:
        raise EnvironmentMapError(f"An environment map has the shape (H, 2H, 3), not {shape}.")
    return np.ascontiguousarray(image, dtype=np.float32)


@contextmanager
def opened(target: Target) -> Iterator[BinaryIO]:
    """A binary stream to fill: the one given, or a file that takes the path's place when the block ends well.

    Raises EnvironmentMapError where the path cannot be written.
    """
    if not isinstance(target, str | os.PathLike):
        yield target
        return
    try:
        with replacing(target) as temporary, temporary.open("wb", _BUFFER) as stream:
            yield stream
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(target)} cannot be written: {error.strerror or error}.") from error


def _try_attributes(header: Mapping[str, Any]) -> None:
    """Write a picture of one pixel with this header; EnvironmentMapError where OpenEXR knows no such attributes."""
    import OpenEXR

    try:
        OpenEXR.File(dict(header), {"RGB": np.zeros((1, 1, 3), np.float32)}).write(io.BytesIO())
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(f"The attributes cannot be those of an EXR: {str(error).rstrip('.')}.") from error


def _attributes(lighting: Lighting | None) -> dict[str, Any]:
    if lighting is None:
        return {}
    check_lighting(lighting)
    return {
        **{f"lighting.{name}": float(getattr(lighting, name)) for name in RANGES},
        **{f"lighting.{name}": float(v) for name in OPTIONAL_RANGES if (v := getattr(lighting, name)) is not None},
        **{f"lighting.{name}": np.array(v, np.float32) for name in COLOUR_RANGES if (v := getattr(lighting, name))},
        "lighting.sky_model": lighting.sky_model,
        "lighting.sun_direction": lighting.sun_direction.astype(np.float32),
        "lighting.evidence": ", ".join(lighting.evidence),
        "lighting.json": json.dumps(full_record(lighting)),
    }


def _lighting_in(header: dict[str, Any]) -> Lighting | None:
    text = header.get("lighting.json")
    if text is None:
        return None
    try:
        record = json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        raise EnvironmentMapError("The EXR file's lighting.json cannot be read: it is not JSON.") from error
    try:
        return Lighting.from_dict(record)
    except ParameterError as error:
        raise EnvironmentMapError(f"The EXR file's lighting.json cannot be read: {error}") from error


def _read(source: Target) -> bytes:
    if not isinstance(source, str | os.PathLike):
        read = getattr(source, "read", None)
        if not callable(read):
            kind = type(source).__name__
            raise EnvironmentMapError(f"An EXR is read from a path or a binary stream, not {kind}.")
        if not isinstance(data := read(), bytes):
            raise EnvironmentMapError("The file is open as text; an EXR is read from one that is open in binary mode.")
        return data
    try:
        return Path(source).read_bytes()
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(source)} cannot be read: {error.strerror or error}.") from error


def _decode(data: bytes) -> tuple[dict[str, Any], dict[str, Any]]:
    import OpenEXR

    try:
        file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
        return file.header(), file.channels()
    except (RuntimeError, ValueError, TypeError) as error:
        # OpenEXR's own words are of buffers, parts and codecs
        raise EnvironmentMapError("The EXR file cannot be read: it is damaged or of an unknown kind.") from error


def _is_whole(data: bytes) -> bool:
    """Whether a plain scanline file holds the last of its chunks; other kinds of EXR are left to the library.

    The library would write about a missing chunk to the terminal, and fill some of them with nothing.
    """
    if not data.startswith(MAGIC):
        raise EnvironmentMapError("The file is not an OpenEXR image.")
    try:
        (version,) = struct.unpack_from("<I", data, 4)
        if version & _NOT_PLAIN:
            return True
        last = int(_chunks(data, _end_of_header(data)).max())
        _, size = struct.unpack_from("<ii", data, last)
        return bool(last + 8 + size <= len(data))
    except (struct.error, ValueError, OverflowError):
        return False


def _chunks(data: bytes, table: int) -> NDArray[np.uint64]:
    """Where the chunks lie (N,), by the table at this position; ValueError where it lacks one.

    The table ends where the chunk begins that is stored first: that of the top rows, or of the lowest ones where the
    rows are stored from the bottom up.
    """
    offsets = np.frombuffer(data, "<u8", min(_MOST_CHUNKS, (len(data) - table) // 8), table)
    ends = table + 8 * np.arange(1, len(offsets) + 1, dtype=np.uint64)
    lowest = np.minimum.accumulate(offsets)
    count = int(np.argmax(lowest <= ends)) + 1
    if lowest[count - 1] != ends[count - 1]:
        raise ValueError("missing chunk")
    return offsets[:count]


def _end_of_header(data: bytes) -> int:
    """Position after the attributes: each is a name, a type, both ended by a zero, a length and so many bytes."""
    position = 8
    while data[position : position + 1] != b"\0":
        position = data.index(b"\0", data.index(b"\0", position) + 1) + 1
        (length,) = struct.unpack_from("<i", data, position)
        if length < 0:
            raise ValueError("negative length")
        position += 4 + length
    return position + 1

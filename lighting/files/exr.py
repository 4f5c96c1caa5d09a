"""OpenEXR read and write, attributes, compression.

Environment maps are R, G, B with the lighting that made them in the header: half floats by `zip` where they fit, else
32-bit floats. Attributes: `envmap`, `chromaticities`, `colorInteropID`, `software`; `lighting.<name>` for each number
of a Lighting that is not None, with the names and units of fields.py; `lighting.sky_model`, `lighting.sky_painted`,
`lighting.sun_direction`, `lighting.evidence`; `lighting.json`, the record. Of a light probe:
`light_probe.coefficients`, 27 numbers, RGB by RGB; `light_probe.direction`, `light_probe.irradiance`,
`light_probe.lux` and `light_probe.kelvin` of its main light.

docs/lab/performance.md says which programs opened which files, how long they take and how large they are.

References:
    [1] OpenEXR File Layout, https://openexr.com: scan lines in chunks of 16 rows, with a table of their offsets.
"""

import ctypes
import io
import json
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeVar

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from lighting.color import CHROMATICITIES, COLOR_SPACES, check_envmap, chromaticities_to_rec709
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError, warn_of_old_name
from lighting.fields import COLOR_RANGES, OPTIONAL_RANGES, RANGES
from lighting.files import atomic_write, join_strips
from lighting.files.deflate import CHUNK_ROWS, deflate_chunk, fits_half, limit_packing_threads, pack_in_threads
from lighting.record_json import record_with_coefficients
from lighting.records import Lighting, check_lighting
from lighting.runtime import available_cpus
from lighting.version import __version__

if TYPE_CHECKING:
    from lighting.records import LightProbe

Image = NDArray[np.float32]
WriteTarget = str | os.PathLike[str] | BinaryIO
Strips = Callable[[], Iterator[Image]]  # yields the rows (R, 2H, 3) of a map from the top down
_Attributes = dict[str, Any]  # of a header, of the types that OpenEXR knows

_Kind = TypeVar("_Kind", bound=np.generic)
SOFTWARE = f"outdoor-lighting {__version__}"
EXR_MAGIC = b"v/1\x01"
_WHOLE_PICTURES = ("combined", "beauty", "rgba", "rgb")  # names of layers that hold a whole picture, in small letters

COMPRESSIONS = {"zip": "ZIP_COMPRESSION", "pxr24": "PXR24_COMPRESSION", "none": "NO_COMPRESSION"}  # OpenEXR's names
_REMOVED = ("zip-exact", "piz", "htj2k")  # they changed no value

_LAYOUT = frozenset({"compression", "type", "lineOrder", "channels"})  # attributes by which chunks lie otherwise
_THREADS = 4  # of OpenEXR, beyond which packing gets no faster
_EFFORT = 1  # of PXR24, 1 to 9: a third less work than OpenEXR's own 4, for a seventh more bytes
_BUFFER_BYTES = 1 << 20  # written at once; OpenEXR writes each 16 rows, with their offset and size, by themselves
_NOT_PLAIN = 0x1A00  # version flags of tiled, deep and multi-part files
_DEEP = 0x800  # version flag of files with any number of samples a pixel
_MAX_READ_PIXELS = 140_000_000  # of a picture that is read: the largest map's, and twice a camera's
_MAX_READ_BYTES = 16 * _MAX_READ_PIXELS  # of all its channels as 32-bit numbers: of four as large
_MAX_CHUNKS = 1 << 16  # of a file, each of a row or more: a map of more rows would hold 100 GB
_UNREADABLE = (  # OpenEXR's own words are of buffers, parts and codecs
    "The EXR file cannot be read: it is damaged or of an unknown kind."
)
_SET_EFFORT = "_ZN7Imf_3_529setDefaultZipCompressionLevelEi"  # Imf::setDefaultZipCompressionLevel(int) of OpenEXR 3.5


def check_exr_compression(compression: str) -> None:
    """Raise EnvironmentMapError for what is not among COMPRESSIONS; of one that was, it says what to use instead.

    Args:
        compression: name to check.
    """
    if compression in _REMOVED:
        raise EnvironmentMapError(f"The compression {compression!r} was removed; none changes no value either.")
    if compression not in COMPRESSIONS:
        names = ", ".join(COMPRESSIONS)
        raise EnvironmentMapError(f"The compression {compression!r} is not known; it must be one of {names}.")


def row_bands(image: NDArray[_Kind]) -> Iterator[NDArray[_Kind]]:
    """Views of a few rows each, so that what is computed of one stays in the processor's cache.

    Args:
        image: (H, ...).
    """
    for start in range(0, len(image), CHUNK_ROWS):
        yield image[start : start + CHUNK_ROWS]


def set_compression_threads(count: int) -> None:
    """Pack in this many threads from now on; one packs in the caller's thread, since a pool of one is slower.

    Args:
        count: of threads, 1 or more.
    """
    limit_packing_threads(count)
    _library().set_global_thread_count(count if count > 1 else 0)


@cache
def _library() -> Any:
    """OpenEXR with little effort in PXR24, and a thread for each CPU unless the program has set their number itself."""
    with suppress(
        OSError, AttributeError
    ):  # Python's module has no name for it; without it PXR24 is as good, but slower
        getattr(ctypes.CDLL(OpenEXR.__file__), _SET_EFFORT)(ctypes.c_int(_EFFORT))
    if OpenEXR.global_thread_count() == 0:
        OpenEXR.set_global_thread_count(min(_THREADS, available_cpus()))
        if hasattr(os, "register_at_fork"):
            _stop_threads_over_forks(OpenEXR)
    return OpenEXR


def _stop_threads_over_forks(library: Any) -> None:
    """End the threads before a fork and start them again in the parent; the child packs in its own thread.

    A forked process has none of them, and would wait for them for ever.
    """
    counts: list[int] = []

    def stop() -> None:
        counts.append(library.global_thread_count())
        library.set_global_thread_count(0)

    os.register_at_fork(before=stop, after_in_parent=lambda: library.set_global_thread_count(counts.pop()))


def write_exr(
    target: WriteTarget,
    image: NDArray[np.floating] | Strips,
    lighting: Lighting | None = None,
    attributes: Mapping[str, object] | None = None,
    *,
    compression: str = "zip",
    probe: "LightProbe | None" = None,
    colors: str = "rec709",
    colours: str | None = None,
) -> None:
    """Write a map to a path or a binary stream.

    `zip` writes the nearest half floats, or 32-bit floats where half floats do not hold the map. `pxr24` and `none`
    always write 32-bit floats.

    Args:
        target: a path, where the file appears when it is whole, or a binary stream.
        image: (H, 2H, 3) linear Rec.709; or what yields its rows (R, 2H, 3) from the top down, 16 or a multiple at a
            time. `zip` writes them one after the other, if need be twice.
        lighting: for the header; None: without.
        attributes: more for the header: texts, numbers and what else OpenEXR knows; None: no others.
        compression: zip, pxr24 or none. `zip` packs without loss: half floats differ from the map by up to 5e-4 of a
            value, 32-bit floats by nothing. `pxr24` changes a value by 1.6e-5, `none` by nothing.
        probe: the map's light probe, for the header; None: without.
        colors: primaries of the file: rec709, acescg or linear-p3. Lighting and probe stay in Rec.709.
        colours: the old name of `colors`; warns of it.

    Raises:
        EnvironmentMapError: the map has another shape, OpenEXR does not know an attribute, or the target cannot be
            written.
        ParameterError: `lighting` is no Lighting.
    """
    if not isinstance(attributes, Mapping | None):
        raise EnvironmentMapError(
            f"The attributes of an EXR have names, which {type(attributes).__name__} has not.",
            code=ErrorCode.WRONG_TYPE,
        )
    if colours is not None:
        warn_of_old_name("lighting.write_exr.colours")
        colors = colours
    if colors not in COLOR_SPACES:
        sentence = f"The colors {colors!r} are not known; they must be one of {', '.join(COLOR_SPACES)}."
        raise EnvironmentMapError(sentence, "colors", ErrorCode.UNKNOWN)
    chromaticities, interop_id = COLOR_SPACES[colors]
    to_rec709 = chromaticities_to_rec709(chromaticities)  # white is (1, 1, 1) in both
    from_rec709 = None if to_rec709 is None else np.linalg.inv(to_rec709.astype(np.float64)).astype(np.float32)
    check_exr_compression(compression)
    own = compression == "zip" and not _LAYOUT.intersection(attributes or ())
    if callable(image) and not own:
        image = join_strips(image)
    rows: Strips = image if callable(image) else partial(iter, (check_envmap(image),))

    def strips() -> Iterator[Image]:
        return rows() if from_rec709 is None else (np.ascontiguousarray(strip @ from_rec709.T) for strip in rows())

    header = {
        "compression": getattr(OpenEXR, COMPRESSIONS[compression]),
        "type": OpenEXR.scanlineimage,
        "envmap": OpenEXR.ENVMAP_LATLONG,
        "chromaticities": chromaticities,
        "colorInteropID": interop_id,
        "software": SOFTWARE,
        **_attributes(lighting, probe),
        **_probe_attributes(probe),
        **(attributes or {}),
    }
    if attributes:
        _check_attributes(header, attributes)
    write = _write_zip if own else _write_by_library
    if isinstance(target, str | os.PathLike):
        with open_target(target) as stream:
            write(stream, header, strips)
    elif not callable(getattr(target, "write", None)):
        raise EnvironmentMapError(
            f"An EXR is written to a path or a binary stream, not {type(target).__name__}.", code=ErrorCode.WRONG_TYPE
        )
    elif type(target) is io.BytesIO and not target.getbuffer():
        write(target, header, strips)  # without a copy, during which no other thread of Python runs
    else:  # both seek backwards, which pipes and files opened for appending cannot
        buffer = io.BytesIO()
        write(buffer, header, strips)
        target.write(buffer.getbuffer())


def _write_by_library(stream: BinaryIO, header: _Attributes, strips: Strips) -> None:
    (pixels,) = strips()
    _library().File(header, {"RGB": pixels}).write(stream)


def _write_zip(stream: BinaryIO, header: _Attributes, strips: Strips) -> None:
    """Write an EXR in ZIP [1] as OpenEXR does, which has no igzip, to an empty stream that can seek."""
    for is_half in (True, False):
        if _write_strips(stream, header, strips(), is_half):
            return
        stream.seek(0)
        stream.truncate()


def _write_strips(stream: BinaryIO, header: _Attributes, strips: Iterator[Image], is_half: bool) -> bool:
    """Write an EXR in ZIP of half floats, or 32-bit floats; False for rows that half floats do not hold."""
    begun = io.BytesIO()
    OpenEXR.File(header, {"RGB": np.zeros((1, 1, 3), np.float16 if is_half else np.float32)}).write(begun)
    head = bytearray(begun.getvalue())
    offsets: list[int] = []
    position = table = height = rows = 0
    for pixels in strips:
        if is_half and not fits_half(pixels):
            return False
        if not offsets:
            height = pixels.shape[1] // 2
            for name, value in _attributes_at(head):
                if name in (b"dataWindow", b"displayWindow"):
                    struct.pack_into("<ii", head, value + 8, pixels.shape[1] - 1, height - 1)
            del head[_end_of_header(head) :]
            table = len(head)
            position = table + 8 * -(-height // CHUNK_ROWS)
            stream.write(head)
            stream.write(bytes(position - table))
        rows += len(pixels)
        first = CHUNK_ROWS * len(offsets)
        starts = range(0, len(pixels), CHUNK_ROWS)
        chunks = pack_in_threads(partial(deflate_chunk, pixels, is_half), starts)
        for start, data in zip(starts, chunks, strict=True):
            offsets.append(position)
            position += stream.write(struct.pack("<ii", first + start, len(data))) + stream.write(data)
    if not height or rows != height or len(offsets) != -(-height // CHUNK_ROWS):
        raise EnvironmentMapError(f"The map's strips have {rows} rows; it needs {height}, 16 or a multiple at a time.")
    stream.seek(table)
    stream.write(struct.pack(f"<{len(offsets)}Q", *offsets))
    stream.seek(0, io.SEEK_END)
    return True


def read_exr(source: WriteTarget) -> tuple[Image, Lighting | None]:
    """Read an EXR file: its pixels (H, W, 3) in linear Rec.709, and the lighting in its header or None.

    Args:
        source: path or binary stream of a file with R, G and B, half or float. They may lie in a layer, such as
            `ViewLayer.Combined` of Blender: the only one that has them, or the one of these with the name of a whole
            picture.

    Raises:
        EnvironmentMapError: it is no such file, is cut short, or has over 140 million pixels or 2.2 GB of channels.
    """
    data = read_map_bytes(source)
    if not _is_whole(data):
        raise EnvironmentMapError("The EXR file is cut short or damaged.")
    _check_exr_size(data)
    header, planes = _colors(_decode(data))
    if len({plane.shape for plane in planes}) > 1:
        raise EnvironmentMapError("The EXR file's channels R, G and B differ in size.")
    pixels = np.stack(planes, axis=-1, dtype=np.float32)
    try:
        matrix = chromaticities_to_rec709(header.get("chromaticities", CHROMATICITIES))
    except (ValueError, TypeError) as error:
        raise EnvironmentMapError("The EXR file's chromaticities are those of no colors.") from error
    return pixels if matrix is None else np.asarray(pixels @ matrix.T), _lighting_in(header)


def _colors(parts: list[tuple[_Attributes, _Attributes]]) -> tuple[_Attributes, list[NDArray[np.floating]]]:
    """The header of the part that counts, and its R, G and B."""
    layers: dict[str, tuple[_Attributes, dict[str, NDArray[np.floating]]]] = {}
    for header, channels in parts:
        for name, channel in channels.items():
            layer, _, last = name.rpartition(".")
            label = ".".join(filter(None, (str(header.get("name", "")) if len(parts) > 1 else "", layer)))
            layers.setdefault(label, (header, {}))[1][last.upper()] = channel.pixels
    colored = {label: layer for label, layer in layers.items() if set("RGB") <= layer[1].keys()}
    if not colored:
        if not parts or not parts[0][1]:  # pixels are damaged, so OpenEXR keeps no channel of them
            raise EnvironmentMapError(_UNREADABLE)
        missing = [name for name in "RGB" if name not in parts[0][1]]
        raise EnvironmentMapError(f"The EXR file has no channel {', '.join(missing)}; it needs R, G and B.")
    whole = [label for label in colored if label.rpartition(".")[2].lower() in _WHOLE_PICTURES]
    chosen = whole if len(whole) == 1 else list(colored)
    if "" not in colored and len(chosen) > 1:
        names = ", ".join(colored)
        raise EnvironmentMapError(f"The EXR file has several layers with R, G and B ({names}); keep one of them.")
    header, planes = colored["" if "" in colored else chosen[0]]
    return header, [planes[name] for name in "RGB"]


def is_exr(file: Path) -> bool:
    """Whether a file begins as an OpenEXR image does.

    Args:
        file: path of a file, else OSError.
    """
    with file.open("rb") as stream:
        return stream.read(len(EXR_MAGIC)) == EXR_MAGIC


def read_exr_attributes(source: WriteTarget) -> _Attributes:
    """The header of an EXR file, without its pixels.

    Args:
        source: path or binary stream of an EXR file, else EnvironmentMapError.
    """
    if not isinstance(source, str | os.PathLike):
        try:
            return dict(OpenEXR.File(io.BytesIO(read_map_bytes(source)), header_only=True).header())
        except (RuntimeError, ValueError, TypeError) as error:
            raise EnvironmentMapError(_UNREADABLE) from error
    try:
        if not is_exr(Path(source)):
            raise EnvironmentMapError(f"{os.fspath(source)} is not an OpenEXR image.")
        return dict(OpenEXR.File(os.fspath(source), header_only=True).header())
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(source)} cannot be read: {error.strerror or error}.") from error
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(f"The header of {os.fspath(source)} cannot be read: {error}.") from error


@contextmanager
def open_target(target: WriteTarget) -> Iterator[BinaryIO]:
    """A binary stream to fill. A file appears under its path when the block ends well.

    Args:
        target: a stream, which is returned, or a path that can be written, else EnvironmentMapError.
    """
    if not isinstance(target, str | os.PathLike):
        yield target
        return
    try:
        with atomic_write(target) as temporary, temporary.open("wb", _BUFFER_BYTES) as stream:
            yield stream
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(target)} cannot be written: {error.strerror or error}.") from error


def _check_attributes(header: _Attributes, attributes: Mapping[str, object]) -> None:
    """Write a picture of one pixel with this header; EnvironmentMapError where OpenEXR knows no such attributes.

    So it is where it gives one of them back as something else: some types are cut or left out without a word.
    """
    for name, value in attributes.items():
        if isinstance(value, int | np.integer) and not -(2**31) <= int(value) < 2**31:
            predicate = f"is {value}, and whole numbers of an EXR have 32 bits; write it as text."
        elif name == "envmap" and not isinstance(value, type(OpenEXR.ENVMAP_LATLONG)):
            predicate = f"is {value!r}; it must be OpenEXR.ENVMAP_LATLONG, which is written without it, too."
        else:
            continue
        raise EnvironmentMapError(f"The attribute {name} {predicate}", "attributes", ErrorCode.OUT_OF_RANGE)
    try:
        OpenEXR.File(dict(header), {"RGB": np.zeros((1, 1, 3), np.float32)}).write(trial := io.BytesIO())
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(f"The attributes cannot be those of an EXR: {str(error).rstrip('.')}.") from error
    trial.seek(0)
    stored = read_exr_attributes(trial)
    for name, value in attributes.items():
        if name not in stored or not _is_stored(value, stored[name]):
            predicate = f"is {value!r}, which OpenEXR leaves out or writes as something else; write it as text."
            raise EnvironmentMapError(f"The attribute {name} {predicate}", "attributes", ErrorCode.OUT_OF_RANGE)


def _is_stored(value: object, stored: Any) -> bool:
    """Whether a number, a text or several of them are what OpenEXR gives back; floats may be rounded to 32 bits."""
    if isinstance(value, list | tuple | np.ndarray):
        return len(value) == len(stored) and all(map(_is_stored, value, stored))
    if isinstance(value, float | np.floating):
        return bool(np.isclose(value, stored, rtol=1e-6, atol=1e-30, equal_nan=True))
    return not isinstance(value, str | int | np.integer) or bool(value == stored)


def _probe_attributes(probe: "LightProbe | None") -> _Attributes:
    if probe is None:
        return {}
    light = probe.main_light
    values: _Attributes = {
        "coefficients": [float(value) for value in probe.coefficients.ravel()],
        "direction": light.direction.astype(np.float32),
        "irradiance": light.irradiance.astype(np.float32),
        "lux": light.lux,
        "kelvin": light.kelvin,
    }
    return {f"light_probe.{name}": value for name, value in values.items() if value is not None}


def _attributes(lighting: Lighting | None, probe: "LightProbe | None") -> _Attributes:
    if lighting is None:
        return {}
    check_lighting(lighting)
    return {
        **{f"lighting.{name}": float(getattr(lighting, name)) for name in RANGES},
        **{f"lighting.{name}": float(v) for name in OPTIONAL_RANGES if (v := getattr(lighting, name)) is not None},
        **{f"lighting.{name}": np.array(v, np.float32) for name in COLOR_RANGES if (v := getattr(lighting, name))},
        "lighting.sky_model": lighting.sky_model,
        "lighting.sky_painted": lighting.map_sky,
        "lighting.sun_direction": lighting.sun_direction.astype(np.float32),
        "lighting.evidence": ", ".join(lighting.evidence),
        "lighting.json": json.dumps(record_with_coefficients(lighting, probe)),
    }


def _lighting_in(header: _Attributes) -> Lighting | None:
    try:
        return Lighting.from_dict(json.loads(header["lighting.json"])) if "lighting.json" in header else None
    except ParameterError as error:
        raise EnvironmentMapError(f"The EXR file's lighting.json cannot be read: {error}") from error
    except (ValueError, TypeError, RecursionError) as error:
        raise EnvironmentMapError("The EXR file's lighting.json cannot be read: it is not JSON.") from error


def read_map_bytes(source: WriteTarget) -> bytes:
    """Return what an EXR's path or a binary stream holds; EnvironmentMapError where that cannot be read.

    Args:
        source: path or stream.
    """
    if not isinstance(source, str | os.PathLike):
        read = getattr(source, "read", None)
        if not callable(read):
            kind = type(source).__name__
            raise EnvironmentMapError(
                f"An EXR is read from a path or a binary stream, not {kind}.", code=ErrorCode.WRONG_TYPE
            )
        if not isinstance(data := read(), bytes):
            raise EnvironmentMapError(
                "The file is open as text; open it in binary mode: open(path, 'rb').", code=ErrorCode.WRONG_TYPE
            )
        return data
    try:
        return Path(source).read_bytes()
    except OSError as error:
        raise EnvironmentMapError(f"{os.fspath(source)} cannot be read: {error.strerror or error}.") from error


def check_read_size(width: int, height: int, kind: str) -> None:
    """Raise EnvironmentMapError for a picture of more pixels than are read.

    Args:
        width: pixels.
        height: pixels.
        kind: of file, for the sentence.
    """
    if width * height > _MAX_READ_PIXELS:
        limit = f"the limit of {_MAX_READ_PIXELS / 1e6:g} million"
        raise EnvironmentMapError(f"The {kind} of {width} x {height} pixels has more than {limit}.")


def _check_exr_size(data: bytes) -> None:
    """Raise EnvironmentMapError for an EXR whose headers announce more than is read, before anything is decoded."""
    if int.from_bytes(data[4:8], "little") & _DEEP:
        raise EnvironmentMapError("The EXR file is a deep picture, which is not read.")
    try:
        headers = [part.header for part in OpenEXR.File(io.BytesIO(data), header_only=True).parts]
        corners = [np.asarray(header["dataWindow"], dtype=np.int64) for header in headers]
        counts = [len(header["channels"]) for header in headers]
    except (RuntimeError, ValueError, TypeError, KeyError) as error:
        raise EnvironmentMapError(_UNREADABLE) from error
    sizes = [(last - first + 1).tolist() for first, last in corners]
    for width, height in sizes:
        check_read_size(width, height, "EXR file")
    if sum(4 * width * height * count for (width, height), count in zip(sizes, counts, strict=True)) > _MAX_READ_BYTES:
        limit = _MAX_READ_BYTES / 1e9
        raise EnvironmentMapError(f"The EXR file's {sum(counts)} channels take more than the limit of {limit:.2g} GB.")


def _decode(data: bytes) -> list[tuple[_Attributes, _Attributes]]:
    """The header of each part, and its channels by their names."""
    try:
        file = OpenEXR.File(io.BytesIO(data), separate_channels=True)
        return [(part.header, part.channels) for part in file.parts]
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(_UNREADABLE) from error


def _is_whole(data: bytes) -> bool:
    """Whether a plain scanline file holds the last of its chunks; other kinds of EXR are left to the library.

    The library would write about a missing chunk to the terminal, and fill some of them with nothing.
    """
    if not data.startswith(EXR_MAGIC):
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
    offsets = np.frombuffer(data, "<u8", min(_MAX_CHUNKS, (len(data) - table) // 8), table)
    ends = table + 8 * np.arange(1, len(offsets) + 1, dtype=np.uint64)
    lowest = np.minimum.accumulate(offsets)
    count = int(np.argmax(lowest <= ends)) + 1
    if lowest[count - 1] != ends[count - 1]:
        raise ValueError("missing chunk")
    return offsets[:count]


def _end_of_header(data: bytes | bytearray) -> int:
    """Position after the attributes."""
    position = 8
    for _, value in _attributes_at(data):
        position = value + struct.unpack_from("<i", data, value - 4)[0]
    return position + 1


def _attributes_at(data: bytes | bytearray) -> Iterator[tuple[bytes, int]]:
    """Name of each attribute and where its value lies, after a type and a length; name and type end with a zero."""
    position = 8
    while data[position : position + 1] != b"\0":
        middle = data.index(b"\0", position)
        end = data.index(b"\0", middle + 1)
        (length,) = struct.unpack_from("<i", data, end + 1)
        if length < 0:
            raise ValueError("negative length")
        yield bytes(data[position:middle]), end + 5
        position = end + 5 + length

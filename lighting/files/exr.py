"""OpenEXR read and write, attributes, compression.

Environment maps are R, G, B with the lighting that made them in the header: half floats by `zip` where they fit, else
32-bit floats. Attributes: `envmap`, `chromaticities`, `colorInteropID`, `software`; `lighting.<name>` for each number
of a Lighting that is not None, with the names and units of fields.py; `lighting.sky_model`, `lighting.sky_painted`,
`lighting.sun_direction`, `lighting.evidence`; `lighting.json`, the record. Of a light probe:
`light_probe.coefficients`, 27 numbers, RGB by RGB; `light_probe.direction`, `light_probe.irradiance`,
`light_probe.lux` and `light_probe.kelvin` of its main light.

docs/lab/performance.md says which programs opened which files, how long they take and how large they are.
"""

import ctypes
import io
import json
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from lighting.color import CHROMATICITIES, COLOR_SPACES, chromaticities_to_rec709
from lighting.errors import EnvironmentMapError, ErrorCode, ParameterError, warn_of_old_name
from lighting.fields import COLOR_RANGES, OPTIONAL_RANGES, RANGES
from lighting.files import atomic_write
from lighting.records import Lighting, check_lighting, record_with_coefficients
from lighting.runtime import available_cpus
from lighting.version import __version__

if TYPE_CHECKING:
    from lighting.records import LightProbe

Image = NDArray[np.float32]
WriteTarget = str | os.PathLike[str] | BinaryIO
_Attributes = dict[str, Any]  # of a header, of the types that OpenEXR knows

SOFTWARE = f"outdoor-lighting {__version__}"
EXR_MAGIC = b"v/1\x01"
_WHOLE_PICTURES = ("combined", "beauty", "rgba", "rgb")  # names of layers that hold a whole picture, in small letters

COMPRESSIONS = {"zip": "ZIP_COMPRESSION", "pxr24": "PXR24_COMPRESSION", "none": "NO_COMPRESSION"}  # OpenEXR's names
_REMOVED = ("zip-exact", "piz", "htj2k")  # they changed no value

_MAX_HALF = 65504.0  # the largest half float
_MIN_ROW_MEAN = 2.0**-12  # of a row of half floats, beside which their steps of 2^-24 do not count
_TEXTURE_BITS = {20: 4, 110: 5}  # of the 10 of a half float that are dropped from a second difference [ulp] on
_LACKED_BITS = np.uint32(23 - 10)  # of a float's mantissa, that a half float has not
_BELOW_MIDDLE = np.uint32((1 << 23 - 10 - 1) - 1)  # in these, just less than half a step
_EXPONENT_SCALE = np.float32(2.0**-112)  # brings a float's exponent to that of a half float
_TEXTURE_ROWS = 256  # of a map from which it has so many pixels that they may be texture
_MAX_TEXTURE = 0x4C00  # the bits of 16, beyond which lies the sun
_MOVED_SHARE = 2.0**-5  # of the light of some rows, up to which they get what rounding took from others
_MANTISSA_BITS = 13  # that `zip` keeps of 32-bit floats, so that a value changes by no more than 1 part in 2^14
_DROPPED = 23 - _MANTISSA_BITS
_HALF, _MASK = np.uint32(1 << (_DROPPED - 1)), np.uint32(0xFFFFFFFF << _DROPPED & 0xFFFFFFFF)
_ROWS = 16  # that are rounded at once
_THREADS = 4  # beyond which packing gets no faster
_EFFORT = 1  # of ZIP, 1 to 9: a third less work than OpenEXR's own 4, for a seventh more bytes
_BUFFER_BYTES = 1 << 20  # written at once; OpenEXR writes each 16 rows, with their offset and size, by themselves
_NOT_PLAIN = 0x1A00  # version flags of tiled, deep and multi-part files
_DEEP = 0x800  # version flag of files with any number of samples a pixel
MAX_READ_PIXELS = 64_000_000  # of a picture that is read: twice those of the largest map, and a camera's
_MAX_READ_BYTES = 1 << 30  # of all its channels as 32-bit numbers
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


def _prepare_compression(
    image: NDArray[np.float32], compression: str, *, overwrite: bool = False
) -> tuple[Any, NDArray[np.floating[Any]]]:
    """OpenEXR's constant of the compression, and the pixels as it is to pack them: rounded by `zip`.

    Args:
        image: (H, W, 3), contiguous in memory.
        compression: one of COMPRESSIONS, else EnvironmentMapError.
        overwrite: whether the result may lie in the image's memory.
    """
    check_exr_compression(compression)
    packing = getattr(_library(), COMPRESSIONS[compression])
    if compression != "zip":
        return packing, image
    if not _fits_half(image):
        return packing, _round_to_float(image, image if overwrite else np.empty_like(image))
    if overwrite:  # half as long rows end before those that are still to be read
        halves = image.reshape(-1).view(np.float16)[: image.size].reshape(image.shape)
    else:
        halves = np.empty(image.shape, np.float16)
    return packing, _round_to_half(image, halves)


def _fits_half(image: NDArray[np.float32]) -> bool:
    """Whether half floats hold the light of an image (H, W, 3): none of it is too bright, and no row too dark."""
    if not (image.size and image.min() >= 0 and image.max() <= _MAX_HALF):  # false for NaN
        return False
    means = image.reshape(len(image), -1) @ np.tile(np.eye(3, dtype=np.float32) / image.shape[1], (image.shape[1], 1))
    return bool(((means == 0) | (means >= _MIN_ROW_MEAN)).all())


def _round_to_half(image: NDArray[np.float32], rounded: NDArray[np.float16]) -> NDArray[np.float16]:
    """Half floats (H, W, 3) of an image that fits, into `rounded`; where a large one is textured, they have fewer bits.

    The zeros that this leaves at the end of most numbers are what ZIP packs fast and small. The light that rounding
    takes from some rows is added to the next.
    """
    if len(image) < _TEXTURE_ROWS:
        rounded[:] = image.astype(np.float16)
        return rounded
    missing = np.zeros(3, np.float32)
    for rows, out in zip(row_bands(image), row_bands(rounded), strict=True):
        total = np.maximum(rows.sum(axis=0).sum(axis=0), np.float32(1e-9))
        moved = np.clip(missing / total, -_MOVED_SHARE, _MOVED_SHARE)
        wanted = rows.reshape(len(rows), -1) * np.tile(1 + moved, rows.shape[1])  # whole rows, which is fastest
        bits = _half_bits(np.minimum(wanted, np.float32(_MAX_HALF), out=wanted)).reshape(rows.shape)
        texture = _round_texture(bits)
        out.view(np.uint16)[:] = bits
        wanted -= _floats_of_bits(bits.reshape(len(rows), -1))
        wanted *= texture
        missing += wanted.sum(axis=0).reshape(-1, 3).sum(axis=0) - moved * total
    return rounded


def _half_bits(values: NDArray[np.float32]) -> NDArray[np.uint16]:
    """The bits of the nearest half floats, the even ones in the middle, five times as fast as NumPy finds them.

    Of values under 6e-5, some that are nearly in the middle count as being there.

    Args:
        values: from 0 to _MAX_HALF.
    """
    bits = (values * _EXPONENT_SCALE).view(np.uint32)
    is_odd = (bits >> _LACKED_BITS) & np.uint32(1)
    bits += is_odd + _BELOW_MIDDLE
    return (bits >> _LACKED_BITS).astype(np.uint16)


def _floats_of_bits(bits: NDArray[np.uint16]) -> NDArray[np.float32]:
    """The values of half floats from 0 on, given by their bits."""
    return np.asarray((bits.astype(np.uint32) << _LACKED_BITS).view(np.float32) / _EXPONENT_SCALE)


def _round_texture(bits: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Round half floats (R, W, 3), given by their bits, the more the less they lie between those beside them.

    The steps are as those of an 8-bit photo, or less than half of such a difference. Returned is where
    (R, 3W) something was rounded.

    Args:
        bits: changed in place.
    """
    curvature = np.abs(np.diff(bits[..., 1].view(np.int16), n=2, axis=1))
    dropped = np.take(_dropped_bits(), curvature, mode="clip")
    rows, columns = bits.shape[:2]
    texture = np.zeros((rows, columns), np.uint16)
    for first in range(3):  # the middle one of three and those beside it
        part = texture[:, first : first + columns - 2]
        np.maximum(part, dropped, out=part)
    pixels = bits.reshape(rows, -1)
    mask = np.repeat(texture, 3, axis=1) * (pixels < _MAX_TEXTURE)
    pixels += (mask + np.uint16(1)) >> np.uint16(1)
    pixels &= ~mask
    return np.asarray(mask > 0)


@cache
def _dropped_bits() -> NDArray[np.uint16]:
    """The bits that are dropped from a second difference on, by _TEXTURE_BITS."""
    dropped = np.zeros(max(_TEXTURE_BITS) + 1, np.uint16)
    for least, count in _TEXTURE_BITS.items():
        dropped[least:] = (1 << count) - 1
    return dropped


def _round_to_float(image: NDArray[np.float32], rounded: NDArray[np.float32]) -> NDArray[np.float32]:
    """32-bit floats (H, W, 3) of an image with 13 bits of mantissa, into `rounded`; what would be infinite stays."""
    for rows, out in zip(row_bands(image), row_bands(rounded), strict=True):
        bits = rows.view(np.uint32) + _HALF
        bits &= _MASK
        values = bits.view(np.float32)
        finite = np.isfinite(values)
        out[:] = values if finite.all() else np.where(finite, values, rows)
    return rounded


def row_bands(image: NDArray[Any]) -> Iterator[NDArray[Any]]:
    """Views of a few rows each, so that what is computed of one stays in the processor's cache.

    Args:
        image: (H, ...).
    """
    for start in range(0, len(image), _ROWS):
        yield image[start : start + _ROWS]


def set_compression_threads(count: int) -> None:
    """Pack in this many threads from now on; one packs in the caller's thread, since a pool of one is slower.

    Args:
        count: of threads, 1 or more.
    """
    _library().set_global_thread_count(count if count > 1 else 0)


@cache
def _library() -> Any:
    """OpenEXR with little effort in ZIP, and a thread for each CPU unless the program has set their number itself."""
    with suppress(OSError, AttributeError):  # Python's module has no name for it; without it ZIP is as good, but slower
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
    image: NDArray[np.floating[Any]],
    lighting: Lighting | None = None,
    attributes: Mapping[str, Any] | None = None,
    *,
    compression: str = "zip",
    probe: "LightProbe | None" = None,
    colors: str = "rec709",
    overwrite: bool = False,
    colours: str | None = None,
) -> None:
    """Write a map to a path or a binary stream.

    `zip` writes half floats, or 32-bit floats where half floats do not hold the map. `pxr24` and `none` always write
    32-bit floats.

    Args:
        target: a path, where the file appears when it is whole, or a binary stream.
        image: (H, 2H, 3) linear Rec.709.
        lighting: for the header; None: without.
        attributes: more for the header: texts, numbers and what else OpenEXR knows; None: no others.
        compression: zip, pxr24 or none. `zip` changes a value by up to 5e-4 of itself, amid texture by 0.02. It changes
            the light by less than 1e-3. `pxr24` changes a value by 1.6e-5, `none` by nothing.
        probe: the map's light probe, for the header; None: without.
        colors: primaries of the file: rec709, acescg or linear-p3. Lighting and probe stay in Rec.709.
        overwrite: whether the image's memory may be used; large maps then need less, and the image is worthless.
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
    chromaticities, interop_id = _color_space(colors)
    packing, pixels = _prepare_compression(
        _convert_colors(check_envmap(image), colors), compression, overwrite=overwrite
    )
    header = {
        "compression": packing,
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
        _check_attributes(attributes)
        _try_attributes(header)
    file = OpenEXR.File(header, {"RGB": pixels})
    if isinstance(target, str | os.PathLike):
        with open_target(target) as stream:
            file.write(stream)
    elif not callable(getattr(target, "write", None)):
        raise EnvironmentMapError(
            f"An EXR is written to a path or a binary stream, not {type(target).__name__}.", code=ErrorCode.WRONG_TYPE
        )
    elif type(target) is io.BytesIO and not target.getbuffer():
        file.write(target)  # without a copy, during which no other thread of Python runs
    else:  # OpenEXR seeks backwards, which pipes and files opened for appending cannot
        buffer = io.BytesIO()
        file.write(buffer)
        target.write(buffer.getbuffer())


def read_exr(source: WriteTarget) -> tuple[Image, Lighting | None]:
    """Read an EXR file: its pixels (H, W, 3) in linear Rec.709, and the lighting in its header or None.

    Args:
        source: path or binary stream of a file with R, G and B, half or float. They may lie in a layer, such as
            `ViewLayer.Combined` of Blender: the only one that has them, or the one of these with the name of a whole
            picture.

    Raises:
        EnvironmentMapError: it is no such file, is cut short, or has over 64 million pixels or a gigabyte of channels.
    """
    data = read_map_bytes(source)
    if not _is_whole(data):
        raise EnvironmentMapError("The EXR file is cut short or damaged.")
    _check_exr_size(data)
    header, planes = _colors(_decode(data))
    if len({plane.shape for plane in planes}) > 1:
        raise EnvironmentMapError("The EXR file's channels R, G and B differ in size.")
    return _in_rec709(np.stack(planes, axis=-1, dtype=np.float32), header), _lighting_in(header)


def _colors(parts: list[tuple[_Attributes, _Attributes]]) -> tuple[_Attributes, list[NDArray[Any]]]:
    """The header of the part that counts, and its R, G and B."""
    layers: dict[str, tuple[_Attributes, dict[str, NDArray[Any]]]] = {}
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


def _in_rec709(pixels: Image, header: Mapping[str, Any]) -> Image:
    """Pixels (H, W, 3) of the primaries that a header names, Rec.709's where it names none, in those of Rec.709."""
    try:
        matrix = chromaticities_to_rec709(header.get("chromaticities", CHROMATICITIES))
    except (ValueError, TypeError) as error:
        raise EnvironmentMapError("The EXR file's chromaticities are those of no colours.") from error
    return pixels if matrix is None else np.asarray(pixels @ matrix.T)


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


def check_envmap(image: NDArray[np.floating[Any]]) -> Image:
    """The map as contiguous float32.

    Args:
        image: (H, 2H, 3), else EnvironmentMapError.
    """
    shape = np.shape(image)
    if not shape:
        sentence = f"An environment map is an array of shape (H, 2H, 3), not {type(image).__name__}."
        raise EnvironmentMapError(sentence, code=ErrorCode.WRONG_TYPE)
    if len(shape) != 3 or shape != (shape[0], 2 * shape[0], 3) or shape[0] == 0:
        raise EnvironmentMapError(f"An environment map has the shape (H, 2H, 3), not {shape}.")
    return np.ascontiguousarray(image, dtype=np.float32)


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


def _check_attributes(attributes: Mapping[str, Any]) -> None:
    """Raise EnvironmentMapError for what OpenEXR would write as something else."""
    for name, value in attributes.items():
        if isinstance(value, int | np.integer) and not -(2**31) <= int(value) < 2**31:
            predicate = f"is {value}, and whole numbers of an EXR have 32 bits; write it as text."
        elif name == "envmap" and not isinstance(value, type(OpenEXR.ENVMAP_LATLONG)):
            predicate = f"is {value!r}; it must be OpenEXR.ENVMAP_LATLONG, which is written without it, too."
        else:
            continue
        raise EnvironmentMapError(f"The attribute {name} {predicate}", "attributes", ErrorCode.OUT_OF_RANGE)


def _try_attributes(header: Mapping[str, Any]) -> None:
    """Write a picture of one pixel with this header; EnvironmentMapError where OpenEXR knows no such attributes."""
    try:
        OpenEXR.File(dict(header), {"RGB": np.zeros((1, 1, 3), np.float32)}).write(io.BytesIO())
    except (RuntimeError, ValueError, TypeError) as error:
        raise EnvironmentMapError(f"The attributes cannot be those of an EXR: {str(error).rstrip('.')}.") from error


def _color_space(name: str) -> tuple[tuple[float, ...], str]:
    """Chromaticities and interoperable name of a space; EnvironmentMapError for another than COLOR_SPACES."""
    if name not in COLOR_SPACES:
        sentence = f"The colors {name!r} are not known; they must be one of {', '.join(COLOR_SPACES)}."
        raise EnvironmentMapError(sentence, "colors", ErrorCode.UNKNOWN)
    return COLOR_SPACES[name]


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


def _lighting_in(header: Mapping[str, Any]) -> Lighting | None:
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
                "The file is open as text; open it in binary mode: open(path, 'rb').",
                code=ErrorCode.WRONG_TYPE,
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
    if width * height > MAX_READ_PIXELS:
        limit = f"the limit of {MAX_READ_PIXELS / 1e6:g} million"
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
        raise EnvironmentMapError(f"The EXR file's {sum(counts)} channels take more than a gigabyte, the limit.")


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


def _convert_colors(linear: NDArray[np.float32], space: str) -> NDArray[np.float32]:
    """Return linear Rec.709 colors (..., 3) in another space of COLOR_SPACES; white stays (1, 1, 1).

    Args:
        linear: (..., 3), Rec.709.
        space: its name.
    """
    matrix = chromaticities_to_rec709(COLOR_SPACES[space][0])
    if matrix is None:
        return linear
    inverse = np.linalg.inv(matrix.astype(np.float64)).astype(np.float32)
    return np.ascontiguousarray(linear @ inverse.T)

"""What is written and read again: environment maps, pictures and records. A file appears only when it is whole.

The formats of maps are entries of MAP_FORMATS, which the command line and the service read.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.files.atomic import leftovers, replacing
    from lighting.files.compression import COMPRESSIONS, check_packing, pack_in_threads
    from lighting.files.exr import (
        MAGIC,
        SOFTWARE,
        Image,
        Target,
        checked_map,
        read_attributes,
        read_exr,
        read_map,
        write_exr,
    )
    from lighting.files.folders import objection_to
    from lighting.files.formats import encode_envmap, write_envmap
    from lighting.files.pictures import encode_jpeg, encode_png
    from lighting.files.record import MAX_RECORD_BYTES, full_record, json_line, named_once, one_record
    from lighting.files.rgbe import MAGIC_HDR, decode_hdr, read_hdr
    from lighting.geometry import Floats
    from lighting.records import Lighting

__all__ = [
    "COMPRESSIONS",
    "MAGIC",
    "MAGIC_HDR",
    "MAP_FORMATS",
    "MAX_RECORD_BYTES",
    "SOFTWARE",
    "MapFormat",
    "Target",
    "check_packing",
    "checked_map",
    "decode_hdr",
    "encode_envmap",
    "encode_jpeg",
    "encode_png",
    "full_record",
    "json_line",
    "leftovers",
    "named_once",
    "objection_to",
    "one_record",
    "pack_in_threads",
    "read_attributes",
    "read_exr",
    "read_hdr",
    "read_map",
    "replacing",
    "write_envmap",
    "write_exr",
]


@dataclass(frozen=True)
class MapFormat:
    """How environment maps are written in one format."""

    write: Callable[..., None]  # (target, image, lighting), and `compression` where it takes one
    media_type: str
    read: Callable[[bytes], "Image"] | None = None  # the linear pixels (H, W, 3); None where a file holds none
    takes_compression: bool = False


def _write_exr(target: "Target", image: "Floats", lighting: "Lighting | None", **options: Any) -> None:
    from lighting.files.exr import write_exr

    write_exr(target, image, lighting, **options)


def _read_exr(data: bytes) -> "Image":
    from io import BytesIO

    from lighting.files.exr import read_exr

    return read_exr(BytesIO(data))[0]


def _write_hdr(target: "Target", image: "Floats", lighting: "Lighting | None") -> None:
    from lighting.files.rgbe import write_hdr

    write_hdr(target, image, lighting)


def _read_hdr(data: bytes) -> "Image":
    from lighting.files.rgbe import decode_hdr

    return decode_hdr(data)


def _write_png(target: "Target", image: "Floats", _lighting: "Lighting | None") -> None:
    from lighting.files.formats import write_png_map

    write_png_map(target, image)


MAP_FORMATS: dict[str, MapFormat] = {  # by the suffix of a file, without its dot
    "exr": MapFormat(_write_exr, "image/x-exr", _read_exr, takes_compression=True),
    "hdr": MapFormat(_write_hdr, "image/vnd.radiance", _read_hdr),
    "png": MapFormat(_write_png, "image/png"),
}

_HOME = {
    "COMPRESSIONS": "compression",
    "MAGIC": "exr",
    "MAGIC_HDR": "rgbe",
    "MAX_RECORD_BYTES": "record",
    "SOFTWARE": "exr",
    "Target": "exr",
    "check_packing": "compression",
    "checked_map": "exr",
    "decode_hdr": "rgbe",
    "encode_envmap": "formats",
    "encode_jpeg": "pictures",
    "encode_png": "pictures",
    "full_record": "record",
    "json_line": "record",
    "leftovers": "atomic",
    "named_once": "record",
    "objection_to": "folders",
    "one_record": "record",
    "pack_in_threads": "compression",
    "read_attributes": "exr",
    "read_exr": "exr",
    "read_hdr": "rgbe",
    "read_map": "exr",
    "replacing": "atomic",
    "write_envmap": "formats",
    "write_exr": "exr",
}

__getattr__ = from_homes(__name__, _HOME)  # what needs numpy, so that the command line's help stays quick

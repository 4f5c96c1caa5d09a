"""What is written and read again: environment maps, pictures and records. A file appears only when it is whole."""

from lighting.files.atomic import leftovers, replacing
from lighting.files.compression import COMPRESSIONS, Compression, check_packing, pack_in_threads
from lighting.files.exr import MAGIC, SOFTWARE, Target, checked_map, read_attributes, read_exr, read_map, write_exr
from lighting.files.folders import objection_to
from lighting.files.formats import encode_envmap, write_envmap
from lighting.files.pictures import encode_jpeg, encode_png
from lighting.files.record import MAX_RECORD_BYTES, full_record, json_line, named_once, one_record
from lighting.files.rgbe import MAGIC_HDR, decode_hdr, read_hdr

__all__ = [
    "COMPRESSIONS",
    "MAGIC",
    "MAGIC_HDR",
    "MAX_RECORD_BYTES",
    "SOFTWARE",
    "Compression",
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

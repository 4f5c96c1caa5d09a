"""Photos: the pixels, EXIF data and time in a file, and the network's input tensor."""

from typing import TYPE_CHECKING

from lighting.lazy import from_homes

if TYPE_CHECKING:
    from lighting.photo.apart import read_apart, start_decoders
    from lighting.photo.canvas import fit_size, fitted, place, to_tensor
    from lighting.photo.clock import OFFSETS, YEARS, in_utc, read_offset, read_time
    from lighting.photo.exif import FULL_FRAME, PhotoFacts, read_facts, read_orientation, vertical_fov
    from lighting.photo.gravity import SENSOR_SPREAD, heading_by_gimbal
    from lighting.photo.held import photo_of
    from lighting.photo.linear import RAW_SUFFIXES, Curve, LinearPhoto, facts_of, of_floats, read_linear
    from lighting.photo.no_photo import is_empty, is_panorama
    from lighting.photo.read import (
        MAX_ASPECT,
        MAX_BYTES,
        MAX_PIXELS,
        MIN_SIDE,
        MOST_PIXELS,
        TARGET,
        Photo,
        Source,
        check_photo,
        photo_data,
        read_photo,
    )

__all__ = [
    "FULL_FRAME",
    "MAX_ASPECT",
    "MAX_BYTES",
    "MAX_PIXELS",
    "MIN_SIDE",
    "MOST_PIXELS",
    "OFFSETS",
    "RAW_SUFFIXES",
    "SENSOR_SPREAD",
    "TARGET",
    "YEARS",
    "Curve",
    "LinearPhoto",
    "Photo",
    "PhotoFacts",
    "Source",
    "check_photo",
    "facts_of",
    "fit_size",
    "fitted",
    "heading_by_gimbal",
    "in_utc",
    "is_empty",
    "is_panorama",
    "of_floats",
    "photo_data",
    "photo_of",
    "place",
    "read_apart",
    "read_facts",
    "read_linear",
    "read_offset",
    "read_orientation",
    "read_photo",
    "read_time",
    "start_decoders",
    "to_tensor",
    "vertical_fov",
]

__getattr__ = from_homes(
    __name__,
    {
        "FULL_FRAME": "exif",
        "MAX_ASPECT": "read",
        "MAX_BYTES": "read",
        "MAX_PIXELS": "read",
        "MIN_SIDE": "read",
        "MOST_PIXELS": "read",
        "OFFSETS": "clock",
        "RAW_SUFFIXES": "linear",
        "SENSOR_SPREAD": "gravity",
        "TARGET": "read",
        "YEARS": "clock",
        "Curve": "linear",
        "LinearPhoto": "linear",
        "Photo": "read",
        "PhotoFacts": "exif",
        "Source": "read",
        "check_photo": "read",
        "facts_of": "linear",
        "fit_size": "canvas",
        "fitted": "canvas",
        "heading_by_gimbal": "gravity",
        "in_utc": "clock",
        "is_empty": "no_photo",
        "is_panorama": "no_photo",
        "of_floats": "linear",
        "photo_data": "read",
        "photo_of": "held",
        "place": "canvas",
        "read_apart": "apart",
        "read_facts": "exif",
        "read_linear": "linear",
        "read_offset": "clock",
        "read_orientation": "exif",
        "read_photo": "read",
        "read_time": "clock",
        "start_decoders": "apart",
        "to_tensor": "canvas",
        "vertical_fov": "exif",
    },
)

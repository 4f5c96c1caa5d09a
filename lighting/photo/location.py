"""Where a photo was taken and where its camera pointed, by EXIF and XMP, however programs write it.

Degrees may be one number or three, rationals or text, signed or with a letter. Where neither a sign nor a letter tells
the hemisphere, each possible place is a candidate. All of it is hostile input.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from itertools import product
from typing import Any

from PIL import ExifTags

from lighting.photo.tags import EXIF_NAMESPACE, Tags, read_number, read_text, read_xmp_number, try_read

Locations = tuple[tuple[float, float], ...]  # latitudes and longitudes, deg, positive north and east

_DJI = "http://www.dji.com/drone-dji/1.0"
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d*)?(?:/\d+)?", re.ASCII)
_LETTERS = re.compile(r"[^\W\d_ºª]+")  # an ordinal's sign stands for the degree's
_DECIMAL_COMMA = re.compile(r"([-+]?\d+),(\d{3,})(?=\D*$)", re.ASCII)  # minutes have two digits before a point
_UNITS = ("deg", "degree", "degrees", "min", "minutes", "sec", "seconds", "d", "m")
_LATIN_1_REST = "Â"  # what Latin-1 makes of the first byte of a degree sign in UTF-8
_MAX_ANGLE = 360.0  # deg
_MAX_TEXT = 64  # characters of an angle
_SIGNS = {"N": 1, "S": -1, "E": 1, "W": -1}


class HeadingReference(StrEnum):
    """The north from which a heading counts."""

    TRUE = "true"
    MAGNETIC = "magnetic"


@dataclass(frozen=True)
class _Coordinate:
    """A latitude or a longitude."""

    size: float  # deg, 0 or more
    signs: tuple[int, ...]  # 1 and -1, those that it may have
    is_negative: bool = False  # whether its number has a sign


def read_locations(gps: Tags, xmp: Mapping[str, str]) -> Locations:
    """The places where a photo may have been taken: none, one, or one for each hemisphere that is left open.

    Args:
        gps: tags of EXIF's GPS directory.
        xmp: properties by "namespace name".
    """
    tag = ExifTags.GPS
    names = (tag.GPSLatitude, tag.GPSLatitudeRef, tag.GPSLongitude, tag.GPSLongitudeRef)
    sources = [tuple(gps.get(name) for name in names)]
    exif = ("GPSLatitude", "GPSLatitudeRef", "GPSLongitude", "GPSLongitudeRef")
    sources.append(tuple(xmp.get(f"{EXIF_NAMESPACE} {name}") for name in exif))
    for longitude in ("GpsLongitude", "GpsLongtitude"):  # the latter is how DJI's first drones spelled it
        sources.append((xmp.get(f"{_DJI} GpsLatitude"), "", xmp.get(f"{_DJI} {longitude}"), ""))
    return next((found for source in sources if (found := _locations(*source))), ())


def _locations(latitude: Any, latitude_reference: Any, longitude: Any, longitude_reference: Any) -> Locations:
    north = _coordinate(latitude, latitude_reference, "NS", 90.0)
    east = _coordinate(longitude, longitude_reference, "EW", 180.0)
    if north is None or east is None or north.size == east.size == 0:  # many programs write 0, 0 for an unknown place
        return ()
    if north.is_negative != east.is_negative:  # who signs one of them would sign the other
        north, east = (_Coordinate(c.size, c.signs[:1] if len(c.signs) == 2 else c.signs) for c in (north, east))
    return tuple(dict.fromkeys((a * north.size, b * east.size) for a, b in product(north.signs, east.signs)))


def _coordinate(value: Any, reference: Any, letters: str, limit: float) -> _Coordinate | None:
    try:
        numbers, is_negative, letter = _parse_angle(value)
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return None
    size = sum(number / 60.0**power for power, number in enumerate(numbers))
    if size > limit or any(number > 60.0 for number in numbers[1:]):
        return None
    stated = letter or _first_letter(reference)
    if stated in letters and stated:
        by_letter = _SIGNS[stated]
        signs = (by_letter,) if not is_negative or by_letter < 0 else (-1, 1)
    else:
        signs = (-1,) if is_negative else (1, -1)
    return _Coordinate(size, signs if size else (1,), is_negative)


def _parse_angle(value: Any) -> tuple[list[float], bool, str]:
    """Degrees, minutes and seconds without signs, whether the degrees have one, and the hemisphere's letter or none."""
    if isinstance(value, bytes | str):
        return _parse_text(read_text(value))
    parts = list(value) if isinstance(value, tuple | list) else [value]
    if not parts:
        raise ValueError("no numbers")
    while len(parts) > 1 and not math.isfinite(float(parts[-1])):
        parts.pop()  # 0/0, of which the part before holds the fraction
    numbers = [_read_signed(part) for part in parts[:3]]
    return [abs(number) for number in numbers], any(number < 0 for number in numbers), ""


def _read_signed(value: Any) -> float:
    """A number, also one below 0 that a program wrote into a rational without a sign."""
    number, numerator = read_number(value), getattr(value, "numerator", 0)
    is_wrapped = number > _MAX_ANGLE and 2**31 <= numerator < 2**32
    return (numerator - 2**32) / value.denominator if is_wrapped else number


def _parse_text(text: str) -> tuple[list[float], bool, str]:
    if len(text) > _MAX_TEXT:
        raise ValueError("too long for an angle")
    text = text.replace(_LATIN_1_REST, "")
    words = [word for word in _LETTERS.findall(text) if word.lower() not in _UNITS]
    found = _NUMBER.findall(_DECIMAL_COMMA.sub(r"\1.\2", text))
    if not 1 <= len(found) <= 3 or len(words) > 1:
        raise ValueError("no angle")
    numbers = [read_xmp_number(number) for number in found]
    return [abs(number) for number in numbers], numbers[0] < 0 or found[0][0] == "-", _first_letter("".join(words))


def _first_letter(reference: Any) -> str:
    """The first letter of a hemisphere's name; empty where there is none, as of what is no text."""
    try:
        return read_text(reference)[:1].upper()
    except (TypeError, ValueError):
        return ""


def read_heading(gps: Tags, xmp: Mapping[str, str]) -> tuple[float | None, HeadingReference | None]:
    """Where the camera pointed, in deg clockwise from a north, 0 to 360; None where that is unknown.

    Args:
        gps: tags of EXIF's GPS directory.
        xmp: properties by "namespace name".
    """
    heading = try_read(lambda tags: _heading(tags[ExifTags.GPS.GPSImgDirection]), gps)
    reference = gps.get(ExifTags.GPS.GPSImgDirectionRef)
    if heading is None and (text := xmp.get(f"{EXIF_NAMESPACE} GPSImgDirection")):
        heading = try_read(lambda _: _heading(text), {})
        reference = xmp.get(f"{EXIF_NAMESPACE} GPSImgDirectionRef")
    references = {"T": HeadingReference.TRUE, "M": HeadingReference.MAGNETIC}
    return heading, references.get(_first_letter(reference))


def _heading(value: Any) -> float | None:
    if isinstance(value, str | bytes):
        heading = read_xmp_number(read_text(value).replace(",", "."))
    else:
        heading = read_number(value[0] if isinstance(value, tuple) else value)
    return heading % 360.0 if -180.0 <= heading <= 360.0 else None

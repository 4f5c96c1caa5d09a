"""EXIF and XMP -> PhotoMetadata.

Both are hostile input: whatever cannot be read, or cannot be true, counts as absent.

Degrees of a place or a heading may be one number or three, rationals or text, signed or with a letter. Where neither a
sign nor a letter tells the hemisphere, each possible place is a candidate.
"""

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum
from itertools import product
from typing import Any

from PIL import ExifTags

from lighting.fields import describe_fields
from lighting.geometry import wrap_azimuth
from lighting.photo.camera import PhotoFrame, read_lens
from lighting.photo.clock import read_clock, read_gps_time
from lighting.photo.imu import DJI_NAMESPACE, read_drone_heading, read_flight_height, read_tilt
from lighting.photo.tags import (
    EXIF_NAMESPACE,
    TAG_ERRORS,
    PhotoTags,
    Tags,
    read_first_number,
    read_make,
    read_number,
    read_text,
    read_xmp_number,
    text_or_empty,
)

Locations = tuple[tuple[float, float], ...]  # latitudes and longitudes, deg, positive north and east

_DJI_NAMES = (  # the second is how DJI's first drones spelled it
    ("GpsLatitude", "GpsLongitude"), ("GpsLatitude", "GpsLongtitude"), ("Latitude", "Longitude"),
)  # fmt: skip
_NUMBER = r"(?a)[-+]?\d+(?:\.\d*)?(?:/\d+)?"
_LETTERS = r"[^\W\d_ºª]+"  # an ordinal's sign stands for the degree's
_DECIMAL_COMMA = r"(?a)([-+]?\d+),(\d{3,})(?=\D*$)"  # minutes have two digits before a point
_UNITS = ("deg", "degree", "degrees", "min", "minutes", "sec", "seconds", "d", "m")
_LATIN_1_REST = "Â"  # what Latin-1 makes of the first byte of a degree sign in UTF-8
_MAX_ANGLE = 360.0  # deg
_MAX_TEXT = 64  # characters of an angle
_SIGNS = {"N": 1, "S": -1, "E": 1, "W": -1}
_HEMISPHERES = {  # by words that begin otherwise; O alone is east in German, west in French, Spanish and Italian
    **dict.fromkeys(("ost", "osten", "oost", "øst", "öst", "leste"), "E"),
    **dict.fromkeys(("ouest", "oeste", "ovest", "vest", "väst"), "W"),
    **{"sever": "N", "sjever": "N", "zuid": "S", "jih": "S"},
}


class HeadingReference(StrEnum):
    """The north from which a heading counts."""

    TRUE = "true"
    MAGNETIC = "magnetic"


@dataclass(frozen=True, eq=False, repr=False)
class _Coordinate:
    """A latitude or a longitude."""

    size: float  # deg, 0 or more
    signs: tuple[int, ...]  # 1 and -1, those that it may have
    is_negative: bool = False  # whether its number has a sign


def _read_locations(gps: Tags, xmp: Mapping[str, str]) -> Locations:
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
    for latitude, longitude in _DJI_NAMES:
        sources.append((xmp.get(f"{DJI_NAMESPACE} {latitude}"), "", xmp.get(f"{DJI_NAMESPACE} {longitude}"), ""))
    return next((found for source in sources if (found := _locations(*source))), ())


def _locations(latitude: object, latitude_ref: object, longitude: object, longitude_ref: object) -> Locations:
    if latitude is None or longitude is None:
        return ()
    north = _coordinate(latitude, latitude_ref, "NS", 90.0)
    east = _coordinate(longitude, longitude_ref, "EW", 180.0)
    if north is None or east is None or north.size == east.size == 0:  # many programs write 0, 0 for an unknown place
        return ()
    if north.is_negative != east.is_negative:  # who signs one of them would sign the other
        north, east = (_Coordinate(c.size, c.signs[:1] if len(c.signs) == 2 else c.signs) for c in (north, east))
    return tuple(dict.fromkeys((a * north.size, b * east.size) for a, b in product(north.signs, east.signs)))


def _coordinate(value: object, reference: object, letters: str, limit: float) -> _Coordinate | None:
    try:
        numbers, is_negative, letter = _parse_angle(value)
    except (ArithmeticError, LookupError, TypeError, ValueError):
        return None
    size = sum(number / 60.0**power for power, number in enumerate(numbers))
    if size > limit or any(number > 60.0 for number in numbers[1:]):
        return None
    stated = letter or _hemisphere(reference)
    if stated in letters and stated:
        by_letter = _SIGNS[stated]
        signs = (by_letter,) if not is_negative or by_letter < 0 else (-1, 1)
    else:
        signs = (-1,) if is_negative else (1, -1)
    return _Coordinate(size, signs if size else (1,), is_negative)


def _parse_angle(value: object) -> tuple[list[float], bool, str]:
    """Degrees, minutes and seconds without signs, whether the degrees have one, and the hemisphere's letter or none."""
    if isinstance(value, bytes | str):
        return _parse_text(read_text(value))
    parts: list[Any] = list(value) if isinstance(value, tuple | list) else [value]
    if not parts:
        raise ValueError("no numbers")
    while len(parts) > 1 and not math.isfinite(float(parts[-1])):
        parts.pop()  # 0/0, of which the part before holds the fraction
    numbers = [_read_signed(part) for part in parts[:3]]
    return [abs(number) for number in numbers], any(number < 0 for number in numbers), ""


def _read_signed(value: object) -> float:
    """A number, also one below 0 that a program wrote into a rational without a sign."""
    number, numerator = read_number(value), getattr(value, "numerator", 0)
    is_wrapped = number > _MAX_ANGLE and 2**31 <= numerator < 2**32
    return (numerator - 2**32) / getattr(value, "denominator", 1) if is_wrapped else number


def _parse_text(text: str) -> tuple[list[float], bool, str]:
    if len(text) > _MAX_TEXT:
        raise ValueError("too long for an angle")
    text = text.replace(_LATIN_1_REST, "")
    words = [word for word in re.findall(_LETTERS, text) if word.lower() not in _UNITS]
    found = re.findall(_NUMBER, re.sub(_DECIMAL_COMMA, r"\1.\2", text))
    if not 1 <= len(found) <= 3 or len(words) > 1:
        raise ValueError("no angle")
    numbers = [read_xmp_number(number) for number in found]
    return [abs(number) for number in numbers], numbers[0] < 0 or found[0][0] == "-", _hemisphere("".join(words))


def _hemisphere(reference: object) -> str:
    """The first letter of a hemisphere's English name; another, or none, where that is open."""
    word = text_or_empty(reference)
    return _HEMISPHERES.get(word.lower(), word[:1].upper())


def _read_heading(gps: Tags, xmp: Mapping[str, str]) -> tuple[float | None, HeadingReference | None]:
    """Where the camera pointed, in deg clockwise from a north, 0 to 360; None where that is unknown.

    Args:
        gps: tags of EXIF's GPS directory.
        xmp: properties by "namespace name".
    """
    heading = _heading(gps.get(ExifTags.GPS.GPSImgDirection))
    reference = gps.get(ExifTags.GPS.GPSImgDirectionRef)
    if heading is None and (text := xmp.get(f"{EXIF_NAMESPACE} GPSImgDirection")):
        heading, reference = _heading(text), xmp.get(f"{EXIF_NAMESPACE} GPSImgDirectionRef")
    references = {"T": HeadingReference.TRUE, "M": HeadingReference.MAGNETIC}
    return heading, references.get(text_or_empty(reference)[:1].upper())


def _heading(value: object) -> float | None:
    if value is None:
        return None
    with suppress(*TAG_ERRORS):
        if isinstance(value, str | bytes):
            heading = read_xmp_number(read_text(value).replace(",", "."))
        else:
            heading = read_first_number(value)
        return heading % 360.0 if -180.0 <= heading <= 360.0 else None
    return None


_BAND_NAMES = (" ImageSource", " BandName")
_THERMAL = r"(?i)infra-?red|thermal|\b[lm]wir\b"
_FLIR = "http://ns.flir.com/"
_EXPOSURE_VALUES = (-20.0, 25.0)  # EV at ISO 100 that a photo can have; others are damage


@dataclass(frozen=True)
class PhotoMetadata:
    """How a photo was taken; None is unknown. The repr omits the location, so that no log shows it."""

    local_time: datetime | None = None
    """Local time of the photo, without an offset from UTC."""
    utc_offset: float | None = None
    """Hours, -12 to 14, local minus universal time, where the file has it."""
    gps_time: datetime | None = None
    """Time by the satellites, with its offset from UTC; it may contradict the two."""
    utc_probability: float | None = None
    """0 to 1, that `local_time` is in UTC, as a clip's file says, and not local after all. None: nothing doubts it."""
    latitude: float | None = field(default=None, repr=False)
    """Deg, -90 to 90, positive north."""
    longitude: float | None = field(default=None, repr=False)
    """Deg, -180 to 180, positive east; None if `latitude` is."""
    heading: float | None = None
    """Deg, 0 to 360, clockwise from `heading_reference`: where the camera points."""
    heading_reference: HeadingReference | None = None
    """True or magnetic north."""
    focal_length: float | None = None
    """Mm, over 0, of the 36 x 24 mm camera with the same diagonal field of view."""
    vertical_fov: float | None = None
    """Deg, 1 to 170, of the upright photo, by its lens and what a crop left."""
    camera_elevation: float | None = None
    """Deg, -90 to 90, of the upright photo: positive looks up."""
    camera_roll: float | None = None
    """Deg, -180 to 180: positive turns the camera clockwise; steep cameras have none."""
    gravity_source: str | None = None
    """Of elevation and roll: "accelerometer", "gimbal" or "elevation angle"."""
    gravity_spread: float | None = None
    """Deg, 0 or more: standard deviation of elevation and roll."""
    exposure_value: float | None = None
    """EV at ISO 100, -20 to 25, of the camera's settings."""
    camera_height: float | None = None
    """Meters above the ground where a drone took off."""
    locations: tuple[tuple[float, float], ...] = field(default=(), repr=False)
    """Possible (latitude, longitude), deg, where the file states no hemisphere."""
    other_vertical_fovs: tuple[float, ...] = ()
    """Deg, 1 to 170, less likely than `vertical_fov`: the file leaves open what was cropped."""
    is_lens_consistent: bool = True
    """Whether the file says of the lens more than a 35 mm value alone, in agreement."""
    camera_make: str | None = None
    """Who made the camera, in small letters, such as "apple"."""
    is_panorama: bool = False
    """Whether the file says that several frames make the picture."""
    is_thermal: bool = False
    """Whether the file says that the picture shows temperatures."""
    orientation: int | None = field(default=None, compare=False)
    """1 to 8: how the pixels lie in the file."""

    @property
    def location(self) -> tuple[float, float] | None:
        """Latitude and longitude [deg], positive north and east; None where they are unknown."""
        return None if self.latitude is None or self.longitude is None else (self.latitude, self.longitude)


describe_fields(PhotoMetadata)


def read_metadata(
    tags: PhotoTags, width: int, height: int, beside: Mapping[str, str] | None = None, *, is_inside: bool = False
) -> PhotoMetadata:
    """What the EXIF, XMP and IPTC of an image say. Never raises.

    Args:
        tags: of the image.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
        beside: XMP properties of files beside the photo, where its own say nothing; None: there are none.
        is_inside: whether the photo lies inside a border of the picture.
    """
    camera, orientation, xmp = tags.camera, tags.orientation, {**(beside or {}), **tags.xmp}
    heading, reference = _read_heading(tags.gps, xmp)
    locations = _read_locations(tags.gps, xmp)
    latitude, longitude = locations[0] if len(locations) == 1 else (None, None)
    stamp = read_clock(camera, tags.main, xmp, tags.iptc, is_located=bool(locations))
    local_time, utc_offset = (stamp.time, stamp.utc_offset) if stamp else (None, None)
    if heading is None and (heading := read_drone_heading(xmp)) is not None:
        reference = HeadingReference.TRUE
    lens = read_lens(tags.main, camera, xmp, PhotoFrame(width, height, orientation in (5, 6, 7, 8), is_inside))
    tilt = read_tilt(camera, xmp, orientation, (width, height)) if lens.is_whole else None
    roll = None if tilt is None or tilt.roll is None else float(wrap_azimuth(tilt.roll + lens.turn))
    return PhotoMetadata(
        local_time,
        utc_offset,
        read_gps_time(tags.gps, xmp, local_time, longitude),
        latitude=latitude,
        longitude=longitude,
        heading=heading,
        heading_reference=reference,
        focal_length=lens.focal_length,
        vertical_fov=lens.vertical_fovs[0] if lens.vertical_fovs else None,
        camera_elevation=tilt.elevation if tilt else None,
        camera_roll=roll,
        gravity_source=tilt.source if tilt else None,
        gravity_spread=tilt.std if tilt else None,
        exposure_value=_exposure_value(camera),
        camera_height=read_flight_height(xmp),
        locations=locations if len(locations) > 1 else (),
        other_vertical_fovs=lens.vertical_fovs[1:],
        is_lens_consistent=lens.is_consistent or not lens.vertical_fovs,
        camera_make=read_make(tags.main) or None,
        is_panorama=lens.is_panorama,
        is_thermal=tags.has_temperatures or _is_thermal(xmp),
        orientation=orientation,
    )


def _is_thermal(xmp: Mapping[str, str]) -> bool:
    """Whether XMP names a camera of far infrared: by DJI's source, by the band of FLIR and Pix4D."""
    names = (value for name, value in xmp.items() if name.endswith(_BAND_NAMES))
    return any(re.search(_THERMAL, value) for value in names) or any(name.startswith(_FLIR) for name in xmp)


def read_exposure(camera: Tags) -> float | None:
    """Exposure time [s] x ISO / 100 / f-number^2 by EXIF; None without a time. Never raises.

    Two photos by one lens differ in this as their pixels do. A sensitivity or an f-number that is absent counts as
    ISO 100 and f/1, for lenses without contacts note none.

    Args:
        camera: tags of EXIF's directory of the camera.
    """
    base = ExifTags.Base
    with suppress(*TAG_ERRORS):
        iso = read_first_number(camera.get(base.ISOSpeedRatings, 100)) or 100.0
        aperture = read_number(camera.get(base.FNumber, 1)) or 1.0
        exposure = read_number(camera[base.ExposureTime]) * iso / 100.0 / aperture**2
        return exposure if exposure > 0 else None
    return None


def _exposure_value(camera: Tags) -> float | None:
    """log2(f-number^2 / time x 100 / ISO); absent unless all three exist."""
    base = ExifTags.Base
    with suppress(*TAG_ERRORS):
        time, aperture = read_number(camera[base.ExposureTime]), read_number(camera[base.FNumber])
        value = math.log2(aperture**2 / time * 100.0 / read_first_number(camera[base.ISOSpeedRatings]))
        low, high = _EXPOSURE_VALUES
        return value if low <= value <= high else None
    return None

"""EXIF and XMP -> PhotoMetadata.

Both are hostile input: whatever cannot be read, or cannot be true, counts as absent.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from typing import Any

from PIL import ExifTags, Image

import lighting.photo.imu as imu
from lighting.photo.clock import read_clock, read_gps_time
from lighting.photo.tags import (
    Tags,
    read_exif,
    read_ifd,
    read_iptc,
    read_main_tags,
    read_number,
    read_text,
    read_xmp,
    try_read,
)

FULL_FRAME_DIAGONAL = math.hypot(36.0, 24.0)  # mm, to which 35 mm equivalents refer

_VERTICAL_FOV = (5.0, 120.0)  # deg, what an ordinary lens covers; values outside are clamped
_EXPOSURE_VALUES = (-20.0, 25.0)  # EV at ISO 100 that a photo can have; others are damage
_SAME_ASPECT = 0.02  # relative difference up to which a picture counts as uncropped


class HeadingReference(StrEnum):
    """The north from which a heading counts."""

    TRUE = "true"
    MAGNETIC = "magnetic"


@dataclass(frozen=True)
class PhotoMetadata:
    """How a photo was taken; None is unknown. The repr omits the location, so that no log shows it."""

    local_time: datetime | None = None  # naive
    utc_offset: float | None = None  # h, local minus universal time, where the file has it
    gps_time: datetime | None = None  # aware, by the satellites; it may contradict the two
    latitude: float | None = field(default=None, repr=False)  # deg, positive north
    longitude: float | None = field(default=None, repr=False)  # deg, positive east; None if latitude is
    heading: float | None = None  # deg clockwise from `heading_reference`, 0 to 360
    heading_reference: HeadingReference | None = None
    focal_length: float | None = None  # mm, of the 36 x 24 mm camera with the same diagonal field of view
    vertical_fov: float | None = None  # deg, of the upright photo
    camera_elevation: float | None = None  # deg, positive looks up, of the upright photo
    camera_roll: float | None = None  # deg, positive turns the camera clockwise; steep cameras have none
    gravity_source: str | None = None  # of the two: "accelerometer", "gimbal" or "elevation angle"
    gravity_spread: float | None = None  # deg, standard deviation of the two
    exposure_value: float | None = None  # EV at ISO 100, of the camera's settings
    camera_height: float | None = None  # m above the ground where a drone took off

    @property
    def location(self) -> tuple[float, float] | None:
        """Latitude and longitude [deg], positive north and east; None where they are unknown."""
        return None if self.latitude is None or self.longitude is None else (self.latitude, self.longitude)


def read_metadata(
    image: Image.Image, width: int, height: int, beside: Mapping[str, str] | None = None
) -> PhotoMetadata:
    """The metadata in an image's EXIF, XMP and IPTC. Never raises.

    Args:
        image: opened by Pillow.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
        beside: XMP properties of files beside the photo, where its own say nothing; None: there are none.
    """
    camera, gps = (read_ifd(image, ifd) for ifd in (ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo))
    xmp = {**(beside or {}), **read_xmp(image.info.get("xmp"))}
    latitude, longitude = try_read(_gps_location, gps) or (None, None)
    stamp = read_clock(camera, read_main_tags(image), xmp, read_iptc(image), is_located=latitude is not None)
    local_time, utc_offset = (stamp.time, stamp.utc_offset) if stamp else (None, None)
    gps_time = read_gps_time(gps, xmp, local_time, longitude)
    heading, reference = try_read(_heading, gps), try_read(_heading_reference, gps)
    if heading is None and (heading := imu.heading_from_xmp(xmp)) is not None:
        reference = HeadingReference.TRUE
    focal_length = try_read(_focal_length, camera)
    uncropped = try_read(lambda tags: _is_uncropped(tags, width / height), camera)
    fov = vertical_fov_from_focal_length(focal_length, width, height) if focal_length and uncropped else None
    tilt = _camera_tilt(camera, xmp, read_orientation(image), (width, height)) if uncropped else None
    known = PhotoMetadata(local_time, utc_offset, gps_time, latitude, longitude, heading, reference, focal_length, fov)
    exposure_value = try_read(_exposure_value, camera)
    known = replace(known, exposure_value=exposure_value, camera_height=imu.height_from_xmp(xmp))
    if tilt is None:
        return known
    known = replace(known, camera_elevation=tilt.elevation, camera_roll=tilt.roll)
    return replace(known, gravity_source=tilt.source, gravity_spread=tilt.std)


def read_exposure(image: Image.Image) -> float | None:
    """Exposure time [s] x ISO / 100 / f-number^2 in an image's EXIF block; None without a time. Never raises.

    Two photos by one lens differ in this as their pixels do. A sensitivity or an f-number that is absent counts as
    ISO 100 and f/1, for lenses without contacts note none.

    Args:
        image: opened by Pillow.
    """
    return try_read(_exposure, read_ifd(image, ExifTags.IFD.Exif))


def read_orientation(image: Image.Image) -> int | None:
    """Orientation 1 to 8 by EXIF, or else by XMP, which Pillow reads for it; None without. Never raises.

    Args:
        image: opened by Pillow.
    """
    try:
        value = read_exif(image).get(ExifTags.Base.Orientation)
    except Exception:  # EXIF is hostile input
        return None
    return value if isinstance(value, int) else None


def vertical_fov_from_focal_length(focal_length: float, width: int, height: int) -> float:
    """Vertical field of view of an upright photo in deg, clamped to 5 to 120.

    By the diagonal: the lens covers the photo's diagonal as one of that focal length covers that of 36 x 24 mm.

    Args:
        focal_length: mm, in 35 mm terms.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
    """
    half_height = 0.5 * FULL_FRAME_DIAGONAL * height / math.hypot(width, height)
    low, high = _VERTICAL_FOV
    return min(max(math.degrees(2 * math.atan2(half_height, focal_length)), low), high)


def _camera_tilt(
    tags: Tags, xmp: Mapping[str, str], orientation: int | None, size: tuple[int, int]
) -> imu.CameraTilt | None:
    """The camera's tilt, by the first source that has it."""
    by_phone = try_read(lambda t: imu.tilt_from_accelerometer(t, orientation, size), tags)
    return by_phone or imu.tilt_from_gimbal(xmp, orientation) or try_read(imu.tilt_from_elevation_angle, tags)


def _gps_location(tags: Tags) -> tuple[float, float] | None:
    gps = ExifTags.GPS
    latitude = _angle(tags[gps.GPSLatitude], read_text(tags[gps.GPSLatitudeRef]), "NS")
    longitude = _angle(tags[gps.GPSLongitude], read_text(tags[gps.GPSLongitudeRef]), "EW")
    nowhere = latitude == longitude == 0  # many programs write 0, 0 where the location is unknown
    return (latitude, longitude) if abs(latitude) <= 90 and abs(longitude) <= 180 and not nowhere else None


def _angle(parts: Any, reference: str, signs: str) -> float:
    """Degrees from degrees, minutes and seconds, the last two of which may be absent."""
    size = sum(read_number(part) / 60.0**power for power, part in enumerate(parts))
    if size < 0:
        raise ValueError("An angle with a reference has no sign.")
    return (1 - 2 * signs.index(reference[:1].upper() or "?")) * size


def _heading(tags: Tags) -> float | None:
    heading = read_number(tags[ExifTags.GPS.GPSImgDirection])
    return heading % 360.0 if 0 <= heading <= 360 else None


def _heading_reference(tags: Tags) -> HeadingReference | None:
    reference = read_text(tags[ExifTags.GPS.GPSImgDirectionRef])[:1].upper()
    return {"T": HeadingReference.TRUE, "M": HeadingReference.MAGNETIC}.get(reference)


def _focal_length(tags: Tags) -> float | None:
    length = read_number(tags[ExifTags.Base.FocalLengthIn35mmFilm])
    return length if length > 0 else None


def _exposure(tags: Tags) -> float | None:
    base = ExifTags.Base
    iso = _iso(tags.get(base.ISOSpeedRatings, 100)) or 100.0
    aperture = read_number(tags.get(base.FNumber, 1)) or 1.0
    exposure = read_number(tags[base.ExposureTime]) * iso / 100.0 / aperture**2
    return exposure if exposure > 0 else None


def _exposure_value(tags: Tags) -> float | None:
    """log2(f-number^2 / time x 100 / ISO); absent unless all three exist."""
    base = ExifTags.Base
    time, aperture = read_number(tags[base.ExposureTime]), read_number(tags[base.FNumber])
    value = math.log2(aperture**2 / time * 100.0 / _iso(tags[base.ISOSpeedRatings]))
    low, high = _EXPOSURE_VALUES
    return value if low <= value <= high else None


def _iso(value: Any) -> float:
    """ISO from a number, or from the first of several."""
    return read_number(value[0] if isinstance(value, tuple) else value)


def _is_uncropped(tags: Tags, aspect: float) -> bool:
    """Whether the photo has the aspect ratio, either way up, that the camera wrote; a crop has another lens."""
    width, height = (tags.get(tag) for tag in (ExifTags.Base.ExifImageWidth, ExifTags.Base.ExifImageHeight))
    if not width or not height:
        return True
    return abs(abs(math.log(aspect)) - abs(math.log(read_number(width) / read_number(height)))) < _SAME_ASPECT

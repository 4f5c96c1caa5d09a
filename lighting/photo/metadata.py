"""EXIF and XMP -> PhotoMetadata.

Both are hostile input: whatever cannot be read, or cannot be true, counts as absent.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime
from typing import Any

from PIL import ExifTags, Image

import lighting.photo.imu as imu
from lighting.documentation import describe_fields
from lighting.geometry import wrap_azimuth
from lighting.photo.clock import read_clock, read_gps_time
from lighting.photo.lens import PhotoFrame, read_lens
from lighting.photo.location import HeadingReference, read_heading, read_locations
from lighting.photo.tags import Tags, read_ifd, read_iptc, read_main_tags, read_number, read_packet, try_read

_EXPOSURE_VALUES = (-20.0, 25.0)  # EV at ISO 100 that a photo can have; others are damage


@describe_fields
@dataclass(frozen=True)
class PhotoMetadata:
    """How a photo was taken; None is unknown. The repr omits the location, so that no log shows it."""

    local_time: datetime | None = None
    """Local time of the photo, without an offset from UTC."""
    utc_offset: float | None = None
    """Hours, -12 to 14, local minus universal time, where the file has it."""
    gps_time: datetime | None = None
    """Time by the satellites, with its offset from UTC; it may contradict the two."""
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
    is_panorama: bool = False
    """Whether the file says that several frames make the picture."""
    orientation: int | None = field(default=None, compare=False)
    """1 to 8: how the pixels lie in the file."""

    @property
    def location(self) -> tuple[float, float] | None:
        """Latitude and longitude [deg], positive north and east; None where they are unknown."""
        return None if self.latitude is None or self.longitude is None else (self.latitude, self.longitude)


def read_metadata(
    image: Image.Image, width: int, height: int, beside: Mapping[str, str] | None = None, *, is_inside: bool = False
) -> PhotoMetadata:
    """The metadata in an image's EXIF, XMP and IPTC. Never raises.

    Args:
        image: opened by Pillow.
        width: of the upright photo, pixels.
        height: of the upright photo, pixels.
        beside: XMP properties of files beside the photo, where its own say nothing; None: there are none.
        is_inside: whether the photo lies inside a border of the picture.
    """
    camera, gps = (read_ifd(image, ifd) for ifd in (ExifTags.IFD.Exif, ExifTags.IFD.GPSInfo))
    main, xmp = read_main_tags(image), {**(beside or {}), **read_packet(image)}
    locations = read_locations(gps, xmp)
    latitude, longitude = locations[0] if len(locations) == 1 else (None, None)
    stamp = read_clock(camera, main, xmp, read_iptc(image), is_located=bool(locations))
    local_time, utc_offset = (stamp.time, stamp.utc_offset) if stamp else (None, None)
    gps_time = read_gps_time(gps, xmp, local_time, longitude)
    heading, reference = read_heading(gps, xmp)
    if heading is None and (heading := imu.heading_from_xmp(xmp)) is not None:
        reference = HeadingReference.TRUE
    orientation = read_orientation(image)
    lens = read_lens(main, camera, xmp, PhotoFrame(width, height, orientation in (5, 6, 7, 8), is_inside))
    known = PhotoMetadata(local_time, utc_offset, gps_time, latitude, longitude, heading, reference, lens.focal_length)
    known = replace(
        known,
        locations=locations if len(locations) > 1 else (),
        vertical_fov=lens.vertical_fovs[0] if lens.vertical_fovs else None,
        other_vertical_fovs=lens.vertical_fovs[1:],
        is_lens_consistent=lens.is_consistent or not lens.vertical_fovs,
        is_panorama=lens.is_panorama,
        exposure_value=try_read(_exposure_value, camera),
        camera_height=imu.height_from_xmp(xmp),
        orientation=orientation,
    )
    tilt = _camera_tilt(camera, xmp, orientation, (width, height)) if lens.is_whole else None
    if tilt is None:
        return known
    roll = None if tilt.roll is None else float(wrap_azimuth(tilt.roll + lens.turn))
    known = replace(known, camera_elevation=tilt.elevation, camera_roll=roll)
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
    value = read_main_tags(image).get(ExifTags.Base.Orientation)
    return value if isinstance(value, int) else None


def _camera_tilt(
    tags: Tags, xmp: Mapping[str, str], orientation: int | None, size: tuple[int, int]
) -> imu.CameraTilt | None:
    """The camera's tilt, by the first source that has it."""
    by_phone = try_read(lambda t: imu.tilt_from_accelerometer(t, orientation, size), tags)
    return by_phone or imu.tilt_from_gimbal(xmp, orientation) or try_read(imu.tilt_from_elevation_angle, tags)


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

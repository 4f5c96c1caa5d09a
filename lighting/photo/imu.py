"""How a camera was held, by its file: accelerometer, gimbal, angle of elevation, heading and height of flight.

The tilt is by an iPhone's accelerometer, a drone's gimbal, or EXIF's elevation angle. Up is a vector in the picture: to
its right, to its upper edge, and into it. Apple's maker note holds CoreMotion's acceleration: the direction of gravity
by axes to the screen's right, to its upper edge and out of it. It is -1 g along y for an iPhone that stands upright,
along z for one that lies on its back. The back camera looks along -z, and the rows of its sensor run from the phone's
top to its foot.
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags

from lighting.geometry import MIN_STEEP_ELEVATION
from lighting.photo.tags import TAG_ERRORS, Tags

_Vector = tuple[float, float, float]
TILT_STD = 1.0  # deg, of the angles of phones at rest and of gimbals
_APPLE = b"Apple iOS\0"
_APPLE_TAGS = 14  # bytes before the number of its tags
_ACCELERATION, _FRONT = 0x0008, 0x0045
_AT_REST = (0.9, 1.1)  # g; beyond, the phone was shaken, and acceleration is not gravity
DJI_NAMESPACE = "http://www.dji.com/drone-dji/1.0"
_PIX4D = "http://pix4d.com/camera/1.0"
_FLIGHT_HEIGHTS = (0.5, 20000.0)  # m over the place of take-off, at which a drone flies
_UNKNOWN = (-1, 0xFFFFFFFF)  # denominators of an elevation that is not known, as EXIF says
_LANDSCAPE, _PORTRAIT = (1, 3), (6, 8)  # orientations that keep the sensor's longer side across, and that raise it


@dataclass(frozen=True, eq=False, repr=False)
class CameraTilt:
    """Elevation and roll of a camera."""

    elevation: float
    """Deg, positive looks up."""
    roll: float | None
    """Deg, positive turns the camera clockwise; None where it is unknown or not defined."""
    std: float
    """Deg, of both."""
    source: str
    """"accelerometer", "gimbal" or "elevation angle"."""


def read_tilt(tags: Tags, xmp: Mapping[str, str], orientation: int | None, size: tuple[int, int]) -> CameraTilt | None:
    """How the camera of an upright photo was tilted, by the first source that says so. Never raises.

    Args:
        tags: of EXIF's directory of the camera.
        xmp: properties by "namespace name".
        orientation: 1 to 8 by EXIF; None: absent.
        size: width and height of the upright photo in pixels.
    """
    by_phone = _tilt_from_accelerometer(tags, orientation, size)
    return by_phone or _tilt_from_gimbal(xmp, orientation) or _tilt_from_elevation_angle(tags)


def _tilt_from_accelerometer(tags: Tags, orientation: int | None, size: tuple[int, int]) -> CameraTilt | None:
    """Tilt by the maker note of an iPhone or iPad; None for front cameras, whose pictures are mirrored.

    Args:
        tags: of EXIF's directory of the camera.
        orientation: 1 to 8 by EXIF; None: absent.
        size: width and height of the upright photo in pixels.
    """
    try:
        note = _apple_note(tags[ExifTags.Base.MakerNote])
        x, y, z = note[_ACCELERATION]
    except TAG_ERRORS:
        return None
    norm, lens, front = math.hypot(x, y, z), str(tags.get(ExifTags.Base.LensModel, "")).lower(), note.get(_FRONT)
    # Neither older maker notes nor the lens's name need say that it is the back camera.
    is_back = "front" not in lens and front in (None, 0) and ("back" in lens or front == 0)
    if not is_back or not _AT_REST[0] <= norm <= _AT_REST[1]:
        return None
    in_sensor = (y / norm, -x / norm, z / norm)
    std = math.hypot(TILT_STD, math.degrees(abs(norm - 1.0)))  # a lateral acceleration is about as large
    return _camera_tilt(_rotate_most_upright(in_sensor, orientation, size), std, "accelerometer")


def _tilt_from_gimbal(xmp: Mapping[str, str], orientation: int | None) -> CameraTilt | None:
    """Tilt by the XMP properties of DJI's drones, or of Pix4D's tags, as others write them; None without.

    Args:
        xmp: properties by "namespace name".
        orientation: 1 to 8 by EXIF; None: absent.
    """
    for namespace, up_by in ((DJI_NAMESPACE, _up_by_dji), (_PIX4D, _up_by_pix4d)):
        angles = _gimbal_angles(xmp, namespace)
        if angles is not None and (up := up_by(*angles)) is not None:
            return _camera_tilt(_rotate_to_upright(up, orientation or 1), TILT_STD, "gimbal")
    return None


def read_drone_heading(xmp: Mapping[str, str]) -> float | None:
    """Heading of a drone's camera in deg clockwise from north; of its picture's upper edge where it looks down.

    Args:
        xmp: properties by "namespace name".
    """
    angles = _gimbal_angles(xmp, DJI_NAMESPACE) or _gimbal_angles(xmp, _PIX4D)
    return None if angles is None else heading_from_gimbal(*angles)


def read_flight_height(xmp: Mapping[str, str]) -> float | None:
    """Height of a DJI drone's camera in m above where it took off; None where it says none, or stands there.

    Args:
        xmp: properties by "namespace name".
    """
    try:
        height = float(xmp[f"{DJI_NAMESPACE} RelativeAltitude"])
    except (KeyError, ValueError):
        return None
    return height if _FLIGHT_HEIGHTS[0] <= height <= _FLIGHT_HEIGHTS[1] else None


def heading_from_gimbal(pitch: float, roll: float, yaw: float) -> float:
    """Heading in deg, 0 to 360, by a gimbal's angles.

    Args:
        pitch: deg, positive up.
        roll: deg, clockwise.
        yaw: deg clockwise from north.
    """
    steep = abs(abs(pitch) - 90.0) < 90.0 - MIN_STEEP_ELEVATION
    upside_down = steep and abs(roll) > 90.0  # straight down, as DJI's may say
    return (yaw + 180.0 * upside_down) % 360.0


def _tilt_from_elevation_angle(tags: Tags) -> CameraTilt | None:
    """Tilt by EXIF's CameraElevationAngle, which says nothing of the roll; None where it is unknown.

    Args:
        tags: of EXIF's directory of the camera.
    """
    try:
        angle = tags[ExifTags.Base.CameraElevationAngle]
        elevation = float(angle)
    except TAG_ERRORS:
        return None
    valid = getattr(angle, "denominator", 1) not in _UNKNOWN and abs(elevation) <= 90.0  # False for what is no number
    return CameraTilt(elevation, None, TILT_STD, "elevation angle") if valid else None


def _rotate_to_upright(up: _Vector, orientation: int) -> _Vector:
    """The vector in the upright picture, of the one in the picture as it is stored."""
    right, top, into = up
    flipped = (right, top), (-right, top), (-right, -top), (right, -top)
    transposed = (-top, -right), (top, -right), (top, right), (-top, right)
    across, above = (*flipped, *transposed)[orientation - 1 if 1 <= orientation <= 8 else 0]
    return across, above, into


def _rotate_most_upright(up: _Vector, orientation: int | None, size: tuple[int, int]) -> _Vector:
    """The vector in the upright picture, of the one in the sensor's, whose longer side lies across.

    Programs that rotate the pixels keep the maker note and write orientation 1. Of the rotations that give the picture
    its shape, theirs is then the one that brings up nearest to the upper edge.
    """
    if orientation is not None and 2 <= orientation <= 8:
        return _rotate_to_upright(up, orientation)
    width, height = size
    possible = _LANDSCAPE if width > height else _PORTRAIT if width < height else _LANDSCAPE + _PORTRAIT
    return max((_rotate_to_upright(up, one) for one in possible), key=lambda vector: vector[1])


def _camera_tilt(up: _Vector, std: float, source: str) -> CameraTilt:
    right, top, into = up
    elevation = math.degrees(math.asin(max(-1.0, min(1.0, into))))
    roll = None if abs(elevation) > MIN_STEEP_ELEVATION else math.degrees(math.atan2(-right, top)) + 0.0
    return CameraTilt(elevation + 0.0, roll, std, source)


def _apple_note(note: object) -> dict[int, Any]:
    """The acceleration (3,) [g] and the number that says whether the front camera was used."""
    if not isinstance(note, bytes) or not note.startswith(_APPLE) or note[_APPLE_TAGS - 2 : _APPLE_TAGS] != b"MM":
        raise ValueError("not Apple's")
    values_by_tag: dict[int, Any] = {}
    (count,) = struct.unpack_from(">H", note, _APPLE_TAGS)
    for at in range(_APPLE_TAGS + 2, min(_APPLE_TAGS + 2 + 12 * count, len(note) - 11), 12):
        tag, kind, values, value = struct.unpack_from(">HHII", note, at)
        if tag == _ACCELERATION and (kind, values) == (10, 3):
            parts = struct.unpack_from(">6i", note, value)
            values_by_tag[tag] = [parts[i] / parts[i + 1] for i in (0, 2, 4)]
        elif tag == _FRONT and (kind, values) == (9, 1):
            values_by_tag[tag] = value
    return values_by_tag


def _gimbal_angles(xmp: Mapping[str, str], namespace: str) -> tuple[float, float, float] | None:
    """Pitch, roll and yaw [deg]; None unless all exist, for all are zero where nothing measured them."""
    name = "Gimbal{}Degree" if namespace == DJI_NAMESPACE else "{}"
    try:
        pitch, roll, yaw = (float(xmp[f"{namespace} {name.format(axis)}"]) for axis in ("Pitch", "Roll", "Yaw"))
    except (KeyError, ValueError):
        return None
    valid = all(abs(angle) <= 360.0 for angle in (pitch, roll, yaw))  # False for what is no number
    return (pitch, roll, yaw) if valid and (pitch or roll or yaw) else None


def _up_by_dji(pitch: float, roll: float, _: float) -> _Vector | None:
    """Pitch is the elevation, positive up; the camera rolls clockwise about its own axis."""
    p, r = math.radians(pitch), math.radians(roll)
    return (-math.cos(p) * math.sin(r), math.cos(p) * math.cos(r), math.sin(p))


def _up_by_pix4d(pitch: float, roll: float, _: float) -> _Vector | None:
    """Angles of a drone whose camera looks down, the picture's upper edge ahead: 90 deg of pitch look ahead."""
    p, r = math.radians(pitch), math.radians(roll)
    if not 0.0 <= pitch <= 180.0:
        return None  # not by that definition
    return (-math.cos(p) * math.sin(r), math.sin(p), -math.cos(p) * math.cos(r))

"""How a camera was held, by what its photo says: an iPhone's accelerometer, a drone's gimbal, or EXIF's own angle.

Up is a vector in the picture: to its right, to its upper edge, and into it. All of it is hostile input, see exif.py.

Apple's maker note holds CoreMotion's acceleration, -1 g along y for an iPhone that stands upright and along z for one
that lies on its back: the direction of gravity by axes to the screen's right, to its upper edge and out of it. The back
camera looks along -z, and the rows of its sensor run from the phone's top to its foot.
"""

import math
import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from PIL import ExifTags

from lighting.geometry import MIN_STEEP_ELEVATION

_Vector = tuple[float, float, float]

TILT_STD = 1.0  # deg, one standard deviation of the angles of phones at rest and of gimbals

_APPLE = b"Apple iOS\0"
_APPLE_TAGS = 14  # bytes before the number of its tags
_ACCELERATION, _FRONT = 0x0008, 0x0045
_AT_REST = (0.9, 1.1)  # g; beyond, the phone was shaken, and acceleration is not gravity
_DJI = "http://www.dji.com/drone-dji/1.0"
_PIX4D = "http://pix4d.com/camera/1.0"
_UNKNOWN = (-1, 0xFFFFFFFF)  # denominators of an elevation that is not known, as EXIF says
_LYING, _STANDING = (1, 3), (6, 8)  # orientations that keep the sensor's longer side across, and that turn it upright


@dataclass(frozen=True)
class CameraTilt:
    """How a camera was held."""

    elevation: float  # deg, positive looks up
    roll: float | None  # deg, positive turns the camera clockwise; None where it is not said, or is not defined
    spread: float  # deg, one standard deviation
    source: str  # "accelerometer", "gimbal" or "elevation angle"


def tilt_from_accelerometer(
    tags: Mapping[int, Any], orientation: int | None, size: tuple[int, int]
) -> CameraTilt | None:
    """By the maker note of an iPhone or iPad in the EXIF `tags`; None for front cameras, whose pictures are mirrored.

    `size` is the upright photo's. Raises what arithmetic, indexing and struct raise where the note is damaged.
    """
    note = _apple_note(tags[ExifTags.Base.MakerNote])
    if not _is_back(str(tags.get(ExifTags.Base.LensModel, "")), note):
        return None
    x, y, z = note[_ACCELERATION]
    norm = math.hypot(x, y, z)
    if not _AT_REST[0] <= norm <= _AT_REST[1]:
        return None
    in_sensor = (y / norm, -x / norm, z / norm)
    spread = math.hypot(TILT_STD, math.degrees(abs(norm - 1.0)))  # an acceleration aside is about as large
    return _held(_most_upright(in_sensor, orientation, size), spread, "accelerometer")


def tilt_from_gimbal(said: Mapping[str, str], orientation: int | None) -> CameraTilt | None:
    """By the XMP properties of DJI's drones, or of Pix4D's tags, as others write them."""
    for up_by, names in ((_up_by_dji, _names(_DJI)), (_up_by_pix4d, _names(_PIX4D))):
        angles = _angles(said, names)
        if angles is not None and (up := up_by(*angles)) is not None:
            return _held(_turned(up, orientation or 1), TILT_STD, "gimbal")
    return None


def heading_from_xmp(said: Mapping[str, str]) -> float | None:
    """Degrees clockwise from north of where such a camera points, of its picture's upper edge where that is down."""
    for names in (_names(_DJI), _names(_PIX4D)):
        if (angles := _angles(said, names)) is not None:
            return heading_from_gimbal(*angles)
    return None


def heading_from_gimbal(pitch: float, roll: float, yaw: float) -> float:
    """The same by a gimbal's own angles [deg]."""
    on_its_head = (
        abs(abs(pitch) - 90.0) < 90.0 - MIN_STEEP_ELEVATION and abs(roll) > 90.0
    )  # straight down, as DJI's may say
    return (yaw + 180.0 * on_its_head) % 360.0


def tilt_from_elevation_angle(tags: Mapping[int, Any]) -> CameraTilt | None:
    """By EXIF's CameraElevationAngle, which says nothing of the roll."""
    angle = tags[ExifTags.Base.CameraElevationAngle]
    elevation = float(angle)
    known = getattr(angle, "denominator", 1) not in _UNKNOWN and abs(elevation) <= 90.0  # False for what is no number
    return CameraTilt(elevation, None, TILT_STD, "elevation angle") if known else None


def _turned(up: _Vector, orientation: int) -> _Vector:
    """The vector in the upright picture, of the one in the picture as it is stored."""
    right, top, into = up
    across, above = {
        1: (right, top),
        2: (-right, top),
        3: (-right, -top),
        4: (right, -top),
        5: (-top, -right),
        6: (top, -right),
        7: (top, right),
        8: (-top, right),
    }.get(orientation, (right, top))
    return across, above, into


def _most_upright(up: _Vector, orientation: int | None, size: tuple[int, int]) -> _Vector:
    """The vector in the upright picture, of the one in the sensor's, whose longer side lies across.

    Programs that turn the pixels keep the maker note and write orientation 1. Of the turns that give the picture its
    shape, theirs is then the one that brings up nearest to the upper edge.
    """
    if orientation is not None and 2 <= orientation <= 8:
        return _turned(up, orientation)
    width, height = size
    ways = _LYING if width > height else _STANDING if width < height else _LYING + _STANDING
    return max((_turned(up, way) for way in ways), key=lambda vector: vector[1])


def _held(up: _Vector, spread: float, source: str) -> CameraTilt:
    right, top, into = up
    elevation = math.degrees(math.asin(max(-1.0, min(1.0, into))))
    roll = None if abs(elevation) > MIN_STEEP_ELEVATION else math.degrees(math.atan2(-right, top)) + 0.0
    return CameraTilt(elevation + 0.0, roll, spread, source)


def _apple_note(note: Any) -> dict[int, Any]:
    """The acceleration (3,) [g] and the number that says whether the front camera was used."""
    if not isinstance(note, bytes) or not note.startswith(_APPLE) or note[_APPLE_TAGS - 2 : _APPLE_TAGS] != b"MM":
        raise ValueError("not Apple's")
    found: dict[int, Any] = {}
    (count,) = struct.unpack_from(">H", note, _APPLE_TAGS)
    for at in range(_APPLE_TAGS + 2, min(_APPLE_TAGS + 2 + 12 * count, len(note) - 11), 12):
        tag, kind, values, value = struct.unpack_from(">HHII", note, at)
        if tag == _ACCELERATION and (kind, values) == (10, 3):
            parts = struct.unpack_from(">6i", note, value)
            found[tag] = [parts[i] / parts[i + 1] for i in (0, 2, 4)]
        elif tag == _FRONT and (kind, values) == (9, 1):
            found[tag] = value
    return found


def _is_back(lens: str, note: Mapping[int, Any]) -> bool:
    """Whether the back camera took it; the maker note of older phones does not say it, and the lens's name may not."""
    front = note.get(_FRONT)
    return "front" not in lens.lower() and front in (None, 0) and ("back" in lens.lower() or front == 0)


def _names(namespace: str) -> tuple[str, str, str]:
    """Those of pitch, roll and yaw."""
    pattern = "Gimbal{}Degree" if namespace == _DJI else "{}"
    pitch, roll, yaw = (f"{namespace} {pattern.format(name)}" for name in ("Pitch", "Roll", "Yaw"))
    return pitch, roll, yaw


def _angles(said: Mapping[str, str], names: Iterable[str]) -> tuple[float, float, float] | None:
    """Pitch, roll and yaw [deg]; None unless all are there, for all are zero where nothing measured them."""
    try:
        pitch, roll, yaw = (float(said[name]) for name in names)
    except (KeyError, ValueError):
        return None
    whole = all(abs(angle) <= 360.0 for angle in (pitch, roll, yaw))  # False for what is no number
    return (pitch, roll, yaw) if whole and (pitch or roll or yaw) else None


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

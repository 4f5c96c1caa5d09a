"""The dome over the spot on which the sun is dragged; nothing here needs Blender.

Its frame has +Z up, and the photo's camera looks along +Y; azimuths count from there to the right.
"""

import math
from typing import Any, NamedTuple

import numpy as np

RADIUS = 0.3  # of the dome, as a share of the way from the camera to the spot: the camera then sees all of it


class Hit(NamedTuple):
    """Where a line of sight meets a dome."""

    direction: Any
    """(3,) unit vector from the dome's center."""
    misses: bool
    """Whether the line passes by, and this is the nearest point of the rim."""


def meet_dome(origin: Any, sight: Any, center: Any, radius: float, *, near: bool) -> Hit:
    """Where a line of sight meets the sphere of a dome.

    Args:
        origin: (3,) of the line.
        sight: (3,) unit vector along it.
        center: (3,) of the dome.
        radius: of the dome, over 0.
        near: whether the side towards the eye is meant.
    """
    origin, sight, center = (np.asarray(vector, dtype=np.float64) for vector in (origin, sight, center))
    along = float(sight @ (center - origin))
    beside = origin + along * sight - center
    distance = float(np.linalg.norm(beside))
    if distance >= radius:
        return Hit(beside / distance, True)
    depth = math.sqrt(radius**2 - distance**2)
    point = beside + (-depth if near and along > depth else depth) * sight
    return Hit(point / radius, False)


def sun_angles(direction: Any) -> tuple[float, float]:
    """Azimuth, -180 to 180, and elevation, -90 to 90 [deg], of a unit vector (3,)."""
    x, y, z = map(float, direction)
    return math.degrees(math.atan2(x, y)), math.degrees(math.asin(min(max(z, -1.0), 1.0)))


def sun_direction(azimuth: float, elevation: float) -> Any:
    """The unit vector (3,) of an azimuth and an elevation [deg]."""
    turn, height = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(turn) * math.cos(height), math.cos(turn) * math.cos(height), math.sin(height)])

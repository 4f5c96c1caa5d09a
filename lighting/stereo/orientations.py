"""Orientations of a surface: those a plan is judged by, those it names, and the half sphere it draws."""

import numpy as np

from lighting.geometry import Floats, direction
from lighting.stereo.gain import sphere_normals

Named = tuple[str, float, float]  # name, azimuth [deg clockwise from north], elevation [deg] of the normal

NORMALS = 180  # over the whole sphere, of which those of interest count
VISIBLE = 80.0  # deg from the facing direction within which a camera before the surface sees orientations well

_COMPASS = (("north", 0.0), ("east", 90.0), ("south", 180.0), ("west", 270.0))


def normals_of_interest(facing: float | None) -> Floats:
    """Unit normals (N, 3) by which windows are judged: within VISIBLE of a level direction [deg], or all that do not
    look down."""
    normals = sphere_normals(NORMALS)
    if facing is None:
        return np.asarray(normals[normals[:, 1] >= 0])
    return np.asarray(normals[normals @ direction(facing, 0.0) > np.cos(np.radians(VISIBLE))])


def named_normals(facing: float | None) -> tuple[list[Named], Floats]:
    """The orientations that a plan speaks of, and their unit normals (N, 3)."""
    if facing is None:
        slopes = [("level", 0.0, 90.0), *((f"slope to the {name}", azimuth, 45.0) for name, azimuth in _COMPASS)]
        named = [*slopes, *((f"wall to the {name}", azimuth, 0.0) for name, azimuth in _COMPASS)]
    else:
        ahead, *sides = ((facing + turn) % 360.0 for turn in (0.0, -45.0, 45.0))
        tilted = [("ahead", ahead, 0.0), ("45° up", ahead, 45.0), ("45° down", ahead, -45.0)]
        named = [*tilted, *((f"towards {azimuth:g}°", azimuth, 0.0) for azimuth in sides)]
    return named, direction([azimuth for _, azimuth, _ in named], [elevation for *_, elevation in named])


def half_sphere(facing: float | None, size: int) -> Floats:
    """Unit normals (size, size, 3) of a sphere's pixels as a distant camera sees it; around it those of its rim.

    The camera stands before the surface, upright; or, without a facing direction, above with north at the top.
    """
    side = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(side, -side)
    beyond = np.maximum(np.hypot(x, y), 1.0)
    x, y = x / beyond, y / beyond
    seen = np.stack([x, y, np.sqrt(np.maximum(1 - x**2 - y**2, 0))], axis=-1)
    if facing is None:
        return np.asarray(seen @ np.stack([direction(90.0, 0.0), direction(0.0, 0.0), direction(0.0, 90.0)]))
    left = direction(facing - 90.0, 0.0)  # the surface's left is the camera's right
    return np.asarray(seen @ np.stack([left, direction(0.0, 90.0), direction(facing, 0.0)]))

"""Orientations of a surface: those a plan is judged by, those it names, and the half sphere it draws."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import direction
from lighting.stereo.gain import sphere_normals

Floats = NDArray[np.floating[Any]]
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
        turned = [("ahead", 0.0, 0.0), ("45° clockwise", 45.0, 0.0), ("45° counter-clockwise", -45.0, 0.0)]
        tilted = [("45° up", 0.0, 45.0), ("45° down", 0.0, -45.0)]
        named = [(name, (facing + turn) % 360.0, elevation) for name, turn, elevation in turned + tilted]
    return named, direction([azimuth for _, azimuth, _ in named], [elevation for *_, elevation in named])


def half_sphere(facing: float | None, size: int) -> tuple[Floats, NDArray[np.bool_]]:
    """Unit normals (N, 3) of a sphere's pixels as a distant camera sees it, and which of (size, size) they are.

    The camera stands before the surface, upright; or, without a facing direction, above with north at the top.
    """
    side = (np.arange(size) + 0.5) / size * 2 - 1
    x, y = np.meshgrid(side, -side)
    inside = x**2 + y**2 < 1
    x, y = x[inside], y[inside]
    towards = np.sqrt(1 - x**2 - y**2)
    if facing is None:
        return np.stack([x, towards, -y], axis=-1), inside
    left = direction(facing - 90.0, 0.0)  # the surface's left is the camera's right
    axes = np.stack([left, np.array([0.0, 1.0, 0.0]), direction(facing, 0.0)])
    return np.stack([x, y, towards], axis=-1) @ axes, inside

"""Triangle meshes for formats without spheres and cylinders."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lighting.geometry import Floats

_SEGMENTS = 64  # around the axis
_RINGS = 32  # of the ball, from pole to pole
_SMALLEST = 1e-4  # area relative to the largest; smaller triangles are degenerate ones at a pole


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles, counter-clockwise seen from outside."""

    positions: NDArray[np.float32]  # (V, 3), metres, +Y up
    normals: NDArray[np.float32]  # (V, 3)
    triangles: NDArray[np.uint16]  # (T, 3)
    coordinates: NDArray[np.float32] | None = None  # (V, 2) of a picture, (0, 0) is its upper left corner


def ball(radius: float) -> Mesh:
    """A sphere around the origin."""
    slope = np.linspace(-np.pi / 2, np.pi / 2, _RINGS + 1)
    normals = np.stack([np.cos(slope), np.sin(slope)], axis=-1)
    return _turned(radius * normals, normals)


def stick(radius: float, height: float) -> Mesh:
    """An upright cylinder that stands on the origin."""
    profile = np.array([[0, 0], [radius, 0], [radius, 0], [radius, height], [radius, height], [0, height]])
    normals = np.array([[0, -1], [0, -1], [1, 0], [1, 0], [0, 1], [0, 1]])
    return _turned(profile, normals)


def disc(radius: float) -> Mesh:
    """A level disc around the origin, facing up."""
    return _turned(np.array([[radius, 0.0], [0.0, 0.0]]), np.array([[0.0, 1.0], [0.0, 1.0]]))


def picture(width: float, height: float) -> Mesh:
    """An upright rectangle around the origin, facing +Z, with texture coordinates."""
    corners = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], dtype=np.float32)
    across, down = (corners - 0.5).T
    positions = np.stack([across * width, -down * height, np.zeros(4)], axis=-1).astype(np.float32)
    normals = np.tile(np.array([0, 0, 1], dtype=np.float32), (4, 1))
    triangles = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint16)
    return Mesh(positions, normals, triangles, corners)


def _turned(profile: Floats, normals: Floats) -> Mesh:
    """The surface of revolution of a profile (P, 2) of (radius, height) around the Y axis; outside is on its right."""
    angle = np.linspace(0.0, 2 * np.pi, _SEGMENTS + 1)
    around = np.stack([np.cos(angle), np.ones_like(angle), -np.sin(angle)], axis=-1)
    points, outward = (around * values[:, None, [0, 1, 0]] for values in (profile, normals))
    first = np.arange(_SEGMENTS) + (_SEGMENTS + 1) * np.arange(len(profile) - 1)[:, None]
    above = first + _SEGMENTS + 1
    triangles = np.stack([first, first + 1, above + 1, first, above + 1, above], axis=-1).reshape(-1, 3)
    corners = _flat(points)[triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=-1)
    kept = triangles[area > _SMALLEST * area.max()]
    return Mesh(_flat(points), _flat(outward), kept.astype(np.uint16))


def _flat(values: Floats) -> NDArray[np.float32]:
    return values.reshape(-1, 3).astype(np.float32)

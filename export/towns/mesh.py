"""Meshes of coloured quads and the box that most things are built of; lengths in m, +Y up, the ground at y = 0."""

from dataclasses import dataclass

import numpy as np

from lighting.geometry import Floats


@dataclass(frozen=True)
class Mesh:
    """Quads with one colour each: corners (Q, 4, 3) and linear albedos (Q, 3)."""

    corners: Floats
    albedo: Floats


def join(meshes: list[Mesh]) -> Mesh:
    """Several meshes as one."""
    return Mesh(np.concatenate([m.corners for m in meshes]), np.concatenate([m.albedo for m in meshes]))


def turned(points: Floats, yaw: float) -> Floats:
    """Points (..., 3) turned about +Y by `yaw` [deg]."""
    s, c = np.sin(np.radians(yaw)), np.cos(np.radians(yaw))
    return np.asarray(points @ np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]).T)


def box(centre: Floats, size: Floats, yaw: float, colour: Floats) -> Mesh:
    """A box standing on the ground at `centre` (x, z), turned by `yaw` [deg]."""
    x, y, z = np.array([[-1, 1, 1, -1], [0, 0, 0, 0], [-1, -1, 1, 1]], float) / 2
    low, high = np.stack([x, y, z], 1), np.stack([x, y + 1, z], 1)
    sides = [np.stack([low[i], low[(i + 1) % 4], high[(i + 1) % 4], high[i]]) for i in range(4)]
    corners = np.stack([*sides, high]) * size
    return Mesh(moved(turned(corners, yaw), centre), np.tile(colour, (5, 1)))


def moved(points: Floats, centre: Floats) -> Floats:
    """Points (..., 3) moved over the ground by `centre` (x, z)."""
    return np.asarray(points + np.array([centre[0], 0.0, centre[1]]))
